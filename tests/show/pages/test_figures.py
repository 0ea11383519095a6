"""Figures drawn from tasks: what they show, in every format, and a frame for every state of every task."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.language import registry
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures import Overlay, figure, overlay, render_frame, scene
from taskspec.show.figures.layout import drawings
from taskspec.show.figures.machine import explore
from taskspec.show.figures.shapes import Scene
from taskspec.show.figures.states import first_state
from taskspec.show.figures.vector_formats import svg
from taskspec.show.pages import gather, write
from taskspec.show.pages.page import anchor
from tests.shared.for_each import for_each
from tests.shared.paper import TEX, compiled
from tests.shared.scenes import boxes, circles, lines, outside, places, words
from tests.shared.specs import spec_file, suite_ids, varied_files, without_figure

IDS = suite_ids("derail")
SPECS = varied_files()


def task(name: str, **parameters: object) -> Task:
    return registry.load(f"derail/{name}-v0", **parameters)


def drawn(name: str, overlay: Overlay | None = None, **parameters: object) -> Scene:
    found = scene(task(name, **parameters), overlay)
    assert found is not None
    return found


def test_risky_path_shows_chances_rewards_and_colours() -> None:
    found = drawn("RiskyPath")
    assert words(found).count("50%") == 2
    assert {"s₀", "s₁", "s₂", "s₃", "safe", "risky", "r = 1", "r = −100"} <= set(words(found))
    assert circles(found, fill="good") and circles(found, fill="bad")


def test_what_an_action_pays_stands_beside_it_and_not_at_its_outcomes() -> None:
    found = scene(registry.load("probes/Echo-v0"))
    assert found is not None
    assert words(found).count("50%") == 4
    assert {"left, r = 1; right, r = 0", "left, r = 0; right, r = 1"} <= set(words(found))


def test_terminal_states_have_two_rims() -> None:
    found = drawn("EarlyTermPos")
    assert len(circles(found)) == 4
    assert found.notes == ("Every step pays 1.",)


def test_branching_with_ten_choices_has_all_its_states() -> None:
    found = drawn("Branching", L=10)
    assert set(map(str, range(21))) <= set(words(found))
    assert len(circles(found, fill="good")) == 1


def test_wide_families_are_tables() -> None:
    assert {"from", "to"} <= set(words(drawn("Branching", L=10, B=12)))


def test_numbers_of_a_knot_are_drawn_over_time() -> None:
    found = scene(build(read_text(without_figure("queue"))))
    assert found is not None and found.alt == "An episode of random actions in Queue over time, 50 steps"


def test_what_else_could_be_drawn_is_said(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="cross") as caught:
        figure(build(read_text(without_figure("tiger"))), tmp_path / "tiger.svg")
    assert "bars" in str(caught.value)


def test_small_branching_is_drawn_whole() -> None:
    assert "…" not in words(drawn("Branching", L=2))


def test_every_arrow_of_a_drawing_joins_vertices_of_it() -> None:
    for parameters in ({"L": 1}, {"L": 3, "B": 4}, {"L": 7, "B": 9}, {"L": 100}):
        machine = explore(task("Branching", **parameters))
        if machine is None:
            continue
        for found in drawings(machine):
            for arc in found.arcs:
                assert {arc.source, arc.target} <= set(found.vertices)


def test_probabilities_leaving_a_state_sum_to_one() -> None:
    machine = explore(task("RiskyPath"))
    assert machine is not None
    total: dict[tuple[int, int], float] = {}
    for t in machine.transitions:
        total[t.source, t.action] = total.get((t.source, t.action), 0.0) + t.probability
    assert set(total.values()) == {1.0}


def test_grid_marks_the_goal_and_the_starts() -> None:
    found = drawn("NoisyObs")
    assert len(boxes(found, fill="good")) == 1 + 1  # in the key
    faint = circles(found, fill="ink")
    assert len(faint) == 4
    for circle in faint:
        assert circle.shade < 1


def test_sorting_ends_sorted() -> None:
    found = drawn("Sort")
    last = np.array(words(found)[-4:], float)
    assert (np.diff(last) >= 0).all()
    assert lines(found, arrow=True)


def test_halves_have_two_colours() -> None:
    colors = [box.fill for box in boxes(drawn("LargestSum", L=10)) if box.fill]
    assert colors == ["accent"] * 10 + ["second"] * 10


def test_overlays() -> None:
    found = drawn("RiskyPath", Overlay(values={0: 4.0}, policy={0: (0,)}, occupancy={1: 0.5}))
    assert "V = 4" in words(found)
    assert max(line.width for line in lines(found)) > 0.05
    assert circles(found, shade=0.5)


def test_overlays_from_the_exact_model() -> None:
    found = overlay(task("RiskyPath"), ["values", "expert", "occupancy"])
    assert found.values[0] == 4
    assert found.policy[0] == (0,)
    assert found.occupancy[2] == 1
    assert found.occupancy[3] == 0


def test_overlays_on_a_grid() -> None:
    one = task("NoisyObs")
    found = scene(one, overlay(one, ["values", "policy"]))
    assert found is not None
    assert "12" in words(found)
    assert len(lines(found, arrow=True)) > 20


def arrows(found: Scene) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """The ways of the arrows in each cell of a grid."""
    ends = places(lines(found, arrow=True))
    cells = ((ends[:, 0] - places(boxes(found)).min(axis=0)) / 0.8).astype(int)
    turned = (3 * (ends[:, 1] - ends[:, 0])).round().astype(int)
    ways: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for (x, y), (dx, dy) in zip(cells.tolist(), turned.tolist(), strict=True):
        ways.setdefault((x, y), []).append((dx, dy))
    return ways


def test_arrows_on_a_grid_show_what_is_chosen_and_not_what_chance_makes_of_it() -> None:
    """The optimal policy of FrozenLake as Gymnasium's own tutorial has it, for as long a horizon."""
    lake = registry.load(spec_file("frozen_lake"))
    found = scene(lake, overlay(lake, ["policy"]))
    assert found is not None
    wanted = {(0, 0): (-1, 0), (1, 0): (0, -1), (0, 1): (-1, 0), (1, 2): (0, 1), (1, 3): (1, 0), (2, 3): (0, 1)}
    for cell, way in wanted.items():
        assert way in arrows(found)[cell]
    ends = {(1, 1), (3, 1), (3, 2), (0, 3), (3, 3)}  # nobody acts in holes and in the goal
    assert not ends & arrows(found).keys()
    assert "arrows: best actions with all 100 steps to go" in words(found)


