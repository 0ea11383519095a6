"""Specs of what other tools have: the same returns as the source, names that can be read, and what is lost said by name."""

import json
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from taskspec import load
from taskspec.exact import Results
from taskspec.exact.scores.difficulty import best_observing
from taskspec.language.task.legal import with_all_actions
from taskspec.tools.exchange import formats
from taskspec.tools.exchange.formats import imported
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.spec_text import spec_text, task_of_tables
from tests.shared.commands import Done, spec
from tests.tools.exchange.umb_files import REWARD, model

TASKS = (
    "derail/RiskyPath", "derail/Branching", "derail/EarlyTermNeg", "derail/NoisyObs", "derail/Sort", "probes/EndInPlace",
    "irl/Shaping", "bsuite/DeepSea", "bsuite/Umbrella", "seals/CliffWorld", "pomdp/Tiger", "toy_text/FrozenLake",
    "textbook/Recycling", "safety/BoatRace", "planning/Hanoi", "operations/Inventory",
)  # fmt: skip


@pytest.mark.parametrize("format", ["umb", "gym-p", "npz"])
@pytest.mark.parametrize("name", TASKS)
def test_what_was_exported_has_the_same_returns_when_it_is_imported(name: str, format: str, tmp_path: Path) -> None:
    """The returns of the imported spec are those of the task; its claims are proved."""
    task = load(name)
    chosen = formats.FORMATS[format]
    if not chosen.is_settled:
        task = with_all_actions(task)
    path = tmp_path / f"file{chosen.suffix}"
    path.write_bytes(formats.written(formats.exported(task, chosen)[1], chosen))
    spec = tmp_path / "spec.yaml"
    spec.write_text(spec_text(imported(str(path))))
    known = Results(task, 1)
    found = Results(load(str(spec)), 1)
    for which in ("optimal", "random", "worst"):
        expected = known.enclosure(which, True)
        value = found.enclosure(which, True)
        assert expected is not None
        assert value is not None
        if expected.is_exact and chosen.is_settled:
            assert value == expected
        assert value.value == pytest.approx(expected.value, rel=1e-9, abs=1e-12)


def test_claims_say_that_the_spec_equals_its_source(tmp_path: Path) -> None:
    path = tmp_path / "lake.yaml"
    assert Done("import", "FrozenLake-v1", "-o", path).status == 0
    checked = Done("check", path, "--strict")
    assert "2 proved" in checked.out
    text = path.read_text()
    assert "horizon: 100\n" in text
    assert "terminal: s' in {r1c1, r1c3, r2c3, r3c0, r3c3}\n" in text
    assert "figure: {kind: grid, at: [s % 4, s // 4]}\n" in text
    path.write_text(text.replace("    r3c3: 1\n", "    r3c3: 2\n"))
    assert "E601" in Done("check", path).out


def test_a_grid_is_recovered_with_a_step_back_to_the_start(tmp_path: Path) -> None:
    path = tmp_path / "cliff.yaml"
    Done("import", "CliffWalking-v1", "--horizon", "200", "--name", "Cliff", "-o", path)
    task = load(str(path))
    assert task.name == "Cliff"
    assert "s % 12, s // 12" in path.read_text()
    assert Results(task, 1).optimal.value == -13  # type: ignore[union-attr]


def test_components_that_a_source_names_are_the_names_of_states(tmp_path: Path) -> None:
    path = tmp_path / "obs.umb"
    Done("export", "NoisyObs", "-o", path)
    text = Done("import", path).out
    assert "values: [x0_y0, x0_y1" in text
    assert "{x0_y0: 1/4, x0_y4: 1/4, x4_y0: 1/4, x4_y4: 1/4}" in text


def test_a_model_of_another_tool(tmp_path: Path) -> None:
    """Rewards of states and choices add up, absorbing states are ends, actions may be missing, and what is lost is said."""
    evil = "__import__('os').system('x')"
    rows = [
        [("go", 0.5, {1: 0.75, 2: 0.25}), (evil, 0.0, {2: 1.0})],
        [("go", 0.0, {2: 1.0})],
        [("go", 0.0, {2: 1.0})],
        [("wait", 7.0, {3: 1.0})],
    ]
    path = tmp_path / "other.umb"
    labels = {"aps": {"goal": {"alias": "the goal"}}}
    path.write_bytes(model(rows, annotations=REWARD | labels, **{"model-data": {"name": "x", "doi": "y"}}, files={
        "annotations/rewards/paid/states/values.bin": struct.pack("<4d", 1, 2, 0, 0),
        "annotations/rewards/cost/choices/values.bin": struct.pack("<5d", 1, 2, 3, 4, 5),
        "annotations/aps/goal/states/values.bin": struct.pack("<Q", 0b0100),
        "valuations/choices/valuations.bin": b"12345",
    }))  # fmt: skip
    out = tmp_path / "spec.yaml"
    said = " ".join(Done("import", path, "--horizon", "10", "-o", out).err.split())
    for part in (
        "lost: label goal, model-data doi, reward cost, valuations/choices",
        "lost: actions without an alternative ('wait')",
        "lost: 1 state that no episode enters",
        """renamed: "__import__('os').sys" -> a__import____os___system__x__""",
    ):
        assert part in said
    text = out.read_text()
    assert "terminal: s' == s2" in text
    assert Results(load(str(out)), 1).optimal.value == pytest.approx(1 + 0.5 + 0.75 * 2)  # type: ignore[union-attr]


