"""One broken spec per code: its first line says which code is expected, and where. One message each, at that place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from taskspec.base.diagnostics import Diagnostic
from taskspec.exact.check.file_checks import check_file
from taskspec.language.targets import File
from taskspec.tools.authoring.checks import examine
from tests.language.source.test_error_codes import FILES


def found_in(path: Path) -> tuple[Diagnostic, ...]:
    """What `taskspec check` reports of a file, warnings left out."""
    return tuple(d for d in check_file(File(path, ""), examine).diagnostics if d.severity == "error")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_broken_spec_gets_its_code_at_its_place(path: Path) -> None:
    first_line = path.read_text(encoding="utf-8").split("\n")[0]
    expected = re.fullmatch(r"# expect: ([EW]\d+) (\d+:\d+)", first_line)
    assert expected is not None, first_line
    problem, *others = found_in(path)
    assert problem.span is not None
    assert (problem.code, f"{problem.span.line}:{problem.span.column}") == expected.groups()
    assert path.stem.startswith(("E1", "E2")) or not others
