"""The distance of a learned reward to the true one, and what is lost by optimising it."""

from itertools import product
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exact import scores
from taskspec.exam import reward_distance
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.learn.exam.starc import RewardMdp

Array = np.ndarray[Any, Any]
MAZE = """
taskspec: 1
name: Maze
state: {s: {type: int, low: 0, high: 4}}
action: {a: {type: int, low: 0, high: 2}}
HORIZON
initial: {s: {0: 1/2, 2: 1/2}}
dynamics: {s': {"(s + a) % 5": 2/3, "(2 * s + 1) % 5": 1/3}}
reward: (s' == 3) - 0.25 * a + 0.5 * (s == 1)
"""
BANDIT = """
taskspec: 1
name: Bandit
state: {s: {type: choice, values: [only]}}
action: {a: {type: int, low: 0, high: 4}}
horizon: 1
reward: "[0.3, -1, 0.7, 2, 0.1][a]"
initial: {}
dynamics: {}
"""
FINITE = ["Branching", "EarlyTermPos", "EarlyTermNeg", "InitShiftExpert", "RiskyPath"]


def maze(horizon: str) -> Task:
    return build(source.read_text(MAZE.replace("HORIZON", horizon)))


def discounted() -> Task:
    return maze("horizon: none\ndiscount: 0.9")


def paid(task: Task) -> Array:
    """The true reward as (S, A, S)."""
    known = taskspec.data.tabular(task)
    return np.broadcast_to(known.R[:, :, None], (*known.R.shape, known.n_states)).copy()


def shaping(task: Task, potential: Array) -> Array:
    """What is gained in a potential (S,), as (S, A, S)."""
    known = taskspec.data.tabular(task)
    gained = known.discount * potential[None, :] - potential[:, None]
    return np.broadcast_to(gained[:, None, :], (len(potential), known.n_actions, len(potential)))


def redistributed(task: Task, rng: np.random.Generator) -> Array:
    """Something that is 0 on average over what a step leads to."""
    chances = taskspec.data.tabular(task).P
    paid = rng.normal(size=chances.shape)
    return paid - (chances * paid).sum(axis=2, keepdims=True)


# -- what makes no difference -------------------------------------------------------------------------------------


def test_shaping_scale_and_redistribution_make_no_difference() -> None:
    task = discounted()
    rng = np.random.default_rng(0)
    for _ in range(5):
        same = 7.5 * paid(task) + shaping(task, rng.normal(size=5)) + redistributed(task, rng)
        found = reward_distance(task, same)
        assert found.starc == pytest.approx(0, abs=1e-9)
        assert found.lost == pytest.approx(0, abs=1e-9)
        assert reward_distance(task, -same).starc == pytest.approx(1)


def test_with_a_horizon_potentials_have_to_end_at_nothing() -> None:
    """States of a tree are those of one time: a potential that the leaves have none of is shaping, another one is not."""
    task = taskspec.load("derail/InitShiftExpert")
    rng = np.random.default_rng(1)
    known = taskspec.data.tabular(task)
    inner = known.P.argmax(axis=2) != np.arange(known.n_states)[:, None]  # its actions lead on
    potential = np.where(inner.all(axis=1), rng.normal(size=known.n_states), 0.0)
    assert np.count_nonzero(potential) >= 3
    assert reward_distance(task, 3 * paid(task) + shaping(task, potential)).starc == pytest.approx(0, abs=1e-9)
    assert reward_distance(task, 3 * paid(task) + shaping(task, rng.normal(size=known.n_states))).starc > 0.01


@pytest.mark.parametrize("name", FINITE)
def test_the_true_reward_is_at_distance_0_and_its_opposite_at_1(name: str) -> None:
    task = taskspec.load(f"derail/{name}")
    known = scores(task)
    assert known.optimal is not None and known.worst is not None
    assert reward_distance(task, 0.01 * paid(task)).starc == pytest.approx(0, abs=1e-9)
    assert reward_distance(task, 1e-9 * paid(task)).lost == pytest.approx(0, abs=1e-9)
    opposite = reward_distance(task, -paid(task))
    assert opposite.starc == pytest.approx(1)
    assert opposite.lost == pytest.approx(known.optimal.value - known.worst.value)


