"""Figures of every task at small, usual and large parameters, measured with the letters of a real font, and the sheet of them."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from docs.tools import contact
from taskspec.base.diagnostics import SpecError
from taskspec.exact import extract
from taskspec.language import registry
from taskspec.language.task.task import Task
from taskspec.show.figures import overlay, scene, undrawn
from taskspec.show.figures.shapes import Scene
from tests.shared.scenes import (
    boxes,
    circles,
    extent,
    labels,
    legible,
    lines,
    outside,
    overlapping,
    places,
    told,
    words,
)
from tests.shared.sparse import sparse


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
    first = labels(word)[0]
    assert overlapping(Scene(9, 9, (first, first), "")) != []
    assert outside(Scene(0.1, 0.1, (first,), "")) == [first]


def test_a_figure_without_room_says_so() -> None:
    huge = registry.load("derail/Branching-v0", L=1000, B=100)
    found = legible(scene(huge))
    assert "100,001 states and 100 actions" in told(found)
    assert "No graph is drawn" in told(found)
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
    (agent,) = circles(found)
    assert agent.centre[0] < 0.5 and found.width > 12
    assert len(boxes(found, fill="good")) == 1 + 1  # in the key


def test_goal_and_agent_are_in_the_picture_at_any_distance() -> None:
    for distance in (1, 10, 100):
        found = drawn("derail/ProcGoal", D=distance)
        assert boxes(found, fill="good") and circles(found, fill="ink")
        assert outside(found) == []


def test_the_expert_sorts_lists_of_every_length() -> None:
    found = drawn("derail/Sort", L=30)
    heights = [bar.height for bar in boxes(found, fill="accent")]
    last = heights[30:]
    assert heights[:30] != last
    assert last == sorted(last)


def test_halves_are_compared() -> None:
    found = drawn("derail/LargestSum", L=3)
    numbers = np.array(re.findall(r"\d+\.\d+", told(found)), float)
    sums = numbers[:6].reshape(2, 3).sum(axis=1)
    assert numbers[6:] == pytest.approx(sums, abs=0.03)
    assert ("<" in words(found)) == (sums[0] < sums[1])


def test_both_starts_are_on_one_tree() -> None:
    for name in ("InitShiftExpert", "InitShiftLearner", "InitShiftLearnerSeals"):
        found = drawn(f"derail/{name}")
        assert "expert starts" in told(found)
        assert "learner starts" in told(found)
        assert {"0", "1", "2", "3", "4", "5", "6"} <= set(words(found))


def test_what_is_seen_through_noise_is_drawn() -> None:
    for length in (1, 20, 60):
        found = drawn("derail/NoisyObs", L=length)
        assert len(boxes(found, fill="second")) == length
    assert {"x", "y", "z"} <= set(told(found).split())


def test_tables_of_transitions_show_each_transition() -> None:
    one = task("seals/RandomTransition", S=12, A=2)
    model = extract(one)
    found = scene(one)
    assert found is not None
    cells = boxes(found, fill="ink")
    step = model.step(0).P.toarray().reshape(2, len(model.codes), len(model.codes)).mean(0)
    assert len(np.unique(places(cells).round(3), axis=0)) == len(cells) == (step > 0).sum()
    assert max(cell.shade for cell in cells) == pytest.approx(0.12 + 0.88 * step.max())


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
    drawing = found()
    forms: dict[str, set[tuple[int, ...]]] = {}
    for shape in [*boxes(drawing), *circles(drawing)]:
        if shape.fill in STROKES:
            x0, y0, x1, y1 = extent(shape)
            inside = []
            for stroke in lines(drawing, color="ink", arrow=False):
                left, top, right, bottom = extent(stroke)
                if x0 <= left and y0 <= top and right <= x1 and bottom <= y1:
                    inside.append(len(stroke.points))
            forms.setdefault(shape.fill, set()).add(tuple(inside))
    assert set(forms) == set(roles.split())
    for role, (form, *others) in forms.items():
        assert not others and len(form) == STROKES[role]
    assert len(set(map(min, forms.values()))) == len(forms)
    assert set(roles.split()) <= set(words(drawing))


def laid(one: Task, *names: str) -> Scene:
    return legible(scene(one, overlay(one, names)))


@pytest.mark.parametrize(
    ("name", "values", "description"),
    [
        ("seals/CliffWorldLarge", {}, "not drawn: best return"),
        ("seals/CliffWorld", {}, "numbers: best return"),
        ("seals/RandomTransition", {"S": 60, "A": 4}, "not drawn: best return"),
        ("derail/Branching", {"L": 20, "B": 6}, "not drawn: best return"),
        ("derail/LargestSum", {}, "E712"),
    ],
)  # fmt: skip
def test_values_are_drawn_or_the_figure_says_that_they_are_not(
    name: str, values: dict[str, int], description: str
) -> None:
    one = task(name, **values)
    if description == "E712":
        with pytest.raises(SpecError, match=description):
            overlay(one, ["values"])
        return
    assert description in told(laid(one, "values"))


def test_visits_are_seen_where_a_state_is_good_or_bad() -> None:
    found = laid(task("derail/RiskyPath"), "occupancy")
    assert len(circles(found, fill="accent")) == 4
    assert {"good", "bad"} <= set(words(found))


def test_a_figure_without_roles_has_no_key() -> None:
    assert {"good", "bad", "end"}.isdisjoint(words(drawn("seals/RandomTransition")))


def test_the_sheet_shows_every_setting_three_times() -> None:
    text = contact.sheet(["derail/RiskyPath-v0", "derail/Sort-v0"])
    assert text.count("<svg xmlns") == 3 * (1 + 4)
    assert text.count('<td class="deuteranopic">') == 5
    assert re.search(r"\.dark \{[^}]*--good: #2f6b3c", text)


def test_the_sheets_of_pages_show_each_in_every_look(tmp_path: Path) -> None:
    text = contact.page_sheet(["derail/RiskyPath-v0"], tmp_path / "pages")
    shown = re.findall(r'<iframe class="(\w+)" src="([^"]+)"', text)
    pages = {look: (tmp_path / address).read_text(encoding="utf-8") for look, address in shown}
    assert list(pages) == ["light", "dark", "deuteranopic", "whole"]
    assert "prefers-color-scheme: dark" not in pages["dark"]
