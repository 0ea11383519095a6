"""Figures of every task at small, usual and large parameters, measured with the letters of a real font, and the sheet of them."""

import re
from collections.abc import Callable
from functools import cache
from itertools import combinations
from pathlib import Path

import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from docs.tools import contact
from taskspec.base.diagnostics import SpecError
from taskspec.exact import extract
from taskspec.language import registry
from taskspec.language.task.task import Task
from taskspec.show.figures import overlay, scene, undrawn
from taskspec.show.figures.raster import FONTS, mathtext
from taskspec.show.figures.shapes import Box, Circle, Item, Label, Line, Scene
from taskspec.show.printers.text import plain
from tests.shared.sparse import sparse

FONT = FontProperties(family=FONTS)
Frame = tuple[float, float, float, float]


@cache
def letters(label: Label) -> Frame:
    """Left, top, right, bottom of the ink of a label, in centimetres."""
    (x, y) = label.at
    path = TextPath((0, 0), mathtext(label.text), size=label.size, prop=FONT).get_extents()
    left = {"start": x, "middle": x - path.width / 2, "end": x - path.width}[label.anchor]
    base = y + 0.34 * label.size
    return left, base - path.y1, left + path.width, base - path.y0


def extent(item: Item) -> Frame:
    match item:
        case Label():
            return letters(item)
        case Circle(centre=(x, y), radius=r):
            return x - r, y - r, x + r, y + r
        case Box(corner=(x, y), width=w, height=h):
            return x, y, x + w, y + h
        case Line(points=points):
            ends = (points[0], points[-1]) if item.curved else points
            return min(x for x, _ in ends), min(y for _, y in ends), max(x for x, _ in ends), max(y for _, y in ends)


def overlapping(found: Scene) -> list[tuple[str, str]]:
    """Labels whose letters lie over one another."""
    boxes = [(plain(x.text), letters(x)) for x in found.items if isinstance(x, Label)]
    return [
        (a, b) for (a, p), (b, q) in combinations(boxes, 2)
        if p[0] < q[2] and q[0] < p[2] and p[1] < q[3] and q[1] < p[3]
    ]  # fmt: skip


def outside(found: Scene) -> list[Item]:
    frames = [(item, extent(item)) for item in found.items]
    return [item for item, (x0, y0, x1, y1) in frames
            if min(x0, y0) < -1e-6 or x1 > found.width + 1e-6 or y1 > found.height + 1e-6]  # fmt: skip


def words(found: Scene) -> str:
    return " ".join(plain(x.text) for x in found.items if isinstance(x, Label))


@pytest.mark.parametrize("name", sparse([*contact.drawn_names(), *contact.foreign_specs()], 8))
def test_figures_are_drawn_and_can_be_read(name: str) -> None:
    settings = list(contact.shown([name]))
    assert len(settings) >= (3 if len(settings[0][1]) and "Parabola" not in name else 1)
    for task, setting in settings:
        found = scene(task)
        assert found is not None, setting
        assert undrawn(task) == (), setting
        assert overlapping(found) == [], setting
        assert outside(found) == [], setting


def test_overlaps_are_found() -> None:
    """The test above would see labels that lie over one another, or leave the frame."""
    word = scene(registry.load("derail/RiskyPath-v0"))
    assert word is not None
    first = next(x for x in word.items if isinstance(x, Label))
    assert overlapping(Scene(9, 9, (first, first), "")) != []
    assert outside(Scene(0.1, 0.1, (first,), "")) == [first]


def test_a_figure_without_room_says_so() -> None:
    huge = registry.load("derail/Branching-v0", L=1000, B=100)
    found = scene(huge)
    assert found is not None
    assert "100,001 states and 100 actions" in words(found)
    assert "No graph is drawn" in words(found)
    assert overlapping(found) == outside(found) == []
    (warning,) = undrawn(huge)
    assert warning.code == "W523"


def task(name: str, **values: object) -> Task:
    return registry.load(f"{name}-v0", **values)


def drawn(name: str, **values: object) -> Scene:
    found = scene(task(name, **values))
    assert found is not None
    return found


def test_a_cliff_of_a_hundred_cells_keeps_its_ends() -> None:
    found = drawn("seals/CliffWorldLarge")
    (agent,) = (x for x in found.items if isinstance(x, Circle))
    assert agent.centre[0] < 0.5 and found.width > 12
    assert sum(isinstance(x, Box) and x.fill == "good" for x in found.items) == 1 + 1  # in the key


def test_goal_and_agent_are_in_the_picture_at_any_distance() -> None:
    for distance in (1, 10, 100):
        found = drawn("derail/ProcGoal", D=distance)
        assert any(isinstance(x, Box) and x.fill == "good" for x in found.items)
        assert any(isinstance(x, Circle) and x.fill == "ink" for x in found.items)
        assert outside(found) == []


def test_the_expert_sorts_lists_of_every_length() -> None:
    found = drawn("derail/Sort", L=30)
    bars = [x for x in found.items if isinstance(x, Box) and x.fill == "accent"]
    last = [x.height for x in bars[30:]]
    assert [x.height for x in bars[:30]] != last
    assert last == sorted(last)


def test_halves_are_compared() -> None:
    found = drawn("derail/LargestSum", L=3)
    numbers = [float(x) for x in re.findall(r"\d+\.\d+", words(found))]
    sums = sum(numbers[:3]), sum(numbers[3:6])
    assert numbers[6:] == pytest.approx(sums, abs=0.03)
    assert (" < " in words(found)) == (sums[0] < sums[1])


