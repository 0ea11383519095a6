"""Bars, tables of transitions and plots: colours, numbers and names are those of the spec."""

from pathlib import Path

import numpy as np
import pytest

import taskspec
from taskspec.language import registry
from taskspec.show.figures import Overlay, scene
from taskspec.show.figures.plane import HEIGHT, WIDTH
from taskspec.show.figures.shapes import Scene, text_width
from taskspec.show.printers.text import plain
from tests.shared.scenes import Array, boxes, labels, lines, places, words

BITS = """\
taskspec: 1
name: Bits
summary: Set them right.
constants: {target: [1, 0, 2, 1]}
state: {x: {type: int, shape: [4], low: 0, high: 2}}
action: {i: {type: int, low: 0, high: 3}}
horizon: 4
initial: {x: [0, 0, 0, 1]}
dynamics: {x': "put(x, i, target[i])"}
reward: count(x' == target)
"""


def drawn(folder: Path, text: str, over: Overlay | None = None) -> Scene:
    path = folder / "spec.yaml"
    path.write_text(text, encoding="utf-8")
    found = scene(registry.load(path), over)
    assert found is not None
    return found


def colored(found: Scene, role: str) -> list[list[int]]:
    """Row and column of the cells of a vector that have a colour."""
    cells = places(boxes(found, line="paper"))
    colored = places(boxes(found, line="paper", fill=role)).reshape(-1, 2)
    (column, row) = (colored - cells.min(axis=0)).T
    return sorted(np.stack([row / 1.5, column], axis=1).round().astype(int).tolist())


@pytest.mark.parametrize(
    ("part", "cells"),
    [
        ("x != target", [0, 2]), ("x == 5", []), ("x[0] == 0", [0, 1, 2, 3]), ("x[3] == 0", []), ("x[2:]", [2, 3]),
        ("[0, 3]", [0, 3]),
    ],
)  # fmt: skip
def test_highlighted_elements_are_those_of_which_it_holds(part: str, cells: list[int], tmp_path: Path) -> None:
    found = drawn(tmp_path, f'{BITS}figure: {{kind: bars, values: x, highlight: {{bad: "{part}"}}}}\n')
    assert [column for row, column in colored(found, "bad") if row == 0] == cells


def test_each_row_is_coloured_by_its_own_state(tmp_path: Path) -> None:
    expert = 'expert: {i: "argmax([x[j] != target[j] for j in range(4)])"}\n'
    found = drawn(tmp_path, f'{BITS}{expert}figure: {{kind: bars, values: x, highlight: {{bad: "x != target"}}}}\n')
    assert colored(found, "bad") == [[0, 0], [0, 2], [1, 2]]
    for box in boxes(found):
        assert 0 <= box.shade <= 1


def test_states_of_a_table_are_numbered_as_on_the_page(tmp_path: Path) -> None:
    names = ["a_first_one", "a_second_one", "a_third_one"]
    text = f"""\
taskspec: 1
name: Named
summary: Labels are long.
state: {{s: {{type: choice, values: [{", ".join(names)}]}}}}
action: {{go: {{type: int, low: 0, high: 1}}}}
horizon: 4
initial: {{s: a_first_one}}
dynamics: {{s': {{by: s, rows: {{a_first_one: a_second_one, a_second_one: a_third_one, a_third_one: a_first_one}}}}}}
reward: go
figure: {{kind: matrix}}
"""
    assert list(filter(str.isdigit, words(drawn(tmp_path, text)))) == ["0", "1", "2"] * 2


def test_columns_of_a_table_are_told_apart(tmp_path: Path) -> None:
    """Names such as "0, 0" need more than a space between them."""
    for last in (3, 6):
        found = drawn(tmp_path, COUNTERS.replace("LAST", str(last)))
        top = places(labels(found, color="muted"))[:, 1].min()
        least = 0.05
        ends = []
        for label in labels(found):
            (x, y) = label.at
            if y == top:
                half = text_width(label.text, label.size) / 2
                ends.append((x - half, x + half))
                if "," in plain(label.text):
                    least = 0.2
        lefts, rights = np.sort(ends, axis=0).T
        assert (lefts[1:] - rights[:-1] >= least).all()


