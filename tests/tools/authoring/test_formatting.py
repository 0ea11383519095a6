"""The usual layout of specs: what it changes, and that nothing else does."""

import hashlib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from taskspec.base.diagnostics import Fix
from taskspec.cli.app import app
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.merge import merge, variant_names
from taskspec.programs.scalar import compile_scalar
from taskspec.tools.authoring.analysis import analyse
from taskspec.tools.authoring.formatting import fixed, formatted
from tests.shared.sparse import sparse

ROOT = Path(__file__).parents[3]
SPECS = sorted(
    path for path in (ROOT / "tasks").glob("*/*.yaml") if path.read_text(encoding="utf-8").startswith("taskspec:")
)
BEFORE = """taskspec: 1
name: Ring   # of three places
state:
  s: {type: choice, values: [one, two, three]}
  k: {type: int, low: 0, high: 3*2}
action:
  a: {type: choice, values: [left, right]}
constants:
  P:
    - [1, 0.25, 3]  # first
    - [0.5, 2, 1]
horizon: 4*2
initial: {s: one, k: 0}
definitions:
  "f(x)": x   +1
dynamics:
  s':
    by: [s, a]
    rows:
      one: {left: two, right: three}
      two: {left: three, right: one}   # back
      three: {left: one, right: {one: 1/2, two: 1 /2}}
  k': "clip( f(k)-(a==left) ,0,-  2 + 8 )"
reward:
  - if: s'==one   and not(a == left)
    then: P[0,1 :][ 0 ]-  1
  - else: >-
      2**  k
        +3
claims:
  - optimal_return>=0
"""
AFTER = """taskspec: 1
name: Ring   # of three places
state:
  s: {type: choice, values: [one, two, three]}
  k: {type: int, low: 0, high: 3 * 2}
action:
  a: {type: choice, values: [left, right]}
constants:
  P:
    - [1,   0.25, 3]  # first
    - [0.5, 2,    1]
horizon: 4 * 2
initial: {s: one, k: 0}
definitions:
  "f(x)": x + 1
dynamics:
  s':
    by: [s, a]
    rows:
      one:   {left: two,   right: three}
      two:   {left: three, right: one}   # back
      three: {left: one,   right: {one: 1/2, two: 1 / 2}}
  k': "clip(f(k) - (a == left), 0, -2 + 8)"
reward:
  - if: s' == one and not (a == left)
    then: P[0, 1:][0] - 1
  - else: >-
      2**k
        + 3
claims:
  - optimal_return >= 0
"""


def digest(text: str, name: str) -> str:
    """Return the hash of the programs of all tasks of a spec."""
    document = read_text(text, name)
    programs = []
    for variant in variant_names(document.data).values():
        if not merge(document, variant).missing:
            programs.append(compile_scalar(build(document, variant)).source)
    return hashlib.sha256("\n".join(programs).encode()).hexdigest()


def crowded(text: str, name: str) -> str:
    """Return a spec with other spaces around the operators of its expressions."""
    fixes = set()
    for attempt in analyse(text, name).attempts:
        for expr in attempt.merged.parsed.values():
            value = expr.place.text.value
            span = expr.place.text.locate(0, len(value))
            marked = span.origin.line(span.line)[span.column - 1 : span.end_column - 1]
            if span.origin.name == name and span.line == span.end_line and marked == value and "'" not in marked:
                fixes.add(Fix(span, value.replace(" + ", "+").replace(" * ", "  *   ").replace(" == ", "==")))
    return fixed(text, fixes)


def test_layout() -> None:
    assert formatted(BEFORE) == AFTER
    assert formatted(AFTER) == AFTER
    assert digest(BEFORE, "ring.yaml") == digest(AFTER, "ring.yaml")
    assert formatted(BEFORE.replace("\n", "\r\n")) == AFTER.replace("\n", "\r\n")


@pytest.mark.parametrize("path", sparse(SPECS, 4), ids=lambda path: path.stem)
def test_the_layout_of_a_spec_changes_no_task_and_is_its_own_layout(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    new = formatted(text, str(path))
    assert formatted(new, str(path)) == new
    other = crowded(text, str(path))
    assert formatted(other, str(path)) == new
    assert digest(other, str(path)) == digest(text, str(path)) == digest(new, str(path))
    comments = [line.partition(" #")[2] for line in text.splitlines()]
    assert [line.partition(" #")[2] for line in new.splitlines()] == comments


def test_the_command_writes_shows_and_reports(tmp_path: Path) -> None:
    spec = tmp_path / "ring.yaml"
    bad = tmp_path / "bad.yaml"
    spec.write_text(BEFORE, encoding="utf-8")
    bad.write_text("taskspec: 1\nname: [\n", encoding="utf-8")
    runner = CliRunner()
    checked = runner.invoke(app, ["fmt", "--check", str(spec)])
    assert (checked.exit_code, checked.stdout) == (1, f"{spec}\n")
    shown = runner.invoke(app, ["fmt", "--diff", str(spec)])
    assert shown.exit_code == 0
    assert "+    k\\x27" not in shown.stdout
    assert spec.read_text(encoding="utf-8") == BEFORE
    written = runner.invoke(app, ["fmt", str(tmp_path)])
    assert written.exit_code == 1
    assert "bad.yaml:2:7:" in written.stderr and "error[E111" in written.stderr
    assert "1 file changed, 1 left as they are" in written.stderr
    assert spec.read_text(encoding="utf-8") == AFTER
    assert bad.read_text(encoding="utf-8") == "taskspec: 1\nname: [\n"
    assert runner.invoke(app, ["fmt", "--check", str(spec)]).exit_code == 0
