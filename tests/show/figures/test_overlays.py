"""Whose results are laid over a figure: the expert's with its memory, and never another policy's in its name."""

from pathlib import Path

import pytest

from taskspec.language import registry
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures import OVERLAYS, overlay, scene
from taskspec.show.figures.shapes import text_width
from taskspec.show.printers.text import plain
from tests.shared.scenes import boxes, labels, words
from tests.shared.tasks import ROAD

CUE = """\
taskspec: 1
name: Cue
summary: Look, then remember.
state:
  s: {type: choice, values: [cue_l, cue_r, fork_l, fork_r, win, lose]}
action:
  a: {type: choice, values: [wait, left, right]}
observation:
  o: "1 if s == cue_l else 2 if s == cue_r else 0"
horizon: 3
initial:
  s: {cue_l: 1/2, cue_r: 1/2}
dynamics:
  s':
    by: [s, a]
    rows:
      cue_l: fork_l
      cue_r: fork_r
      fork_l: {left: win, right: lose, wait: fork_l}
      fork_r: {right: win, left: lose, wait: fork_r}
      else: s
reward: s' == win and s != win
memory:
  m: {type: int, low: 0, high: 2, initial: o, next: m}
expert:
  a: left
"""
WIN = 4
LOSE = 5
FORK_R = 3
LEFT = 1
RIGHT = 2


def cue(folder: Path, text: str = CUE) -> Task:
    path = folder / "cue.yaml"
    path.write_text(text, encoding="utf-8")
    return registry.load(path)


def legend(task: Task, *names: str) -> list[str]:
    found = scene(task, overlay(task, names))
    assert found is not None
    return [word for word in words(found) if ": " in word]


def test_an_expert_that_remembers_is_shown_as_it_acts(tmp_path: Path) -> None:
    """This one always goes left, and so loses in half of its episodes; an optimal policy never does."""
    task = cue(tmp_path)
    found = overlay(task, ["expert", "occupancy"])
    assert found.policy[FORK_R] == (LEFT,)
    assert found.occupancy == {0: 1.0, 1: 1.0, 2: 1.0, 3: 1.0, WIN: 1.0, LOSE: 1.0}
    told = legend(task, "expert", "occupancy")
    assert "thick arrows: the expert's actions at first, whatever it remembers" in told
    assert "shade, up to 0.5 per episode: the expert's visits" in told


def test_what_it_may_do_with_several_memories_is_shown_together(tmp_path: Path) -> None:
    task = cue(tmp_path, CUE.replace("a: left", "a: left if m == 1 else right").replace("next: m}", "next: 3 - m}"))
    assert overlay(task, ["expert"]).policy[FORK_R] == (LEFT, RIGHT)


def test_an_expert_without_a_plan_is_not_replaced(tmp_path: Path) -> None:
    """Its memory is a real number, of which there is no model: nothing is drawn, and the legend says so."""
    text = CUE.replace("type: int, low: 0, high: 2, initial: o", "type: real, initial: o")
    task = cue(tmp_path, text)
    found = overlay(task, ["expert", "occupancy"])
    assert not found.policy
    assert not found.occupancy
    assert legend(task, "expert", "occupancy") == [
        "not drawn: the expert's actions at first, for which there is no exact plan",
        "not drawn: the expert's visits, for which there is no exact plan",
    ]


def test_only_one_policy_is_drawn_and_the_other_is_named(tmp_path: Path) -> None:
    told = legend(cue(tmp_path), *OVERLAYS)
    assert "thick arrows: best actions with all 3 steps to go" in told
    assert "not drawn: the expert's actions" in "\n".join(told)
    alone = legend(cue(tmp_path, CUE.split("memory:")[0]), "expert")
    assert alone == ["thick arrows: an optimal policy's actions at first"]


KEYS = """\
taskspec: 1
name: Keys
summary: Walk to a key.
state:
  x: {type: int, low: 0, high: 3}
  y: {type: int, low: 0, high: 2}
action: {a: {type: choice, values: [left, right, up, down]}}
horizon: 8
initial: {x: 0, y: 0}
dynamics:
  x': clip(x + (a == right) - (a == left), 0, 3)
  y': clip(y + (a == down) - (a == up), 0, 2)
reward: 1 / 3 if x' == 2 and y' == 1 else 0
figure: {kind: grid, at: [x, y], objects: {key: [2, 1], bed: [2, 1], jar: [0, 0]}}
"""


@pytest.mark.parametrize("names", [["values"], ["values", "policy"]])
def test_objects_leave_the_values_of_their_cells_to_be_read(names: list[str], tmp_path: Path) -> None:
    task = cue(tmp_path, KEYS)
    found = scene(task, overlay(task, names))
    assert found is not None
    badges = boxes(found, fill="second")
    texts = [label for label in labels(found) if plain(label.text)[0].isdigit()]
    assert len(badges) == 3
    assert len(texts) == 12
    for badge in badges:
        x = badge.corner[0] + badge.width / 2
        y = badge.corner[1] + badge.height / 2
        for text in texts:
            is_beside = abs(text.at[0] - x) >= (text_width(text.text, text.size) + badge.width) / 2
            assert is_beside or abs(text.at[1] - y) >= (text.size + badge.height) / 2


FOG = """\
taskspec: 1
name: Fog
summary: A walk that slips, of which the graph has room for no values.
state:
  s: {type: int, low: 0, high: 4}
action:
  a: {type: choice, values: {left: -1, stay: 0, right: 1}}
horizon: 5
initial:
  s: UniformInt(0, 4)
dynamics:
  s': "clip(s + a, 0, 4) if Bernoulli(3/4) else s"
reward: s' == 2
"""


@pytest.mark.parametrize("figure", ["", "figure: {kind: graph}\n"])
def test_a_graph_that_values_make_too_crowded_becomes_a_matrix_with_them(figure: str, tmp_path: Path) -> None:
    task = cue(tmp_path, FOG + figure)
    bare = scene(task)
    assert bare is not None and bare.alt.startswith("Transition graph")
    shown = legend(task, "values", "policy")
    assert shown == [
        "V: best return with all 5 steps to go",
        "frames where they lead: best actions with all 5 steps to go",
    ]
    found = scene(task, overlay(task, ["values"]))
    assert found is not None and "V = 4.667" in words(found)


def test_values_of_states_that_only_longer_episodes_enter_are_of_all_steps_left() -> None:
    """500 steps along a road of 20,000 places, of which episodes enter 501."""
    shown = overlay(build(read_text(ROAD)), ["values"]).values
    assert shown[400] == sum(range(401, 901))
