"""Expected returns and scores of policies: tables, functions, experts, and objects with `predict`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.policies.adapters import (
    ObservationFunction,
    ObservationPolicy,
    Predictor,
    ProbabilisticPolicy,
    StateFunction,
    Varies,
)  # fmt: skip
from taskspec.exact.policies.experts import Expert
from taskspec.exact.policies.files import is_network, outputs_of
from taskspec.exact.policies.policy import Asking, EpisodeBatch, TaskPolicy, greedy, legal_rows, planned, states_of
from taskspec.exact.rollout.rollout import EPISODES, Rollout, State
from taskspec.exact.scores.returns import Results, Return
from taskspec.exact.scores.scores import Scores, scores
from taskspec.exact.solve import solve
from taskspec.exact.solve.backward import Plan
from taskspec.exact.solve.plans import stationary, timed
from taskspec.language.registry import load
from taskspec.language.task.legal import restricted
from taskspec.language.task.task import Task, TaskLike

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
        return _table_value(results, np.asarray(policy))
    if isinstance(policy, Expert) and not deterministic:
        return _expert_value(results, policy)
    if isinstance(policy, TaskPolicy):
        return _value(results, policy)
    if hasattr(policy, "predict"):
        return _value(results, Predictor(results.task, policy, deterministic))
    if not callable(policy):
        hint = None
        if isinstance(policy, str) and planned(policy) is not None:
            hint = f"`Expert(task, {policy!r})`"
        misused(f"{type(policy).__name__} is not a policy", hint or "a table, a function, or an object with `predict`")
    return _value(results, StateFunction(results.task, policy))


def is_table(policy: Any) -> bool:
    return isinstance(policy, list | tuple) or hasattr(policy, "__array__")


def _value(results: Results, policy: TaskPolicy) -> PolicyValue:
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


def _expert_value(results: Results, expert: Expert) -> PolicyValue:
    if expert.given is not None:
        results = expert.results
    value = results.expert
    if value is None:
        refuse(f"the expert of {expert.task.name} has no return: {results.why_not}")
    return PolicyValue(value, "probabilities" if value.exact else "samples")


# -- tables over the states of an exact model -------------------------------------------------------------------------


def _table_value(results: Results, table: Array) -> PolicyValue:
    model = results.model
    if table.ndim == 1 and table.dtype.kind == "f":
        misused("a list of reals is not a policy", "returns of episodes are given as `score(task, returns=[...])`")
    if model is None:
        refuse(f"a table of actions needs an exact model: {results.why_not}")
    value = Return(solve.policy_return(model, plan_of_table(model, table)))
    return PolicyValue(value, "probabilities" if table.dtype.kind == "f" else "actions")


def plan_of_table(model: Model, table: Array) -> Plan:
    """Return the plan of a table: actions (S,) or (T, S), or probabilities (S, A) or (T, S, A)."""
    table = _by_row(table, model.n_states, model.n_actions)
    if not are_probabilities(table):
        misused("the probabilities of the actions in a state are at least 0, and sum to 1", LAST_AXIS)
    by_action = np.moveaxis(table, -1, -2)
    if table.ndim == 2:
        return stationary(by_action)
    return timed(list(by_action))


def _by_row(table: Array, rows: int, actions: int, first: int = 0) -> Array:
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


# -- policies of observations, greedy and stochastic ------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ObservedValue:
    """The expected returns of a policy of observations: with its most likely actions, and with those that it draws."""

    deterministic: Return
    stochastic: Return


Probabilities = Callable[[Any], Array]
"""From observations (N, *shape) to the probabilities, or values, of actions (N, A)."""


def observed_value(results: Results, policy: Any, seed: int) -> ObservedValue:
    """Return the expected returns of a policy of observations: exact if the task has a model on which it can be tabulated.

    Args:
        results: of the task.
        policy: an object with `predict` (and maybe `probabilities`), a function of the observation, a table (see `_of_table`), or
            a network of PyTorch: from observations (N, *shape) to actions of a box, or else to probabilities or values (N, A), as
            in a table.
        seed: of what it draws.
    """
    if is_table(policy):
        return _of_table(results, np.asarray(policy), seed)
    if is_network(policy):
        return _of_network(results, policy, seed)
    probabilities = observed_probabilities(policy, results.task)
    if probabilities is not None:
        return _of_rows(results, probabilities, seed)
    if hasattr(policy, "predict"):
        predictor = Predictor(results.task, policy, deterministic=True)
        best = _value(results, predictor).value
        if "deterministic" not in predictor.takes:
            return ObservedValue(best, best)
        return ObservedValue(best, _value(results, Predictor(results.task, policy, deterministic=False)).value)
    if not callable(policy):
        hint = "a table, a function of the observation, an object with `predict`"
        misused(f"{type(policy).__name__} is not a policy", hint)
    value = _value(results, ObservationFunction(results.task, policy, name="", seed=seed)).value
    return ObservedValue(value, value)


def _of_network(results: Results, network: Any, seed: int) -> ObservedValue:
    task = results.task
    outputs = outputs_of(network)
    if task.action_layout.form == "box":
        value = _value(results, Predictor(task, _Acting(outputs))).value
        return ObservedValue(value, value)
    start = Predictor(task, None).observe(Rollout(task, 1).start(), 0, np.random.default_rng(0))
    return _of_rows(results, outputs, seed, are_probabilities(outputs(start)))


class _Acting:
    """An object with `predict`, of a function."""

    def __init__(self, function: Callable[[Any], Array]) -> None:
        self.predict = function


def observed_probabilities(policy: Any, task: Task) -> Probabilities | None:
    """Return the probabilities that a policy gives of finite actions; None where it gives none."""
    if task.action_layout.form == "box":
        return None
    predictor = Predictor(task, policy)
    if not predictor.gives_probabilities:
        if not hasattr(policy, "predict"):
            return None
        start = predictor.observe(Rollout(task, 1).start(), 0, np.random.default_rng(0))
        if predictor.probabilities(start) is None:
            return None
    return lambda observations: np.asarray(predictor.probabilities(observations), np.float64)


def _of_rows(results: Results, rows: Probabilities, seed: int, is_stochastic: bool = True) -> ObservedValue:
    """Return the values of the greedy policy of some rows (N, A), and of the stochastic one, if they are probabilities."""
    best = ProbabilisticPolicy(results.task, rows, seed, is_greedy=True)
    drawn = ProbabilisticPolicy(results.task, rows, seed, is_greedy=not is_stochastic)
    return ObservedValue(_value(results, best).value, _value(results, drawn).value)


def _of_table(results: Results, table: Array, seed: int) -> ObservedValue:
    """Return the values of a table over observations that are one number.

    The table has actions (O,) or (T, O), or probabilities or values (O, A) or (T, O, A). A table of values, whose rows are not
    probabilities, is a greedy policy.
    """
    seen = results.task.observation_layout
    actions = results.task.action_layout
    if seen.form != "discrete" or actions.form not in ("discrete", "multi_discrete"):
        misused(f"a table is a policy where observations are one number and actions finite, not on {results.task.id}")
    first = 0
    if actions.form == "discrete":
        first = actions.starts[0]
    table = _by_row(table, seen.counts[0], int(np.prod(actions.counts)), first)
    is_stochastic = are_probabilities(table)
    if table.ndim == 3:
        best = _timed_value(results, table, is_greedy=True)
        return ObservedValue(best, _timed_value(results, table, is_greedy=not is_stochastic))
    start = seen.starts[0]
    return _of_rows(results, lambda seen: table[np.asarray(seen) - start], seed, is_stochastic)


def observation_rows(task: Task, policy: Any) -> Array | None:
    """Return the probabilities (O, A) of a policy of discrete observations and actions; None where it gives none."""
    seen = task.observation_layout
    actions = task.action_layout
    if is_table(policy):
        table = _by_row(np.asarray(policy), seen.counts[0], actions.counts[0], actions.starts[0])
        if table.ndim == 3:
            return None
        if are_probabilities(table):
            return table
        return greedy(table)
    observations = np.arange(seen.counts[0]) + seen.starts[0]
    if is_network(policy):
        return observation_rows(task, outputs_of(policy)(observations))
    probabilities = observed_probabilities(policy, task)
    if probabilities is None:
        return None
    return probabilities(observations)


def _timed_value(results: Results, table: Array, is_greedy: bool) -> Return:
    """Return the value of a table (T, O, A) of probabilities, or of values of a greedy policy, on the exact model.

    Its states and observations have to be one to one.
    """
    model = results.model
    policy = Predictor(results.task, None)
    if model is None or model.task is not results.task or policy.is_noisy or policy.sees_time:
        misused(f"a table over the time is a policy where observations show the state, not on {results.task.id}")
    observations = policy.observe(states_of(model), 0, np.random.default_rng(0)) - policy.layout.starts[0]
    rows = table[:, observations].astype(np.float64)
    legal = legal_rows(results.task, states_of(model))
    if is_greedy:
        rows = greedy(rows, legal)
    elif legal is not None:
        rows = restricted(rows, legal)
    return _table_value(results, rows).value


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
        """Bounds of the score at a confidence, as (low, high)."""
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