@pytest.mark.parametrize(
    ("name", "constant", "starc"), [("RiskyPath", 3, 0), ("EarlyTermPos", -3, 1), ("EarlyTermNeg", 3, 1)]
)
def test_a_constant_matters_where_episodes_may_end_early(name: str, constant: float, starc: float) -> None:
    """EarlyTermPos pays 1 in each step, and EarlyTermNeg -1: beyond 0 they want the opposite."""
    task = taskspec.load(f"derail/{name}")
    assert reward_distance(task, paid(task) + constant).starc == pytest.approx(starc, abs=1e-9)


def test_a_reward_that_tells_no_actions_apart_is_half_way() -> None:
    task = taskspec.load("derail/RiskyPath")
    nothing = reward_distance(task, np.zeros(taskspec.data.tabular(task).n_states))
    assert nothing.starc == pytest.approx(0.5)
    measured = scores(task)
    assert measured.optimal is not None and measured.random is not None
    assert nothing.lost == pytest.approx(
        measured.optimal.value - measured.random.value
    )  # all are best, so any is taken


def test_what_no_episode_comes_to_does_not_count() -> None:
    """Of RiskyPath's trap, goal and detour, the detour alone is left by an action that matters."""
    task = taskspec.load("derail/InitShiftExpert")
    known = taskspec.data.tabular(task)
    changed = paid(task)
    never = np.setdiff1d(np.arange(known.n_states), _entered(task))
    assert len(never)
    changed[never] = np.random.default_rng(0).normal(size=changed[never].shape)
    assert reward_distance(task, changed).starc == pytest.approx(0, abs=1e-9)


def _entered(task: Task) -> Array:
    known = taskspec.data.tabular(task)
    assert known.horizon is not None
    here = known.p0 > 0
    found = known.p0 > 0
    for _ in range(known.horizon - 1):
        here = np.einsum("s,sat->t", here.astype(float), known.P) > 0
        found = found | here
    return np.flatnonzero(found)


# -- against arithmetic by hand -----------------------------------------------------------------------------------


def test_on_a_bandit_the_distance_is_a_function_of_the_correlation() -> None:
    task = build(source.read_text(BANDIT))
    rng = np.random.default_rng(3)
    true = np.array([0.3, -1, 0.7, 2, 0.1])
    for learned in rng.normal(size=(8, 5)):
        found = reward_distance(task, learned[None, :])
        assert found.starc == pytest.approx(np.sqrt((1 - np.corrcoef(true, learned)[0, 1]) / 2))
        assert found.lost == pytest.approx(2 - true[learned.argmax()])


@pytest.mark.parametrize("horizon", ["horizon: 4", "horizon: none\ndiscount: 0.9", "horizon: 6\ndiscount: 0.5"])
def test_the_distance_is_that_of_advantages_worked_out_one_by_one(horizon: str) -> None:
    task = maze(horizon)
    rng = np.random.default_rng(5)
    known = taskspec.data.tabular(task)
    for _ in range(3):
        learned = rng.normal(size=(5, 3, 5))
        one, other = (_advantages(known, r) for r in (paid(task), learned))
        wanted = np.linalg.norm(one / np.linalg.norm(one) - other / np.linalg.norm(other)) / 2
        assert reward_distance(task, learned).starc == pytest.approx(wanted, rel=1e-6)


def _advantages(known: Any, reward: Array) -> Array:
    """Advantages (T * S * A,) of random actions, by recursion over states and actions; without a horizon, after many steps."""
    values = [0.0] * 5
    found = []
    steps = known.horizon or 300
    everything = [(0, 2), range(5)]  # the states of the first step, and of all others
    for t in reversed(range(steps)):
        q = [
            [
                sum(known.P[s, a, n] * (reward[s, a, n] + known.discount * values[n]) for n in range(5)) for a in range(3)
            ]
            for s in range(5)
        ]  # fmt: skip
        values = [sum(row) / 3 for row in q]
        here = everything[1] if known.horizon is None or t else everything[0]
        found.append([q[s][a] - values[s] for s in here for a in range(3)])
    chosen = found[-1:] if known.horizon is None else found[::-1]
    if known.horizon is not None:  # after one step not every state may be entered
        reached = {n for s, a, n in product((0, 2), range(3), range(5)) if known.P[s, a, n] > 0}
        chosen[1] = [v for s in range(5) if s in reached for v in chosen[1][3 * s : 3 * s + 3]]
        later = {n for s, a, n in product(reached, range(3), range(5)) if known.P[s, a, n] > 0}
        assert later == set(range(5))
    return np.array([v for step in chosen for v in step])


