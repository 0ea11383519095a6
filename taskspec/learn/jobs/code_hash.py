"""The basis of results: the hash of a function with the files that it imports, the machine, versions of packages."""

from __future__ import annotations

import ast
import hashlib
import os
import platform
import re
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from taskspec.base import __version__
from taskspec.base.diagnostics import spec_error


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
    looked_for: set[str] = set()
    waiting = [start]
    while waiting:
        file = waiting.pop()
        if file in contents or not file.is_relative_to(home):
            continue
        try:
            about = file.stat()
            contents[file], imports = _read(file, about.st_mtime_ns, about.st_size)
        except OSError as error:
            raise spec_error("E710", f"cannot read {str(file)!r}: {error.strerror or error}") from error
        for module, level in imports:
            if 0 < level <= len(file.parents):
                waiting += _files(module, [file.parents[level - 1]], set())
            else:
                waiting += _files(module, folders, looked_for)
    return contents


def _home(file: Path) -> Path:
    home = file.parent
    while (home.parent / "__init__.py").is_file() and (home / "__init__.py").is_file():
        home = home.parent
    return home


@lru_cache(maxsize=4096)
def _read(file: Path, changed: int, size: int) -> tuple[bytes, tuple[tuple[str, int], ...]]:
    """Return the content of a file, and what it imports: names, and how many dots are before them.

    Args:
        changed: when the file was changed last, which makes another content another call; as the size does.
    """
    content = file.read_bytes()
    return content, tuple(dict.fromkeys(_imported(content)))


def _imported(content: bytes) -> Iterator[tuple[str, int]]:
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(content)
    except (SyntaxError, ValueError, RecursionError):  # running it shows the mistake
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, 0
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                yield f"{node.module or ''}.{alias.name}".lstrip("."), node.level


def _files(module: str, folders: list[Path], looked_for: set[str]) -> Iterator[Path]:
    """Yield the files of a module and of the packages that it is in; the last parts may be names in one of them.

    Args:
        looked_for: modules whose files were yielded before, if they have some; these are added.
    """
    parts = module.split(".")
    for count in range(1, len(parts) + 1):
        name = "/".join(parts[:count])
        if name in looked_for:
            continue
        looked_for.add(name)
        for folder in folders:
            for place in (folder / name / "__init__.py", folder / f"{name}.py"):
                if place.is_file():
                    yield place


PACKAGES = (
    "numpy", "numba", "jax", "optax", "gymnasium", "seals", "gymnax", "envpool", "stable-baselines3", "imitation",
)  # fmt: skip
CPU_INFO = Path("/proc/cpuinfo")


def machine() -> dict[str, Any]:
    """Return processor, system and versions of packages as plain data."""
    processor = platform.processor() or platform.machine()
    with suppress(OSError):
        model = re.search(r"^model name\s*:\s*(.+)$", CPU_INFO.read_text(encoding="utf-8"), re.MULTILINE)
        if model:
            processor = model[1]
    versions = {"python": platform.python_version(), "taskspec": __version__}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return {
        "processor": processor,
        "cores": os.cpu_count(),
        "platform": f"{platform.system()} {platform.machine()}",
        "versions": versions,
    }