def test_a_terminal_state_has_no_value() -> None:
    one = task("EarlyTermPos")
    over = overlay(one, ["values", "policy"])
    assert over.values == {0: 10, 1: 10}
    assert set(over.policy) == {0, 1}
    found = scene(one, over)
    assert found is not None
    assert "V: best return with all 10 steps to go" in words(found)


def test_unknown_overlay() -> None:
    with pytest.raises(SpecError, match="E713"):
        overlay(task("RiskyPath"), ["colour"])


@for_each("name", IDS)
def test_every_shipped_task_has_a_figure(name: str) -> None:
    found = scene(registry.load(name))
    assert found is not None
    assert found.alt
    ElementTree.fromstring(svg(found))
    assert outside(found) == []


@pytest.mark.parametrize("ending", ["svg", "tex", "png", "pdf"])
def test_files(ending: str, tmp_path: Path) -> None:
    path = figure(task("RiskyPath"), tmp_path / f"risky.{ending}")
    head = path.read_bytes()[:5]
    assert head.startswith({"svg": b"<svg", "tex": b"\\def", "png": b"\x89PNG", "pdf": b"%PDF"}[ending])
    again = figure(task("RiskyPath"), tmp_path / f"again.{ending}")
    assert again.read_bytes() == path.read_bytes()


def test_unknown_ending(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="E726"):
        figure(task("RiskyPath"), tmp_path / "risky.docx")


@for_each("name", [*IDS, *map(str, SPECS)][::4])
def test_tasks_have_frames(name: str) -> None:
    one = registry.load(name)
    frame = render_frame(one, first_state(one), size=(160, 120))
    assert frame.dtype == np.uint8
    assert frame.shape == (120, 160, 3)
    assert frame.std() > 0


@pytest.mark.parametrize("state", [0, 1, 7, 20])
def test_a_frame_of_a_graph_shows_where_the_agent_is(state: int) -> None:
    one = task("Branching", L=10)
    found = scene(one, Overlay(here={"s": state}))
    assert found is not None
    assert len(circles(found, fill="accent")) == 1


def test_frames_of_an_episode_have_one_size_and_follow_the_state() -> None:
    one = task("NoisyObs")
    a = render_frame(one, {"x": 0, "y": 1}, size=(160, 120))
    b = render_frame(one, {"x": 3, "y": 1}, size=(160, 120))
    assert a.shape == b.shape
    assert not np.array_equal(a, b)


@TEX
def test_tikz_stands_alone(tmp_path: Path) -> None:
    """A figure's file needs tikz, amsmath and xcolor, nothing else of ours."""
    inputs = ""
    for name in ("RiskyPath", "Branching", "NoisyObs", "Parabola", "Sort"):
        figure(task(name), tmp_path / f"{name}.tex")
        inputs += rf"\input{{{name}}}\par"
    packages = r"\usepackage{amsmath,amssymb,xcolor,tikz}"
    compiled(tmp_path, rf"\documentclass{{article}}{packages}\begin{{document}}{inputs}\end{{document}}")


def test_cells_of_ints_show_ints() -> None:
    spec = """\
taskspec: 1
name: X
state: {x: {type: int, shape: [3], low: -9, high: 9}}
action: {a: {type: bool}}
horizon: 3
initial: {x: "(2, 0, -1)"}
dynamics: {x': "reverse(x)"}
reward: x[0]
figure: {kind: bars, values: x}
"""
    found = scene(build(read_text(spec)))
    assert found is not None
    assert words(found)[:3] == ["2", "0", "−1"]


def test_pages_show_exact_results_in_the_figure_without_a_script(tmp_path: Path) -> None:
    views = ["task", "film", "best returns", "best actions", "visits", "expert"]
    for name, layers in (("RiskyPath", views), ("Parabola", ["task", "film"])):
        one = task(name)
        write([one], ["html"], tmp_path, facts={one.id: gather(one)})
        (path,) = tmp_path.glob(f"{anchor(name)}.html")
        text = path.read_text(encoding="utf-8")
        assert re.findall(r'<label for="layer-\d">([^<]*)</label>', text) == layers
        assert len(re.findall('class="figure(?: film)?"', text)) == len(layers) and "<script" not in text


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Pong1D", "pong-1d"), ("Level2Boss", "level2-boss"), ("BranchingSeals", "branching-seals"),
        ("CliffWorldXY", "cliff-world-xy"),
    ],
)  # fmt: skip
def test_file_names_are_the_words_of_the_name(name: str, expected: str) -> None:
    assert anchor(name) == expected
