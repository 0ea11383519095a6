"""The tasks of the paper's appendix, typed in exactly as they are printed there: what the checker says about each."""

import re
from pathlib import Path

import pytest

from taskspec import exact
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language import source
from taskspec.language.task.build import build

FOLDER = Path(__file__).parent
FILES = sorted(FOLDER.glob("*.yaml"))
TABLE = FOLDER / "README.md"


def findings(path: Path) -> tuple[Diagnostic, ...]:
    document = source.read_file(path)
    try:
        task = build(document)
    except SpecError as error:
        return error.diagnostics
    return exact.check(task).diagnostics


def comment(path: Path, key: str) -> str:
    found = re.search(rf"^# {key}: (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return found[1]


def expected(path: Path) -> list[tuple[str, tuple[str, ...]]]:
    """Codes with the path of the section that they point into."""
    line = comment(path, "expect")
    if line == "sound":
        return []
    pairs = (part.split(" @ ") for part in line.split(", "))
    return [(code, tuple(place.split("."))) for code, place in pairs]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_contradiction_is_found_where_it_is_printed(path: Path) -> None:
    document = source.read_file(path)
    found = findings(path)
    assert sorted(d.code for d in found) == sorted(code for code, _ in expected(path))
    for code, place in expected(path):
        span = next(d.span for d in found if d.code == code)
        assert span is not None
        first = document.key_span(place)
        value = document.span(place)
        assert first.line <= span.line <= value.end_line


def rows() -> list[str]:
    lines = ["| printed task | says | finding |", "|---|---|---|"]
    for path in FILES:
        said = "; ".join(f"{d.code}: {d.message}" for d in findings(path)) or "no errors, no warnings"
        lines.append(f"| `{path.name}` | {comment(path, 'text')} | {said} |")
    return lines


def test_the_table_of_findings_is_up_to_date(update_golden: bool) -> None:
    text = HEAD + "\n".join(rows()) + "\n"
    if update_golden:
        TABLE.write_text(text, encoding="utf-8")
    assert TABLE.read_text(encoding="utf-8") == text


HEAD = """# The appendix as printed

Each file transcribes one task of the DERAIL paper's appendix exactly, contradictions included. `taskspec check`
reports these:

"""
