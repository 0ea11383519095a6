"""Policies of observations: objects with `predict`, functions of an observation, and probabilities of actions.

Objects with `predict` follow Stable-Baselines3 and imitation. Observations are normalised as in training where the policy knows
how (`VecNormalize`), and a recurrent policy is given its own memory.
"""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import partial, reduce
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import plural
from taskspec.base.named import all_names
from taskspec.exact.model.model import Model, misused
from taskspec.exact.policies.policy import (
    Actions,
    Asking,
    EpisodeBatch,
    Tabulated,
    TaskPolicy,
    drawn,
    greedy,
    legal_rows,
    named,
    observation_of,
    states_of,
    unknown,
)  # fmt: skip
from taskspec.exact.policies.python_files import function_of, is_function, plain
from taskspec.exact.rollout.rollout import State, reads_of
from taskspec.exact.solve.plans import timed
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import Kind
from taskspec.language.expressions.variates import WordLayout, batch_sampler
from taskspec.language.task import spaces
from taskspec.language.task.legal import restricted
from taskspec.language.task.questions import reads_time
from taskspec.language.task.task import Task

ASKS = 16
"""How often a policy is asked about the same states before its actions are taken never to vary."""


def policy_of(task: Task, policy: Any) -> TaskPolicy:
    """Return the policy of a name, of `model.py:fn`, of a function of an observation, or of an object with `predict`."""
    if isinstance(policy, str) and not is_function(policy):
        return named(task, policy)
    name = policy
    if not isinstance(policy, str):
        name = getattr(policy, "__name__", type(policy).__name__)
    given = policy
    if isinstance(policy, str):
        given = function_of(policy)
    if hasattr(given, "predict"):
        return Predictor(task, given, deterministic=True, name=name)
    if callable(given):
        return ObservationFunction(task, given, name=name)
    unknown(name, ("a function of the observation", "an object with `predict`"))


def asked(acting: TaskPolicy, batch: EpisodeBatch, policy: Any) -> Any:
    """Return what a policy does. Where a file has it, its mistakes are messages; other mistakes are the caller's to see."""
    try:
        return acting.act(batch)
    except SpecError:
        raise
    except Exception as error:
        if not isinstance(policy, str):
            raise
        message = f"the policy {acting.name} failed: {type(error).__name__}: {error}"
        raise spec_error("E713", message) from error