@pytest.mark.parametrize("seed", range(10))
def test_random_pomdps_keep_their_observations(seed: int, tmp_path: Path) -> None:
    """States look alike in the imported spec where they do in the file, whoever wrote it, and nothing is said to be lost."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    classes = rng.integers(0, 3, n).tolist()
    rows = []
    for _ in range(n):
        first, second = rng.dirichlet(np.ones(n), 2).tolist()
        x = ("x", float(rng.integers(3)), dict(enumerate(first)))
        y = ("y", float(rng.integers(3)), dict(enumerate(second)))
        rows.append([x, y])
    path = tmp_path / "other.umb"
    path.write_bytes(model(rows, classes))
    read = imported(str(path), horizon=5)
    assert read.remarks == ()
    assert observed(read) == alike(classes)
    for name, chosen in formats.FORMATS.items():
        tables = replace(read, seen=tuple((c / 7, -1.0) for c in classes))
        path = tmp_path / f"{name}{chosen.suffix}"
        path.write_bytes(formats.written(tables, chosen))
        again = imported(str(path))
        assert observed(again) == alike(classes)
        assert again.claims["optimal_return"] == pytest.approx(read.claims["optimal_return"])


def observed(task: FrozenTask) -> set[frozenset[int]]:
    """Sets of states that look alike in the text of the spec."""
    rows = yaml.safe_load(spec_text(task))["observation"]["seen"]["value"]["rows"]
    return alike([str(rows[name]) for name in task.states])


def alike(classes: Sequence[object]) -> set[frozenset[int]]:
    """Sets of states of the same class."""
    members: dict[object, list[int]] = {}
    for s, each in enumerate(classes):
        members.setdefault(each, []).append(s)
    return set(map(frozenset, members.values()))


@pytest.mark.parametrize("format", formats.FORMATS)
def test_an_imported_task_hides_what_the_task_hides(format: str, tmp_path: Path) -> None:
    """The best return of a policy of the last observation alone, which is not that of one that sees the state."""
    chosen = formats.FORMATS[format]
    task = load(str(spec(tmp_path, HIDDEN)))
    path = tmp_path / f"x{chosen.suffix}"
    path.write_bytes(formats.written(formats.exported(task, chosen)[1], chosen))
    again = Results(task_of_tables(imported(str(path))), 1)
    assert again.optimal.value == pytest.approx(1)  # type: ignore[union-attr]
    for best in (best_observing(again, "memoryless"), best_observing(Results(task, 1), "memoryless")):
        assert best.low == pytest.approx(0) == best.high


HIDDEN = """\
taskspec: 1
name: Hidden
state: {s: {type: choice, values: [start, left, right, over]}}
action: {a: {type: choice, values: [to_left, to_right]}}
observation: {o: "s in {left, right}"}
horizon: 3
initial: {s: start}
dynamics: {s': {by: s, rows: {start: {left: 1/2, right: 1/2}, else: over}}}
reward: {by: [s, a], rows: {left: {to_left: 1, else: -1}, right: {to_right: 1, else: -1}, else: 0}}
"""


def test_a_name_that_means_something_else_is_changed_alone(tmp_path: Path) -> None:
    """An action `a` is no reason to rename the others."""
    names = ["a", "left", "go right", "go_right", "7", "lambda", ""]
    path = tmp_path / "names.umb"
    path.write_bytes(model([[(name, float(i), {1: 1.0}) for i, name in enumerate(names)], [("a", 0.0, {1: 1.0})]]))
    task = imported(str(path))
    assert task.actions == ("a_", "left", "go_right", "go_right_3", "a7", "lambda_", "a6")
    (remark,) = task.remarks
    assert (
        remark == "renamed: 'a' -> a_, 'go right' -> go_right, 'go_right' -> go_right_3, 'lambda' -> lambda_, '' -> a6"
    )
    assert Results(task_of_tables(task), 1).optimal.value == 6  # type: ignore[union-attr]


def test_rewards_that_are_drawn_become_their_mean(tmp_path: Path) -> None:
    path = tmp_path / "drawn.json"
    path.write_text(json.dumps({"P": {0: {0: [[0.25, 0, 4, True], [0.75, 0, 0, True]]}}, "version": 2, "horizon": 3}))
    task = imported(str(path))
    assert task.claims["optimal_return"] == 1
    assert task.remarks == ("lost: version", "rewards that are drawn: their mean, for each next state")


def test_ten_thousand_rows_of_which_all_differ(tmp_path: Path) -> None:
    """States that are entered with and without an end get a copy, so that ends depend on the next state."""
    rng = np.random.default_rng(0)
    shape = (2500, 4, 4)
    to = rng.integers(0, 2500, shape)
    reward = rng.integers(0, 3, shape).astype(float)
    ends = rng.random(shape) < 0.01
    P: dict[int, dict[int, list[Any]]] = {}
    for s, a in np.ndindex(2500, 4):
        outcomes = zip([0.25] * 4, to[s, a].tolist(), reward[s, a].tolist(), ends[s, a].tolist(), strict=True)
        P.setdefault(s, {})[a] = list(outcomes)
    path = tmp_path / "many.json"
    path.write_text(json.dumps({"P": P, "horizon": 3}))
    found = imported(str(path))
    assert len(found.outcomes) * len(found.actions) > 10_000
    V = np.zeros(2500)
    for _ in range(3):
        Q = (reward + np.where(ends, 0, V[to])).mean(axis=2)
        V = Q.max(axis=1)
    assert found.claims["optimal_return"] == pytest.approx(V[0])
    assert len(spec_text(found).splitlines()) > 2500
