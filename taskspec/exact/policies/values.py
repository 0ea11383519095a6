"""Expected returns and scores of policies: tables, functions, experts, and objects with `predict`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.policies.adapters import ObservationPolicy, Predictor, StateFunction, Varies
from taskspec.exact.policies.experts import Expert
from taskspec.exact.policies.policy import Asking, EpisodeBatch, TaskPolicy, planned
from taskspec.exact.rollout.rollout import EPISODES, State
from taskspec.exact.scores.returns import Results, Return
from taskspec.exact.scores.scores import Scores, scores
from taskspec.exact.solve import solve
from taskspec.exact.solve.backward import Plan
from taskspec.exact.solve.plans import stationary, timed
from taskspec.language.registry import load
from taskspec.language.task.task import TaskLike

LAST_AXIS = "actions are the last axis of a table; `table.T` turns one round"


@dataclass(frozen=True, slots=True)
class PolicyValue:
    """The expected return of a policy, and what it rests on."""

    value: Return
    asked: Asking


def policy_value(results: Results, policy: Any, deterministic: bool | None = None) -> PolicyValue:
    """Return the expected return of a policy: exact if the task has a model on which the policy can be tabulated.

    Args:
        results: of the task; they give the number of simulated episodes, and their seed.
        policy: a table over the states of the exact model (see `plan_of_table`), a function of the states and the time, an
            `Expert`, an object with `predict`, or a `TaskPolicy`.
        deterministic: passed to `predict`.
    """
    if is_table(policy):
        return table_value(results, np.asarray(policy))
    if isinstance(policy, Expert) and not deterministic:
        if policy.given is not None:
            results = policy.results
        value = results.expert
        if value is None:
            refuse(f"the expert of {policy.task.name} has no return: {results.why_not}")
        return PolicyValue(value, "probabilities" if value.exact else "samples")
    if isinstance(policy, TaskPolicy):
        return value_of(results, policy)
    if hasattr(policy, "predict"):
        return value_of(results, Predictor(results.task, policy, deterministic))
    if not callable(policy):
        hint = None
        if isinstance(policy, str) and planned(policy) is not None:
            hint = f"`Expert(task, {policy!r})`"
        misused(f"{type(policy).__name__} is not a policy", hint or "a table, a function, or an object with `predict`")
    return value_of(results, StateFunction(results.task, policy))


def is_table(policy: Any) -> bool:
    return isinstance(policy, list | tuple) or hasattr(policy, "__array__")


def value_of(results: Results, policy: TaskPolicy) -> PolicyValue:
    model = results.model
    if model is not None and model.task is policy.task:
        tabulated = policy.tabulate(model)
        try:
            if tabulated is not None:
                return PolicyValue(Return(solve.policy_return(model, tabulated.plan)), tabulated.asked)
        except Varies:
            pass

    def choose(states: State, t: int, rng: np.random.Generator) -> Mapping[str, Array]:
        if isinstance(policy, ObservationPolicy):
            return policy.choose(policy.batch(states, t, rng))
        return policy.choose(EpisodeBatch.sharing(t, states, None, rng))

    return PolicyValue(results.simulated(choose), "samples")


# -- tables over the states of an exact model -------------------------------------------------------------------------


def table_value(results: Results, table: Array) -> PolicyValue:
    model = results.model
    if table.ndim == 1 and table.dtype.kind == "f":
        misused("a list of reals is not a policy", "returns of episodes are given as `score(task, returns=[...])`")
    if model is None:
        refuse(f"a table of actions needs an exact model: {results.why_not}")
    value = Return(solve.policy_return(model, plan_of_table(model, table)))
    return PolicyValue(value, "probabilities" if table.dtype.kind == "f" else "actions")


def plan_of_table(model: Model, table: Array) -> Plan:
    """Return the plan of a table: actions (S,) or (T, S), or probabilities (S, A) or (T, S, A)."""
    table = by_row(table, model.n_states, model.n_actions)
    if not are_probabilities(table):
        misused("the probabilities of the actions in a state are at least 0, and sum to 1", LAST_AXIS)
    by_action = np.moveaxis(table, -1, -2)
    if table.ndim == 2:
        return stationary(by_action)
    return timed(list(by_action))


def by_row(table: Array, rows: int, actions: int, first: int = 0) -> Array:
    if table.dtype.kind in "iu" and table.shape[-1:] == (rows,) and table.shape[-2:] != (rows, actions):
        if not ((table >= first) & (table < first + actions)).all():
            misused(f"an action of the table is not in {first} to {first + actions - 1}")
        table = np.eye(actions)[table - first]
    if table.ndim not in (2, 3) or table.shape[-2:] != (rows, actions):
        forms = f"({rows},) for actions, ({rows}, {actions}) for their probabilities or values"
        misused(f"a table has shape {forms}; maybe with the time in front; not {table.shape}", LAST_AXIS)
    if not np.isfinite(table).all():
        misused("an entry of the table is no finite number")
    return table.astype(np.float64)


def are_probabilities(table: Array) -> bool:
    return bool((table >= 0).all() and np.allclose(table.sum(axis=-1), 1))


@dataclass(frozen=True)
class Score:
    """A policy's return and its place between random actions (0) and the expert (1).

    `asked` is the basis of the return: the policy's "probabilities" of actions, its "actions" if they are deterministic,
    "samples" of them in episodes, or given "returns". Only the first two can be exact.
    """

    value: Return
    normalised: float
    scores: Scores
    asked: Asking | Literal["returns"]

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Bound the score.

        Args:
            confidence: level of the interval, as for `Return.interval`.

        Returns:
            (low, high), in units of the score.
        """
        low, high = self.value.interval(confidence)
        return self.scores.normalise(low), self.scores.normalise(high)