class ObservationPolicy(TaskPolicy):
    """A policy that sees observations only.

    Attributes:
        memory: what a recurrent policy remembers of the last step; None for other policies.
        may_explore: whether it may act at random now and then, so that its actions cannot be tabulated.
    """

    memory: Any = None
    may_explore = False

    def __init__(self, task: Task, name: str) -> None:
        self.task = task
        self.name = name
        self.layout = task.observation_layout
        self.is_noisy = task.observation.is_random
        self.sees_time = reads_time(task.observation.nodes)
        self._words = WordLayout.of(task.observation.nodes)

    def observe(self, states: State, t: int, rng: np.random.Generator) -> Any:
        """Observe states by component, (*shape, N): observations (N, *shape), or a dict of them for a dict space."""
        lanes = next(iter(states.values())).shape[-1]
        words = rng.integers(0, 2**32, (self._words.count, lanes), dtype=np.uint32)
        values = evaluate(self.task.observation.nodes, reads_of(states, {}, t), batch_sampler(self._words, words))
        rows = []
        for value in values:
            spread = np.broadcast_to(value, (*value.shape[:-1], lanes))
            rows.append(spread.reshape(-1, lanes).T)
        return spaces.pack_many(self.layout, rows)

    def batch(self, states: State, t: int, rng: np.random.Generator, observed_at: int | None = None) -> EpisodeBatch:
        """Make a batch with observations of states; `observed_at` is the time they show, if it differs from `t`."""
        if observed_at is None:
            observed_at = t
        observations = self.observe(states, observed_at, rng)
        return EpisodeBatch.sharing(t, states, observations, rng)

    @abstractmethod
    def act(self, batch: EpisodeBatch) -> Any:
        """Return actions (N, *shape), in the format of the environment."""

    def choose(self, batch: EpisodeBatch) -> Actions:
        actions = np.asarray(plain(self.act(batch)))
        lanes = len(batch.running)
        if len(np.atleast_1d(actions)) != lanes:
            misused(f"`predict` gave {len(np.atleast_1d(actions))} actions for a batch of {lanes} observations")
        rows = actions.reshape(lanes, -1)
        size = sum(segment.size for segment in self.actions.segments)
        if rows.shape[1] != size:
            hint = "give the action itself, as `env.step` takes it: not a value for each action"
            misused(f"an action is {plural(size, 'number')} on {self.task.id}; the policy gave {rows.shape[1]}", hint)
        chosen = {}
        for c, segment in zip(self.task.action, self.actions.segments, strict=True):
            values = rows[:, segment.first : segment.first + segment.size]
            if segment.starts:
                values = values + np.array(segment.starts)
            if c.type.kind is Kind.REAL:
                whole = values.astype(np.float64)
            else:
                whole = np.rint(values).astype(np.int64)
            chosen[c.name] = whole.T.reshape(*c.type.shape, lanes)
        return chosen

    def probabilities(self, observations: Any, legal: Array | None = None) -> Array | None:
        """Return probabilities float64 (N, A) of actions, first component slowest; None where they are unknown.

        Args:
            legal: bool (N, A); illegal actions have the probability 0.
        """
        return None

    def tabulate(self, model: Model) -> Tabulated | None:
        """Return its probabilities, or else its actions if they never vary, in all states of a model."""
        if self.is_noisy or (self.sees_time and model.horizon is None):
            return None
        asks: dict[Asking, Callable[[Model, int], Array | None]] = {
            "probabilities": self._probabilities,
            "actions": self._constant,
        }
        times = 1
        if self.sees_time:
            times = model.horizon or 1
        for asked, answer in asks.items():
            tables = []
            for t in range(times):
                table = answer(model, t)
                if table is None:
                    break
                tables.append(table)
            else:
                return Tabulated(timed(tables), asked)
        return None

    def _probabilities(self, model: Model, t: int) -> Array | None:
        states = states_of(model)
        pi = self.probabilities(self.observe(states, t, np.random.default_rng(0)), legal_rows(self.task, states))
        if pi is None:
            return None
        is_right = pi.shape == (model.n_states, model.n_actions) and (pi >= 0).all()
        if not is_right or not np.allclose(pi.sum(axis=1), 1):
            form = f"rows of {model.n_actions} probabilities that sum to 1, one for each observation"
            misused(f"`action_probabilities` gives {form}")
        return pi.T

    def _constant(self, model: Model, t: int) -> Array | None:
        """Return actions as probabilities (A, S); None for a policy that remembers, or whose actions vary."""

        def ask() -> Array:
            chosen = self.choose(self.batch(states_of(model), 0, np.random.default_rng(0), observed_at=t))
            return one_hot(model, [chosen[c.name] for c in model.actions.components])

        if self.may_explore:
            return None
        answer = unvaried(ask)
        if self.memory is not None:
            return None
        return answer


