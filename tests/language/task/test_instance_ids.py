"""Ids of instances, `derail/NoisyObs-v0?L=50&M=7`, in all that takes a task; and several values of `-p`."""

import shutil
from pathlib import Path
from typing import Any

import gymnasium
import pytest

import taskspec
from taskspec.base import ids
from taskspec.base.diagnostics import SpecError
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each

ID = "derail/NoisyObs-v0?L=50&M=7"
NUMBERS: tuple[Any, ...] = (0, -3, 10**20, 0.1, 1e-300, 1e300, -0.5, True, False)
TEXTS = ("a", "left-up", "a&b", "1 + 1", "x?y=2", "%20", "é")


def test_every_task_is_named_by_its_instance_id() -> None:
    for name in taskspec.task_ids()[::3]:
        task = taskspec.load(name)
        again = taskspec.load(task.instance_id)
        assert again == task and again.values == task.values
    assert taskspec.load("NoisyObs", M=7, L=50).instance_id == ID
    assert taskspec.load(taskspec.load("NoisyObs", M=7), L=50).instance_id == ID


@for_each("value", NUMBERS + TEXTS)
def test_values_are_read_back(value: Any) -> None:
    found = ids.parse(str(ids.InstanceId("s/Name-v0", {"x": value, "y": 1}, ("m=0.5,k=a", "n"))))
    assert found.parameters == {"x": value, "y": 1} and type(found.parameters["x"]) is type(value)
    assert (found.name, found.modifiers) == ("s/Name-v0", ("m=0.5,k=a", "n"))


def test_python_takes_it() -> None:
    assert taskspec.load(ID).values == {"M": 7, "L": 50}
    assert taskspec.load("NoisyObs?L=50", M=7).values == {"M": 7, "L": 50}
    assert taskspec.make(ID).task.values == {"M": 7, "L": 50}
    assert taskspec.make_vec(ID, num_envs=2, backend="numpy").task.values == {"M": 7, "L": 50}
    assert taskspec.exact.scores(ID).optimal.value == 16


def test_gymnasium_takes_it() -> None:
    env: Any = gymnasium.make(ID)
    assert env.unwrapped.task.values == {"M": 7, "L": 50}
    again: Any = gymnasium.make(env.spec)
    assert again.unwrapped.task.values == {"M": 7, "L": 50}
    assert gymnasium.make("taskspec:derail/NoisyObs-v0?L=50").unwrapped.task.values["L"] == 50  # type: ignore[attr-defined]
    lanes: Any = gymnasium.make_vec(ID, num_envs=3)
    assert lanes.task.values == {"M": 7, "L": 50}
    assert gymnasium.spec("derail/NoisyObs-v0").kwargs == {
        "task": "derail/NoisyObs-v0"
    }  # the registered one is as it was
    with pytest.raises(gymnasium.error.Error, match="Malformed"):
        gymnasium.make("CartPole-v1?x=1")


def test_gymnasium_adds_modifiers_to_those_of_the_id() -> None:
    wanted = taskspec.load("RiskyPath", modifiers=["sticky=0.25", "delay=2"])
    env: Any = gymnasium.make("derail/RiskyPath-v0+sticky=0.25", modifiers=["delay=2"])
    again: Any = gymnasium.make(env.spec)
    lanes: Any = gymnasium.make_vec("derail/RiskyPath-v0+sticky=0.25", num_envs=2, modifiers=["delay=2"])
    assert env.unwrapped.task == again.unwrapped.task == lanes.task == wanted


@pytest.mark.parametrize("modifiers", ["sticky=0.25", {"sticky": 0.25}, None], ids=repr)
def test_modifiers_are_a_list(modifiers: Any) -> None:
    for make in (taskspec.load, taskspec.make, taskspec.make_vec, gymnasium.make):
        with pytest.raises(SpecError, match="given as a list") as caught:
            make("derail/RiskyPath-v0", modifiers=modifiers)
        assert caught.value.diagnostics[0].code == "E718"


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("NoisyObs?L", "E713", "not of the form name=value"),
        ("NoisyObs?L=5&L=6", "E713", "gives 'L' twice"),
        ("NoisyObs?K=5", "E702", "no parameter 'K'"),
        ("NoisyObs?L=x", "E703", "must be an int"),
        ("NoisyObz?L=5", "E701", "no task 'NoisyObz'"),
        ("nowhere.yaml?L=5", "E710", "nowhere.yaml"),
    ],
)
def test_mistakes_are_told(name: str, code: str, words: str) -> None:
    caught = refusal(taskspec.load, name)
    assert caught.diagnostics[0].code == code and words in str(caught)


def test_a_path_takes_values_and_a_file_its_own_name(tmp_path: Path) -> None:
    spec = taskspec.load("NoisyObs").source.document.origin.name
    for name in ("a.yaml", "b+c.yaml", "d?e.yaml"):
        shutil.copy(spec, tmp_path / name)
    assert taskspec.load(f"{tmp_path}/a.yaml?L=50").values["L"] == 50
    assert taskspec.load(f"{tmp_path}/b+c.yaml").values["L"] == taskspec.load(f"{tmp_path}/d?e.yaml").values["L"]
