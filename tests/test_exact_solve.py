"""Exact models and planning against independent witnesses: enumeration, linear programming, the reference interpreter."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec import source
from taskspec.exact import extract
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.model import Model
from taskspec.exact.planning import maxent, plans, solve
from taskspec.exact.scoring.returns import Results, simulate
from taskspec.exact.simulation.rollout import at_random
from taskspec.lang.evaluate import evaluate
from taskspec.lang.ir import Draw, Role
from taskspec.task.build import build
from taskspec.task.task import Task

ROOT = Path(__file__).parents[1]
Array = np.ndarray[Any, Any]


def shipped(name: str, variant: str | None = None, **parameters: Any) -> Task:
    return build(source.read(ROOT / "tasks" / "derail" / f"{name}.yaml"), variant, parameters, "derail")


def model_of(task: Task) -> Model:
    found = abstraction(task)
    return extract(task if found is None else found.stand_in)


# -- anchors --------------------------------------------------------------------------------------

ANCHORS = [
    ("risky_path", None, 4, -122.21875),
    ("risky_path", "seals", 3, -97.9375),
    ("early_term", "EarlyTermPos", 10, 3.875),
    ("early_term", "EarlyTermNeg", -2, -3.875),
    ("branching", None, 1, 2**-10),
    ("branching", "seals", 1, 2**-10),
    ("init_shift", "InitShiftExpert", 2, 0.25),
    ("init_shift", "InitShiftLearner", 2, 0),
    ("init_shift", "InitShiftExpertSeals", 2, 0.25),
    ("init_shift", "InitShiftLearnerSeals", 2, 0),
    ("noisy_obs", None, 12, 0.362645504),
    ("sort", None, 10 + 1 / 24, 1 / 3),
    ("proc_goal", None, -45, -318.59716004262515),
]


@pytest.mark.parametrize(("name", "variant", "optimal", "random"), ANCHORS)
def test_anchors(name: str, variant: str | None, optimal: float, random: float) -> None:
    model = model_of(shipped(name, variant))
    assert solve.optimal_return(model) == pytest.approx(optimal, abs=1e-9)
    assert solve.random_return(model) == pytest.approx(random, abs=1e-9)


# -- small random tasks ---------------------------------------------------------------------------

RANDOM = """
taskspec: 1
name: Small
constants:
  P: {P}
  R: {R}
state:
  s: {{type: int, low: 0, high: {S} - 1}}
action:
  a: {{type: int, low: 0, high: {A} - 1}}
horizon: {H}
discount: {discount}
initial:
  s: Categorical({start})
dynamics:
  s': Categorical(P[s, a])
