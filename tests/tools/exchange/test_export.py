"""Tasks in the formats of other tools: what the files hold, and what is said of the rest."""

import io
import json
import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from taskspec import load, make
from taskspec.tools.exchange import formats
from taskspec.tools.exchange.settled import settled
from tests.shared.commands import Done, spec
from tests.tools.exchange.umb_files import rationals, unpacked

CORRIDOR = """\
taskspec: 1
name: Corridor
state: {s: {type: int, low: -1, high: 2}}
action: {a: {type: choice, values: [left, right]}}
observation: {o: "s + Bernoulli(1/10)"}
horizon: none
discount: 0.9
initial: {s: {0: 1/3, 1: 2/3}}
dynamics: {s': "clip(s + (1 if a == right and Bernoulli(0.1) else 0), -1, 2)"}
reward: 0.3 * (s' == 2) - 0.1
terminal: s' == 2
measures: {cost: a == right}
claims:
  - probability(s == 2) <= 1
figure: {kind: grid, at: [s, 0], highlight: {good: s == 2}}
"""


def test_numbers_are_those_that_the_spec_writes(tmp_path: Path) -> None:
    """One tenth is 1/10, and neither probabilities nor rewards went through floats."""
    path = tmp_path / "corridor.umb"
    Done("export", spec(tmp_path, CORRIDOR), "-o", path)
    files = unpacked(path.read_bytes())
    shares = rationals(files["branch-to-probability.bin"])
    assert shares[:2] == [Fraction(1, 3), Fraction(2, 3)]
    assert set(map(str, shares)) == {"1/3", "2/3", "9/10", "1/10", "81/100", "9/100", "1/100", "1"}
    rewards = rationals(files["annotations/rewards/reward/branches/values.bin"])
    assert set(map(str, rewards)) == {"0", "-1/10", "1/5"}


@pytest.mark.parametrize("name", [
    "CoinToss", "EndInPlace", "FrozenLake", "CliffWalking", "Branching", "bsuite/DiscountingChain", "Inventory?M=3",
    "bsuite/Umbrella", "planning/ThreeInAColumn", "NoisyObs",
])  # fmt: skip
def test_the_table_of_an_environment_is_that_of_the_file(name: str) -> None:
    task = load(name)
    form = formats.FORMATS["gym-p"]
    written = json.loads(formats.written(formats.exported(task, form)[1], form))
    env = make(task)
    table = {str(s): {str(a): list(map(list, row)) for a, row in rows.items()} for s, rows in env.P.items()}
    assert table == written["P"]
    assert env.initial_state_distrib.tolist() == written["initial"]


def test_what_a_format_cannot_carry_is_said_by_name(tmp_path: Path) -> None:
    path = spec(tmp_path, CORRIDOR)
    err = Done("export", path, "-o", tmp_path / "x.umb").err
    for part in (
        "observations (o)",
        "measures (cost)",
        "discount 9/10",
        "start distribution",
    ):
        assert part in err
    assert 'R{"reward"}max=? [F "end"]' in err
    refused = Done("export", "derail/Parabola", "-f", "gym-p")
    assert refused.status == 1
    assert "E712" in refused.err
    assert "E726" in Done("export", "RiskyPath", "-f", "dot").err
    assert Done("export", "RiskyPath", "-f", "umb").status == 2


def test_umb_holds_the_arrays_of_its_specification() -> None:
    """The bytes, read as the specification of the format says, without the reader."""
    _, found = formats.exported(load("RiskyPath"))
    files = unpacked(formats.written(found, formats.FORMATS["umb"]))
    assert next(iter(files)) == "index.json"
    index = json.loads(files["index.json"])
    system = index["transition-system"]
    assert (system["#states"], system["#choices"], system["#branches"], system["#players"]) == (4, 8, 9, 1)
    assert struct.unpack("<5Q", files["state-to-choices.bin"]) == (0, 2, 4, 6, 8)
    assert struct.unpack("<9Q", files["choice-to-branches.bin"]) == (0, 1, 3, 4, 5, 6, 7, 8, 9)
    assert struct.unpack("<9Q", files["branch-to-target.bin"]) == (1, 2, 3, 2, 1, 2, 2, 3, 3)
    assert rationals(files["branch-to-probability.bin"])[1:3] == [Fraction(1, 2)] * 2
    paid = rationals(files["annotations/rewards/reward/branches/values.bin"])
    assert paid == [0, 1, -100, 1, 0, 1, 1, -100, -100]
    assert files["actions/choices/strings.bin"] == b"saferisky"
    assert files["state-is-initial.bin"] == (1).to_bytes(8, "little")
    assert system["#observations"] == 0
    assert index["annotations"]["aps"]["good"]["applies-to"] == ["states"]