class Predictor(ObservationPolicy):
    """An object with `predict`.

    Args:
        task: the task in which it acts.
        policy: the object; it may have `action_probabilities`, or be a model of Stable-Baselines3.
        deterministic: passed to `predict`; None leaves it to the policy.
    """

    def __init__(self, task: Task, policy: Any, deterministic: bool | None = None, name: str = "") -> None:
        super().__init__(task, name)
        self.policy = policy
        self.deterministic = deterministic
        self.takes = parameters(getattr(policy, "predict", None))
        self.normalise: Callable[[Any], Any] = lambda observations: observations
        wrapper = None
        if hasattr(policy, "get_vec_normalize_env"):
            wrapper = policy.get_vec_normalize_env()
        if wrapper is not None:  # that it was trained with
            self.normalise = wrapper.normalize_obs
        self.gives_probabilities = getattr(policy, "probabilities", getattr(policy, "action_probabilities", None))
        self.may_explore = "deterministic" in self.takes and not deterministic

    def act(self, batch: EpisodeBatch) -> Any:
        options: dict[str, Any] = {}
        if self.deterministic is not None and "deterministic" in self.takes:
            options["deterministic"] = self.deterministic
        if "state" in self.takes and batch.t and self.memory is not None:
            options["state"] = self.memory
        if "episode_start" in self.takes:
            options["episode_start"] = np.full(len(batch.running), batch.t == 0)
        if "action_masks" in self.takes and batch.states:
            options["action_masks"] = legal_rows(self.task, batch.states)
        answer = self.policy.predict(self.normalise(batch.observations), **options)
        if isinstance(answer, tuple):
            actions, self.memory = answer
        else:
            actions, self.memory = (answer, None)
        return actions

    def probabilities(self, observations: Any, legal: Array | None = None) -> Array | None:
        if self.deterministic:
            return None
        pi: Array | None
        if self.gives_probabilities:
            pi = np.asarray(plain(self.gives_probabilities(self.normalise(observations))), np.float64)
        else:
            pi = _sb3_probabilities(self.policy, self.normalise(observations))
        if pi is None or legal is None:
            return pi
        return restricted(pi, legal)


class ProbabilisticPolicy(ObservationPolicy):
    """A policy given by its probabilities of actions.

    Args:
        task: the task in which it acts.
        function: from observations (N, *shape) to probabilities (N, A), or to values if it is greedy.
        seed: of its draws.
        is_greedy: whether it takes the actions of the largest values.
    """

    def __init__(self, task: Task, function: Callable[[Any], Array], seed: int, is_greedy: bool = False) -> None:
        super().__init__(task, "probabilities")
        self.function = function
        self.is_greedy = is_greedy
        self.rng = np.random.default_rng(seed)

    def act(self, batch: EpisodeBatch) -> Any:
        rows = self.probabilities(batch.observations, legal_rows(self.task, batch.states))
        index = drawn(rows.T, self.rng.random(len(rows)))
        if self.actions.form == "discrete":
            return index + self.actions.starts[0]
        return np.stack(np.unravel_index(index, self.actions.counts), axis=1)

    def probabilities(self, observations: Any, legal: Array | None = None) -> Array:
        pi = np.asarray(self.function(observations), np.float64)
        if self.is_greedy:
            return greedy(pi, legal)
        if legal is None:
            return pi
        return restricted(pi, legal)


class ObservationFunction(ObservationPolicy):
    """A function from one observation to one action, which may take a generator as `rng`.

    Args:
        task: the task in which it acts.
        function: the function.
        name: for messages.
        seed: of its draws; None takes those of each batch.
    """

    def __init__(self, task: Task, function: Callable[..., Any], name: str, seed: int | None = None) -> None:
        super().__init__(task, name)
        self.function = function
        self.takes_rng = "rng" in parameters(function)
        if seed is None:
            self.rng = None
        else:
            self.rng = np.random.default_rng(seed)
        self.may_explore = self.takes_rng and seed is None  # each batch has the same draws while it is tabulated

    def act(self, batch: EpisodeBatch) -> Array:
        running = np.flatnonzero(batch.running)
        chosen = np.array([plain(self._one(batch, int(lane))) for lane in running])
        if len(running) == len(batch.running):
            return chosen
        actions = np.repeat(chosen[:1], len(batch.running), axis=0)  # actions after the end of an episode do not matter
        actions[running] = chosen
        return actions

    def _one(self, batch: EpisodeBatch, lane: int) -> Any:
        observation = observation_of(batch.observations, lane)
        given = {}
        if self.takes_rng:
            given["rng"] = self.rng or batch.draws.generator(lane)
        action = self.function(observation, **given)
        if action is None:
            raise spec_error("E706", f"the policy {self.name} returned no action", "does the function end in `return`?")
        return action


