"""The exact model: its rows beside the reference interpreter, its names, its size."""

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.exact import check, extract
from taskspec.exact.model.extract import lasting, visits
from taskspec.exact.model.model import NEVER, Model
from taskspec.exact.model.transitions import Steps
from taskspec.exact.solve import solve
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Draw
from taskspec.language.expressions.types import Role
from taskspec.language.task.task import Task
from tests.shared.sections import build_text, text
from tests.shared.solved import worst
from tests.shared.tasks import ROAD, Small, shipped, spec


def outcomes(task: Task, reads: dict[Any, Any]) -> dict[tuple[Any, ...], float]:
    """Every outcome of a step with its probability: the reference interpreter, each draw tried in every way."""
    total: dict[tuple[Any, ...], float] = {}
    roots = (*task.process.next, task.process.reward, task.process.terminal)

    def explore(chosen: list[int]) -> None:
        weights: list[float] = []
        sizes: list[int] = []

        def sample(draw: Draw, args: list[Any]) -> tuple[Any, ...]:
            table = table_of(draw, args)
            i = chosen[len(sizes)] if len(sizes) < len(chosen) else 0
            sizes.append(len(table))
            weights.append(table[i][1])
            return table[i][0]

        values = evaluate(roots, reads, sample)
        if len(sizes) > len(chosen):
            for i in range(sizes[len(chosen)]):
                explore([*chosen, i])
            return
        p = math.prod(map(float, weights))
        key = tuple(map(float, itertools.chain(*values)))
        if p:
            total[key] = total.get(key, 0.0) + p

    explore([])
    return total


def table_of(draw: Draw, args: list[Any]) -> list[tuple[tuple[Any, ...], Any]]:
    assert draw.type.is_scalar
    match draw.base:
        case "categorical":
            return [((i,), p) for i, p in enumerate(args[0])]
        case "index":
            count = args[0][0]
            return [((i,), Fraction(1, count)) for i in range(count)]
        case "bernoulli":
            return [((False,), 1 - args[0][0]), ((True,), args[0][0])]
        case _:
            raise AssertionError(draw.base)


CHECKED = [
    shipped("risky_path"), shipped("branching"), shipped("noisy_obs"), shipped("early_term", "EarlyTermPos"),
    spec("frozen_lake"), spec("umbrella"), shipped("cliff_world", suite="seals"), spec("deep_sea"), Small(1).task,
]  # fmt: skip


@pytest.mark.parametrize("task", CHECKED, ids=lambda t: t.name)
def test_every_row_equals_the_reference_interpreter(task: Task) -> None:
    model = extract(task)
    for t in {0, len(model.steps) - 1}:
        step = model.step(t)
        going = step.P.toarray()
        ending = np.zeros_like(going) if step.P_end is None else step.P_end.toarray()
        for a, s in itertools.product(range(model.n_actions), range(model.n_states)):
            expected = outcomes(task, _reads(model, s, a, t))
            row = a * model.n_states + s
            want_going = np.zeros(model.n_states)
            want_ending = np.zeros(model.n_states)
            want_reward = 0.0
            for key, p in expected.items():
                code, outside = model.states.encode(list(np.array(key[:-2])[:, None]), 1)
                assert outside is None
                (want_ending if key[-1] else want_going)[code[0]] += p
                want_reward += p * key[-2]
            np.testing.assert_allclose(going[row], want_going, atol=1e-12)
            np.testing.assert_allclose(ending[row], want_ending, atol=1e-12)
            assert step.R[row] == pytest.approx(want_reward, abs=1e-9)


def _reads(model: Model, s: int, a: int, t: int) -> dict[Any, Any]:
    found = model.states.decode(model.codes[s : s + 1]) | model.actions.decode(np.array([a]))
    return {k: tuple(v.reshape(-1).tolist()) for k, v in found.items()} | {(Role.TIME, "t"): (t,)}


def _first_times(model: Model) -> list[int]:
    """By sets of states, one for each time."""
    found = [NEVER] * model.n_states
    level = set(np.flatnonzero(model.start).tolist())
    for t in range(model.horizon or model.n_states):
        for s in level:
            found[s] = min(found[s], t)
        P = model.step(t).P.tocoo()
        acted = np.isin(P.row % model.n_states, sorted(level)) & (P.data > 0)
        level = set(P.col[acted].tolist())
    return found