def test_both_starts_are_on_one_tree() -> None:
    for name in ("InitShiftExpert", "InitShiftLearner", "InitShiftLearnerSeals"):
        told = words(drawn(f"derail/{name}"))
        assert "expert starts" in told
        assert "learner starts" in told
        assert {"0", "1", "2", "3", "4", "5", "6"} <= set(told.split())


def test_what_is_seen_through_noise_is_drawn() -> None:
    for length in (1, 20, 60):
        found = drawn("derail/NoisyObs", L=length)
        assert sum(isinstance(x, Box) and x.fill == "second" for x in found.items) == length
    assert {"x", "y", "z"} <= set(words(found).split())


def test_tables_of_transitions_show_each_transition() -> None:
    one = task("seals/RandomTransition", S=12, A=2)
    model = extract(one)
    found = scene(one)
    assert found is not None
    cells = {(round(x.corner[1] / 0.55, 3), round(x.corner[0] / 0.55, 3)): x.shade
             for x in found.items if isinstance(x, Box) and x.fill == "ink"}  # fmt: skip
    step = model.step(0).P.toarray().reshape(2, len(model.codes), len(model.codes)).mean(0)
    assert len(cells) == (step > 0).sum()
    assert max(cells.values()) == pytest.approx(0.12 + 0.88 * step.max())


STROKES = {"good": 1, "bad": 2, "end": 1}


@pytest.mark.parametrize(
    ("found", "roles"),
    [
        (lambda: drawn("seals/CliffWorld"), "good bad"),
        (lambda: drawn("derail/RiskyPath"), "good bad"), (lambda: drawn("derail/EarlyTermPos"), "end"),
        (lambda: drawn("derail/ProcGoal"), "good"), (lambda: laid(task("derail/RiskyPath"), "values"), "good bad"),
        (lambda: laid(task("seals/CliffWorld"), "values"), "good bad"),
    ],
)  # fmt: skip
def test_states_are_told_apart_without_colours(found: Callable[[], Scene], roles: str) -> None:
    """A sign in each of them, of another form for each role, and a key that names all that are there."""
    items = found().items
    strokes = [(extent(x), len(x.points)) for x in items if isinstance(x, Line) and x.color == "ink" and not x.arrow]
    forms: dict[str, set[tuple[int, ...]]] = {}
    for item in items:
        if isinstance(item, Box | Circle) and item.fill in STROKES:
            x0, y0, x1, y1 = extent(item)
            inside = [n for (a, b, c, d), n in strokes if x0 <= a and y0 <= b and c <= x1 and d <= y1]
            forms.setdefault(item.fill, set()).add(tuple(inside))
    assert set(forms) == set(roles.split())
    assert all(len(form) == 1 and len(min(form)) == STROKES[role] for role, form in forms.items())
    assert len(set(map(min, forms.values()))) == len(forms)
    assert set(roles.split()) <= {plain(x.text) for x in items if isinstance(x, Label)}


def laid(one: Task, *names: str) -> Scene:
    found = scene(one, overlay(one, names))
    assert found is not None
    assert overlapping(found) == outside(found) == []
    return found


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("seals/CliffWorldLarge", {}, "not drawn: best return"),
        ("seals/CliffWorld", {}, "numbers: best return"),
        ("seals/RandomTransition", {"S": 60, "A": 4}, "not drawn: best return"),
        ("derail/Branching", {"L": 20, "B": 6}, "not drawn: best return"),
        ("derail/LargestSum", {}, "E712"),
    ],
)  # fmt: skip
def test_values_are_drawn_or_the_figure_says_that_they_are_not(name: str, values: dict[str, int], told: str) -> None:
    one = task(name, **values)
    if told == "E712":
        with pytest.raises(SpecError, match=told):
            overlay(one, ["values"])
        return
    assert told in words(laid(one, "values"))


def test_visits_are_seen_where_a_state_is_good_or_bad() -> None:
    found = laid(task("derail/RiskyPath"), "occupancy")
    assert sum(isinstance(x, Circle) and x.fill == "accent" for x in found.items) == 4
    assert {"good", "bad"} <= set(words(found).split())


def test_a_figure_without_roles_has_no_key() -> None:
    assert {"good", "bad", "end"}.isdisjoint(words(drawn("seals/RandomTransition")).split())


def test_the_sheet_shows_every_setting_three_times() -> None:
    text = contact.sheet(["derail/RiskyPath-v0", "derail/Sort-v0"])
    assert text.count("<svg xmlns") == 3 * (1 + 4)
    assert text.count('<td class="deuteranopic">') == 5
    assert re.search(r"\.dark \{[^}]*--good: #2f6b3c", text)


def test_the_sheets_of_pages_show_each_in_every_look(tmp_path: Path) -> None:
    text = contact.page_sheet(["derail/RiskyPath-v0"], tmp_path / "pages")
    shown = re.findall(r'<iframe class="(\w+)" src="([^"]+)"', text)
    assert [look for look, _ in shown] == ["light", "dark", "deuteranopic", "whole"]
    assert all((tmp_path / address).is_file() for _, address in shown)
    assert "prefers-color-scheme: dark" not in (tmp_path / dict(shown)["dark"]).read_text(encoding="utf-8")
