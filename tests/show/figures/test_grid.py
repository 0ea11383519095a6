"""Grids with several agents and objects, headings, and walls that are drawn per instance."""

from pathlib import Path

import numpy as np
import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.language import registry
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.figures import Overlay, overlay, scene, undrawn
from taskspec.show.figures.board import CELL
from taskspec.show.figures.shapes import Scene
from taskspec.show.printers.text import plain
from tests.shared.scenes import boxes, circles, extent, labels, legible, letters, lines, places, told

SPECS = Path(__file__).parents[2] / "specs" / "figures"


def drawn(name: str, here: dict[str, object] | None = None, **values: object) -> Scene:
    one = registry.load(SPECS / f"{name}.yaml", **values)
    assert undrawn(one) == ()
    return legible(scene(one, Overlay(here=here)))


def cell(found: Scene, at: tuple[float, float]) -> tuple[int, int]:
    """Column and row of a point."""
    left, top = places(boxes(found, line="faint")).min(axis=0)
    return int((at[0] - left) / CELL), int((at[1] - top) / CELL)


def words(found: Scene) -> dict[str, tuple[int, int]]:
    return {plain(label.text): cell(found, label.at) for label in labels(found)}


def agent(found: Scene) -> tuple[int, int]:
    return cell(found, circles(found, fill="ink")[0].centre)


def ways(found: Scene) -> dict[tuple[int, int], tuple[int, int]]:
    """Which way what is in a cell faces."""
    facing = {}
    for line in lines(found, arrow=True):
        (x0, y0), (x1, y1) = line.points
        facing[cell(found, (x0, y0))] = (round((x1 - x0) * 4), round((y1 - y0) * 4))
    return facing


