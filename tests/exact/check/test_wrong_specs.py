"""Wrong specs and what is said of them: each file of `tests/wrong` has a right spec and changes of it, and the answers beside.

A change is an old and a new piece of the text, with the name of a variant where that is built; or it is sections, which
take the place of those of the spec; or a whole text, where there is no spec. `variant` names one in which all changes are
looked at, and with `ranges: false` other values of parameters are not tried. `pytest --update-golden` writes the answers;
then read the diff.
"""

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
PARSER = re.compile(r" \(while parsing .*\)")
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
        return with_sections(spec, change) if spec else change, []
    old, new, *variant = change
    assert old in spec, f"{old!r} is not in the spec"
    return spec.replace(old, new, 1), variant


def answer(text: str, variant: str | None = None, ranges: bool = True) -> list[str]:
    """What building and checking a spec says, a line each."""
    try:
        found = check(build(read_text(text, "spec.yaml"), variant), ranges=ranges).diagnostics
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
    marked = " ".join(map(str.strip, rows))
    return f"{found.code} {span.line}:{span.column} `{marked}`: {words}".replace("\n", " ")


def said(path: Path) -> str:
    """The changes of a file, each with the answers below it."""
    written = yaml.safe_load(path.read_text(encoding="utf-8"))
    spec = written.get("spec", "")
    ranges = written.get("ranges", True)
    if spec:
        assert answer(spec, None, ranges) == written.get("warnings", [])
    rows = []
    for change in written["changes"]:
        text, named = changed(spec, change)
        variant = named[0] if named else written.get("variant")
        title = change if isinstance(change, str) else " -> ".join(change)
        rows.append(" ".join(title.split()))
        rows += [f"  {each}" for each in answer(text, variant, ranges)]
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_what_is_said_of_wrong_specs(path: Path, update_golden: bool) -> None:
    beside = path.with_suffix(".txt")
    if update_golden:
        beside.write_text(said(path), encoding="utf-8")
    assert beside.read_text(encoding="utf-8") == said(path)


def test_the_same_is_said_of_yaml_without_libyaml(monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the words of the parser itself."""
    traps = FILES[0].with_name("traps.yaml")
    wanted = traps.with_suffix(".txt").read_text(encoding="utf-8")
    monkeypatch.delattr(yaml, "CSafeLoader", raising=False)
    assert PARSER.sub("", said(traps)) == PARSER.sub("", wanted)
