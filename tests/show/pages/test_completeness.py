"""What pages must not leave out: figures without text, open claims, discounts, who acts where."""

import re
from pathlib import Path

import pytest

from tests.shared.commands import Done, spec
from tests.shared.paper import TEX

WALK = """\
taskspec: 1
name: Walk
summary: Walk to the end.
state: {s: {type: choice, values: [a, b, c]}}
action: {go: {type: choice, values: [stay, on]}}
horizon: 4
initial: {s: a}
dynamics: {s': {by: [s, go], rows: {a: {on: b, else: a}, b: {on: c, else: b}, c: c}}}
reward: s' == c
expert: {go: "on"}
"""
OPEN = """\
taskspec: 1
name: Open
summary: A number that grows.
state: {x: {type: real}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 3
initial: {x: 0}
dynamics: {x': "x + a * Uniform(0, 1)"}
reward: x'
claims: [optimal_return > 1]
"""


def pages(folder: Path, text: str, *options: object) -> Path:
    done = Done(
        "docs", spec(folder, text), "-f", "latex", "-f", "html", "-f", "markdown", "-o", folder / "out", *options
    )
    assert done.status == 0, done.err
    return folder / "out"


@TEX
@pytest.mark.parametrize("brief", [False, True])
def test_a_variant_with_another_figure_alone(brief: bool, tmp_path: Path) -> None:
    text = WALK + "variants: {table: {figure: {kind: matrix}}}\n"
    options = ("--brief",) if brief else ()
    done = Done("docs", spec(tmp_path, text), "-f", "pdf", "--no-results", "-o", tmp_path / "out", *options)
    assert done.status == 0, done.err
    assert (r"\taskspecalone" in (tmp_path / "out" / "walk.tex").read_text(encoding="utf-8")) is not brief


def test_claims_that_are_not_decided_are_marked(tmp_path: Path) -> None:
    out = pages(tmp_path, OPEN)
    assert r"\taskspecholds{not decided}" in (out / "open.tex").read_text(encoding="utf-8")
    assert re.search(r'class="mark open">.*not decided</span>', (out / "open.html").read_text(encoding="utf-8"))
    assert "(not decided)" in (out / "open.md").read_text(encoding="utf-8")
    unchecked = pages(tmp_path, OPEN, "--no-results")
    assert "decided" not in (unchecked / "open.tex").read_text(encoding="utf-8")


def test_returns_are_discounted_where_the_task_discounts(tmp_path: Path) -> None:
    text = WALK.replace("horizon: 4", "horizon: 4\ndiscount: 0.9")
    assert r"\gamma^t" in (pages(tmp_path, text) / "appendix.tex").read_text(encoding="utf-8")
    assert "discounted by 0.9 a step" in Done("solve", spec(tmp_path, text)).out
    (tmp_path / "other").mkdir()
    assert r"\gamma" not in (pages(tmp_path / "other", WALK) / "appendix.tex").read_text(encoding="utf-8")
    assert "a step" not in Done("solve", spec(tmp_path, WALK)).out


def test_cells_of_formulas_do_not_shrink_into_each_other(tmp_path: Path) -> None:
    assert "mtable { white-space: nowrap; }" in (pages(tmp_path, WALK) / "walk.html").read_text(encoding="utf-8")


def test_roles_are_told_by_themselves(tmp_path: Path) -> None:
    """They may differ in more than where episodes start."""
    roles = "variants: {slow: {horizon: 9}, fast: {horizon: 3}}\nroles: {expert: slow, learner: fast}\n"
    for options in ((), ("--brief",)):
        tex = (pages(tmp_path, WALK + roles, "--no-results", *options) / "walk.tex").read_text(encoding="utf-8")
        assert re.search(r"Roles(:|}:|]) the expert acts in slow, and the learner in fast", tex)
    assert "**Roles**: the expert acts in slow" in (tmp_path / "out" / "walk.md").read_text(encoding="utf-8")