def test_observations_of_states_are_in_every_file() -> None:
    """Tiger shows what is heard, one of three; before the first state nothing is observed, which is the first class."""
    _, found = formats.exported(load("pomdp/Tiger"))
    files = unpacked(formats.written(found, formats.FORMATS["umb"]))
    system = json.loads(files["index.json"])["transition-system"]
    assert (system["#observations"], system["observations-apply-to"]) == (4, "states")
    heard = np.array([row["heard"] for row in found.values])
    classes = np.concatenate([[0], 1 + heard, 1 + heard])
    assert files["observations/states/values.bin"] == classes.astype("<u8").tobytes()
    seen = np.eye(3)[heard].tolist()
    assert json.loads(formats.written(found, formats.FORMATS["gym-p"]))["observations"] == seen
    with np.load(io.BytesIO(formats.written(found, formats.FORMATS["npz"]))) as arrays:
        assert arrays["observations"].tolist() == seen


def test_umbi_reads_umb(tmp_path: Path) -> None:
    """The library of the format's authors."""
    umbi = pytest.importorskip("umbi")
    path = tmp_path / "task.umb"
    Done("export", "NoisyObs", "-o", path)
    try:
        found = umbi.ats.read(path)
    except ValueError as error:  # umbi 0.2.5 fails on valuations with bitstring 5
        pytest.skip(str(error))
    assert found.num_states == 26
    assert found.choice_action_to_name == ["up", "down", "left", "right", "stay"]
    for branch in found.get_state_choices(0)[0].branches:
        assert branch.prob == Fraction(1, 4)


@pytest.mark.parametrize("name", ["FrozenLake", "Taxi", "CliffWalking"])
def test_the_table_p_is_that_of_gymnasium(name: str) -> None:
    """Outcome by outcome, in all states in which episodes act; ours are numbered without those that none enters."""
    ours = json.loads(Done("export", f"toy_text/{name}", "-f", "gym-p").out)
    env: Any = gymnasium.make(
        {"FrozenLake": "FrozenLake-v1", "Taxi": "Taxi-v4", "CliffWalking": "CliffWalking-v1"}[name]
    )
    P = env.unwrapped.P
    _, found = formats.exported(load(f"toy_text/{name}"))
    if name != "FrozenLake":
        assert len(ours["P"]) == len(found.states)
        return
    for s, by_action in ours["P"].items():
        if int(s) in found.acting:
            for a, outcomes in by_action.items():
                theirs: dict[tuple[int, float, bool], float] = {}
                for p, to, reward, ends in P[int(s)][int(a)]:
                    theirs[int(to), reward, bool(ends)] = theirs.get((int(to), reward, bool(ends)), 0.0) + p
                assert {(to, r, e): p for p, to, r, e in outcomes} == pytest.approx(theirs)


def test_npz_holds_arrays_that_load_without_pickles(tmp_path: Path) -> None:
    path = tmp_path / "task.npz"
    Done("export", "RiskyPath", "-f", "npz", "-o", path)
    with np.load(path, allow_pickle=False) as arrays:
        assert arrays["probability"].sum() == 8
        assert arrays["states"].tolist() == ["start", "detour", "goal", "trap"]
        assert arrays["label_good"].tolist() == [False, False, True, False]
        assert arrays["component_s"].tolist() == [0, 1, 2, 3]
        assert arrays["horizon"] == 5


def test_illegal_actions_are_left_out_for_model_checkers() -> None:
    """Gambler may stake no more than there is; tables for Python have all actions, as environments do."""
    _, found = formats.exported(load("textbook/Gambler"))
    files = unpacked(formats.written(found, formats.FORMATS["umb"]))
    first = np.frombuffer(files["state-to-choices.bin"], "<u8")[:51].astype(int)
    assert np.diff(first).tolist() == list(range(1, 51))  # of money from 1 to 50, at most all
    done = Done("export", "textbook/Gambler", "-f", "gym-p")
    assert len(json.loads(done.out)["P"]["1"]) == 50
    assert "legal actions: not in the file" in done.err


def test_time_becomes_a_component_of_the_state() -> None:
    model, found = formats.exported(load("bsuite/Umbrella"))
    assert model.is_timed
    ready = settled(found)
    assert {row["t"] for row in ready.values} == set(range(21))
    assert "time: the component t" in Done("export", "bsuite/Umbrella", "-f", "gym-p").err
