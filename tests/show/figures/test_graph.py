"""Graphs of transitions, and tables where a graph would be too large."""

import random
from pathlib import Path

import pytest
from typer.testing import CliRunner

from taskspec.cli.app import app
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures import Overlay, scene
from taskspec.show.figures.machine import NAMED, Machine, explore
from taskspec.show.figures.overlays import OVERLAYS, overlay
from taskspec.show.figures.shapes import Box, Label, Scene
from taskspec.show.printers.text import plain
from tests.docs.test_contact_sheet import outside, overlapping

CHAIN = """
taskspec: 1
name: Chain
state: {{s: {{type: int, low: 0, high: {last}}}}}
action: {{a: {{type: choice, values: [left, right]}}}}
horizon: 400
initial: {{s: {first}}}
dynamics: {{s': "min(s + 1, {last}) if a == right else {back}"}}
reward: 1 if s == {last} else 0
figure: {{kind: {kind}}}
"""


def chain(back: str, last: int = 20, first: int = 0, kind: str = "graph") -> Task:
    return build(read_text(CHAIN.format(back=back, last=last, first=first, kind=kind), "chain.yaml"))


def modes(count: int, figure: str = "figure: {kind: graph}") -> str:
    """States with names, each with a way on and one to any other."""
    names = [f"mode{i}" for i in range(count)]
    chance = random.Random(count)
    rows = [f"    mode{i}: {{on: mode{(i + 1) % count}, off: {chance.choice(names)}}}" for i in range(count)]
    return "\n".join([
        "taskspec: 1", "name: Modes", f"state: {{m: {{type: choice, values: [{', '.join(names)}]}}}}",
        "action: {a: {type: choice, values: [on, off]}}", "horizon: 90", "initial: {m: mode0}", "dynamics:", "  m':",
        "    by: [m, a]", "    rows:", *(f"  {row}" for row in rows), "reward: 1 if m == mode1 else 0", figure,
    ])  # fmt: skip


def drawn(task: Task) -> Scene:
    found = scene(task, Overlay())
    assert found is not None
    assert overlapping(found) == outside(found) == []
    return found


def labels(found: Scene) -> list[str]:
    return [plain(x.text).strip() for x in found.items if isinstance(x, Label)]


def machine(task: Task) -> Machine:
    found = explore(task)
    assert found is not None
    return found


@pytest.mark.parametrize("back", ["s", "max(s - 1, 0)", "max(s - 5, 0)", "0"])
def test_a_graph_that_is_too_long_is_a_table(back: str) -> None:
    assert {"from", "to"} <= set(labels(drawn(chain(back))))


@pytest.mark.parametrize("count", [12, 15, 20, 25, NAMED])
def test_all_of_up_to_thirty_states_are_named(count: int) -> None:
    found = labels(drawn(build(read_text(modes(count, "figure: {kind: matrix}"), "modes.yaml"))))
    assert {f"mode{i}" for i in range(count)} <= set(found)
    assert all(found.count(str(i)) == 2 for i in range(count))  # beside the name of its row, and above its column


@pytest.mark.parametrize(("last", "step"), [(5, 1), (20, 1), (NAMED - 1, 1), (NAMED, 2), (59, 5), (99, 10), (299, 20)])
def test_numbers_of_states_are_their_names(last: int, step: int) -> None:
    found = drawn(chain("0", last, kind="matrix"))
    rows = [plain(x.text) for x in found.items if isinstance(x, Label) and x.anchor == "end"]
    assert rows == [*map(str, range(0, last + 1, step)), "from"]


def test_irregular_states_are_a_table_and_nothing_is_written_of_them_unasked(tmp_path: Path) -> None:
    assert "…" not in labels(drawn(build(read_text(modes(15), "modes.yaml"))))
    spec = tmp_path / "modes.yaml"
    spec.write_text(modes(15, ""))
    ran = CliRunner().invoke(app, ["docs", str(spec), "-f", "svg", "-o", str(tmp_path / "out")])
    assert ran.exit_code == 1
    assert "kind: ..." in ran.output.replace("\n", " ")


def test_tables_frame_where_chosen_actions_lead_and_shade_visits() -> None:
    task = chain("max(s - 1, 0)", last=9, kind="matrix")
    laid = scene(task, overlay(task, OVERLAYS))
    assert laid is not None
    boxes = [x for x in laid.items if isinstance(x, Box)]
    frames = [x for x in boxes if x.line == "accent"]
    (table, column) = (x for x in boxes if x.line == "faint" and x.fill is None)
    places = [((x.corner[1] - table.corner[1]) / x.height, (x.corner[0] - table.corner[0]) / x.width) for x in frames]
    assert [(round(row), round(to)) for row, to in places] == [(s, min(s + 1, 9)) for s in range(10)]
    visited = [x for x in boxes if x.fill == "accent"]
    assert [x.shade == 1 for x in visited] == [False] * 9 + [True]  # it stays in the last state
    assert all(x.corner[0] == pytest.approx(column.corner[0]) for x in visited)
    assert {x for x in labels(laid) if ":" in x} == {
        "V: best return with all 400 steps to go",
        "frames where they lead: best actions with all 400 steps to go",
        "shade, up to 391 per episode, in the column on the right: an optimal policy's visits",
    }
    assert not overlapping(laid)
    assert not outside(laid)


def test_conditions_are_labelled_as_pages_print_them() -> None:
    text = """
taskspec: 1
name: Lamp
state: {on: {type: bool}}
action: {press: {type: bool}}
horizon: 4
initial: {on: false}
dynamics: {on': not on if press else on}
reward: on
figure: {kind: graph}
"""
    assert set(labels(drawn(build(read_text(text, "lamp.yaml"))))) >= {"0", "1"}
