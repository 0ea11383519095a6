"""Exact results with legal actions, against backward induction over legal actions written out here."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

import taskspec
from taskspec.exact import difficulty, scores
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.backward import Boltzmann, Uniform
from taskspec.exact.solve.constrained import constrained_optimum, pareto_front
from taskspec.exact.solve.plans import MaxEnt
from taskspec.language.modifiers import modify
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from tests.shared.sections import build_text

SPEC = """
state: {s: {type: int, low: 0, high: 4}}
action: {a: {type: int, low: 0, high: 3}}
definitions: {fits: (s + a) % 3 != 1 and (s != 4 or a == 1)}
legal: fits
noise: {slip: Bernoulli(1/4)}
horizon: HORIZON
discount: 9/10
initial: {s: {0: 1/2, 1: 1/2}}
dynamics: {s': "(2 * s + a + slip) % 5"}
reward: (s + 1) * a % 4 - 2 * slip + (0 if fits else BONUS)
measures: {illegal: not fits}
terminal: s' == 3 and slip
expert: {a: "2 if s == 0 else 1 if s in {1, 4} else 0"}
"""
STATES = range(5)
ACTIONS = range(4)
GAMMA = 0.9
START = {0: 0.5, 1: 0.5}
EXPERT = {0: 2, 1: 1, 2: 0, 3: 0, 4: 1}
Choose = Callable[[int, dict[int, float]], float]


def is_legal(s: int, a: int) -> bool:
    return (s + a) % 3 != 1 and (s != 4 or a == 1)


def outcomes(s: int, a: int, bonus: float) -> list[tuple[float, int, float, bool]]:
    """Probability, next state, reward and end."""
    found = []
    for p, slip in ((0.75, 0), (0.25, 1)):
        after = (2 * s + a + slip) % 5
        reward = (s + 1) * a % 4 - 2 * slip + (0 if is_legal(s, a) else bonus)
        found.append((p, after, reward, after == 3 and slip == 1))
    return found


LEGAL = {s: [a for a in ACTIONS if is_legal(s, a)] for s in STATES}


def backed_up(s: int, a: int, bonus: float, V: Mapping[int, float]) -> float:
    """The expected reward of an action, and the value after it."""
    total = 0.0
    for p, after, reward, end in outcomes(s, a, bonus):
        total += p * reward
        if not end:
            total += p * GAMMA * V[after]
    return total


def at_start(V: Mapping[int, float]) -> float:
    return sum(p * V[s] for s, p in START.items())


def value(horizon: int, bonus: float, choose: Choose, actions: Mapping[int, Sequence[int]] = LEGAL) -> float:
    """The value of the start, where `choose` gives the value of a state from those of some actions."""
    V = dict.fromkeys(STATES, 0.0)
    for _ in range(horizon):
        before = {}
        for s in STATES:
            before[s] = choose(s, {a: backed_up(s, a, bonus, V) for a in actions[s]})
        V = before
    return at_start(V)


CHOICES: dict[str, Choose] = {
    "optimal": lambda s, Q: max(Q.values()),
    "worst": lambda s, Q: min(Q.values()),
    "random": lambda s, Q: sum(Q.values()) / len(Q),
    "expert": lambda s, Q: Q[EXPERT[s]],
}


def ring(horizon: int | str, bonus: float) -> Task:
    return build_text(SPEC.replace("HORIZON", str(horizon)).replace("BONUS", str(bonus)))


@pytest.mark.parametrize("bonus", [-50, 50])
@pytest.mark.parametrize("horizon", [1, 4, 60, "none"])
@pytest.mark.parametrize("which", CHOICES)
def test_returns(horizon: int | str, bonus: float, which: str) -> None:
    results = Results(ring(horizon, bonus))
    steps = 400 if horizon == "none" else int(horizon)
    expected = value(steps, bonus, CHOICES[which])
    found = getattr(results, which)
    assert found.exact
    assert found.value == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert abs(found.value - expected) <= found.bound + 1e-12
    for name in ("optimal", "worst", "random", "expert"):
        assert results.measures["illegal"][name].value == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("bonus", [-50, 50])
def test_soft_policies(bonus: float) -> None:
    """Values of the soft policy by its recursion; the expected return by following its probabilities."""
    task = ring(4, bonus)
    results = Results(task)
    V = dict.fromkeys(STATES, 0.0)
    followed = dict.fromkeys(STATES, 0.0)
    for _ in range(4):
        soft = {}
        gained = {}
        for s in STATES:
            q = np.array([backed_up(s, a, bonus, V) for a in LEGAL[s]])
            returns = np.array([backed_up(s, a, bonus, followed) for a in LEGAL[s]])
            weights = np.exp(2 * q)
            soft[s] = math.log(weights.sum()) / 2
            gained[s] = weights @ returns / weights.sum()
        V = soft
        followed = gained
    expected = at_start(followed)
    assert results.solvers.of(Boltzmann(2.0)).value(Boltzmann(2.0)).value == pytest.approx(expected, rel=1e-12)
    model = results.model
    assert model is not None
    for rule in (Boltzmann(2.0), MaxEnt(1.0), Uniform()):
        for _, policy in results.solvers.in_floats.policies(rule):
            table = np.asarray(policy.table)
            assert table.sum(axis=0) == pytest.approx(1)
            for s in STATES:
                assert np.flatnonzero(table[:, s]).tolist() == LEGAL[s]


@pytest.mark.parametrize("bonus", [-50, 50])
@pytest.mark.parametrize("horizon", [3, "none"])
def test_linear_programs_keep_to_legal_actions(horizon: int | str, bonus: float) -> None:
    """Where nothing is illegal, a limit on the measure of it gives the same optimum."""
    task = ring(horizon, bonus)
    free = with_all_actions(task)
    best = Results(task).optimal
    assert best is not None
    limited = constrained_optimum(free, ["illegal<=0"])
    assert limited.value == pytest.approx(best.value, abs=1e-6)
    assert constrained_optimum(task, ["illegal<=5"]).value == pytest.approx(best.value, abs=1e-6)
    (point,) = pareto_front(task, "illegal")
    assert point.measures["illegal"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("modifier", ["permuted_actions", "permuted_actions=3,per_state=true", "absorbing"])
def test_modifiers_keep_returns(modifier: str) -> None:
    task = ring(5, 50)
    changed = modify(task, modifier)
    for name in ("optimal", "random", "worst"):
        before = getattr(Results(task), name).value
        assert getattr(Results(changed), name).value == pytest.approx(before)
    env = taskspec.make(changed)
    _, info = env.reset(seed=0)
    assert sum(info["action_mask"]) == len(LEGAL[env.state["s"]])


def test_absorbed_states_allow_all_actions() -> None:
    env = taskspec.make(ring(30, 0), ending="absorb")
    env.reset(seed=0)
    env.action_space.seed(0)
    over = False
    while not over:
        *_, over, info = env.step(env.action_space.sample())
    assert env.state["absorbed"] and info["action_mask"].tolist() == [1, 1, 1, 1]


def test_what_plays_illegal_actions_has_the_effect_of_the_equations() -> None:
    task = ring(4, 50)
    found = taskspec.exact.score(task, np.ones(5, int))
    assert found.value.value == pytest.approx(value(4, 50, lambda s, Q: Q[1], dict.fromkeys(STATES, ACTIONS)))


def test_measures_of_difficulty_are_those_of_legal_actions() -> None:
    """Random actions of the task are those of one without illegal actions whose other actions do what a legal one does."""
    task = ring(4, 50)
    found = difficulty(task)
    chance = value(4, 50, CHOICES["random"])
    assert scores(task).random.value == pytest.approx(chance)
    lengths = dict.fromkeys(STATES, 0.0)
    for _ in range(4):
        longer = {}
        for s in STATES:
            longer[s] = 1.0
            for a in LEGAL[s]:
                for p, after, _, end in outcomes(s, a, 0):
                    if not end:
                        longer[s] += p * lengths[after] / len(LEGAL[s])
        lengths = longer
    assert found["random_length"] == pytest.approx(at_start(lengths))
    branches = []
    for s in STATES:
        nexts = set()
        for a in LEGAL[s]:
            nexts.update(after for _, after, _, _ in outcomes(s, a, 0))
        branches.append(len(nexts))
    assert found["branching"] == pytest.approx(np.mean(branches))
