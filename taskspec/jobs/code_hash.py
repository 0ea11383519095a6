"""The content of a function in a file, so that results of what it did before a change are not taken for those of today."""

from __future__ import annotations

import hashlib
import warnings
from contextlib import suppress
from pathlib import Path

from taskspec.base.diagnostics import Diagnostic, SpecError


def code_hash(path: Path | str, function: str) -> str:
    """Return a hash of a function: of its name, of the file, and of all that the file imports from its own folder.

    Imports are read and followed, those inside functions included; nothing is run. Names that are put together as a program
    runs, and other files that it reads, are not seen. The hash does not depend on where the folder lies.

    Args:
        path: the file; where its folder is a part of a package, the whole package counts as its folder.
        function: its name in the file.
    """
    contents = code_files(path)
    digest = hashlib.sha256(function.encode())
    home = _home(Path(path).resolve())
    for file in sorted(contents):
        name = file.relative_to(home).as_posix()
        digest.update(f"\n{name} {len(contents[file])}\n".encode())
        digest.update(contents[file])
    return digest.hexdigest()


def code_files(path: Path | str) -> dict[Path, bytes]:
    """Return the contents of a file and of all that it imports from its own folder, by their places (see `code_hash`)."""
    from modulefinder import ModuleFinder

    start = Path(path).resolve()
    try:
        contents = {start: start.read_bytes()}
    except OSError as error:
        message = f"cannot read {str(start)!r}: {error.strerror or error}"
        raise SpecError([Diagnostic("E710", None, message)]) from error
    home = _home(start)
    folders = [str(start.parent)]
    if (home / "__init__.py").is_file():
        folders.append(str(home.parent))
    finder = ModuleFinder(folders)
    with warnings.catch_warnings(action="ignore"), suppress(Exception):  # running a broken file shows what is wrong
        finder.import_hook(".".join(start.relative_to(folders[-1]).with_suffix("").parts))
    for module in finder.modules.values():
        file = Path(getattr(module, "__file__", None) or "")
        if file.is_relative_to(home) and file.is_file():
            contents[file] = file.read_bytes()
    return contents


def _home(file: Path) -> Path:
    """Return the folder of a file, or of the whole package that it is a part of."""
    home = file.parent
    while (home.parent / "__init__.py").is_file() and (home / "__init__.py").is_file():
        home = home.parent
    return home