def test_it_is_a_distance() -> None:
    task = maze("horizon: 4")
    rng = np.random.default_rng(6)
    chain = RewardMdp(task)
    for a, b, c in rng.normal(size=(10, 3, 5, 3)):
        assert chain.distance(a, b) == pytest.approx(chain.distance(b, a))
        assert chain.distance(a, a) == 0
        assert chain.distance(a, c) <= chain.distance(a, b) + chain.distance(b, c) + 1e-12


@pytest.mark.parametrize("horizon", ["horizon: 4", "horizon: none\ndiscount: 0.9"])
def test_what_is_lost_is_what_the_plan_for_the_learned_reward_earns_less(horizon: str) -> None:
    """The learned reward in the place of the true one, planned by the package; its policy followed step by step."""
    task = maze(horizon)
    rng = np.random.default_rng(8)
    known = taskspec.data.tabular(task)
    for _ in range(3):
        learned = rng.normal(size=(5, 3))
        steps = known.horizon or 400
        values = np.zeros(5)
        plans = []
        for _ in range(steps):
            q = learned + known.discount * np.einsum("san,n->sa", known.P, values)
            plans.append(q.argmax(axis=1))
            values = q.max(axis=1)
        earned = np.zeros(5)
        for plan in plans if known.horizon else [plans[-1]] * steps:
            earned = np.array([known.R[s, plan[s]] + known.discount * known.P[s, plan[s]] @ earned for s in range(5)])
        best = scores(task).optimal
        assert best is not None
        assert reward_distance(task, learned).lost == pytest.approx(best.value - known.p0 @ earned, abs=1e-8)


# -- rewards in other forms ---------------------------------------------------------------------------------------


def test_functions_of_observations_are_asked_for_the_steps_that_there_are() -> None:
    task = taskspec.load("derail/RiskyPath")
    known = taskspec.data.tabular(task)
    table = np.random.default_rng(2).normal(size=(known.n_states, known.n_actions, known.n_states))
    asked: list[tuple[Any, Any, Any]] = []

    def learned(obs: Array, action: Array, following: Array) -> Array:
        asked.append((obs, action, following))
        return table[obs, action, following]

    assert reward_distance(task, learned) == reward_distance(task, table)
    steps = np.concatenate([np.stack(each, axis=1) for each in asked])
    assert all(known.P[s, a, n] > 0 for s, a, n in steps)
    twin = taskspec.modify(task, "permuted_actions=3,per_state=true", "relabelled=2")  # other names for the same
    shown = {tuple(row): i for i, row in enumerate(taskspec.data.tabular(twin).observations.reshape(-1, 1))}
    assert len(shown) == known.n_states
    negative = reward_distance(twin, lambda obs, action, following: -paid(twin)[[shown[o,] for o in obs], action, 0])
    assert negative.starc == pytest.approx(1)


def test_rewards_after_the_end_are_not_asked() -> None:
    """EarlyTermPos ends in a state; whatever a network says of what follows, no episode is paid for it."""
    task = taskspec.load("derail/EarlyTermPos")
    known = taskspec.data.tabular(task)
    assert known.absorbed.any()
    beyond = np.where(known.absorbed[:, None, None], 100.0, paid(task))
    assert reward_distance(task, beyond) == reward_distance(task, paid(task))


@pytest.mark.parametrize(
    ("task_id", "reward", "code", "message"),
    [
        ("RiskyPath", np.zeros((3, 3)), "E713", "has shape"),
        ("RiskyPath", np.full(4, np.nan), "E713", "finite number"),
        ("RiskyPath", lambda obs, action, following: np.zeros(2), "E713", "for each step"),
        ("LargestSum", np.zeros(4), "E712", ""),
        ("NoisyObs", lambda obs, action, following: np.zeros(len(obs)), "E712", "not a function of the state"),
        ("Sort", lambda obs, action, following: np.zeros(len(obs)), "E712", "abstraction"),
    ],
)
def test_what_cannot_be_told_has_a_code(task_id: str, reward: Any, code: str, message: str) -> None:
    with pytest.raises(SpecError) as error:
        reward_distance(f"derail/{task_id}", reward)
    assert error.value.codes == [code]
    assert message in error.value.diagnostics[0].message
