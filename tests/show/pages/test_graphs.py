"""Transition graphs of random machines: what is drawn can be read, is the same every time, and takes few steps."""

import math
import random
from itertools import combinations, pairwise, product

import numpy as np
import pytest

from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures import Overlay, raster, scene
from taskspec.show.figures.graph import MOST_CROSSINGS, _planned, graph
from taskspec.show.figures.layout import drawings, ordered
from taskspec.show.figures.machine import explore
from taskspec.show.figures.shapes import Box, Circle, Label, Line, Point, Scene, text_width
from taskspec.show.figures.vector_formats import svg, tikz
from taskspec.show.printers.text import plain
from tests.shared.for_each import for_each
from tests.shared.scenes import Array, boxes, circles, labels, lines
from tests.shared.work import calls

CASES = list(product((2, 3, 4), (1, 2, 3), (1, 2), (False, True), (1, 2), (0,)))


def machine(n: int, n_actions: int, k: int, long: bool, starts: int, seed: int) -> Task:
    """A random MDP whose actions have up to `k` outcomes; names of states may be long."""
    rng = random.Random(f"{n} {n_actions} {k} {long} {starts} {seed}")
    stem = "waiting" if long else "q"
    states = [f"{stem}{i}" for i in range(n)]
    actions = [f"a{i}" for i in range(n_actions)]
    rows = ""
    for s in states:
        rows += f"      {s}:\n"
        for a in actions:
            first, *others = rng.sample(states, k if rng.random() < 0.6 else 1)
            p = rng.choice((0.1, 0.25, 0.5))
            leads = first
            for other in others:
                leads = f"{{{first}: {p}, {other}: {1 - p}}}"
            rows += f'        {a}: "{leads}"\n'
    rewards = ""
    for s in states:
        rewards += f"    {s}: {rng.choice((0, 0, 1, -2.5))}\n"
    first = f"Uniform({{{', '.join(states[:starts])}}})" if starts > 1 else states[0]
    return build(
        read_text(f"""\
taskspec: 1
name: R
state: {{s: {{type: choice, values: [{", ".join(states)}]}}}}
action: {{a: {{type: choice, values: [{", ".join(actions)}]}}}}
horizon: 20
initial: {{s: "{first}"}}
dynamics:
  s':
    by: [s, a]
    rows:
{rows}reward:
  by: s
  rows:
{rewards}""")
    )


def box(label: Label) -> tuple[float, float, float, float]:
    (x, y) = label.at
    w = text_width(label.text, label.size)
    h = label.size
    left = x - w * {"start": 0.0, "middle": 0.5, "end": 1.0}[label.anchor]
    return left, y - h / 2, left + w, y + h / 2


def outside(shape: Circle | Box, p: Point) -> float:
    """How far a point is from the outline of a shape, negative inside."""
    match shape:
        case Circle(centre=(x, y), radius=r):
            return math.hypot(p[0] - x, p[1] - y) - r
        case Box(corner=(x, y), width=w, height=h, round=r):
            dx = abs(p[0] - x - w / 2) - w / 2 + r
            dy = abs(p[1] - y - h / 2) - h / 2 + r
            return math.hypot(max(dx, 0), max(dy, 0)) + min(max(dx, dy), 0) - r


def pieces(line: Line) -> Array:
    """(piece, end, 2): straight pieces of a line, 16 of a curve."""
    if line.curved:
        t = np.linspace(0, 1, 17)
        weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
        points = weights @ np.array(line.points)
    else:
        points = np.array(line.points)
    return np.stack([points[:-1], points[1:]], axis=1)


def crosses(a: Line, b: Line) -> int:
    """How often two lines cross."""

    def left(p: Array, q: Array, r: Array) -> Array:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    p, q = np.moveaxis(pieces(a)[:, None], 2, 0)
    r, s = np.moveaxis(pieces(b)[None], 2, 0)
    parted = left(p, q, r) * left(p, q, s) < -1e-12
    return int(np.sum(parted & (left(r, s, p) * left(r, s, q) < -1e-12)))


def outlined(found: Scene) -> list[Circle | Box]:
    return [*circles(found), *boxes(found)]


def drawn(task: Task) -> Scene | None:
    _planned.cache_clear()
    return graph(task, Overlay())


@for_each("case", CASES[::4])
def test_what_is_drawn_can_be_read(case: tuple[int, int, int, bool, int, int]) -> None:
    task = machine(*case)
    found = drawn(task)
    assert drawn(task) == found
    if found is None:
        return
    shapes = outlined(found)
    for one, other in combinations(labels(found), 2):
        a = box(one)
        b = box(other)
        is_apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        assert is_apart, (plain(one.text), plain(other.text))
    for label in labels(found):
        left, top, right, bottom = box(label)
        corners = [(left, top), (right, top), (left, bottom), (right, bottom), ((left + right) / 2, (top + bottom) / 2)]
        if min(outside(shape, label.at) for shape in shapes) >= -0.1:
            for shape, corner in product(shapes, corners):
                assert outside(shape, corner) > 0, plain(label.text)
    for line in lines(found):
        ends = [line.points[-1]]
        if line.color == "ink":  # the arrow to a start comes from nowhere
            ends.append(line.points[0])
        for end in ends:
            assert min(abs(outside(shape, end)) for shape in shapes) < 0.05, end
    crossings = sum(crosses(a, b) for a, b in combinations(lines(found), 2))
    assert crossings <= MOST_CROSSINGS + 1  # finer pieces may cross once more


