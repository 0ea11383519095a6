"""Documents of TeX: compiled, and read again with poppler."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

TEX = pytest.mark.skipif(None in map(shutil.which, ("pdflatex", "pdfinfo", "pdftotext")), reason="no TeX or no poppler")


def compiled(folder: Path, source: str, times: int = 1) -> str:
    """What TeX says of a document in a folder; twice, so that its references are known."""
    (folder / "paper.tex").write_text(source, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    for _ in range(times):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
        assert done.returncode == 0, done.stdout[-2000:]
    return done.stdout


def text(path: Path, *options: str) -> str:
    return subprocess.run(["pdftotext", *options, path, "-"], capture_output=True, text=True, check=True).stdout


def about(path: Path) -> str:
    """Metadata of a document."""
    return subprocess.run(["pdfinfo", path], capture_output=True, text=True, check=True).stdout


class Page(NamedTuple):
    """The words of a page, with the places of their frames: how far from the left, and from the top."""

    height: float
    words: np.ndarray
    left: np.ndarray
    right: np.ndarray
    bottom: np.ndarray


def pages(path: Path) -> list[Page]:
    found = []
    for page in text(path, "-bbox").split("<page ")[1:]:
        height = float(re.findall(r'height="([\d.]+)"', page)[0])
        word = re.findall(r'xMin="([\d.]+)" yMin="[\d.]+" xMax="([\d.]+)" yMax="([\d.]+)">([^<]*)</word>', page)
        left, right, bottom, words = np.array(word).T
        found.append(Page(height, words, left.astype(float), right.astype(float), bottom.astype(float)))
    return found