@pytest.mark.parametrize("size", [8, 12, 20])
def test_two_agents_are_on_one_grid(size: int) -> None:
    """Also where there are more states than are looked at one by one."""
    found = drawn("chase", L=size)
    assert agent(found) == (0, 0)
    assert {"P": (size - 1, size - 2), "N": (size // 2, size // 2)}.items() <= words(found).items()
    assert ways(found) == {(size - 1, size - 2): (1, 0)}
    assert "P: prey, N: nest." in found.notes
    later = drawn("chase", {"x": 3, "y": 3, "px": 1, "py": 6}, L=size)
    assert (agent(later), words(later)["P"], ways(later)) == ((3, 3), (1, 6), {(1, 6): (-1, 0)})
    assert (later.width, later.height) == (found.width, found.height)


def test_keys_and_doors_are_there_until_they_are_used() -> None:
    found = drawn("keys")
    assert (agent(found), ways(found)) == ((1, 1), {(1, 1): (1, 0)})
    assert {"K": (2, 3), "D": (3, 2)}.items() <= words(found).items()
    walls = np.unique(places(boxes(found, fill="muted")).round(3), axis=0)
    assert len(walls) == 7 + 3 + 2 + 3 + 7
    opened = drawn("keys", {"x": 2, "y": 3, "dir": "south", "has": False, "open": True})
    assert "D" not in words(opened)
    assert words(opened)["K"] == agent(opened) == (2, 3)
    assert ways(opened) == {(2, 3): (0, 1)}


@pytest.mark.parametrize("seed", [0, 3])
@pytest.mark.parametrize("size", [9, 30])
def test_walls_are_those_of_the_instance(size: int, seed: int) -> None:
    found = drawn("walls", L=size, instance_seed=seed)
    walls = registry.load(SPECS / "walls.yaml", L=size, instance_seed=seed).constants["walls"]
    assert len(boxes(found, fill="muted")) == walls.sum()


@pytest.mark.parametrize(("figure", "code"), [
    ("{kind: grid, at: [x, y, 1]}", "E307"), ("{kind: grid, at: [x, y], objects: {key: 3}}", "E307"),
    ("{kind: grid, at: [x, y], objects: {key: [x, z]}}", "E302"), ("{kind: grid, at: [x, y], objects: [x, y]}", "E2"),
])  # fmt: skip
def test_what_is_no_place_is_told(figure: str, code: str) -> None:
    text = (SPECS / "chase.yaml").read_text(encoding="utf-8").partition("figure:")[0]
    with pytest.raises(SpecError) as found:
        build(read_text(f"{text}figure: {figure}\n"))
    (first, *_) = found.value.diagnostics
    assert first.code.startswith(code)
    assert first.span is not None


TURNING = """\
taskspec: 1
name: Turning
state:
  p: {type: int, low: 0, high: 3}
  h: {type: choice, values: {east: 1, west: -1}}
action:
  a: {type: choice, values: [ahead, turn]}
horizon: 8
initial: {p: 1, h: west}
dynamics:
  p': clip(p + (h if a == ahead else 0), 0, 3)
  h': {by: [h, a], rows: {east: {ahead: east, turn: west}, west: {ahead: west, turn: east}}}
terminal: p' == 3
reward: -1
expert: {a: "turn if h == west else ahead"}
figure: {kind: grid, at: [p, 0]}
"""


def test_what_is_laid_over_a_cell_of_several_states() -> None:
    """Facing east, 3 - p steps are left, and one more facing west; no action is the best one either way."""
    one = build(read_text(TURNING))
    found = scene(one, overlay(one, ["values", "policy"]))
    assert found is not None
    assert {"−2": (1, 0), "−1": (2, 0), "−3": (0, 0)}.items() <= words(found).items()
    assert not lines(found, arrow=True)
    assert "numbers, of the best state in a cell: best return with all 8 steps to go" in words(found)
    assert "not drawn: best actions with all 8 steps to go" in words(found)
    # The expert turns in cell 1, and walks through cells 1 and 2: two states, and one, of each.
    shaded = scene(one, overlay(one, ["occupancy"]))
    assert shaded is not None
    cells = sorted(boxes(shaded, fill="accent"), key=lambda box: box.corner)
    assert [box.shade for box in cells] == pytest.approx([0.0, 1.0, 0.5, 0.0])


CROSSING = """
taskspec: 1
name: Crossing
state: {x: {type: int, low: 0, high: 2}, dead: {type: bool}, key: {type: bool}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 9
initial: {x: 0, dead: false, key: false}
dynamics: {x': "min(x + a, 2)", dead': dead or Bernoulli(1/9), key': key or x' == 1}
reward: 0
figure: {kind: grid, at: [x, 0], highlight: {good: x == 2 and key, bad: dead}}
"""


def test_what_may_hold_in_every_cell_marks_none() -> None:
    """A condition that some state of a cell fulfils marks the cell, as long as this says something about the place."""
    found = scene(build(read_text(CROSSING)))
    assert found is not None
    assert "Not marked: bad, which may hold in every cell." in found.notes
    assert boxes(found, fill="good") and not boxes(found, fill="bad")


def test_a_map_without_columns_is_none() -> None:
    text = CROSSING.replace("state:", 'constants: {rooms: "[[i for i in range(0)] for j in range(2)]"}\nstate:')
    with pytest.raises(SpecError, match=r"E204.*the constant 'rooms' is neither a grid of letters nor a matrix"):
        build(read_text(text.replace("kind: grid,", "kind: grid, map: rooms,")))


def crossed(found: Scene) -> list[str]:
    """Labels that an arrow runs over, and signs that it touches."""
    frames = [(plain(label.text), letters(label)) for label in labels(found)]
    frames += [("sign", extent(line)) for line in lines(found, arrow=False, color="ink")]
    ends = places(lines(found, arrow=True))
    along = np.linspace(ends[:, 0], ends[:, 1], 21)
    touched = []
    for word, (x0, y0, x1, y1) in frames:
        is_inside = (along > (x0, y0)) & (along < (x1, y1))
        if is_inside.all(axis=-1).any():
            touched.append(word)
    return touched


@pytest.mark.parametrize("source", [SPECS / "lake.yaml", "seals/CliffWorld"], ids=["moves", "diagonal moves"])
def test_arrows_run_over_no_number_and_no_sign(source: str | Path) -> None:
    one = registry.load(source)
    found = legible(scene(one, overlay(one, ["values", "policy"])))
    assert crossed(found) == []
    assert len(lines(found, arrow=True)) >= 15


@pytest.mark.parametrize(
    ("source", "scale"),
    [
        ("derail/EarlyTermPos", "up to 5 per episode"),
        ("derail/RiskyPath", "up to 3 per episode"),
        (SPECS / "keys.yaml", "relative to the most visited cell"),
    ],
)
def test_the_shade_of_visits_has_a_scale(source: str | Path, scale: str) -> None:
    one = registry.load(source)
    found = scene(one, overlay(one, ["occupancy"]))
    assert found is not None
    assert f"shade, {scale}: " in told(found)
