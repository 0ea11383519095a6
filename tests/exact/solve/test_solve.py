"""Exact models and planning against independent witnesses: enumeration, linear programming, the reference interpreter."""

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from scipy import sparse

from taskspec.exact.model.probabilities import Reader
from taskspec.exact.solve import infinite_horizon, plans, solve
from taskspec.exact.solve.backward import Boltzmann, Given, action_values, backward, first_values
from taskspec.exact.solve.bounded import Bounded
from taskspec.exact.solve.rational import Rational
from tests.shared.solved import optimal_return, random_return
from tests.shared.tasks import Array, Small, model_of, shipped

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
    assert optimal_return(model) == pytest.approx(optimal, abs=1e-9)
    assert random_return(model) == pytest.approx(random, abs=1e-9)


def test_backward_induction_is_the_same_in_floats_with_bounds_and_in_rationals() -> None:
    model = model_of(shipped("branching", None))
    shape = (model.n_actions, model.n_states)

    def backup(t: int, value: Array) -> Array:
        step = model.step(t)
        return action_values(step.P, step.R.reshape(shape), model.discount, value)

    assert model.horizon is not None
    steps = list(backward(backup, lambda t, q: q.max(axis=0), np.zeros(model.n_states), model.horizon))
    assert [t for t, _, _ in steps] == list(range(model.horizon - 1, -1, -1))
    assert model.start @ first_values(steps) == 1
    for numbers in (Bounded(model), Rational(model, Reader())):
        found = backward(numbers.backup, lambda t, q, top=numbers.top: top(q), numbers.zero(), model.horizon)
        assert str(numbers.at_start(first_values(found))) == "1"


