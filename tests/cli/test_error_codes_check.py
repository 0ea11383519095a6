"""One spec per code of sense and claims: exactly one diagnostic, at its place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from taskspec.exact.check.file_checks import check_file
from taskspec.language.targets import File
from taskspec.tools.authoring.checks import examine
from tests.exact.check.test_error_codes import FILES, FOLDER


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_one_diagnostic_at_its_place(path: Path) -> None:
    expected = re.match(r"# expect: ([EW]\d+) (\d+:\d+)\n", path.read_text(encoding="utf-8"))
    assert expected is not None
    (found,) = check_file(File(path, ""), examine).diagnostics
    assert found.span is not None
    assert (found.code, f"{found.span.line}:{found.span.column}") == expected.groups()


def test_a_stand_in_that_starts_outside_its_states_gives_no_results(tmp_path: Path) -> None:
    sort = (FOLDER.parents[1] / "tasks/derail/sort.yaml").read_text(encoding="utf-8")
    assert sort.count("low: 0, high: L - 1, doc: rank") == 1
    text = sort.replace("low: 0, high: L - 1, doc: rank", "low: 1, high: L - 1, doc: rank")
    (tmp_path / "sort.yaml").write_text(text, encoding="utf-8")
    found = check_file(File(tmp_path / "sort.yaml", ""), examine).diagnostics
    assert {d.code for d in found} == {"E602", "W522", "W531"}
