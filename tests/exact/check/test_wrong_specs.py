"""Wrong specs and what is said of them: each file of `tests/wrong` has a right spec and changes of it, and the answers beside.

A change is an old and a new piece of the text, with the name of a variant where that is built; or it is sections, which
take the place of those of the spec. `variant` names one that all changes are looked at in. `pytest --update-golden` writes
the answers; then read the diff.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact import check
from taskspec.language.source import read_text
from taskspec.language.task.build import build

FILES = sorted(Path(__file__).parents[2].glob("wrong/*.yaml"))
SECTION = re.compile(r"^(?=[A-Za-z_]\w*:)", re.MULTILINE)


def with_sections(spec: str, written: str) -> str:
    """A spec with the sections of a text in place of its own, or below them."""
    sections = {part.partition(":")[0]: part for part in SECTION.split(spec) if part}
    for part in SECTION.split(written):
        sections[part.partition(":")[0]] = part.rstrip("\n") + "\n"
    return "".join(sections.values())


def changed(spec: str, change: Any) -> tuple[str, list[str]]:
    """The text after a change, and the variant to build, if it names one."""
    if isinstance(change, str):
        return with_sections(spec, change), []
    old, new, *variant = change
    assert old in spec, f"{old!r} is not in the spec"
    return spec.replace(old, new, 1), variant


def answer(text: str, variant: str | None = None) -> list[str]:
    """What building and checking a spec says, a line each."""
    try:
        found = check(build(read_text(text, "spec.yaml"), variant)).diagnostics
    except SpecError as error:
        found = error.diagnostics
    return [line(each, text) for each in found]


def line(found: Diagnostic, text: str) -> str:
    """A diagnostic in one line: code, place, the characters that it points at, words, and a hint."""
    words = found.message if found.hint is None else f"{found.message} ({found.hint})"
    if found.span is None:
        return f"{found.code} {words}"
    span = found.span
    rows = [*text.split("\n")[span.line - 1 : span.end_line]]
    rows[-1] = rows[-1][: span.end_column - 1]
    rows[0] = rows[0][span.column - 1 :]
    marked = " ".join(row.strip() for row in rows)
    return f"{found.code} {span.line}:{span.column} `{marked}`: {words}".replace("\n", " ")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_what_is_said_of_wrong_specs(path: Path, update_golden: bool) -> None:
    written = yaml.safe_load(path.read_text(encoding="utf-8"))
    spec = written["spec"]
    assert answer(spec) == written.get("warnings", [])
    rows = []
    for change in written["changes"]:
        text, variant = changed(spec, change)
        title = change if isinstance(change, str) else " -> ".join(change)
        rows.append(" ".join(title.split()))
        rows += [f"  {each}" for each in answer(text, *variant or [written.get("variant")])]
    beside = path.with_suffix(".txt")
    said = "\n".join(rows) + "\n"
    if update_golden:
        beside.write_text(said, encoding="utf-8")
    assert beside.read_text(encoding="utf-8") == said
