"""Bars, tables of transitions and plots: colours, numbers and names are those of the spec."""

from __future__ import annotations

from pathlib import Path

import pytest

from taskspec import registry
from taskspec.figures import Overlay, scene
from taskspec.figures.scene import Box, Label, Scene
from taskspec.printers.plain import plain

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
    assert colored(found, "bad") == [(0, i) for i in cells]


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
