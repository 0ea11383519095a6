"""The smallest task that shows a mistake, and what right and wrong learners learn there, from the exact models."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from docs.tools.probes import PASSES, scores
from taskspec.base.arrays import Array
from taskspec.language import registry
from taskspec.language.task.task import Task
from taskspec.learn.data.episodes import demonstrations
from taskspec.learn.exam.asked_tasks import tasks_of
from taskspec.learn.exam.dynamics import EXPLORATIONS, Behaviour, Dynamics, EpsilonGreedy, dynamics_of
from taskspec.learn.exam.learned_values import is_read
from taskspec.learn.exam.operators import APART, OPERATORS
from taskspec.learn.exam.pairings import PAIRINGS, shown_of
from taskspec.learn.exam.starc import REWARDS, RewardMdp, half_distance
from taskspec.learn.exam.ways import actor_ways, greedy_ways, reduced

GAMMA = 0.9
"""The discount of the learners on the pages."""
SWEEPS = 500
"""Sweeps after which values at this discount are those of the fixed point, to more digits than are shown."""
EPISODES = 100
"""Demonstrated episodes."""
MOST_ROWS = 12
APART_ON_PAGES = 0.05
"""The difference of values, as a share of the largest one, from which a task shows a mistake."""


class Evidence(NamedTuple):
    """The smallest task that shows a mistake: what its numbers are, and a table of them."""

    task: Task
    about: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    after: str = ""


def number(value: float) -> str:
    """Return a number with four digits."""
    return f"{round(float(value), 10) + 0.0:.4g}"


# -- learned values


@cache
def probes() -> tuple[Task, ...]:
    """Return the probes whose values can be read, the smallest ones first."""
    found = [task for task in tasks_of(("probes",), None) if is_read(task)]
    return tuple(sorted(found, key=lambda task: dynamics_of(task, GAMMA).acted.sum()))


@cache
def probes_failed(name: str) -> tuple[str, ...]:
    """Return the probes on which the greedy policy of a mistake's values fails, at the discount of the pages."""
    return tuple(task.name for task in probes() if scores(task, GAMMA).get(name, 1.0) < PASSES)


def by_values(name: str) -> Evidence:
    """Return the smallest probe that shows a mistake by its score at the discount of this page, else by its values."""
    if name in PATTERNS:
        return PATTERNS[name]()
    if OPERATORS[name].of == "values":
        return _first_that_differs(name, critic_values, "Values of a critic under random actions")
    for task in probes():
        score = scores(task, GAMMA).get(name)
        if score is not None and score < PASSES:
            after = f"The greedy policy of the latter scores {number(score)}, and that of right values 1."
            return _compared(task, name, q_values(task, "right"), q_values(task, name), after=after)
    after = "The best actions stay what they are; only the values tell."
    found = _first_that_differs(name, q_values)
    return found._replace(after=after)


def _first_that_differs(
    name: str, values: Callable[[Task, str], Array | None], what: str = "Action values"
) -> Evidence:
    for task in probes():
        right = values(task, "right")
        wrong = values(task, name)
        acted = dynamics_of(task, GAMMA).acted
        if right is None or wrong is None:
            continue
        if np.abs(right - wrong)[..., acted].max() >= APART_ON_PAGES * np.abs(right[..., acted]).max():
            return _compared(task, name, right, wrong, what)
    raise LookupError(f"no probe shows '{name}'")


def q_values(task: Task, name: str) -> Array | None:
    """Return the fixed point (A, S) of an operator, for a learner that explores; None where it has none."""
    explores = EXPLORATIONS[-1]
    way = greedy_ways(task, GAMMA)[name][EXPLORATIONS.index(explores)]
    if not way.settles:
        return None
    dynamics = dynamics_of(task, GAMMA)
    return _settled(dynamics, name, way.Q, EpsilonGreedy(explores)(way.Q), is_critic=False)


def critic_values(task: Task, name: str) -> Array | None:
    """Return the fixed point (S,) of an operator, for the critic of random actions."""
    dynamics = dynamics_of(task, GAMMA)
    pi = np.full_like(dynamics.R, 1 / len(dynamics.R))
    way = actor_ways(dynamics, pi)[name][0]
    Q = _settled(dynamics, name, way.Q, pi, is_critic=True)
    found: Array = (pi * Q).sum(axis=0)
    return found


