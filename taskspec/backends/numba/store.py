"""A private folder for files that must be what this user wrote: machine code, which is run as it is found.

The folder belongs to its user, nobody else may enter it, and it is held open while it is used, so that nothing can be put in
its place after it was looked at. Every file begins with a message authentication code (HMAC-SHA256, RFC 2104) of its name and
content, made with a key that lies in the folder and that nobody else can read. What does not carry the right one is as good
as absent.
"""

from __future__ import annotations

import hmac
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

KEY, KEY_SIZE, CODE_SIZE = "key", 32, 32
LARGEST = 256 * 2**20
OTHERS = stat.S_IRWXG | stat.S_IRWXO
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
SUPPORTED = hasattr(os, "geteuid") and os.open in os.supports_dir_fd
"""Whether the system has what privacy is checked with; Windows has not, and keeps nothing."""


class NotPrivateError(Exception):
    """A folder that somebody else may have written to; the message says why."""


@dataclass(frozen=True)
class KernelStore:
    """An open folder, as a file descriptor, and its key."""

    _folder: int
    _key: bytes

    def read(self, name: str) -> bytes | None:
        """The content that was written under a name; None where there is none, or another."""
        whole = _read(self._folder, name, _OTHERS_WRITE)
        if whole is None or not hmac.compare_digest(whole[:CODE_SIZE], self._code(name, whole[CODE_SIZE:])):
            return None
        return whole[CODE_SIZE:]

    def write(self, name: str, content: bytes) -> None:
        """Keep a content, at once and whole; where that is not possible, it is not kept."""
        with suppress(OSError):
            _write(self._folder, name, self._code(name, content) + content, os.replace)

    def _code(self, name: str, content: bytes) -> bytes:
        return hmac.digest(self._key, name.encode() + b"\0" + content, "sha256")


@contextmanager
def opened(path: Path) -> Iterator[KernelStore]:
    """The store in a folder, which is made if it does not exist.

    Raises:
        NotPrivateError: the folder may be somebody else's.
        OSError: it cannot be used.
    """
    folder = _private(path)
    try:
        yield KernelStore(folder, _key_of(folder))
    finally:
        os.close(folder)


def _private(path: Path) -> int:
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        path.mkdir(0o700)
    if path.is_symlink():
        raise NotPrivateError(f"{path} is a symbolic link")
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        _check_private(folder, path)
    except BaseException:
        os.close(folder)
        raise
    return folder


def _check_private(folder: int, path: Path) -> None:
    found = os.fstat(folder)
    if found.st_uid != os.geteuid():
        raise NotPrivateError(f"{path} belongs to another user")
    if found.st_mode & _OTHERS_WRITE:
        raise NotPrivateError(
            f"others may write to {path} (mode {stat.S_IMODE(found.st_mode):o}; `chmod 700` closes it)"
        )
    if found.st_mode & OTHERS:
        os.fchmod(folder, 0o700)


def _key_of(folder: int) -> bytes:
    """The key of a folder: a new one where there is none, or one that others could know."""
    kept = _read(folder, KEY, OTHERS)
    if kept is not None and len(kept) == KEY_SIZE:
        return kept
    fresh = os.urandom(KEY_SIZE)
    try:
        _write(folder, KEY, fresh, _link)
    except FileExistsError:  # another process was faster, or what is there is no key
        kept = _read(folder, KEY, OTHERS)
        if kept is not None and len(kept) == KEY_SIZE:
            return kept
        _write(folder, KEY, fresh, os.replace)
    return fresh


def _link(old: str, new: str, **folders: int) -> None:
    os.link(old, new, follow_symlinks=False, **folders)
    os.unlink(old, dir_fd=folders["src_dir_fd"])


def _read(folder: int, name: str, forbidden: int) -> bytes | None:
    """A regular file of this user's own, with none of the forbidden permissions; None where there is no such thing."""
    try:
        handle = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
        with os.fdopen(handle, "rb") as file:
            found = os.fstat(handle)
            own = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & forbidden
            return file.read() if own and found.st_size <= LARGEST else None
    except OSError:
        return None


def _write(folder: int, name: str, content: bytes, move: Callable[..., Any]) -> None:
    """A file that is written under a name of its own and then moved to its place."""
    unfinished = f".{name}.{os.urandom(8).hex()}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    handle = os.open(unfinished, flags, 0o600, dir_fd=folder)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        move(unfinished, name, src_dir_fd=folder, dst_dir_fd=folder)
    except BaseException:
        with suppress(OSError):
            os.unlink(unfinished, dir_fd=folder)
        raise
