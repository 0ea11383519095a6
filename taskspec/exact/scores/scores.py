"""Scores: the returns of a task that others are normalised by."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError
from taskspec.base.display import html_table
from taskspec.base.files import write_text
from taskspec.base.limits import tell
from taskspec.exact.model.model import misused
from taskspec.exact.rollout.rollout import EPISODES
from taskspec.exact.scores.returns import Results, Return, normalised
from taskspec.language.registry import load
from taskspec.language.task.task import TaskLike

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
    measures: Mapping[str, Mapping[str, Return | None]] = field(default_factory=dict)
    """The expected sum of each measure of the task under each of these policies."""

    @property
    def gap(self) -> float | None:
        """The difference of the optimal return and the expert's; None if one of them is not known exactly."""
        if self.optimal is None or self.expert is None or not (self.optimal.exact and self.expert.exact):
            return None
        return self.optimal.value - self.expert.value

    def normalise(self, value: float, floor: float | None = -1.0) -> float:
        """Score a return: 0 for random actions, 1 for the expert, or for the optimum if there is none.

        Args:
            value: a return.
            floor: the smallest score; None for none.

        Returns:
            the score; nan where one of the two returns is not known.
        """
        top = self.expert or self.optimal
        if top is None or self.random is None:
            return float("nan")
        return normalised(value, self.random.value, top.value, floor)

    def record(self) -> dict[str, Any]:
        """Write the scores as plain data: the fields by name, returns as mappings with "value", "error" and "status"."""
        data = asdict(self) | {"parameters": dict(self.parameters), "gap": self.gap}
        for name in RETURNS:
            data[name] = _return_record(getattr(self, name))
        for name, by_policy in self.measures.items():
            for policy, value in by_policy.items():
                data["measures"][name][policy] = _return_record(value)
        return data

    def rows(self) -> list[dict[str, Any]]:
        """List known returns, as `pandas.DataFrame` takes them.

        Returns:
            a row for each: parameters by name, "id", "return" (its name), "value", "error" and "status".
        """
        rows = []
        for name in RETURNS:
            known = getattr(self, name)
            if known is not None:
                row = {**self.parameters, "id": self.id, "return": name}
                rows.append(row | {"value": known.value, "error": known.error, "status": known.status})
        return rows

    def _repr_html_(self) -> str:
        rows = [(row["return"], row["value"], row["error"], row["status"]) for row in self.rows()]
        return html_table(self.id, ("return", "value", "error", "status"), rows)

    def save(self, path: str | Path) -> None:
        """Write the scores to a JSON file, with the task's content hash."""
        write_text(Path(path), json.dumps(self.record(), indent=2, default=str) + "\n")

    @classmethod
    def load(cls, path: str | Path, task: TaskLike) -> Scores:
        """Read scores from a file.

        Args:
            path: of the file.
            task: the task whose scores they are.

        Returns:
            The scores, as `scores(task)` gives them.

        Raises:
            SpecError: E710, E711 if there is no such file, or it cannot be read; E713 if it contains no scores.
            StaleScores: if they belong to another task, or another version of it.
        """
        task = load(task)
        try:
            scores = TypeAdapter(cls).validate_json(Path(path).read_bytes(), strict=True)
        except FileNotFoundError:
            raise SpecError([Diagnostic("E710", None, f"there is no file {str(path)!r}")]) from None
        except ValidationError as error:
            why = "it is no JSON object"
            for part in error.errors()[0]["loc"][:1]:
                why = f"`{part}` is missing, or wrong"
            misused(f"{str(path)!r} contains no scores: {why}", "compute them again, and save them")
        except (OSError, ValueError) as error:
            raise SpecError([Diagnostic("E711", None, f"cannot read {str(path)!r}: {error}")]) from None
        if scores.id != task.id:
            raise StaleScores(f"E714: {path} holds scores of {scores.id}, not of {task.id}")
        if scores.content_hash != task.content_hash:
            raise StaleScores(f"E714: {path} holds scores of {scores.id} as it was; the task has changed since")
        return scores


def _return_record(value: Return | None) -> dict[str, Any] | None:
    if value is None:
        return None
    return asdict(value) | {"status": value.status}


class StaleScores(TaskspecError, ValueError):
    """Scores in a file belong to another task, or another version of it (E714)."""


def scores(task: TaskLike | Results, episodes: int = EPISODES, seed: int = 0) -> Scores:
    """Compute the optimal, random, worst and expert return of a task: exact if it has a model, otherwise estimated.

    Args:
        task: the task, its id or its path; or its `Results`, with their own episodes and seed.
        episodes: of each estimate.
        seed: of these episodes.

    Returns:
        the returns, discounted as the task says, each with its error; None for a return that cannot be computed.

    Raises:
        SpecError: there is no such task, or it has a mistake.
    """
    tell("the exact model")
    if isinstance(task, Results):
        results = task
    else:
        results = Results(load(task), episodes, seed)
    task = results.task
    model = results.model
    states = None
    actions = None
    if model is not None:
        states = int(model.entered.sum())
        actions = model.n_actions
    return Scores(
        task.id, task.content_hash, task.values, results.optimal, results.random, results.worst, results.expert,
        states, actions, results.why_not, tuple(map(str, task.modifiers)), results.measures,
    )  # fmt: skip
