"""The partially observable tasks beside published `.pomdp` files: every transition, observation and reward.

The files are those of the package `gym_pomdps`, wherever a checkout of it is on the path; a small one is written out here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.language.task.task import Task
from tests.shared.specs import spec_file
from tests.verification.originals.beside import OutcomesOf, State

SHUTTLE = """
states: docked_lrv mrv_front space_to_mrv lrv_back mrv_back space_to_lrv lrv_front docked_mrv
actions: turn forward backup
observations: lrv mrv mrv_dock nothing lrv_dock
T: turn
0 1 0 0 0 0 0 0  0 0 0 0 1 0 0 0  0 0 0 0 0 1 0 0  0 0 0 0 0 0 1 0
0 1 0 0 0 0 0 0  0 0 1 0 0 0 0 0  0 0 0 1 0 0 0 0  0 1 0 0 0 0 0 0
T: forward
0 0 0 0 1 0 0 0  0 1 0 0 0 0 0 0  0 1 0 0 0 0 0 0  0 0 1 0 0 0 0 0
0 0 0 0 0 1 0 0  0 0 0 0 0 0 1 0  0 0 0 0 0 0 1 0  0 0 0 0 1 0 0 0
T: backup
0 0 0 0 0 0 0 1  0 .4 .3 0 .3 0 0 0  0 0 .1 .8 0 0 .1 0  .7 0 0 .3 0 0 0 0
0 0 0 0 .3 0 0 .7  0 .1 0 0 .8 .1 0 0  0 0 0 .3 0 .3 .4 0  0 0 0 0 0 0 0 1
O: *
0 0 0 0 1  0 1 0 0 0  0 .7 0 .3 0  0 0 0 1 0  0 0 0 1 0  .7 0 0 .3 0  1 0 0 0 0  0 0 1 0 0
R: forward : mrv_front : mrv_front : * -3
R: forward : lrv_front : lrv_front : * -3
R: backup : lrv_back : docked_lrv : * 10
"""
"""shuttle.95.POMDP as A. R. Cassandra distributes it, with names for its numbers."""


@dataclass(frozen=True)
class Pomdp:
    """`T[a, s, s']`, `O[a, s', o]` and `R[a, s, s']`; `resets[a, s]` where the file begins anew."""

    states: list[str]
    actions: list[str]
    observations: list[str]
    T: Any
    O: Any  # noqa: E741
    R: Any
    resets: Any


def read(text: str) -> Pomdp:
    """Read the part of the format that these files use."""
    lines = [line for line in re.sub(r"#.*", "", text).splitlines() if line.strip()]
    names = {key: rest.split() for key, _, rest in (line.partition(":") for line in lines)}
    states = names["states"]
    actions = names["actions"]
    seen = names["observations"]
    sizes = {"T": (actions, states, states), "O": (actions, states, seen), "R": (actions, states, states, ["*"])}
    arrays = {kind: np.zeros([len(axis) for axis in axes]) for kind, axes in sizes.items()}
    resets = np.zeros((len(actions), len(states)), bool)
    entries = re.split(r"^(?=[TOR]\s*:)", "\n".join(lines), flags=re.MULTILINE)[1:]
    for entry in entries:
        kind, *words = entry.replace(":", " ").split()
        axes = sizes[kind]
        array = arrays[kind]
        at: list[Any] = []
        while words and len(at) < len(axes) and (words[0] == "*" or words[0] in axes[len(at)]):
            word = words.pop(0)
            at.append(slice(None) if word == "*" else axes[len(at)].index(word))
        match words:
            case ["reset"]:
                resets[tuple(at)] = True
            case ["identity"]:
                array[tuple(at)] = np.eye(len(states))
            case ["uniform"]:
                array[tuple(at)] = 1 / array.shape[-1]
            case [value]:
                array[tuple(at)] = float(value)
            case _:
                array[tuple(at)] = np.reshape(list(map(float, words)), array.shape[len(at) :])
    return Pomdp(states, actions, seen, arrays["T"], arrays["O"], arrays["R"][..., 0], resets)


def file(name: str) -> str:
    found = find_spec("gym_pomdps")
    if found is None:
        pytest.skip("no checkout of gym_pomdps is on the path")
    return (Path(next(iter(found.submodule_search_locations))) / "pomdps" / f"{name}.pomdp").read_text()


def compare(
    task: Task,
    theirs: Pomdp,
    put: Callable[[str], State],
    hidden: Callable[[Mapping[str, Any]], str],
    heard: Callable[[Mapping[str, Any]], str],
    action: Callable[[str], int],
) -> int:
    """Compare the joint distribution of the next state and the observation, and the reward, everywhere.

    Args:
        put: our state, by the name of theirs.
        hidden: the name of their state, by ours.
        heard: what they call the observation in our state; `nothing` for one that tells nothing.
        action: our action, by the name of theirs.

    Returns:
        The number of pairs of states and actions.
    """
    outcomes = OutcomesOf(task)
    compared = 0
    for s, state in enumerate(theirs.states):
        for a, name in enumerate(theirs.actions):
            joint = np.zeros((len(theirs.states), len(theirs.observations)))
            for (code, ends, reward), (chance, _) in outcomes.of(put(state), action(name), 0).items():
                assert ends == theirs.resets[a, s]
                following = outcomes.steps.states.values_of(code)
                k = s if ends else theirs.states.index(hidden(following))
                assert reward == theirs.R[a, s, k]
                said = heard(following)
                if said in theirs.observations:
                    joint[k, theirs.observations.index(said)] += chance
                else:
                    joint[k] += chance * theirs.O[a, k]
            if not theirs.resets[a, s]:
                np.testing.assert_allclose(joint, theirs.T[a, s][:, None] * theirs.O[a], atol=1e-6)
            compared += 1
    return compared


def test_shuttle() -> None:
    theirs = read(SHUTTLE)
    task = taskspec.load("pomdp/Shuttle")
    ours = {"put": lambda s: {"at": s, "sees": "nothing"}, "hidden": lambda s: s["at"], "heard": lambda s: s["sees"]}
    assert compare(task, theirs, **ours, action=theirs.actions.index) == 24


def test_tiger() -> None:
    """What is heard after a door was opened tells nothing in either."""
    theirs = read(file("tiger.original"))
    assert not np.ptp(theirs.O[1:]) > 0
    compared = compare(
        taskspec.load("pomdp/Tiger"), theirs,
        put=lambda s: {"tiger": s.removeprefix("tiger-"), "heard": "nothing"},
        hidden=lambda s: f"tiger-{s['tiger']}", heard=lambda s: f"obs-{s['heard']}", action=theirs.actions.index,
    )  # fmt: skip
    assert compared == 6


def test_voicemail() -> None:
    theirs = read(file("voicemail"))
    assert not np.ptp(theirs.O[1:]) > 0
    compared = compare(
        taskspec.load("pomdp/Voicemail"), theirs,
        put=lambda s: {"wish": s, "heard": "nothing"},
        hidden=lambda s: s["wish"], heard=lambda s: f"hear{s['heard'].title()}", action=theirs.actions.index,
    )  # fmt: skip
    assert compared == 6


@pytest.mark.slow
def test_rock_sample(tmp_path: Path) -> None:
    """Six rocks on a map of five by five; its rows are counted from below."""
    theirs = read(file("rock_sample_5_6.v0"))
    rocks = [[3, 0], [1, 1], [4, 2], [1, 2], [3, 3], [0, 4]]
    source = spec_file("rock_sample").read_text().replace("rocks: [[0, 1], [1, 0]]", f"rocks: {rocks}")
    path = tmp_path / "rocks.yaml"
    path.write_text(source.partition("expert:")[0])

    def put(name: str) -> State:
        _, x, y, good = name.split("_")
        return {"x": int(x), "y": 4 - int(y), "good": [bit == "1" for bit in good], "heard": "nothing"}

    def hidden(state: Mapping[str, Any]) -> str:
        return f"s_{state['x']}_{4 - state['y']}_{''.join('01'[bit] for bit in state['good'])}"

    def heard(state: Mapping[str, Any]) -> str:
        return {"nothing": "none", "good_rock": "good", "bad_rock": "bad"}[state["heard"]]

    def action(name: str) -> int:
        return "NESW".index(name) if name in "NESW" else 4 if name == "sample" else 5 + int(name.removeprefix("check_"))

    task = taskspec.load(path, n=5)
    assert compare(task, theirs, put, hidden, heard, action) == len(theirs.states) * 11