def score(
    task: TaskLike, policy: Any = None, *, returns: Sequence[float] | None = None, deterministic: bool | None = None,
    episodes: int = EPISODES, seed: int = 0, known: Scores | None = None,
) -> Score:  # fmt: skip
    """Score a policy, or the returns of its episodes.

    Args:
        task: the task, its id or its path.
        policy: a table of probabilities (S, A) or (T, S, A), or of actions (S,) or (T, S), in the order of the exact model; a
            function from the state by component (arrays, batch axis last) and the time to actions by component; or an object
            with `predict(observations, ...)`, as models of Stable-Baselines3 are. If such an object gives probabilities, as
            `action_probabilities(observations)` of shape (N, A) or as Stable-Baselines3 does, the stochastic policy is scored.
        returns: of episodes, instead of a policy.
        deterministic: True scores the deterministic version of an object with `predict`, False what it samples; None what the
            policy is by itself.
        episodes: of an estimate, if the policy has to be simulated.
        seed: of these episodes.
        known: scores of the task that were computed before.

    Returns:
        the return of the policy with its error, and its score: 0 for random actions, 1 for the expert.

    Raises:
        SpecError: E706 for actions outside the action space, E712 if a missing exact model is needed, E713 for anything that
            is not a policy.
    """
    if (policy is None) == (returns is None):
        misused("`score` takes a policy, or `returns=` of episodes")
    task = load(task)
    measured = known or scores(task, episodes, seed)
    if returns is not None:
        value = Return.estimated(_numbers(returns))
        return Score(value, measured.normalise(value.value), measured, "returns")
    valued = policy_value(Results(task, episodes, seed), policy, deterministic)
    return Score(valued.value, measured.normalise(valued.value.value), measured, valued.asked)


def _numbers(returns: Sequence[float]) -> Array:
    try:
        array = np.asarray(returns, np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.ndim != 1 or not array.size:
        misused("`returns` is a list of numbers, one for each episode")
    if np.isnan(array).any():
        misused(f"return number {int(np.isnan(array).argmax()) + 1} of {array.size} is nan")
    return array
