"""One spec per code of sense and claims: exactly one diagnostic, at its place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from taskspec.cli.checking import check_file
from taskspec.cli.targets import File
from taskspec.diagnostics import CODES

FOLDER = Path(__file__).parent / "errors"
FILES = sorted([*FOLDER.glob("W5*.yaml"), *FOLDER.glob("E6*.yaml")])


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_one_diagnostic_at_its_place(path: Path) -> None:
    expected = re.match(r"# expect: ([EW]\d+) (\d+:\d+)\n", path.read_text(encoding="utf-8"))
    assert expected is not None
    (found,) = check_file(File(path, "")).diagnostics
    assert found.span is not None
    assert (found.code, f"{found.span.line}:{found.span.column}") == expected.groups()


def test_every_code_has_a_spec() -> None:
    wanted = {f"{c.code}-{c.slug}" for c in CODES.values() if c.code[:2] in ("W5", "E6")}
    assert {path.stem for path in FILES} == wanted
