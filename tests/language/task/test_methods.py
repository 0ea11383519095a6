"""What a task tells of itself: its texts, its variants and roles, and its spaces."""

import copy
from pathlib import Path

import pytest
import yaml

import taskspec
from taskspec.base.limits import also
from taskspec.exact import scores
from taskspec.language.registry import task_ids
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from tests.shared.for_each import for_each
from tests.shared.sections import build_text


@for_each("task_id", [i for i in task_ids() if i.startswith("derail/")])
def test_spaces_and_texts_are_those_of_the_environment_and_the_file(task_id: str) -> None:
    task = taskspec.load(task_id)
    env = taskspec.make(task)
    assert (task.observation_space, task.action_space) == (env.observation_space, env.action_space)
    written = yaml.safe_load(task.source.document.origin.text)
    if task.source.variant is None:
        assert (task.summary, task.capability) == (written["summary"], written["capability"])
    assert list(task.variants) == list(written.get("variants", {}))
    for variant in task.variants:
        assert taskspec.load(task, variant).source.variant == variant


def test_roles_are_the_variants_of_expert_and_learner() -> None:
    task = taskspec.load("derail/InitShiftLearner-v0")
    assert task.roles == {"expert": "InitShiftExpert", "learner": "InitShiftLearner"}
    assert taskspec.load(task, task.roles["expert"]) == taskspec.load("derail/InitShiftExpert-v0")
    assert taskspec.load("RiskyPath").roles == {}


def test_spaces_follow_the_conventions() -> None:
    task = taskspec.load("Branching", modifiers=["time_observed"])
    assert task.observation_space == taskspec.make("Branching", observe_time=True).observation_space


def test_scores_are_flat_rows() -> None:
    found = scores(taskspec.load("Branching", L=4))
    rows = found.rows()
    assert rows[1] == {
        "id": "derail/Branching-v0", "L": 4, "B": 2, "return": "random", "value": 1 / 16, "error": 0.0, "status": "exact",
    }  # fmt: skip
    for row, name in zip(rows, ("optimal", "random", "worst", "expert"), strict=True):
        assert row["return"] == name
        assert set(map(type, row.values())) <= {str, int, float}


ALIASED = """
taskspec: 1
name: Aliased
parameters: {L: {type: int, default: 2, ALIAS}}
state: {s: {type: int, low: 0, high: L}, x: {type: real, shape: [2, 1]}, b: {type: bool}}
action: {a: {type: bool}}
initial: {s: 0, x: [[0.5], [0.25]], b: false}
dynamics: {s': "min(s + 1, L)", b': a}
horizon: 3
reward: s
info: [new_state]
"""


@pytest.mark.parametrize(
    ("alias", "code"), [("s", "E309"), ("L", "E309"), ("path", "E309"), ("pi", "E309"), ("1x", "E2")]
)
def test_an_alias_is_a_name_of_its_own(alias: str, code: str) -> None:
    with pytest.raises(taskspec.SpecError, match=code):
        build_text(ALIASED.replace("ALIAS", f"alias: {alias}"))


def test_infos_are_flat_and_say_what_is_asked_for() -> None:
    task = build_text(ALIASED.replace("ALIAS", "alias: length"), length=5)
    assert task.values == {"L": 5}
    env = taskspec.make(task)
    env.reset(seed=0)
    env.step(0)
    info = env.step(1)[4]
    assert list(info) == ["new_state"] and info["new_state"].dtype == "float32"
    assert info["new_state"].tolist() == [2, 0.5, 0.25, 1]
    copied = copy.deepcopy(env)
    assert copied.step(0)[4]["new_state"].tolist() == env.step(0)[4]["new_state"].tolist() == [3, 0.5, 0.25, 0]


def test_a_task_is_built_once_for_the_same_values() -> None:
    """Checks try many settings, some of them more than once; what differs in a value, or under another limit, is another task."""
    document = read_text(ALIASED.replace("ALIAS", "alias: length"))
    task = build(document, None, {"L": 5})
    assert build(document, None, {"L": 5}) is task
    assert build(document, None, {"L": 4}) is not task
    with also("expressions=5"), pytest.raises(taskspec.SpecError, match="E314"):
        build(document, None, {"L": 5})
    other = build(document, None, {"L": 4})
    assert task.source.surface.sections["reward"] is other.source.surface.sections["reward"]


def test_values_that_are_equal_but_not_the_same_make_tasks_of_their_own(tmp_path: Path) -> None:
    spec = tmp_path / "aliased.yaml"
    spec.write_text(ALIASED.replace(", ALIAS}", "}, z: {type: real, default: 1}").replace("reward: s", "reward: s + z"))
    for source in (spec, taskspec.load(spec)):
        for zero in (0.0, -0.0, 0.0):
            assert str(taskspec.load(source, z=zero).values["z"]) == str(zero)
        assert taskspec.load(source, L=1).values["L"] == 1
        with pytest.raises(taskspec.SpecError):
            taskspec.load(source, L=True)
