"""One broken spec for each code, in `tests/errors`, and beside it what is said of it; `pytest --update-golden` writes that."""

from pathlib import Path

import pytest

from taskspec.base.codes import codes
from taskspec.base.diagnostics import render
from taskspec.tools.authoring.checks import check_file, examine
from taskspec.tools.targets import File

FOLDER = Path(__file__).parents[1] / "errors"
FILES = sorted(FOLDER.glob("*.yaml"))
OF_SPECS = ("E1", "E2", "E3", "E4", "E6", "W5")


def test_every_code_of_specs_has_a_broken_spec() -> None:
    there = {path.stem for path in FILES}
    for code, entry in codes().items():
        assert (f"{code}-{entry.slug}" in there) == code.startswith(OF_SPECS)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_broken_spec_gets_its_code(path: Path, update_golden: bool) -> None:
    found = check_file(File(path, ""), examine).diagnostics
    assert path.stem[:4] in {each.code for each in found}
    said = render(found).replace(str(path), path.name) + "\n"
    beside = path.with_suffix(".txt")
    if update_golden:
        beside.write_text(said, encoding="utf-8")
    assert beside.read_text(encoding="utf-8") == said
