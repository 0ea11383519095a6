"""The files of a folder."""

from pathlib import Path


def names(folder: Path) -> list[str]:
    """Names of files and folders in a folder, sorted."""
    return sorted(path.name for path in folder.iterdir())
