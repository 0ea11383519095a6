"""The content of a function in a file, so that results of what it did before a change are not taken for those of today."""

from __future__ import annotations

import ast
import hashlib
import warnings
from collections.abc import Iterator
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
    start = Path(path).resolve()
    home = _home(start)
    folders = [start.parent]
    if (home / "__init__.py").is_file():
        folders.append(home.parent)
    contents: dict[Path, bytes] = {}
    waiting = [start]
    while waiting:
        file = waiting.pop()
        if file in contents or not file.is_relative_to(home):
            continue
        try:
            contents[file] = file.read_bytes()
        except OSError as error:
            message = f"cannot read {str(file)!r}: {error.strerror or error}"
            raise SpecError([Diagnostic("E710", None, message)]) from error
        waiting += _imported(contents[file], file, folders)
    return contents


def _home(file: Path) -> Path:
    home = file.parent
    while (home.parent / "__init__.py").is_file() and (home / "__init__.py").is_file():
        home = home.parent
    return home


def _imported(content: bytes, file: Path, folders: list[Path]) -> Iterator[Path]:
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(content)
    except (SyntaxError, ValueError, RecursionError):  # running it shows the mistake
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _files(alias.name, folders)
        elif isinstance(node, ast.ImportFrom):
            if 0 < node.level <= len(file.parents):
                within = [file.parents[node.level - 1]]
            else:
                within = folders
            for alias in node.names:
                yield from _files(f"{node.module or ''}.{alias.name}".lstrip("."), within)


def _files(module: str, folders: list[Path]) -> Iterator[Path]:
    """Yield the files of a module and of the packages that it is in; the last parts may be names in one of them."""
    for folder in folders:
        place = folder
        for part in module.split("."):
            place = place / part
            for file in (place / "__init__.py", place.with_name(f"{part}.py")):
                if file.is_file():
                    yield file
