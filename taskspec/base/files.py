"""Names of files, and atomic writing: to a temporary file beside the place, flushed to disk, then renamed."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from taskspec.base.diagnostics import SpecError, spec_error

LONGEST = 100
"""The largest number of bytes of a safe name, without its hash."""
_KEPT = re.compile(r"[^\w .,=+()-]")
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])(\..*)?", re.IGNORECASE)
"""Device names of Windows, with any suffix."""


def safe_name(text: str) -> str:
    """Return a text as a part of a file's name that means the same on every system, in the folder where it is put.

    A text that is such a name is returned as it is. Of others, letters that may not be are replaced, and a hash of the text
    is added: different texts have different names.
    """
    clean = _KEPT.sub("-", text).encode(errors="replace")[:LONGEST].decode(errors="ignore").strip("-. ")
    is_reserved = _RESERVED.fullmatch(clean) is not None
    if clean == text and clean and not is_reserved:
        return clean
    digest = hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:8]
    return f"{'_' * is_reserved}{clean or 'unnamed'}-{digest}"


def write_text(place: Path, text: str, new: bool = False) -> None:
    """Write a text in UTF-8, with the line ends that it has (see `whole`)."""
    with whole(place, new) as path:
        path.write_text(text, encoding="utf-8", newline="")


def write_bytes(place: Path, content: bytes) -> None:
    """Write a file (see `whole`)."""
    with whole(place) as path:
        path.write_bytes(content)


@contextmanager
def whole_text(place: Path) -> Iterator[TextIO]:
    """Yield a file for a text in UTF-8 that is written piece by piece, with the line ends that it has (see `whole`)."""
    with whole(place) as path, path.open("w", encoding="utf-8", newline="") as file:
        yield file


def append_text(place: Path, text: str) -> None:
    """Add a text in UTF-8 at the end of a file, which is made if need be.

    Raises:
        SpecError: E716, it cannot be written.
    """
    with refused(place), place.open("a", encoding="utf-8") as file:
        file.write(text)


@contextmanager
def whole(place: Path, new: bool = False) -> Iterator[Path]:
    """Yield a temporary path, which is renamed to the place when all went well; otherwise an existing file stays.

    Args:
        place: the path of the file; missing folders are created.
        new: raise an error if the file exists.
    """
    with refused(place):
        file = Unfinished(place, new)
        try:
            yield file.path
            file.finish()
        except BaseException:
            file.discard()
            raise


@contextmanager
def whole_folder(place: Path, mark: str) -> Iterator[Path]:
    """Yield a temporary folder, which is renamed to the place when all went well; otherwise an existing folder stays.

    Args:
        place: the path of the folder. An existing one is replaced if it is empty or contains a file called `mark`.
        mark: the name of a file that such folders have.
    """
    with refused(place):
        place = place.resolve()
        if place.exists() and not (place.is_dir() and ((place / mark).is_file() or not any(place.iterdir()))):
            raise _already_exists(place)
        place.parent.mkdir(parents=True, exist_ok=True)
        made = place.with_name(f".{os.urandom(8).hex()}")
        old = place.with_name(f".{os.urandom(8).hex()}")
        made.mkdir()
        try:
            yield made
            if place.exists():
                place.replace(old)
            made.replace(place)
        finally:
            shutil.rmtree(made, ignore_errors=True)
            shutil.rmtree(old, ignore_errors=True)


@contextmanager
def refused(place: Path) -> Iterator[None]:
    """Turn errors of the system about a file into messages."""
    try:
        yield
    except OSError as error:
        raise spec_error("E716", f"cannot write {str(place)!r}: {error.strerror or error}") from error


class Unfinished:
    """A file that is being written at `path`, beside its place, with the permissions of the final file.

    Links are followed. Anything but a regular file, such as a terminal, is written to directly.
    """

    def __init__(self, place: Path, new: bool = False) -> None:
        if new:
            self._place = place
        else:
            self._place = place.resolve()
        self._new = new
        self._place.parent.mkdir(parents=True, exist_ok=True)
        if new:
            try:
                self._place.touch(exist_ok=False)
            except FileExistsError:
                raise _already_exists(self._place) from None
        self._direct = self._place.exists() and not self._place.is_file()
        if self._direct:
            self.path = self._place
        else:
            self.path = self._place.with_name(f".{os.urandom(8).hex()}{place.suffix}")
        if not self._direct:
            self.path.touch(exist_ok=False)
            with suppress(FileNotFoundError):
                self.path.chmod(stat.S_IMODE(self._place.stat().st_mode))

    def finish(self) -> None:
        """Move the file to its place."""
        if not self._direct:
            with self.path.open("rb+") as file:
                os.fsync(file.fileno())
            self.path.replace(self._place)

    def discard(self) -> None:
        """Leave everything as it was."""
        if not self._direct:
            self.path.unlink(missing_ok=True)
        if self._new:
            self._place.unlink(missing_ok=True)


def _already_exists(place: Path) -> SpecError:
    return spec_error("E716", f"{str(place)!r} already exists; it was not changed", "give another place")


def near(path: Path) -> Path:
    """Return a path relative to the current folder, where it lies below that."""
    try:
        return path.relative_to(Path.cwd())
    except (ValueError, OSError):
        return path