COUNTERS = """\
taskspec: 1
name: Two
summary: Two counters.
state:
  p: {type: int, low: 0, high: LAST}
  q: {type: int, low: 0, high: LAST}
action: {a: {type: int, low: 0, high: 2}}
horizon: 12
initial: {p: 0, q: 0}
dynamics:
  p': min(p + (a == 0), LAST)
  q': min(q + (a == 1), LAST)
reward: a
figure: {kind: matrix}
"""
TURNS = """\
taskspec: 1
name: Turns
summary: Round and round.
state:
  theta: {type: real, low: -pi, high: pi, symbol: '\\theta'}
  omega: {type: real, low: -8, high: 8, symbol: '\\omega'}
action: {tau: {type: real, low: -1, high: 1}}
horizon: 40
initial: {theta: 0, omega: 3}
dynamics:
  omega': -omega if theta > 2 and omega == 3 else omega
  theta': (theta + 0.2 * omega + pi) % (2 * pi) - pi
reward: theta'
expert: {tau: 0}
figure: """


def steps(found: Scene, color: str) -> Array:
    """How far right or left the points that are joined lie from each other, in centimetres."""
    widths = []
    for line in lines(found, color=color, arrow=False):
        if len(line.points) > 2:
            widths.append(abs(np.diff(np.array(line.points)[:, 0])))
    return np.concatenate(widths)


def test_series_name_what_is_written_for_them(tmp_path: Path) -> None:
    written = '["theta", "omega * theta", "cos(theta)"]'
    found = drawn(tmp_path, TURNS + f"{{kind: series, values: {written}}}\n")
    assert [x.replace(" ", "") for x in words(found) if x not in "t" and not x[-1].isdigit()] == ["θ", "ωθ", "cos(θ)"]
    vector = drawn(tmp_path, TURNS + '{kind: series, values: "[theta + i for i in range(2)]"}\n')
    assert not {"v₀", "v₁"} & set(words(vector))


@pytest.mark.parametrize(
    ("figure", "color"),
    [
        ("{kind: portrait, at: [theta, omega]}", "accent"),
        ("{kind: curve, at: [theta, omega], curve: sin(theta)}", "second"),
    ],
)
def test_an_angle_that_wraps_is_not_joined(figure: str, color: str, tmp_path: Path) -> None:
    assert steps(drawn(tmp_path, TURNS + figure + "\n"), color).max() < 1.0


def test_series_are_joined_but_for_angles_that_wrap(tmp_path: Path) -> None:
    """The speed jumps by its whole range, and stays one line."""
    found = drawn(tmp_path, TURNS + "{kind: series, values: [theta, omega]}\n")
    counts = [len(line.points) for line in lines(found, color="accent")]
    assert len(counts) > 2
    assert max(counts) == 41


def test_a_portrait_shades_where_a_highlight_holds(tmp_path: Path) -> None:
    found = drawn(tmp_path, TURNS + '{kind: portrait, at: [theta, omega], highlight: {bad: "omega > 4"}}\n')
    strips = boxes(found, fill="bad", line=None)
    for strip in strips:
        assert strip.width == pytest.approx(WIDTH)
    assert np.ptp(places(strips)[:, 1]) + strips[0].height == pytest.approx(HEIGHT / 4, abs=0.1)
    assert "bad" in words(found)


def test_a_matrix_is_a_board() -> None:
    """Lights Out: a cell for each light, filled where it is on in the first state."""
    task = registry.load("planning/LightsOut-v0")
    found = scene(task)
    assert found is not None and "as a board of 3 rows and 3 columns" in found.alt
    first, _ = taskspec.make("planning/LightsOut-v0").reset(seed=0)
    assert len(boxes(found, fill="accent")) == np.sum(first)
    assert not labels(found)


def test_an_empty_board_shows_a_few_steps() -> None:
    found = scene(registry.load("planning/TicTacToe-v0"))
    assert found is not None and found.notes == ("A state after 3 steps of random actions.",)
    assert labels(found)


def test_thin_walls_of_a_map_are_drawn_as_walls() -> None:
    """Taxi's map has walls and openings between its cells."""
    task = registry.load("toy_text/Taxi-v0")
    found = scene(task)
    assert found is not None
    assert len(boxes(found, fill="muted", line=None)) == "".join(task.spec.constants["map"]["grid"]).count("|")
    assert not {":", "|"} & set(words(found))
