"""Graphs of transitions, and tables where a graph would be too large."""

import random
from pathlib import Path

import numpy as np
import pytest

from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures import Overlay, scene
from taskspec.show.figures.machine import NAMED
from taskspec.show.figures.overlays import OVERLAYS, overlay
from taskspec.show.figures.shapes import Scene
from taskspec.show.printers.text import plain
from tests.shared.commands import Done
from tests.shared.scenes import boxes, labels, legible, places, words

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
    rows = ""
    for i, name in enumerate(names):
        rows += f"      {name}: {{on: {names[(i + 1) % count]}, off: {chance.choice(names)}}}\n"
    return f"""
taskspec: 1
name: Modes
state: {{m: {{type: choice, values: [{", ".join(names)}]}}}}
action: {{a: {{type: choice, values: [on, off]}}}}
horizon: 90
initial: {{m: mode0}}
dynamics:
  m':
    by: [m, a]
    rows:
{rows}reward: 1 if m == mode1 else 0
{figure}
"""


def drawn(task: Task) -> Scene:
    return legible(scene(task, Overlay()))


@pytest.mark.parametrize("back", ["s", "max(s - 1, 0)", "max(s - 5, 0)", "0"])
def test_a_graph_that_is_too_long_is_a_table(back: str) -> None:
    assert {"from", "to"} <= set(words(drawn(chain(back))))


@pytest.mark.parametrize("count", [12, 15, 20, 25, NAMED])
def test_all_of_up_to_thirty_states_are_named(count: int) -> None:
    found = words(drawn(build(read_text(modes(count, "figure: {kind: matrix}"), "modes.yaml"))))
    for i in range(count):
        assert f"mode{i}" in found
        assert found.count(str(i)) == 2  # beside the name of its row, and above its column


@pytest.mark.parametrize(("last", "step"), [(5, 1), (20, 1), (NAMED - 1, 1), (NAMED, 2), (59, 5), (99, 10), (299, 20)])
def test_numbers_of_states_are_their_names(last: int, step: int) -> None:
    found = drawn(chain("0", last, kind="matrix"))
    rows = [plain(label.text) for label in labels(found, anchor="end")]
    assert rows == [*map(str, range(0, last + 1, step)), "from"]


def test_irregular_states_are_a_table_and_nothing_is_written_of_them_unasked(tmp_path: Path) -> None:
    assert "…" not in words(drawn(build(read_text(modes(15), "modes.yaml"))))
    spec = tmp_path / "modes.yaml"
    spec.write_text(modes(15, ""))
    ran = Done("docs", spec, "-f", "svg", "-o", tmp_path / "out")
    assert ran.status == 1
    assert "kind: ..." in ran.err.replace("\n", " ")


def test_tables_frame_where_chosen_actions_lead_and_shade_visits() -> None:
    task = chain("max(s - 1, 0)", last=9, kind="matrix")
    laid = scene(task, overlay(task, OVERLAYS))
    assert laid is not None
    legible(laid)
    (table, column) = boxes(laid, line="faint", fill=None)
    frames = boxes(laid, line="accent")
    to, row = ((places(frames) - table.corner) / (frames[0].width, frames[0].height)).T
    assert row == pytest.approx(np.arange(10))
    assert to == pytest.approx([1, 2, 3, 4, 5, 6, 7, 8, 9, 9])
    visited = boxes(laid, fill="accent")
    assert places(visited)[:, 0] == pytest.approx(column.corner[0])
    assert [box.shade == 1 for box in visited] == [False] * 9 + [True]  # it stays in the last state
    assert {x for x in words(laid) if ":" in x} == {
        "V: best return with all 400 steps to go",
        "frames where they lead: best actions with all 400 steps to go",
        "shade, up to 391 per episode, in the column on the right: an optimal policy's visits",
    }


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
    assert set(words(drawn(build(read_text(text, "lamp.yaml"))))) >= {"0", "1"}
