"""Scores: the returns of a task that others are normalised by, and the place of a policy between them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError
from taskspec.base.display import html_table
from taskspec.base.files import write_text
from taskspec.base.limits import tell
from taskspec.model.model import misused
from taskspec.registry import load
from taskspec.rollout.rollout import EPISODES
from taskspec.scores.returns import Results, Return, normalised
from taskspec.task.task import TaskLike

if TYPE_CHECKING:
    from taskspec.policies.policy import Asking

RETURNS = ("optimal", "random", "worst", "expert")


@dataclass(frozen=True)
class Scores:
    """The returns that scores of a task are normalised by; None for those that cannot be computed."""

    id: str
    content_hash: str
    parameters: Mapping[str, Any]
    optimal: Return | None
    random: Return | None
    worst: Return | None
    expert: Return | None
    states: int | None
    actions: int | None
    why_not_exact: str | None
    modifiers: tuple[str, ...]

    @property
    def gap(self) -> float | None:
        """The difference of the optimal return and the expert's; None if one of them is not known exactly."""
        if self.optimal is None or self.expert is None or not (self.optimal.exact and self.expert.exact):
            return None
        return self.optimal.value - self.expert.value

    def normalise(self, value: float, floor: float | None = -1.0) -> float:
        """Return the score of a return: 0 for random actions, 1 for the expert (the optimum if there is none)."""
        top = self.expert or self.optimal
        if top is None or self.random is None:
            return float("nan")
        return normalised(value, self.random.value, top.value, floor)

    def record(self) -> dict[str, Any]:
        """Return all of it as plain data for JSON."""
        returns = {name: getattr(self, name) for name in RETURNS}
        found = asdict(self) | {"parameters": dict(self.parameters), "gap": self.gap}
        for name, value in returns.items():
            if value is not None:
                found[name] = asdict(value) | {"status": value.status}
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return one flat row for each known return, as `pandas.DataFrame` takes them."""
        known = [(name, found) for name in RETURNS if (found := getattr(self, name)) is not None]
        return [
            {**self.parameters, "id": self.id, "return": name, "value": r.value, "error": r.error, "status": r.status}
            for name, r in known
        ]

    def _repr_html_(self) -> str:
        """Return the returns, for notebooks."""
        rows = [(row["return"], row["value"], row["error"], row["status"]) for row in self.rows()]
        return html_table(self.id, ("return", "value", "error", "status"), rows)

    def save(self, path: str | Path) -> None:
        """Write the scores to a JSON file, with the task's content hash."""
        write_text(Path(path), json.dumps(self.record(), indent=2, default=str) + "\n")

    @classmethod
    def load(cls, path: str | Path, task: TaskLike) -> Scores:
        """Return scores from a file.

        Raises:
            SpecError: E710, E711 if there is no such file, or it cannot be read; E713 if it contains no scores.
            StaleScores: if they belong to another version of the task.
        """
        task = load(task)
        try:
            found = TypeAdapter(cls).validate_json(Path(path).read_bytes(), strict=True)
        except FileNotFoundError:
            raise SpecError([Diagnostic("E710", None, f"there is no file {str(path)!r}")]) from None
        except ValidationError as error:
            why = "it is no JSON object"
            for part in error.errors()[0]["loc"][:1]:
                why = f"`{part}` is missing, or wrong"
            misused(f"{str(path)!r} contains no scores: {why}", "compute them again, and save them")
        except (OSError, ValueError) as error:
            raise SpecError([Diagnostic("E711", None, f"cannot read {str(path)!r}: {error}")]) from None
        if found.content_hash != task.content_hash or found.id != task.id:
            raise StaleScores(f"E714: {path} holds scores of {found.id} as it was; the task has changed since")
        return found


class StaleScores(TaskspecError, ValueError):
    """Scores in a file belong to another version of the task (E714)."""


def scores(task: TaskLike | Results, episodes: int = EPISODES, seed: int = 0) -> Scores:
    """Return optimal, random, worst and expert return of a task: exact if it has a model, otherwise estimated.

    Args:
        task: the task, its id or its path; or its `Results`, with their own episodes and seed.
        episodes: of each estimate.
        seed: of these episodes.
    """
    tell("the exact model")
    results = task if isinstance(task, Results) else Results(load(task), episodes, seed)
    task = results.task
    model = results.model
    states = None
    actions = None
    if model is not None:
        states = int(model.entered.sum())
        actions = model.n_actions
    return Scores(
        task.id, task.content_hash, task.values, results.optimal, results.random, results.worst, results.expert,
        states, actions, results.why_not, tuple(map(str, task.modifiers)),
    )  # fmt: skip


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
        """Return the confidence interval of the normalised score."""
        low, high = self.value.interval(confidence)
        return self.scores.normalise(low), self.scores.normalise(high)


def score(
    task: TaskLike,
    policy: Any = None,
    *,
    returns: Sequence[float] | None = None,
    deterministic: bool | None = None,
    episodes: int = EPISODES,
    seed: int = 0,
    known: Scores | None = None,
) -> Score:
    """Return the score of a policy, or of the returns of its episodes.

    Args:
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

    Raises:
        SpecError: E706 for actions outside the action space, E712 if a missing exact model is needed, E713 for anything that
            is not a policy.
    """
    from taskspec.policies.values import policy_value

    if (policy is None) == (returns is None):
        misused("`score` takes a policy, or `returns=` of episodes")
    task = load(task)
    measured = known or scores(task, episodes, seed)
    if returns is not None:
        value = Return.estimated(_numbers(returns))
        return Score(value, measured.normalise(value.value), measured, "returns")
    found = policy_value(Results(task, episodes, seed), policy, deterministic)
    return Score(found.value, measured.normalise(found.value.value), measured, found.asked)


def _numbers(returns: Sequence[float]) -> Array:
    try:
        array = np.asarray(returns, np.float64)
    except (TypeError, ValueError):
        array = np.zeros((0, 0))
    if array.ndim != 1 or not array.size:
        misused("`returns` is a list of numbers, one for each episode")
    if np.isnan(array).any():
        misused(f"return number {int(np.isnan(array).argmax()) + 1} of {array.size} is nan")
    return array
