"""Reports of exams, in files: pages, pictures and tables. The one for the terminal is `taskspec.cli.report`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.files import write_text
from taskspec.exam.report import pictures
from taskspec.exam.report.page import page
from taskspec.exam.report.rows import write_scores
from taskspec.figures import save


def _html(exam: Mapping[str, Any], path: Path) -> None:
    write_text(path, page(exam))


def _picture(exam: Mapping[str, Any], path: Path) -> None:
    save(pictures.of_exam(exam), path)


def _parquet(exam: Mapping[str, Any], path: Path) -> None:
    write_scores({exam["learner"]: exam}, path)


_WRITERS: dict[str, tuple[str, Callable[[Mapping[str, Any], Path], None]]] = {
    "html": ("report.html", _html), "png": ("report.png", _picture), "pdf": ("report.pdf", _picture),
    "svg": ("report.svg", _picture), "parquet": ("scores.parquet", _parquet),
}  # fmt: skip
FORMATS = tuple(_WRITERS)
"""Forms of a report besides `exam.json`, which it is made of."""
PICTURES = ("png", "pdf", "svg")


def write(exam: Mapping[str, Any], folder: Path | str, formats: Iterable[str] = ("html",)) -> list[Path]:
    """Write reports of an exam into a folder.

    Args:
        exam: what `exam.json` holds.
        folder: made if need be.
        formats: of `FORMATS`.

    Returns:
        The files written, in order.

    Raises:
        SpecError: E713 for another format; E705 for PNG and PDF without matplotlib, for tables without pyarrow; E716 for a file
            that cannot be written.
    """
    written = []
    for name in _known(formats, FORMATS):
        file, writer = _WRITERS[name]
        writer(exam, Path(folder) / file)
        written.append(Path(folder) / file)
    return written


def write_several(exams: Mapping[str, Mapping[str, Any]], folder: Path | str, formats: Iterable[str]) -> list[Path]:
    """Write exams of several learners side by side, as the paper has them.

    Args:
        exams: what `exam.json` holds, by what the learner is called.
        folder: made if need be.
        formats: of `PICTURES`: a heat map `table`, and box plots `task-NAME` and `learner-NAME`; `parquet`: all scores.

    Returns:
        The files written, in order.

    Raises:
        SpecError: as `write`.
    """
    place = Path(folder)
    written = []
    for name in _known(formats, (*PICTURES, "parquet")):
        if name == "parquet":
            written.append(write_scores(exams, place / "scores.parquet"))
        else:
            written += [save(scene, place / f"{stem}.{name}") for stem, scene in pictures.of_several(exams)]
    return written


def _known(formats: Iterable[str], known: Sequence[str]) -> list[str]:
    """Return the formats asked for, each once, or raise E713 for an unknown one."""
    wanted = list(dict.fromkeys(formats))
    for name in wanted:
        if name not in known:
            hint = suggest(name, known) or f"use {', '.join(known)}"
            raise SpecError([Diagnostic("E713", None, f"'{name}' is not a format of this report", hint)])
    return wanted
