"""Ids of instances, `derail/NoisyObs-v0?L=50&M=7`, in all that takes a task; and several values of `-p`."""

import json
from pathlib import Path

import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from tests.language.task.test_instance_ids import ID
from tests.shared.commands import Done
from tests.shared.folders import names


def test_a_value_is_given_once() -> None:
    with pytest.raises(SpecError, match="give it once"):
        taskspec.load("NoisyObs?L=5", L=6)
    assert "give it once" in Done("check", "NoisyObs?L=5", "-p", "L=6").err


@pytest.mark.parametrize(
    "command",
    [
        ("show", "--json"),
        ("solve", "--json"),
        ("run", "--json"),
        ("docs", "-o", "docs"),
        ("figure", "-o", "f.svg"),
        ("check",),
    ],
    ids=lambda c: c[0],
)
def test_commands_take_it(command: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = Done(command[0], ID, *command[1:])
    assert done.status == 0, done.err
    if "--json" in command:
        values = done.data["parameters"]
        if command[0] == "show":
            values = {parameter["name"]: parameter["value"] for parameter in values}
        assert values == {"M": 7, "L": 50}


def test_several_values_are_all_their_combinations(tmp_path: Path) -> None:
    done = Done("solve", "Branching", "-p", "L=2,3", "-p", "B=2,3", "--json")
    found = [each["parameters"] for each in done.data]
    assert found == [{"L": 2, "B": 2}, {"L": 2, "B": 3}, {"L": 3, "B": 2}, {"L": 3, "B": 3}]
    assert Done("solve", "Branching", "-p", "L=2,3,B=2,3", "--json").out == done.out
    assert len(json.loads(Done("show", "Branching", "-p", "L=2,3", "--json").out)) == 2
    assert len(json.loads(Done("run", "Branching", "-p", "L=2,3", "-n", "2", "--json").out)) == 2
    assert Done("figure", "Branching", "-p", "L=2,3,B=2", "-o", str(tmp_path / "f.svg")).status == 0
    assert names(tmp_path) == ["f-L=2-B=2.svg", "f-L=3-B=2.svg"]
    assert "2 tasks in 2 specs" in Done("check", "Branching", "-v", "BranchingSeals", "-p", "L=2,3", "--quick").out


def test_commands_about_one_setting_say_so() -> None:
    assert "takes one value" in Done("play", "Branching", "-p", "L=2,3").err
    assert "given twice" in Done("solve", "Branching", "-p", "L=2", "-p", "L=3").err
    assert "not of the form" in Done("solve", "Branching", "-p", "L=,2").err
