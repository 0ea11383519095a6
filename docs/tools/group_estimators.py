"""Estimators of groups of episodes, right ones and those with a mistake: their exact expectations, from `taskspec.oracle`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from docs.tools.mistake_numbers import Evidence, number
from taskspec import oracle
from taskspec.base.arrays import Array
from taskspec.language import registry
from taskspec.language.task.task import Task

HALF = Fraction(1, 2)
POLICIES = {
    "LongFailures": [[HALF, HALF], [Fraction(1), Fraction(0)]],
    "Votes": [[HALF, HALF], [HALF, HALF]],
}
"""Policies at which gradients are taken; no action matters where LongFailures is lost, and one keeps episodes few."""
ACTIONS = {"LongFailures": ("safe", "bold"), "Votes": ("left", "right")}
BETA = 0.1
Group = Sequence[oracle.EnumeratedEpisode]


def gradient(advantages: Callable[[Array], Array], is_averaged: bool = False) -> Callable[[Group], Array]:
    """Return an estimator of the policy gradient from a group of episodes.

    Args:
        advantages: from the returns of a group (k,) to advantages (k,).
        is_averaged: whether each episode is divided by its number of steps.
    """

    def estimate(group: Group) -> Array:
        A = advantages(np.array([episode.discounted_return for episode in group]))
        total = 0
        for advantage, episode in zip(A, group, strict=True):
            each = advantage * episode.log_prob_gradients().sum(axis=0)
            if is_averaged:
                each = each / len(episode)
            total = total + each
        return np.asarray(total) / len(group)

    return estimate


def expected(name: str, estimate: Callable[[Group], Array], episodes: int = 2) -> Array:
    """Return the exact expectation of an estimator over groups from one start, as fractions (A,), by what is observed first."""
    pi = np.array(POLICIES[name], dtype=object)
    found = oracle.expectation(estimate, f"probes/{name}", pi, episodes=episodes, same_start=True, exact=True).mean
    return _observed(name, found)


def _observed(name: str, by_state: Array) -> Array:
    """Return the rows of the states that look like the first one, as one."""
    found: Array = by_state.sum(axis=0) if name == "Votes" else by_state[0]
    return found


RIGHT = gradient(oracle.rloo)
WRONG = {
    "length normalised": ("LongFailures", gradient(oracle.rloo, is_averaged=True)),
    "deviation divided": ("Votes", gradient(oracle.grpo)),
}
"""Estimators with a mistake, and the probe on which their expectation has the wrong sign."""


def _task(name: str) -> Task:
    return registry.load(f"probes/{name}")


def _of_gradient(name: str) -> Evidence:
    probe, wrong = WRONG[name]
    task = _task(probe)
    exact = _observed(probe, oracle.policy_gradient(task, np.array(POLICIES[probe], dtype=object), exact=True))
    columns = (exact, expected(probe, RIGHT), expected(probe, wrong))
    rows = [(str(action), *map(str, each)) for action, *each in zip(ACTIONS[probe], *columns, strict=True)]
    header = ("action", "exact gradient", "RLOO", name)
    about = (
        "The gradient of the return at equal probabilities, and the expectation of estimators over pairs of episodes:"
    )
    after = (
        "The signs are turned. `paper/grpo` divides by lengths and by deviations, and learns the worse action on both probes; "
        "`grpo` divides by neither, and learns the better one."
    )
    return Evidence(task, about, header, rows, after)


def _batch_deviation() -> Evidence:
    """Compare the advantages of two groups of Votes, one from each room."""
    rewards = np.array([[-1, -1, 0, 0], [10, 10, 0, 0]], dtype=np.float64)
    right = oracle.grpo(rewards)
    wrong = (rewards - rewards.mean()) / rewards.std()
    rows = []
    for room, reward, *both in zip(("first", "second"), rewards[:, ::2], right[:, ::2], wrong[:, ::2], strict=True):
        for door, paid, one, other in zip(("left", "right"), reward, *both, strict=True):
            rows.append((room, door, number(paid), number(one), number(other)))
    about = "Advantages of two groups in which each door was taken twice:"
    header = ("room", "door", "reward", "of the group", "of the batch")
    return Evidence(_task("Votes"), about, header, rows, "In the first room both doors look bad.")


def _reference_moves() -> Evidence:
    """Compare the loss of a pair from one room with the left door preferred, as the policy comes to prefer it."""
    rows = []
    for p in (0.5, 0.75, 0.9):
        left, right = np.log(p), np.log(1 - p)
        half = np.log(0.5)
        losses = (
            oracle.dpo_loss(left, right, half, half, beta=BETA),
            oracle.dpo_loss(left, right, left, right, beta=BETA),
        )
        rows.append((number(p), *map(number, losses)))
    about = f"The loss of a pair whose left door is preferred (beta {BETA:g}), by the probability of the left door:"
    return Evidence(_task("Votes"), about, ("probability", "right", "reference moves"), rows)


def _steps_averaged() -> Evidence:
    """Compare a short episode that is preferred with a long failure, whose steps the policy made less likely, too."""
    short = np.log([0.75])
    long = np.log([0.25, *[0.6] * 9])
    half = np.log(0.5)
    rows: list[Any] = []
    for what, reduce in (("right", np.sum), ("steps averaged", np.mean)):
        chosen, rejected = reduce(short), reduce(long)
        loss = oracle.dpo_loss(chosen, rejected, reduce(np.full(1, half)), reduce(np.full(10, half)), beta=BETA)
        rows.append((what, *(number(float(each)) for each in (chosen, rejected, loss))))
    about = (
        f"A pair of an episode of one step, which is preferred, and of a failure of ten (beta {BETA:g}). The reference takes "
        "all actions with probability 1/2; the policy the safe one with 3/4, and those of the last nine steps with 0.6:"
    )
    header = ("", "of the preferred episode", "of the other", "loss")
    return Evidence(_task("LongFailures"), about, header, rows)


GROUPS: dict[str, Callable[[], Evidence]] = {
    "length normalised": lambda: _of_gradient("length normalised"),
    "deviation divided": lambda: _of_gradient("deviation divided"),
    "batch deviation": _batch_deviation,
    "reference moves": _reference_moves,
    "steps averaged": _steps_averaged,
}
"""Evidence by the name of the mistake."""