class StateFunction(TaskPolicy):
    """A function from states by component, (*shape, N), and the time to actions by component.

    Raises:
        SpecError: (E713) when it takes other arguments; once it is asked, when it gives anything else.
    """

    def __init__(self, task: Task, function: Callable[..., Any]) -> None:
        self.task = task
        self.name = getattr(function, "__name__", type(function).__name__)
        self.function = function
        self.names = all_names(task.action)
        actions = ", ".join(f"{name!r}: ..." for name in self.names)
        self.hint = f"`lambda state, t: {{{actions}}}`; of observations, an object with `predict`"
        try:
            inspect.signature(function).bind({}, 0)
        except ValueError:  # functions that are not written in Python have no signature
            pass
        except TypeError:
            misused("a function that is a policy takes the states and the time", self.hint)

    def choose(self, batch: EpisodeBatch) -> Actions:
        answer = self.function(batch.states, batch.t)
        if isinstance(answer, Mapping) and all(name in answer for name in self.names):
            return answer
        misused(f"a function that is a policy gives the action by component, {', '.join(self.names)}", self.hint)

    def tabulate(self, model: Model) -> Tabulated:
        """Return its actions in all states; the plan raises `Varies` if they are not always the same."""

        def ask(t: int) -> Array:
            states = {name: v.copy() for name, v in states_of(model).items()}
            chosen = self.choose(EpisodeBatch.sharing(t, states, None, np.random.default_rng(0)))
            values = [np.asarray(chosen[c.name]) for c in model.actions.components]
            return one_hot(model, [np.broadcast_to(v, (*v.shape[:-1], model.n_states)) for v in values])

        def plan(t: int) -> Array:
            table = unvaried(partial(ask, t), ASKS if t == 0 else 2)
            if table is None:
                raise Varies
            return table

        return Tabulated(plan, "actions")


class Varies(Exception):
    """A policy does not give the same actions each time it is asked about the same states."""


def unvaried(ask: Callable[[], Array], times: int = ASKS) -> Array | None:
    """Return an answer, if it is the same several times; None if it varies."""
    first = ask()
    for _ in range(times - 1):
        if not np.array_equal(first, ask()):
            return None
    return first


def one_hot(model: Model, values: list[Array]) -> Array:
    """Return actions by component, (*shape, S), as probabilities (A, S)."""
    code, outside = model.actions.encode(values, model.n_states)
    if outside is not None and outside.any():
        state = model.state_name(int(np.flatnonzero(outside)[0]))
        raise SpecError([Diagnostic("E706", None, f"the policy chose an action outside the action space in {state}")])
    table = np.zeros((model.n_actions, model.n_states))
    table[code, np.arange(model.n_states)] = 1.0
    return table


def parameters(function: Any) -> frozenset[str]:
    """Return the names of a function's parameters; none where they are unknown."""
    try:
        return frozenset(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        return frozenset()


def _sb3_probabilities(policy: Any, observations: Any) -> Array | None:
    """Return probabilities (N, A) of a policy of Stable-Baselines3 with categorical actions; None for any other."""
    actor = getattr(policy, "policy", policy)
    if not (hasattr(actor, "get_distribution") and hasattr(actor, "obs_to_tensor")):
        return None
    actor.set_training_mode(False)
    distribution = actor.get_distribution(actor.obs_to_tensor(observations)[0]).distribution
    parts = [distribution]
    if isinstance(distribution, list):
        parts = distribution
    if any(type(part).__name__ not in ("Categorical", "MaskableCategorical") for part in parts):
        return None
    rows = [plain(part.probs).astype(np.float64) for part in parts]
    joint = reduce(lambda a, b: (a[:, :, None] * b[:, None, :]).reshape(len(a), -1), rows)
    return joint / joint.sum(axis=1, keepdims=True)