def _settled(dynamics: Dynamics, name: str, Q: Array, pi: Array, is_critic: bool) -> Array:
    behaviour = Behaviour(dynamics, pi)
    operator = OPERATORS[name]
    for _ in range(SWEEPS):
        V = reduced(dynamics, operator, Q, behaviour, is_critic)
        Q = np.where(behaviour.visited > 0, operator.targets(dynamics, behaviour, Q, V), Q)
    return Q


def _compared(
    task: Task, name: str, right: Array | None, wrong: Array | None, what: str = "Action values", after: str = ""
) -> Evidence:
    assert right is not None
    assert wrong is not None
    rows = []
    for place, index in _places(dynamics_of(task, GAMMA), right):
        rows.append((*place, number(right[index]), number(wrong[index])))
    about = f"{what} to which learners converge, at a discount of {GAMMA:g}:"
    return Evidence(task, about, _header(right, name), rows[:MOST_ROWS], after)


def _header(values: Array, name: str) -> tuple[str, ...]:
    if values.ndim == 2:
        return ("state", "action", "right", name)
    return ("state", "right", name)


def _places(dynamics: Dynamics, values: Array) -> Iterator[tuple[tuple[str, ...], tuple[int, ...]]]:
    """Yield names and indices of the values, (A, S) or (S,), of states in which episodes act."""
    model = dynamics.model
    for s in np.flatnonzero(dynamics.acted):
        state = model.state_name(int(s))
        if values.ndim == 1:
            yield (state,), (int(s),)
            continue
        for a in range(model.n_actions):
            yield (state, model.action_name(a)), (a, int(s))


# -- mistakes whose values have a pattern, and no fixed point


def _probe(name: str) -> Task:
    return registry.load(f"probes/{name}")


def _untrained() -> Evidence:
    task = _probe("EndInPlace")
    right = q_values(task, "right")
    return _compared(task, "untrained", right, np.zeros((2, 1)), after="Values that begin at 0 stay there.")


def _one_pair() -> Evidence:
    """Only the first action of the first state is learned."""
    task = _probe("SecondThought")
    dynamics = dynamics_of(task, GAMMA)
    Q = np.zeros_like(dynamics.R)
    behaviour = Behaviour(dynamics, np.full_like(Q, 1 / len(Q)))
    first = (0, int(np.argmax(dynamics.model.start)))
    for _ in range(SWEEPS):
        Q[first] = OPERATORS["right"].targets(dynamics, behaviour, Q, Q.max(axis=0))[first]
    return _compared(task, "one pair", q_values(task, "right"), Q)


def _grows() -> Evidence:
    task = _probe("EndInPlace")
    dynamics = dynamics_of(task, GAMMA)
    behaviour = Behaviour(dynamics, np.full_like(dynamics.R, 1 / len(dynamics.R)))
    Q = np.zeros_like(dynamics.R)
    sweeps = 100
    for _ in range(sweeps):
        Q = Q - 0.1 * (OPERATORS["right"].targets(dynamics, behaviour, Q, Q.max(axis=0)) - Q)
    after = f"These are the values after {sweeps} sweeps with a step size of 0.1; they go on without a bound."
    return _compared(task, "grows", q_values(task, "right"), Q, after=after)


def _scaled() -> Evidence:
    task = _probe("SecondThought")
    right = q_values(task, "right")
    assert right is not None
    after = "Rewards were multiplied by 1/10. The best actions stay what they are."
    return _compared(task, "rewards scaled", right, right / 10, after=after)


def _another_discount() -> Evidence:
    task = _probe("Patience")
    Q = _fixed_point(dynamics_of(task, GAMMA), gamma=GAMMA / 2)
    after = "What follows counted half of its discount."
    return _compared(task, "another discount", q_values(task, "right"), Q, after=after)


def _shifted() -> Evidence:
    task = _probe("EndInPlace")
    Q = _fixed_point(dynamics_of(task, GAMMA), shift=-1.0)
    after = "Each step cost 1, until the end."
    return _compared(task, "rewards shifted", q_values(task, "right"), Q, after=after)


