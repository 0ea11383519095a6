"""Bars, tables of transitions and plots: colours, numbers and names are those of the spec."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import taskspec
from taskspec.language import registry
from taskspec.show.figures import Overlay, scene
from taskspec.show.figures.plane import HEIGHT, WIDTH
from taskspec.show.figures.shapes import Box, Label, Line, Scene, text_width
from taskspec.show.printers.text import plain

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


def labels(found: Scene) -> list[str]:
    return [plain(item.text).strip() for item in found.items if isinstance(item, Label)]


def colored(found: Scene, role: str) -> list[tuple[int, int]]:
    """Row and column of the cells of a vector that have a colour."""
    corners = [x.corner for x in found.items if isinstance(x, Box) and x.fill == role and x.line == "paper"]
    left, top = (min(x.corner[i] for x in found.items if isinstance(x, Box) and x.line == "paper") for i in (0, 1))
    return sorted((round((y - top) / 1.5), round(x - left)) for x, y in corners)


@pytest.mark.parametrize(
    ("part", "cells"),
    [
        ("x != target", [0, 2]),
        ("x == 5", []),
        ("x[0] == 0", [0, 1, 2, 3]),
        ("x[3] == 0", []),
        ("x[2:]", [2, 3]),
        ("[0, 3]", [0, 3]),
    ],
)
def test_highlighted_elements_are_those_of_which_it_holds(part: str, cells: list[int], tmp_path: Path) -> None:
    found = drawn(tmp_path, f'{BITS}figure: {{kind: bars, values: x, highlight: {{bad: "{part}"}}}}\n')
    assert [cell for cell in colored(found, "bad") if cell[0] == 0] == [(0, i) for i in cells]


def test_each_row_is_coloured_by_its_own_state(tmp_path: Path) -> None:
    expert = 'expert: {i: "argmax([x[j] != target[j] for j in range(4)])"}\n'
    found = drawn(tmp_path, f'{BITS}{expert}figure: {{kind: bars, values: x, highlight: {{bad: "x != target"}}}}\n')
    assert colored(found, "bad") == [(0, 0), (0, 2), (1, 2)]
    assert all(0 <= x.shade <= 1 for x in found.items if isinstance(x, Box))


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
    numbers = [x for x in labels(drawn(tmp_path, text)) if x.isdigit()]
    assert numbers == ["0", "1", "2"] * 2


def test_columns_of_a_table_are_told_apart(tmp_path: Path) -> None:
    """Names such as "0, 0" need more than a space between them."""
    for last in (3, 6):
        found = drawn(tmp_path, COUNTERS.replace("LAST", str(last)))
        top = min(x.at[1] for x in found.items if isinstance(x, Label) and x.color == "muted")
        row = sorted((x for x in found.items if isinstance(x, Label) and x.at[1] == top), key=lambda x: x.at[0])
        ends = [(x.at[0] - text_width(x.text, x.size) / 2, x.at[0] + text_width(x.text, x.size) / 2) for x in row]
        least = 0.2 if "," in plain(row[0].text) else 0.05
        assert all(b[0] - a[1] >= least for a, b in pairwise(ends))


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


def steps(found: Scene, color: str) -> list[float]:
    """How far right or left the points that are joined lie from each other, in centimetres."""
    lines = [
        x.points for x in found.items if isinstance(x, Line) and x.color == color and not x.arrow and len(x.points) > 2
    ]
    return [abs(b[0] - a[0]) for line in lines for a, b in pairwise(line)]


def test_series_name_what_is_written_for_them(tmp_path: Path) -> None:
    written = '["theta", "omega * theta", "cos(theta)"]'
    found = drawn(tmp_path, TURNS + f"{{kind: series, values: {written}}}\n")
    assert [x.replace(" ", "") for x in labels(found) if x not in "t" and not x[-1].isdigit()] == ["θ", "ωθ", "cos(θ)"]
    vector = drawn(tmp_path, TURNS + '{kind: series, values: "[theta + i for i in range(2)]"}\n')
    assert not {"v₀", "v₁"} & set(labels(vector))


@pytest.mark.parametrize(
    ("figure", "color"),
    [
        ("{kind: portrait, at: [theta, omega]}", "accent"),
        ("{kind: curve, at: [theta, omega], curve: sin(theta)}", "second"),
    ],
)
def test_an_angle_that_wraps_is_not_joined(figure: str, color: str, tmp_path: Path) -> None:
    found = steps(drawn(tmp_path, TURNS + figure + "\n"), color)
    assert found
    assert max(found) < 1.0


def test_series_are_joined_but_for_angles_that_wrap(tmp_path: Path) -> None:
    """The speed jumps by its whole range, and stays one line."""
    found = drawn(tmp_path, TURNS + "{kind: series, values: [theta, omega]}\n")
    lines = [x for x in found.items if isinstance(x, Line) and x.color == "accent"]
    assert len(lines) > 2
    assert max(len(x.points) for x in lines) == 41


def test_a_portrait_shades_where_a_highlight_holds(tmp_path: Path) -> None:
    found = drawn(tmp_path, TURNS + '{kind: portrait, at: [theta, omega], highlight: {bad: "omega > 4"}}\n')
    strips = [x for x in found.items if isinstance(x, Box) and x.fill == "bad" and x.line is None]
    assert {round(x.width, 6) for x in strips} == {WIDTH}
    tops = [x.corner[1] for x in strips]
    assert max(tops) - min(tops) + strips[0].height == pytest.approx(HEIGHT / 4, abs=0.1)
    assert "bad" in labels(found)


def test_a_matrix_is_a_board() -> None:
    """Lights Out: a cell for each light, filled where it is on in the first state."""
    task = registry.load("planning/LightsOut-v0")
    found = scene(task)
    assert found is not None and "as a board of 3 rows and 3 columns" in found.alt
    lit = [x for x in found.items if isinstance(x, Box) and x.fill == "accent"]
    first, _ = taskspec.make("planning/LightsOut-v0").reset(seed=0)
    assert len(lit) == int(np.sum(first))
    assert not any(isinstance(x, Label) for x in found.items)


def test_an_empty_board_shows_a_few_steps() -> None:
    found = scene(registry.load("planning/TicTacToe-v0"))
    assert found is not None and found.notes == ("A state after 3 steps of random actions.",)
    assert any(isinstance(x, Label) for x in found.items)


def test_thin_walls_of_a_map_are_drawn_as_walls() -> None:
    """Taxi's map has walls and openings between its cells."""
    task = registry.load("toy_text/Taxi-v0")
    found = scene(task)
    assert found is not None
    walls = [x for x in found.items if isinstance(x, Box) and x.fill == "muted" and x.line is None]
    assert len(walls) == sum(row.count("|") for row in task.spec.constants["map"]["grid"])
    assert not {":", "|"} & {plain(x.text) for x in found.items if isinstance(x, Label)}