reward: R[s, a][s']
terminal: s' == {last}
"""


class Small:
    """A random MDP with R(s, a, s') whose last state is terminal, as dense arrays and as a spec."""

    def __init__(self, seed: int, states: int = 3, actions: int = 2, horizon: Any = 3, discount: float = 1.0) -> None:
        rng = np.random.default_rng(seed)
        weights = rng.integers(0, 4, (states, actions, states)) + np.eye(states, dtype=int)[:, None, :]
        self.p = weights / weights.sum(axis=-1, keepdims=True)
        self.r = rng.integers(-5, 6, (states, actions, states)).astype(float)
        start = rng.integers(1, 4, states)
        start[-1] = 0
        self.start = start / start.sum()
        self.horizon, self.discount, self.states, self.actions = horizon, discount, states, actions
        text = RANDOM.format(
            P=self.p.tolist(), R=self.r.tolist(), S=states, A=actions, H=horizon, discount=discount,
            start=self.start.tolist(), last=states - 1,
        )  # fmt: skip
        self.task = build(source.read_text(text, "small.yaml"))
        self.model = extract(self.task)

    def going(self, s: int) -> bool:
        return s != self.states - 1

    def trajectories(
        self, t: int = 0, s: int | None = None
    ) -> Iterator[tuple[float, tuple[tuple[int, int], ...], float]]:
        """Probability of the outcomes, the (state, action) pairs, and the return, of every episode."""
        if s is None:
            for first in range(self.states):
                for p, pairs, total in self.trajectories(0, first):
                    yield self.start[first] * p, pairs, total
            return
        if t == self.horizon:
            yield 1.0, (), 0.0
            return
        for a in range(self.actions):
            for s2 in range(self.states):
                p, r = self.p[s, a, s2], self.r[s, a, s2]
                rest = self.trajectories(t + 1, s2) if self.going(s2) else [(1.0, (), 0.0)]
                for q, pairs, total in rest if p > 0 else ():
                    yield p * q, ((s, a), *pairs), r + self.discount * total

    def value(self, policy: Any) -> float:
        """The expected return of `policy(t, s) -> probabilities`, by plain recursion."""

        def at(t: int, s: int) -> float:
            if t == self.horizon:
                return 0.0
            total = 0.0
            for a, pi in enumerate(policy(t, s)):
                for s2 in range(self.states):
                    after = self.discount * at(t + 1, s2) if self.going(s2) else 0.0
                    total += pi * self.p[s, a, s2] * (self.r[s, a, s2] + after)
            return total

        return sum(self.start[s] * at(0, s) for s in range(self.states))


@pytest.mark.parametrize("seed", range(4))
def test_the_best_and_the_worst_of_all_policies(seed: int) -> None:
    small = Small(seed, horizon=3, discount=0.9)
    free = [(t, s) for t in range(3) for s in range(2)]  # the terminal state is never acted in
    values = []
    for choice in itertools.product(range(2), repeat=len(free)):
        table = dict(zip(free, choice, strict=True))
        values.append(small.value(lambda t, s, table=table: np.eye(2)[table.get((t, s), 0)]))
    assert solve.optimal_return(small.model) == pytest.approx(max(values), abs=1e-12)
    assert solve.worst_return(small.model) == pytest.approx(min(values), abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_given_policy_by_recursion(seed: int) -> None:
    small = Small(seed, states=4, actions=3, horizon=3)
    tables = np.random.default_rng(seed).dirichlet(np.ones(3), (3, 4))  # (t, s, a)
    value = solve.policy_return(small.model, lambda t: tables[t].T)
    assert value == pytest.approx(small.value(lambda t, s: tables[t, s]), abs=1e-12)
    uniform = small.value(lambda t, s: np.full(3, 1 / 3))
    assert solve.random_return(small.model) == pytest.approx(uniform, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("beta", [0.3, 2.0])
def test_non_causal_maximum_entropy_by_enumerating_trajectories(seed: int, beta: float) -> None:
    small = Small(seed, horizon=3)
    weight = np.zeros((small.horizon, small.actions, small.states))
    for p, pairs, total in small.trajectories():
        for t, (s, a) in enumerate(pairs):
            weight[t, a, s] += p * np.exp(beta * total)
    plan = plans.maxent_plan(small.model, beta)
    for t in range(small.horizon):
        seen = weight[t].sum(axis=0) > 0
        expected = weight[t][:, seen] / weight[t][:, seen].sum(axis=0)
        np.testing.assert_allclose(plan(t)[:, seen], expected, atol=1e-12)


@pytest.mark.parametrize("beta", [0.3, 2.0])
def test_causal_maximum_entropy_is_the_best_trade_of_return_and_entropy(beta: float) -> None:
    small, rng = Small(0, horizon=3), np.random.default_rng(0)
    plan = plans.soft_plan(small.model, beta)
    best = with_entropy(small, np.array([plan(t) for t in range(3)]), beta)
    assert solve.solve(small.model, solve.soft(beta)).expected == pytest.approx(best, abs=1e-12)
    for _ in range(50):
        other = rng.dirichlet(np.ones(2), (3, 3)).transpose(0, 2, 1)
        mixed = 0.9 * np.array([plan(t) for t in range(3)]) + 0.1 * other
        assert with_entropy(small, mixed, beta) <= best


def with_entropy(small: Small, policy: Array, beta: float) -> float:
    """The expected return plus entropy / beta of a policy (T, A, S), by plain recursion."""

    def at(t: int, s: int) -> float:
        if t == small.horizon:
            return 0.0
        total = 0.0
        for a, pi in enumerate(policy[t][:, s]):
            total -= pi * np.log(pi) / beta
            for s2 in range(small.states):
                after = at(t + 1, s2) if small.going(s2) else 0.0
                total += pi * small.p[s, a, s2] * (small.r[s, a, s2] + after)
        return float(total)

    return float(sum(small.start[s] * at(0, s) for s in range(small.states)))


@pytest.mark.parametrize("seed", range(3))
def test_occupancy_and_visits_by_enumerating_trajectories(seed: int) -> None:
    small = Small(seed, horizon=3)
    uniform = plans.uniform_plan(small.model)
    acted, visited = np.zeros(small.states), 0.0
    for p, pairs, _ in small.trajectories():
        weight = p * small.actions ** -len(pairs)
        for s, _ in pairs:
            acted[s] += weight
        visited += weight * any(s == 1 for s, _ in pairs)
    np.testing.assert_allclose(solve.occupancy(small.model, uniform), acted, atol=1e-12)
    found = solve.visit_probability(small.model, uniform, np.arange(small.states) == 1)
    last = sum(p * small.actions**-3 for p in _ends_in_one(small))
    assert found == pytest.approx(visited + last, abs=1e-12)


def _ends_in_one(small: Small) -> Iterator[float]:
    """Probabilities of full-length paths whose last state alone is state 1."""

    def walk(t: int, s: int, p: float) -> Iterator[float]:
        if t == small.horizon:
            if s == 1:
                yield p
            return
        if s == 1 or not small.going(s):
            return
        for a in range(small.actions):
            for s2 in range(small.states):
                yield from walk(t + 1, s2, p * small.p[s, a, s2])

    for s in range(small.states):
        yield from walk(0, s, small.start[s])


@pytest.mark.parametrize("seed", range(4))
def test_without_a_horizon_by_linear_programming(seed: int) -> None:
    from scipy.optimize import linprog

    small = Small(seed, states=5, actions=3, horizon="none", discount=0.9)
    live = np.array([small.going(s) for s in range(5)])
    r = (small.p * small.r).sum(axis=-1)  # (s, a)
    rows = [np.eye(5)[s] - 0.9 * small.p[s, a] * live for s in range(5) for a in range(3)]
    found = linprog(np.ones(5), A_ub=-np.array(rows), b_ub=-r.reshape(-1), bounds=[(None, None)] * 5)
    assert solve.solve(small.model).value[live] == pytest.approx(found.x[live], abs=1e-7)


def test_finite_horizon_by_linear_programming() -> None:
    from scipy.optimize import linprog

    model = model_of(shipped("noisy_obs"))
    n, horizon = model.n_states, 15
    size = n * horizon
    rows, bounds = [], []
    for t in range(horizon):
        dense = model.step(t).going.toarray()
        for row in range(model.n_actions * n):
            line = np.zeros(size)
            line[t * n + row % n] -= 1
            if t + 1 < horizon:
                line[(t + 1) * n : (t + 2) * n] += dense[row]
            rows.append(line)
            bounds.append(-model.step(t).reward[row])
    found = linprog(np.ones(size), A_ub=np.array(rows), b_ub=bounds, bounds=[(None, None)] * size)
    assert model.start @ found.x[:n] == pytest.approx(solve.optimal_return(model), abs=1e-7)


# -- extraction against the reference interpreter -------------------------------------------------


def outcomes(task: Task, reads: dict[Any, Any]) -> dict[tuple[Any, ...], float]:
    """Every outcome of a step with its probability: the reference interpreter, each draw tried in every way."""
    total: dict[tuple[Any, ...], float] = {}
    roots = (*task.next, task.reward, task.terminal)

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
        p = float(np.prod([float(w) for w in weights])) if weights else 1.0
        key = tuple(float(x) for v in values for x in v)
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
            return [((i,), Fraction(1, args[0][0])) for i in range(args[0][0])]
        case "bernoulli":
            return [((False,), 1 - args[0][0]), ((True,), args[0][0])]
        case _:
            raise AssertionError(draw.base)


def spec(name: str) -> Task:
    return build(source.read(ROOT / "tests" / "specs" / f"{name}.yaml"))


CHECKED = [
    shipped("risky_path"), shipped("branching"), shipped("noisy_obs"), shipped("early_term", "EarlyTermPos"),
    spec("frozen_lake"), spec("umbrella"), spec("cliff_world"), spec("deep_sea"), Small(1).task,
]  # fmt: skip


@pytest.mark.parametrize("task", CHECKED, ids=lambda t: t.name)
def test_every_row_equals_the_reference_interpreter(task: Task) -> None:
    model = extract(task)
    for t in {0, len(model.steps) - 1}:
        step = model.step(t)
        going = step.going.toarray()
        ending = np.zeros_like(going) if step.ending is None else step.ending.toarray()
        for a, s in itertools.product(range(model.n_actions), range(model.n_states)):
            expected = outcomes(task, _reads(model, s, a, t))
            row = a * model.n_states + s
            want_going, want_ending, want_reward = np.zeros(model.n_states), np.zeros(model.n_states), 0.0
            for key, p in expected.items():
                code, outside = model.states.encode([np.array([v]) for v in key[:-2]], 1)
                assert outside is None
                (want_ending if key[-1] else want_going)[code[0]] += p
                want_reward += p * key[-2]
            np.testing.assert_allclose(going[row], want_going, atol=1e-12)
            np.testing.assert_allclose(ending[row], want_ending, atol=1e-12)
            assert step.reward[row] == pytest.approx(want_reward, abs=1e-9)


def _reads(model: Model, s: int, a: int, t: int) -> dict[Any, Any]:
    found = model.states.decode(model.codes[s : s + 1]) | model.actions.decode(np.array([a]))
    return {k: tuple(v.reshape(-1).tolist()) for k, v in found.items()} | {(Role.TIME, "t"): (t,)}


@pytest.mark.parametrize("task", CHECKED, ids=lambda t: t.name)
def test_reachable_and_whole_models_agree(task: Task) -> None:
    whole, reached = extract(task, reachable=False), extract(task, reachable=True)
    assert reached.n_states == int(whole.entered.sum())
    assert list(whole.codes[whole.entered]) == list(reached.codes)
    for rule in (solve.best, solve.worst):
        assert solve.solve(whole, rule).expected == pytest.approx(solve.solve(reached, rule).expected, abs=1e-12)
    for step in whole.steps:
        mass = np.asarray(step.going.sum(axis=1)).reshape(-1)
        mass += 0 if step.ending is None else np.asarray(step.ending.sum(axis=1)).reshape(-1)
        np.testing.assert_allclose(mass, 1, atol=1e-12)


def test_names_both_ways() -> None:
    model = extract(shipped("risky_path"))
    for i in range(model.n_states):
        assert model.state_index(model.state(i)) == i
    assert model.state_name(3) == "s = trap"
    assert [model.action_name(a) for a in range(2)] == ["a = safe", "a = risky"]
    with pytest.raises(KeyError):
        extract(shipped("branching")).state_index({"s": 21})


def test_rewards_by_next_state() -> None:
    small = Small(3)
    matrix = maxent.reward_matrix(small.model).toarray().reshape(small.actions, small.states, small.states)
    expected = np.where(small.p > 0, small.r, 0).transpose(1, 0, 2)
    np.testing.assert_allclose(matrix, expected)


def test_size_is_bounded_before_memory_is_spent() -> None:
    from taskspec.diagnostics import SpecError

    with pytest.raises(SpecError, match="E712"):
        extract(shipped("branching", L=1000, B=100), limit=10_000)
    with pytest.raises(SpecError, match="'s' has infinitely many values"):
        extract(shipped("largest_sum"))


# -- Monte Carlo ----------------------------------------------------------------------------------

EVERY = [
    ("risky_path", None), ("early_term", "EarlyTermPos"), ("early_term", "EarlyTermNeg"), ("branching", None),
    ("init_shift", "InitShiftExpert"), ("init_shift", "InitShiftLearner"), ("noisy_obs", None), ("sort", None),
    ("proc_goal", None), ("proc_goal", "seals"), ("sort", "seals"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_random_returns_by_simulation(name: str, variant: str | None) -> None:
    task = shipped(name, variant)
    returns = simulate(task, at_random(task), episodes=4000, seed=7)
    error = returns.std(ddof=1) / np.sqrt(len(returns))
    assert abs(returns.mean() - solve.random_return(model_of(task))) <= 5 * error + 1e-9


@pytest.mark.parametrize(("name", "variant"), EVERY)
def test_experts_by_simulation(name: str, variant: str | None) -> None:
    from taskspec.exact.simulation.rollout import by_expert

    task = shipped(name, variant)
    results = Results(task)
    assert results.expert is not None
    returns = simulate(task, by_expert(task), episodes=2000, seed=3)
    error = returns.std(ddof=1) / np.sqrt(len(returns))
    assert abs(returns.mean() - results.expert.value) <= 5 * error + 1e-9


@pytest.mark.parametrize("name", ["umbrella", "frozen_lake", "queue", "contextual_bandit", "random_mdp", "taxi"])
def test_other_specs_by_simulation(name: str) -> None:
    task = spec(name)
    returns = simulate(task, at_random(task), episodes=3000, seed=1)
    error = returns.std(ddof=1) / np.sqrt(len(returns))
    assert abs(returns.mean() - solve.random_return(extract(task))) <= 5 * error + 1e-9