@pytest.mark.parametrize("task", CHECKED, ids=lambda t: t.name)
def test_reachable_and_whole_models_agree(task: Task) -> None:
    whole = extract(task, reachable=False)
    reached = extract(task, reachable=True)
    assert reached.n_states == int(whole.entered.sum())
    assert list(whole.codes[whole.entered]) == list(reached.codes)
    assert whole.first_times.tolist() == _first_times(whole)
    for rule in (solve.best, worst):
        assert whole.start @ rule(whole).value == pytest.approx(reached.start @ rule(reached).value, abs=1e-12)
    for step in whole.steps:
        mass = np.asarray(step.P.sum(axis=1)).reshape(-1)
        mass += 0 if step.P_end is None else np.asarray(step.P_end.sum(axis=1)).reshape(-1)
        np.testing.assert_allclose(mass, 1, atol=1e-12)


def test_a_cell_of_one_value_is_certain_beside_cells_that_are_drawn() -> None:
    table = "{by: s, rows: {0: {0: 1/4, 9: 3/4}, 9: 9, else: 0}}"
    step = extract(build_text(text(dynamics=f'{{"s\'": {table}}}')), reachable=False).step(0)
    mass = step.P.toarray()[:10]
    assert mass.sum(axis=1).tolist() == [1.0] * 10
    assert mass[0, [0, 9]].tolist() == [0.25, 0.75]
    assert mass[1:9, 0].tolist() == [1.0] * 8


def test_names_both_ways() -> None:
    model = extract(shipped("risky_path"))
    for i in range(model.n_states):
        assert model.state_index(model.state(i)) == i
    assert model.state_name(3) == "s = trap"
    assert (model.action_name(0), model.action_name(1)) == ("a = safe", "a = risky")
    with pytest.raises(KeyError):
        extract(shipped("branching")).state_index({"s": 21})


def test_size_is_bounded_before_memory_is_spent() -> None:
    with pytest.raises(SpecError, match="E712"):
        extract(shipped("branching", L=1000, B=100), limit=10_000)
    with pytest.raises(SpecError, match="'s' has infinitely many values"):
        extract(shipped("largest_sum"))


def test_a_step_may_have_as_many_outcomes_as_the_limit_says(set_limits: Callable[..., None]) -> None:
    task = build_text(text(dynamics='{"s\'": "UniformInt(0, 9)"}'))
    set_limits(outcomes=10)
    assert len(extract(task).step(0).P.data) > 0
    set_limits(outcomes=9)
    with pytest.raises(SpecError, match="up to 10 outcomes; the limit is 9"):
        extract(task)


def test_what_reads_the_time_in_vain_is_kept_once() -> None:
    model = extract(build_text(text(reward='"0 * t"')))
    assert not model.is_timed and model.horizon is not None and model.horizon > 1


def test_what_is_left_over_is_the_float_nearest_to_it() -> None:
    task = build_text(text(dynamics='{"s\'": "0 if Bernoulli(1/3) else 1"}'))
    assert set(extract(task).step(0).P.data) == {float(Fraction(1, 3)), float(Fraction(2, 3))}
    assert float(Fraction(2, 3)) != 1 - 1 / 3


CORRIDOR = """
state: {k: {type: int, low: 0, high: 20000}}
action: {a: {type: int, low: 0, high: 0}}
horizon: none
discount: 1/2
initial: {k: 0}
dynamics: {k': "min(k + 1, 20000)"}
reward: 0
"""


def test_a_search_that_finds_one_state_after_another_keeps_to_its_time(set_limits: Callable[..., None]) -> None:
    """However little each state takes, twenty thousand levels take seconds."""
    set_limits(seconds=1)
    with pytest.raises(SpecError, match=r"E712.*find no new state take more than 1 "):
        visits(Steps(build_text(CORRIDOR)), 10**6)


def test_a_search_counts_the_outcomes_of_draws(set_limits: Callable[..., None]) -> None:
    """Each of a million states leads to a thousand others: a billion outcomes take minutes."""
    text = CORRIDOR.replace("20000}}", "9999999}}").replace("action:", "noise: {next: 'UniformInt(0, 999)'}\naction:")
    text = text.replace('"min(k + 1, 20000)"', '"(1000 * k + next) % 10000000"')
    set_limits(seconds=1)
    with pytest.raises(SpecError, match=r"E712.*find no new state take more than 1 "):
        visits(Steps(build_text(text)))


def test_states_that_only_longer_episodes_enter_are_there_where_values_depend_on_them() -> None:
    """500 steps along a road of 20,000 places."""
    task = build_text(ROAD)
    model = extract(task)
    assert (model.n_states, model.is_closed) == (501, False)
    assert lasting(model).n_states == 20_000
    assert check(task).diagnostics == ()
