"""One broken spec per code: its first line says which code is expected, and where."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import pytest

from taskspec import source
from taskspec.diagnostics import CODES, Diagnostic, SpecError
from taskspec.spec.schema import check_shape, load

FOLDER = Path(__file__).parent / "errors"
FILES = sorted(FOLDER.glob("E[12]*.yaml"))


def first_problem(path: Path) -> Diagnostic:
    """What reading the file, or checking its shape, complains about first."""
    try:
        document = source.read(path)
        found: Iterable[Diagnostic] = check_shape(document) or load_problems(document)
    except SpecError as error:
        found = error.diagnostics
    return next(iter(found))


def load_problems(document: source.Document) -> Iterable[Diagnostic]:
    with pytest.raises(SpecError) as caught:
        load(document)
    return caught.value.diagnostics


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_broken_spec_gets_its_code_at_its_place(path: Path) -> None:
    first_line = path.read_text(encoding="utf-8").split("\n")[0]
    expected = re.fullmatch(r"# expect: ([EW]\d+) (\d+:\d+)", first_line)
    assert expected is not None, first_line
    problem = first_problem(path)
    assert problem.span is not None
    assert (problem.code, f"{problem.span.line}:{problem.span.column}") == expected.groups()


def test_every_code_of_reading_and_shape_has_a_broken_spec() -> None:
    wanted = {f"{c.code}-{c.slug}" for c in CODES.values() if c.code[:2] in ("E1", "E2")}
    assert {path.stem for path in FILES} == wanted
