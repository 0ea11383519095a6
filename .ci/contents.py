"""Say what is in distributions, and fail where a wheel has what nobody needs to run it."""

from __future__ import annotations

import sys
import tarfile
import zipfile
from collections import Counter
from pathlib import Path

LARGEST = 3_000_000
"""Bytes of a wheel."""
FOREIGN = ("tests/", "docs/", "build/", "results/")


def files(path: Path) -> dict[str, int]:
    """Return the files of a distribution and their sizes."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as archive:
            return {each.filename: each.file_size for each in archive.infolist()}
    with tarfile.open(path) as archive:
        members = [each for each in archive.getmembers() if each.isfile()]
    return {each.name.partition("/")[2]: each.size for each in members}


def main(paths: list[str]) -> int:
    """Print each distribution's folders, and return 1 if a wheel is wrong."""
    wrong = []
    for path in map(Path, paths):
        found = files(path)
        folders = Counter(name.partition("/")[0] for name in found)
        listed = ", ".join(f"{name} {count}" for name, count in sorted(folders.items()))
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB, {len(found)} files: {listed}")
        if path.suffix != ".whl":
            continue
        wrong += [name for name in found if name.startswith(FOREIGN) or name.endswith(".pth")]
        wrong += [name for name in found if "/results/" in name]
        if path.stat().st_size > LARGEST:
            wrong.append(f"more than {LARGEST} bytes")
    for name in wrong:
        print(f"not in a wheel: {name}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
