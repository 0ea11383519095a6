"""The report of all checks of a task: its warnings, which of them it accepts, and all else that is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from taskspec.base.diagnostics import Collector, Diagnostic, Span, SpecError, in_order
from taskspec.base.display import html_table, plural
from taskspec.exact.abstraction.abstraction import SymmetryCheck, verify_symmetry
from taskspec.exact.check import model_warnings, spec_warnings
from taskspec.exact.check.spec_warnings import Doubt, LintContext
from taskspec.exact.model.model import NoModel, TooLarge
from taskspec.exact.model.points import Method
from taskspec.exact.rules.claim_verdicts import Verdict, verdicts
from taskspec.exact.rules.examples import wrong_examples
from taskspec.exact.scores.returns import Results
from taskspec.exact.soundness.soundness import Ranges, check_ranges, examine
from taskspec.language.modifiers import is_as_written
from taskspec.language.registry import load
from taskspec.language.task.merge import merge
from taskspec.language.task.questions import written_in
from taskspec.language.task.task import Task, TaskLike
from taskspec.programs.agreement import QUICK, ProgramChecks

KINDS: tuple[tuple[str, Callable[[LintContext], Iterator[Doubt]]], ...] = (
    ("W501", model_warnings.unreachable),
    ("W502", model_warnings.later_rewards),
    ("W503", model_warnings.same_reward),
    ("W504", model_warnings.indifferent),
    ("W505", model_warnings.inert),
    ("W506", spec_warnings.unused_names),
    ("W507", model_warnings.expert),
    ("W510", spec_warnings.moved),
    ("W516", spec_warnings.constant),
    ("W518", spec_warnings.hidden),
    ("W519", model_warnings.unread),
    ("W519", model_warnings.forgotten),
    ("W522", spec_warnings.unproved_abstraction),
    ("W528", model_warnings.illegal),
    ("W530", spec_warnings.unknown_capability),
)  # codes of warnings, and the functions that find them


def warnings(task: TaskLike, results: Results | None = None) -> tuple[Diagnostic, ...]:
    """Look for suspicious parts of a task, for its present parameters.

    Warnings that need an exact model are not looked for where the task is not finite; where a limit forbids the model, W529
    names them.

    Args:
        task: the task, its id or its path.
        results: of the task, where they are known already.

    Returns:
        warnings, sorted by place.

    Raises:
        SpecError: there is no such task, or it has a mistake of form.
    """
    task = load(task)
    return _sanity(task, results or Results(task)).diagnostics


class _Sanity(NamedTuple):
    """Warnings, and the codes of those that were not looked for, because a limit forbids the exact model."""

    diagnostics: tuple[Diagnostic, ...]
    untried: tuple[str, ...]


def _sanity(task: Task, results: Results) -> _Sanity:
    context = LintContext(task, results)
    collector = Collector()
    untried = []
    reason: Diagnostic | None = None
    for code, find in KINDS:
        try:
            for doubt in find(context):
                collector.add(code, doubt.place, doubt.message, doubt.hint, doubt.notes)
        except TooLarge as error:
            untried.append(code)
            reason = error.diagnostics[0]
        except NoModel:
            continue
    if reason is not None:
        message = f"there is no exact model to look for {', '.join(untried)}: {reason.message}"
        collector.add("W529", context.key("name"), message, reason.hint)
    return _Sanity(collector.diagnostics, tuple(untried))


@dataclass(frozen=True, slots=True)
class Accepted:
    """A warning that the spec accepts, the reason, and its place."""

    warning: Diagnostic
    because: str
    place: Span


def set_aside(task: Task, diagnostics: Sequence[Diagnostic]) -> tuple[list[Diagnostic], list[Accepted]]:
    """Split diagnostics into those to report, and warnings that the task accepts."""
    reasons = task.spec.accept
    merged = merge(task.source.document, task.source.variant)
    left = []
    accepted = []
    for each in diagnostics:
        if each.severity == "warning" and each.code in reasons:
            accepted.append(Accepted(each, reasons[each.code], merged.key_span(("accept", each.code))))
        else:
            left.append(each)
    return left, accepted


def idle(task: Task, accepted: Sequence[Accepted], unknown: Sequence[str] = ()) -> list[Diagnostic]:
    """Reasons for warnings that a whole check did not give; `unknown` are codes that it did not look for."""
    merged = merge(task.source.document, task.source.variant)
    needed = {each.warning.code for each in accepted}
    diagnostics = []
    for code in task.spec.accept:
        if code not in needed and code not in unknown:
            place = merged.key_span(("accept", code))
            diagnostics.append(Diagnostic("W511", place, f"there is no {code} to accept", "remove this entry"))
    return diagnostics


@dataclass(frozen=True, slots=True)
class Coverage:
    """Parts of a check that were carried out, and parts that were not; plain data.

    Args:
        cases: other parameter values at which soundness was checked.
        untried_cases: number of other parameter values that a limit or a `require` kept from the check.
        untried_claims: number of claims that were not evaluated: all of them where a task is not sound, or nobody asked.
        untried: codes of warnings that were not looked for, because a limit forbids the exact model.
        examples: number of examples that were checked.
        wrong_examples: indices of examples that are not confirmed.
        programs: number of settings at which each program did what the interpreter does.
        left_out: number of settings at which a program did not run, by program and reason.
    """

    cases: tuple[Mapping[str, Any], ...] = ()
    untried_cases: int = 0
    untried_claims: int = 0
    untried: tuple[str, ...] = ()
    examples: int = 0
    wrong_examples: frozenset[int] = frozenset()
    programs: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[tuple[str, str], int] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """The result of `check`.

    Args:
        task: the task that was checked.
        diagnostics: errors and warnings, sorted by place.
        method: of the check of soundness: all points, or samples.
        results: exact results, computed when they are asked for.
        verdicts: one for each claim that was evaluated.
        symmetries: one check for each declared symmetry.
        accepted: warnings for which the spec itself gives a reason; they are not among the `diagnostics`.
        coverage: numbers of cases, examples and programs that were checked, and of those that were not.
    """

    task: Task
    diagnostics: tuple[Diagnostic, ...]
    method: Method
    results: Results = field(repr=False)
    verdicts: tuple[Verdict, ...] = ()
    symmetries: tuple[SymmetryCheck, ...] = ()
    accepted: tuple[Accepted, ...] = ()
    coverage: Coverage = field(default_factory=Coverage)

    @property
    def codes(self) -> list[str]:
        """Codes of the diagnostics, such as `W506`, in their order."""
        return [each.code for each in self.diagnostics]

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self.diagnostics if d.severity == "error")

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self.diagnostics if d.severity == "warning")

    def __repr__(self) -> str:
        counts = f"{plural(len(self.diagnostics), 'problem')}, {plural(len(self.verdicts), 'verdict')}"
        return f"<Report of {self.task.instance_id}: {counts}>"

    def _repr_html_(self) -> str:
        rows = [(f"{d.severity} {d.code}", d.span or "", d.message, d.hint or "") for d in self.diagnostics]
        rows += [(v.status, "", v.claim.text, v.detail) for v in self.verdicts]
        caption = f"{self.task.id}: {plural(len(self.errors), 'error')}, {plural(len(self.warnings), 'warning')}"
        return html_table(caption, ("", "where", "what", ""), rows)


_MEANINGLESS = {"E404", "E406"}  # no warnings are given without a first state, or for rewards that are not numbers


def check(  # noqa: C901
    task: TaskLike,
    *,
    ranges: bool = True,
    with_warnings: bool = True,
    claims: bool = True,
    programs: Sequence[str] = QUICK,
    beside: Callable[[Task], Sequence[Diagnostic]] | None = None,
) -> Report:
    """Check a task; a wrong task raises nothing, all mistakes are in the report.

    Args:
        task: the task, its id or its path.
        ranges: whether to check soundness for other parameter values, too.
        with_warnings: whether to look for warnings.
        claims: whether to evaluate claims and examples.
        programs: "scalar" and names of backends, whose programs are reset and stepped at every setting, and compared with the
            reference interpreter.
        beside: gives the warnings of other parts of the package (`ELSEWHERE`) for sound tasks; None if they are not looked for.

    Returns:
        the report of all checks.

    Raises:
        SpecError: there is no such task, or it has a mistake of form.
    """
    task = load(task)
    sound = examine(task)
    problems = list(sound.diagnostics)
    is_sound = not any(d.severity == "error" for d in problems)
    run = ProgramChecks(programs)
    if is_sound:
        problems += run.problems(task)
    others = Ranges()
    if ranges and task.parameters:
        others = check_ranges(task, beside=run.problems)
        problems += others.diagnostics
    symmetries = []
    if is_as_written(task):
        symmetries = [verify_symmetry(task, symmetry) for symmetry in task.annotations.symmetries]
    for each in symmetries:
        if each.problem is not None:
            place = merge(task.source.document, task.source.variant).key_span(("symmetries", each.symmetry.name))
            problems.append(Diagnostic("E605", place, f"'{each.symmetry.name}' is not a symmetry: {each.problem}"))
    examples = 0
    wrong = set()
    if claims:
        examples = len(task.annotations.examples)
        for number, problem in wrong_examples(task):
            wrong.add(number)
            problems.append(problem)
    results = Results(task)
    decided: tuple[Verdict, ...] = ()
    untried: tuple[str, ...] = ()
    if with_warnings and is_as_written(task) and not _MEANINGLESS & {d.code for d in sound.diagnostics}:
        doubts, untried = _warnings(task, results)
        problems += doubts
    if claims and is_sound:
        decided = tuple(verdicts(task, results))
        problems += [v.diagnostic for v in decided if v.diagnostic is not None]
    has_errors = any(d.severity == "error" for d in problems)
    unknown = ELSEWHERE
    if beside is not None:
        unknown = ()
        if is_sound:
            problems += beside(task)
    left, accepted = set_aside(task, problems)
    at_defaults = all(p.value == p.default for p in task.parameters)
    if with_warnings and claims and at_defaults and not has_errors:
        left += idle(task, accepted, (*unknown, *untried))
    number_of_claims = sum(len(claim.cases or ({},)) for claim in task.annotations.claims)
    coverage = Coverage(
        cases=others.cases,
        untried_cases=others.untried,
        untried_claims=number_of_claims - len(decided),
        untried=untried,
        examples=examples,
        wrong_examples=frozenset(wrong),
        programs=run.settings,
        left_out=run.left_out,
    )
    return Report(task, in_order(left), sound.method, results, decided, tuple(symmetries), tuple(accepted), coverage)


def _warnings(task: Task, results: Results) -> _Sanity:
    try:
        verified = results.abstraction_check
    except SpecError as error:
        return _Sanity(error.diagnostics, ())
    diagnostics, untried = _sanity(task, results)
    if verified is not None and verified.problem is not None:
        expr = next(iter(written_in(task, "abstraction").values()))
        problem = f"the abstraction is not faithful: {verified.problem}"
        diagnostics = (*diagnostics, Diagnostic("E604", expr.place.span, problem))
    return _Sanity(diagnostics, untried)


ELSEWHERE: tuple[str, ...] = ("W523", "W524", "W527", "W531", "W532")  # warnings about how a task is drawn and printed