def test_most_small_machines_are_drawn() -> None:
    are_drawn = []
    for case in product((3, 4), (1, 2), (1, 2), (False, True), (1, 2), (0,)):
        are_drawn.append(graph(machine(*case), Overlay()) is not None)
    assert np.mean(are_drawn) > 0.6


@pytest.mark.parametrize("n", [8, 20, 60])
def test_large_machines_take_no_longer(n: int) -> None:
    task = machine(n, 4, 2, True, 2, 0)
    assert calls(lambda: drawn(task)) < 100_000


@pytest.mark.parametrize("n", [4, 8, 10, 14])
@pytest.mark.parametrize("starts", [1, 2])
def test_drawings_are_graphs(n: int, starts: int) -> None:
    """Vertices differ, arrows join vertices, and what leads on in the task leads on in the drawing."""
    for n_actions, k, seed in product((1, 2, 4), (1, 2), range(4)):
        found = explore(machine(n, n_actions, k, False, starts, seed))
        assert found is not None
        leading = {t.source for t in found.transitions if t.source != t.target}
        for drawing in drawings(found):
            vertices = set(drawing.vertices)
            sources = {arc.source for arc in drawing.arcs}
            targets = {arc.target for arc in drawing.arcs}
            assert len(vertices) == len(drawing.vertices)
            assert sources | targets <= vertices
            assert leading & vertices <= sources
            assert sorted(map(str, ordered(drawing).vertices)) == sorted(map(str, vertices))


@pytest.mark.parametrize("seed", range(3))
def test_every_format_shows_the_same(seed: int) -> None:
    found = graph(machine(3, 2, 1, True, 2, seed), Overlay())
    assert found is not None
    n_labels = len(labels(found))
    n_shapes = len(outlined(found))
    n_lines = len(lines(found))
    n_arrows = len(lines(found, arrow=True))
    paper = 1
    picture = svg(found)
    assert picture.count("<text ") == n_labels
    assert picture.count("<circle ") + picture.count("<rect ") == n_shapes + paper
    assert (picture.count("<path "), picture.count("<polygon ")) == (n_lines, n_arrows)
    text = tikz(found)
    assert (text.count(r"\node["), text.count(r"\path[")) == (n_labels, n_shapes)
    assert (text.count(r"\draw["), text.count("-- cycle")) == (n_lines, n_arrows)
    _, axes = raster._canvas(found.width, found.height)
    raster._draw(axes, found, 1.0)
    assert (len(axes.texts), len(axes.patches)) == (n_labels, n_shapes + n_lines + n_arrows)


@pytest.mark.parametrize(("letters", "kind"), [(4, "Transition graph"), (40, "Transitions of Chain as a table")])
def test_a_graph_that_no_page_has_room_for_is_drawn_as_a_table(letters: int, kind: str) -> None:
    names = [f"{'s' * letters}{i}" for i in range(6)]
    rows = ""
    for name, after in pairwise([*names, names[-1]]):
        rows += f"      {name}: {{go: {after}, stop: {name}}}\n"
    one = build(
        read_text(
            f"taskspec: 1\nname: Chain\nstate:\n  s: {{type: choice, values: [{', '.join(names)}]}}\n"
            f"action:\n  a: {{type: choice, values: [go, stop]}}\nhorizon: 9\ninitial: {{s: {names[0]}}}\n"
            f"dynamics:\n  s':\n    by: [s, a]\n    rows:\n{rows}reward: 1\nfigure: {{kind: graph}}\n"
        )
    )
    found = scene(one)
    assert found is not None and found.alt.startswith(kind)
    assert found.width < 25


def ring(n: int, highlight: str, step: str = "s + (1 if a == 1 else n - 1)", horizon: int = 50) -> Scene:
    """The figure of a ring, which its horizon cuts open where it is larger."""
    text = f"""\
taskspec: 1
name: Ring
parameters: {{n: {{type: int, default: {n}, low: 2, high: 90}}}}
state: {{s: {{type: int, low: 0, high: n - 1}}}}
action: {{a: {{type: int, low: 0, high: 1}}}}
horizon: {horizon}
initial: {{s: 0}}
dynamics:
  s': ({step}) % n
reward: s' == n - 1
terminal: s' == n - 1
figure: {{kind: graph, highlight: {highlight}}}
"""
    found = scene(build(read_text(text)))
    assert found is not None
    return found


def fills(found: Scene) -> list[str]:
    """The roles of states, without the key below."""
    roles = []
    for shape in outlined(found):
        is_state = isinstance(shape, Circle) or shape.round
        if is_state and shape.fill in ("good", "bad", "end"):
            roles.append(shape.fill)
    return sorted(roles)


def test_a_highlight_that_no_state_has_is_told() -> None:
    found = ring(9, "{good: s == n - 1, bad: s == n // 2}", "s * 5 + 3 * a + 1")
    assert "Not shown: good, which holds in no state that episodes reach." in found.notes
    assert fills(found) == ["bad"]
