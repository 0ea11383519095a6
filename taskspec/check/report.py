"""The report of all checks of a task, and its scores."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from taskspec.abstraction.symmetry_proofs import SymmetryCheck, verify_symmetry
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError, in_order
from taskspec.base.display import html_table
from taskspec.base.extras import install, is_installed
from taskspec.base.files import write_text
from taskspec.base.limits import tell
from taskspec.check.warnings import Accepted, idle, set_aside, warnings
from taskspec.model.model import misused
from taskspec.model.points import Method
from taskspec.modifiers import is_as_written
from taskspec.registry import load
from taskspec.rollout.rollout import EPISODES
from taskspec.rules.claim_verdicts import Verdict, verdicts
from taskspec.rules.examples import wrong_examples
from taskspec.scores.returns import Results, Return, normalised, read
from taskspec.soundness.soundness import check_ranges, examine
from taskspec.task.merge import merge
from taskspec.task.task import Task, TaskLike

if TYPE_CHECKING:
    from taskspec.policies.policy import Asking

MODERATE = 4_000_000
"""Entries up to which a model is extracted for warnings alone."""


@dataclass(frozen=True)
class Report:
    """The result of `check`.

    Args:
        method: for soundness: all points, or samples.
        cases: other parameter values that were checked.
        skipped: checks that were not possible, and the reason; None if there are none.
        accepted: warnings for which the spec itself gives a reason; they are not among the `diagnostics`.
        wrong_examples: numbers of examples that are not confirmed.
    """

    task: Task
    diagnostics: tuple[Diagnostic, ...]
    method: Method
    cases: tuple[Mapping[str, Any], ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    skipped: str | None = None
    results: Results | None = field(default=None, repr=False)
    accepted: tuple[Accepted, ...] = ()
    wrong_examples: frozenset[int] = frozenset()
    symmetries: tuple[SymmetryCheck, ...] = ()

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self.diagnostics if d.severity == "error")

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self.diagnostics if d.severity == "warning")

    @cached_property
    def unlimited(self) -> Results:
        """Returns by a model as large as limits allow; warnings alone use a moderate one."""
        if self.results is None or self.results.limit is not None:
            return Results(self.task)
        return self.results

    def _repr_html_(self) -> str:
        """Return diagnostics and verdicts on claims, for notebooks."""
        found = [(f"{d.severity} {d.code}", d.span or "", d.message, d.hint or "") for d in self.diagnostics]
        said = [(v.status, "", v.claim.text, v.detail) for v in self.verdicts]
        caption = f"{self.task.id}: {len(self.errors)} errors, {len(self.warnings)} warnings"
        return html_table(caption, ("", "where", "what", ""), [*found, *said])


_MEANINGLESS = {"E404", "E406"}
"""No warnings are given without a first state, or for rewards that are not numbers."""


def check(  # noqa: C901
    task: TaskLike,
    *,
    ranges: bool = True,
    with_warnings: bool = True,
    claims: bool = True,
    beside: Callable[[Task], Sequence[Diagnostic]] | None = None,
) -> Report:
    """Check a task; a wrong task raises nothing, all mistakes are in the report.

    Args:
        ranges: whether to check soundness for other parameter values, too.
        with_warnings: whether to look for warnings.
        claims: whether to evaluate claims and examples.
        beside: gives the warnings of other parts of the package (`ELSEWHERE`) for sound tasks; None if they are not looked for.
    """
    task = load(task)
    sound = examine(task)
    found = list(sound.diagnostics)
    cases: tuple[Mapping[str, Any], ...] = ()
    if ranges and task.parameters:
        others = check_ranges(task)
        found += others.diagnostics
        cases = others.cases
    symmetries = []
    for symmetry in task.symmetries if is_as_written(task) else ():
        each = verify_symmetry(task, symmetry)
        symmetries.append(each)
        if each.problem is not None:
            place = merge(task.document, task.variant).key_span(("symmetries", each.symmetry.name))
            found.append(Diagnostic("E605", place, f"'{each.symmetry.name}' is not a symmetry: {each.problem}"))
    wrong = list(wrong_examples(task)) if claims else []
    found += [diagnostic for _, diagnostic in wrong]
    report = Report(task, (), sound.method, cases, wrong_examples=frozenset(dict(wrong)), symmetries=tuple(symmetries))
    if not is_installed("scipy"):
        skipped = None
        if with_warnings or claims:
            skipped = f"sanity checks and claims need scipy: {install('exact')}"
        return replace(report, diagnostics=in_order(found), skipped=skipped)
    results = Results(task) if task.claims else Results(task, limit=MODERATE)
    decided: tuple[Verdict, ...] = ()
    if with_warnings and is_as_written(task) and not _MEANINGLESS & {d.code for d in sound.diagnostics}:
        found += _warnings(task, results)
    is_sound = not any(d.severity == "error" for d in sound.diagnostics)
    if claims and is_sound:
        decided = tuple(verdicts(task, results))
        found += [v.diagnostic for v in decided if v.diagnostic is not None]
    has_errors = any(d.severity == "error" for d in found)
    unknown = ELSEWHERE
    if beside is not None:
        unknown = ()
        if is_sound:
            found += beside(task)
    left, accepted = set_aside(task, found)
    at_defaults = all(p.value == p.default for p in task.parameters)
    if with_warnings and claims and at_defaults and not has_errors:
        left += idle(task, accepted, unknown)
    return replace(report, diagnostics=in_order(left), verdicts=decided, results=results, accepted=tuple(accepted))


def _warnings(task: Task, results: Results) -> list[Diagnostic]:
    try:
        stand_in = results.abstraction
    except SpecError as error:
        return list(error.diagnostics)
    found = list(warnings(task, results))
    if stand_in is not None and results.abstraction_check is not None and results.abstraction_check.problem is not None:
        expr = next(iter(task.surface.sections["abstraction"].values()))
        problem = f"the abstraction is not faithful: {results.abstraction_check.problem}"
        found.append(Diagnostic("E604", expr.place.span, problem))
    return found


ELSEWHERE: tuple[str, ...] = ("W523",)
"""Warnings about how a task is drawn."""
RETURNS = ("optimal", "random", "worst", "expert")


# -- scores ---------------------------------------------------------------------------------------


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
    states: int | None = None
    actions: int | None = None
    why_not_exact: str | None = None
    modifiers: tuple[str, ...] = ()

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
        data = read(path, RETURNS)
        if data["content_hash"] != task.content_hash or data["id"] != task.id:
            raise StaleScores(f"E714: {path} holds scores of {data['id']} as it was; the task has changed since")
        for name in RETURNS:
            record = data[name]
            if record is not None:
                record.pop("status", None)
                data[name] = Return(**record)
        return cls(**data | {"modifiers": tuple(data["modifiers"])})


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