# -- small random tasks ---------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_the_best_and_the_worst_of_all_policies(seed: int) -> None:
    small = Small(seed, horizon=3, discount=0.9)
    free = list(itertools.product(range(3), range(2)))  # the terminal state is never acted in
    values = []
    for choice in itertools.product(range(2), repeat=len(free)):
        table = dict(zip(free, choice, strict=True))
        values.append(small.value(lambda t, s, table=table: np.eye(2)[table.get((t, s), 0)]))
    assert optimal_return(small.model) == pytest.approx(max(values), abs=1e-12)
    assert solve.Solvers(small.model).of().worst().value == pytest.approx(min(values), abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_given_policy_by_recursion(seed: int) -> None:
    small = Small(seed, states=4, actions=3, horizon=3)
    tables = np.random.default_rng(seed).dirichlet(np.ones(3), (3, 4))  # (t, s, a)
    value = solve.policy_return(small.model, lambda t: tables[t].T)
    assert value == pytest.approx(small.value(lambda t, s: tables[t, s]), abs=1e-12)
    uniform = small.value(lambda t, s: np.full(3, 1 / 3))
    assert random_return(small.model) == pytest.approx(uniform, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("beta", [0.3, 2.0])
def test_non_causal_maximum_entropy_by_enumerating_trajectories(seed: int, beta: float) -> None:
    small = Small(seed, horizon=3)
    weight = np.zeros((small.horizon, small.actions, small.states))
    for p, pairs, total in small.trajectories():
        for t, (s, a) in enumerate(pairs):
            weight[t, a, s] += p * np.exp(beta * total)
    plan = plans.tables(small.model, plans.MaxEnt(beta))
    for t in range(small.horizon):
        seen = weight[t].sum(axis=0) > 0
        expected = weight[t][:, seen] / weight[t][:, seen].sum(axis=0)
        np.testing.assert_allclose(plan(t)[:, seen], expected, atol=1e-12)


@pytest.mark.parametrize("beta", [0.3, 2.0])
def test_causal_maximum_entropy_is_the_best_trade_of_return_and_entropy(beta: float) -> None:
    small = Small(0, horizon=3)
    rng = np.random.default_rng(0)
    plan = plans.tables(small.model, Boltzmann(beta))
    policy = np.array([plan(t) for t in range(3)])
    best = with_entropy(small, policy, beta)
    value = first_values(Boltzmann(beta).plan(Bounded(small.model))).value
    assert small.model.start @ value == pytest.approx(best, abs=1e-12)
    for _ in range(50):
        other = rng.dirichlet(np.ones(2), (3, 3)).transpose(0, 2, 1)
        mixed = 0.9 * policy + 0.1 * other
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
    acted = np.zeros(small.states)
    visited = 0.0
    for p, pairs, _ in small.trajectories():
        weight = p * small.actions ** -len(pairs)
        for s, _ in pairs:
            acted[s] += weight
        visited += weight * any(s == 1 for s, _ in pairs)
    np.testing.assert_allclose(solve.occupancy(small.model, uniform), acted, atol=1e-12)
    found = solve.Solvers(small.model).in_floats.probability(Given(uniform), np.arange(small.states) == 1).value
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
@pytest.mark.parametrize("least", [0, infinite_horizon.COMPILED])
def test_without_a_horizon_by_linear_programming(monkeypatch: pytest.MonkeyPatch, seed: int, least: int) -> None:
    from scipy.optimize import linprog

    monkeypatch.setattr(infinite_horizon, "COMPILED", least)
    monkeypatch.setattr(infinite_horizon, "DIRECT", min(least, infinite_horizon.DIRECT))
    small = Small(seed, states=5, actions=3, horizon="none", discount=0.9)
    live = np.arange(5) < 4
    r = (small.p * small.r).sum(axis=-1)  # (s, a)
    rows = np.eye(5)[:, None, :] - 0.9 * small.p * live  # (s, a, s')
    found = linprog(np.ones(5), A_ub=-rows.reshape(15, 5), b_ub=-r.reshape(-1), bounds=[(None, None)] * 5)
    assert solve.best(small.model).value[live] == pytest.approx(found.x[live], abs=1e-7)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("direct", [0, infinite_horizon.DIRECT])
def test_states_that_lead_to_others_by_powers_of_the_matrix(
    monkeypatch: pytest.MonkeyPatch, seed: int, direct: int
) -> None:
    monkeypatch.setattr(infinite_horizon, "DIRECT", direct)
    states = 12
    rng = np.random.default_rng(seed)
    rows = sparse.csr_array(rng.random((2 * states, states)) < 0.06, dtype=np.float64)
    rows.data[::5] = 0  # entries that lead nowhere
    targets = rng.random(states) < 0.2
    steps = rows.toarray().reshape(2, states, states).sum(axis=0) > 0
    distance = np.where(targets, 0, states)
    for k in range(1, states):
        leads = (np.linalg.matrix_power(steps.astype(int), k) @ targets) > 0
        distance[leads] = np.minimum(distance[leads], k)
    order = infinite_horizon.nearest_first(rows, targets)
    assert sorted(order) == np.flatnonzero(distance < states).tolist()
    assert (np.diff(distance[order]) >= 0).all()
    assert infinite_horizon.leading_to(rows, targets).tolist() == (distance < states).tolist()


def test_finite_horizon_by_linear_programming() -> None:
    from scipy.optimize import linprog

    model = model_of(shipped("noisy_obs"))
    n = model.n_states
    horizon = 15
    size = n * horizon
    rows = []
    bounds = []
    for t in range(horizon):
        dense = model.step(t).P.toarray()
        for row in range(model.n_actions * n):
            line = np.zeros(size)
            line[t * n + row % n] -= 1
            if t + 1 < horizon:
                line[(t + 1) * n : (t + 2) * n] += dense[row]
            rows.append(line)
            bounds.append(-model.step(t).R[row])
    found = linprog(np.ones(size), A_ub=np.array(rows), b_ub=bounds, bounds=[(None, None)] * size)
    assert model.start @ found.x[:n] == pytest.approx(optimal_return(model), abs=1e-7)