def _fixed_point(dynamics: Dynamics, gamma: float = GAMMA, shift: float = 0.0) -> Array:
    """Return action values (A, S) for another discount, or with a constant added to each reward."""
    Q = np.zeros_like(dynamics.R)
    for _ in range(SWEEPS):
        Q = dynamics.R + shift + gamma * dynamics.following(Q.max(axis=0))
    return Q


def _one_outcome() -> Evidence:
    task = _probe("CoinToss")
    dynamics = dynamics_of(task, GAMMA)
    right = q_values(task, "right")
    assert right is not None
    V = right.max(axis=0)
    rows = []
    for place, (a, s) in _places(dynamics, right):
        reached = np.flatnonzero(dynamics.row(dynamics.P, a, s))
        outcomes = [number(dynamics.R[a, s] + dynamics.gamma * V[each]) for each in reached]
        rows.append((*place, number(right[a, s]), " or ".join(outcomes) or number(dynamics.R[a, s])))
    about = f"The action values at a discount of {GAMMA:g}, and those after one outcome alone:"
    after = "In half of the seeds the coin loses, and the sure thing looks better."
    return Evidence(task, about, _header(right, "one outcome"), rows, after)


PATTERNS = {
    "untrained": _untrained, "one pair": _one_pair, "grows": _grows, "rewards scaled": _scaled,
    "another discount": _another_discount, "rewards shifted": _shifted, "one outcome": _one_outcome,
}  # fmt: skip


# -- learned rewards


def by_reward(name: str) -> Evidence:
    """Return the smallest probe on which the reward of a mistake is not the right one."""
    for task in probes():
        mdp = RewardMdp(task)
        wrong = REWARDS[name](mdp)
        distance = half_distance(mdp.canonical(wrong), mdp.known["right"])
        if distance < APART:
            continue
        rows = []
        for (state, action), (a, s) in _places(dynamics_of(task, GAMMA), mdp.true.T):
            rows.append((state, action, number(mdp.true[s, a]), number(wrong[s, a])))
        after = f"Their STARC distance is {number(distance)}. The best policy for the wrong one loses {number(mdp.lost(wrong))}."
        about = "Rewards that are learned, up to scale and shaping:"
        return Evidence(task, about, ("state", "action", "right", name), rows[:MOST_ROWS], after)
    raise LookupError(f"no probe shows '{name}'")


# -- policies after demonstrations


def by_policy(name: str) -> Evidence:
    """Return the smallest task on which the pairs of a mistake have other frequencies."""
    for task in _demonstrated():
        shown = shown_of(task, demonstrations(task, episodes=EPISODES, seed=0))
        right = PAIRINGS["right"](shown)
        wrong = PAIRINGS[name](shown)
        if shown.distance(wrong, right) < APART:
            continue
        seen = task.observation_layout.starts[0]
        rows = []
        for o in np.unique(shown.obs):
            for a in range(shown.shape[1]):
                rows.append((str(o + seen), str(a), number(right[o, a]), number(wrong[o, a])))
        about = (
            f"The probabilities of actions in {EPISODES} demonstrated episodes of the expert (seed 0), by observation:"
        )
        header = ("observation", "action", "right", name)
        after = (
            f"Their total variation is {number(shown.distance(wrong, right))}, in the mean over what was demonstrated."
        )
        return Evidence(task, about, header, rows[:MOST_ROWS], after)
    raise LookupError(f"no task shows '{name}'")


@cache
def _demonstrated() -> tuple[Task, ...]:
    """Return small tasks with an expert, discrete observations and actions, and a page: probes first, the smallest ones first."""
    sizes = {}
    for suite in ("probes", "derail", "toy_text", "textbook", "irl"):
        for task in tasks_of((suite,), None):
            seen = task.observation_layout
            acts = task.action_layout
            is_small = seen.form == acts.form == "discrete" and acts.counts[0] > 1
            if is_small and task.horizon is not None and task.annotations.expert is not None:
                sizes[task] = (suite != "probes", seen.counts[0] * acts.counts[0])
    return tuple(sorted(sizes, key=lambda task: sizes[task]))
