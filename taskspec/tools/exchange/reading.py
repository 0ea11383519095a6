"""Files of other tools: unpacked up to a limit, and refused with the reason."""

from __future__ import annotations

import gzip
import io
import lzma
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.exact.tables.frozen_task import FrozenTask

MOST_BYTES = 50_000_000
"""The size of a file, unpacked."""
CHUNK = 1_000_000
"""Bytes that are unpacked at a time."""
COMPRESSIONS: dict[bytes, Callable[[io.BytesIO], Any]] = {b"\x1f\x8b": gzip.open, b"\xfd7zXZ\0": lzma.open}
"""From the first bytes of a compressed file to the function that opens it."""
MOST_HEADERS = 1_000_000
"""Bytes of all headers of a tar file: those of about 2,000 members."""
MOST_LISTED = 5
"""Names that one remark lists."""


@dataclass(frozen=True)
class ForeignFile:
    """A file that is read: its name for messages, and its content."""

    name: str
    content: bytes

    def wrong(self, message: str, hint: str | None = None) -> NoReturn:
        """Raise E728."""
        raise spec_error("E728", f"{self.name}: {message}", hint)

    def text(self) -> str:
        """Return the content as text."""
        return self.content.decode("utf-8")

    def unpacked(self) -> bytes:
        """Return the content without the compression of gzip or xz; no more of it is unpacked than is allowed."""
        opened = next((COMPRESSIONS[magic] for magic in COMPRESSIONS if self.content.startswith(magic)), None)
        if opened is None:
            return self.content
        data = bytearray()
        with opened(io.BytesIO(self.content)) as stream:
            while chunk := stream.read(CHUNK):
                data += chunk
                if len(data) > MOST_BYTES:
                    self.wrong(f"unpacked, it has more than {MOST_BYTES:,} bytes")
        return bytes(data)

    def members(self) -> dict[str, bytes]:
        """Return the files of a tar file, by name."""
        data = self.unpacked()
        files: dict[str, bytes] = {}
        with tarfile.open(fileobj=_Headers(self, data), mode="r:") as tar:
            for member in tar:
                if not member.isfile():
                    continue
                name = member.name.removeprefix("./").removeprefix("/")
                if name in files or member.issparse():
                    self.wrong(f"`{name}` is there twice, or in pieces")
                files[name] = data[member.offset_data : member.offset_data + member.size]
                if len(files[name]) != member.size:
                    self.wrong("it ends too early")
            end = tar.offset
        if not data.startswith(bytes(tarfile.BLOCKSIZE), end):
            self.wrong("it ends too early")
        return files


class _Headers(io.BytesIO):
    """A tar file whose headers are read, up to a limit of bytes."""

    def __init__(self, source: ForeignFile, data: bytes) -> None:
        super().__init__(data)
        self.source = source
        self.left = MOST_HEADERS

    def read(self, size: int | None = -1) -> bytes:
        """Read some bytes of headers."""
        if size is None or not 0 <= size <= self.left:
            self.source.wrong(f"it has more than {MOST_HEADERS:,} bytes of headers: too many files, or names too long")
        self.left -= size
        return super().read(size)


BROKEN = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RecursionError, NotImplementedError, TypeError,
    ValueError, lzma.LZMAError, tarfile.TarError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What readers raise where a file is not what they expect."""


def guarded(read: Callable[[ForeignFile], FrozenTask]) -> Callable[[ForeignFile], FrozenTask]:
    """Return a reader with E728 in place of each exception that another reader raises."""

    def safely(source: ForeignFile) -> FrozenTask:
        try:
            return read(source)
        except SpecError:
            raise
        except KeyError as error:
            source.wrong(f"it has no {error}")
        except BROKEN as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            source.wrong(f"it is not in the format that its name says: {reason}")

    return safely


def listed(names: Sequence[str]) -> str:
    """Return names with commas; of many, the first ones and how many more there are."""
    shown = ", ".join(names[:MOST_LISTED])
    if len(names) > MOST_LISTED:
        return f"{shown} and {len(names) - MOST_LISTED:,} more"
    return shown
