"""An exam: a trial for every task, twin and block of seeds, and what follows from the scores."""

from __future__ import annotations

import math
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.extras import machine
from taskspec.base.limits import written
from taskspec.exam import baselines
from taskspec.exam.case import ExamTerms
from taskspec.exam.findings import diagnose
from taskspec.exam.learners import Examinee, learner_of
from taskspec.exam.results import FORMAT, Exam, Examined, Score, read, write
from taskspec.exam.trial import LearnerFailed, Row, Trial, run_trial
from taskspec.exam.twins import Modifiers, exam_id, tasks_of, twins_of
from taskspec.exam.verdicts import check_comparable, flags, verdicts
from taskspec.jobs.engine import Standing, run
from taskspec.jobs.store import Job, JobResult, Store
from taskspec.modifiers import modify
from taskspec.task.task import Task, TaskLike

WIDEST = 16
"""Seeds of a block, for learners that train many together."""
PROBED = 5
"""Seeds on which it is tried whether a withheld reward makes a difference."""
EPISODES = 1000
"""For scores that cannot be computed."""


@dataclass(frozen=True)
class Planned:
    """One line of the plan: a task, or a twin of it, or its probe, and a block of seeds."""

    task: Task
    twin: Modifiers | None
    trial: Trial

    @property
    def name(self) -> str:
        what = " negated" if self.trial.negated else "" if self.twin is None else f"+{'+'.join(self.twin)}"
        return f"{self.task.instance_id}{what}, seeds {self.trial.seeds[0]} to {self.trial.seeds[-1]}"


@dataclass(frozen=True)
class Running:
    """How jobs are run: see `taskspec.jobs.run`."""

    workers: int | None = None
    cluster: str | None = None
    seconds: float | None = None
    retry: bool = False
    progress: Callable[[Standing], None] | None = None


def examine(
    learner: str | Callable[[Any], Any], *, suite: str = "derail", tasks: Sequence[TaskLike] | None = None,
    seeds: int | Iterable[int] = 15, steps: int = 500_000, transitions: int = 10_000, twins: int = 2,
    probes: bool = True, learns_from: Sequence[str] | None = None, against: Path | str | None = None,
    out: Path | str | None = None, running: Running | None = None,
) -> Exam:  # fmt: skip
    """Examine a learner; the result is what `exam.json` holds.

    Args:
        learner: `"file.py:train"` or `"module:train"`, which is run in other processes, or a function, which is run in this one.
        suite: whose tasks are asked.
        tasks: those that are asked instead of all of the suite, by name or as anything that `taskspec.load` takes.
        seeds: how many, or which.
        steps: of the environment, for each seed on each task.
        transitions: that the expert demonstrates, at least; whole episodes.
        twins: of every task that has some.
        probes: whether it is tried if a reward that is withheld makes a difference.
        learns_from: what is granted, some of "reward", "demonstrations", "preferences", in place of what the learner says.
        against: a folder with an earlier exam: regressions since then are flagged.
        out: a folder for `exam.json`, and for the results on the way to it, from which an exam that was stopped goes on.
        running: for a learner in other processes: how many, time limits, a cluster.

    Raises:
        SpecError: E710, E711, E713 for a learner or an option that cannot be; E701 for a task that is unknown.
        Interrupted: Ctrl-C; what is done is kept.
    """
    numbers = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
    _check(seeds=len(numbers), steps=steps, transitions=transitions)
    who = learner_of(learner, learns_from)
    asked = tasks_of(suite, tasks)
    terms = ExamTerms(steps, who.learns_from, transitions)
    baseline = None if against is None else _baseline(against, asked, terms)
    plan = _plan(asked, who, numbers, terms, twins, probes)
    folder = None if out is None else Path(out)
    rows, measures = _trained(plan, asked, who, folder, running or Running())
    found = _exam(who, suite, plan, rows, {exam_id(t): _examined(t, measures[exam_id(t)]) for t in asked})
    return _concluded(found, suite, baseline, folder)


def _baseline(folder: Path | str, asked: Sequence[Task], terms: ExamTerms) -> Exam:
    """Return an earlier exam that this one can be compared with."""
    found = read(folder)
    hashes = {exam_id(task): task.content_hash for task in asked}
    check_comparable(found, str(folder), hashes, {"steps": terms.steps, "transitions": terms.transitions})
    return found


def _check(**numbers: int) -> None:
    for name, number in numbers.items():
        if number < 1:
            raise SpecError([Diagnostic("E713", None, f"an exam needs 1 or more {name}, not {number}")])


# -- the plan -----------------------------------------------------------------------------------------------------


def _plan(
    asked: Sequence[Task], who: Examinee, seeds: tuple[int, ...], terms: ExamTerms, twins: int, probes: bool
) -> list[Planned]:
    width = WIDEST if who.together else 1
    blocks = [seeds[i : i + width] for i in range(0, len(seeds), width)]
    plan = []
    for task in asked:
        for twin in (None, *twins_of(task, twins)):
            plan += [_place(task, twin, who, terms, block) for block in blocks]
        if probes and "reward" not in who.learns_from:
            probed = blocks[: max(1, PROBED // width)]
            plan += [_place(task, None, who, terms, block, negated=True) for block in probed]
    return plan


def _place(
    task: Task, twin: Modifiers | None, who: Examinee, terms: ExamTerms, seeds: tuple[int, ...], negated: bool = False
) -> Planned:
    trial = Trial(modify(task, *(twin or ())), negated, who.place or "", who.content, terms, seeds, EPISODES, written())
    return Planned(task, twin, trial)


# -- trials -------------------------------------------------------------------------------------------------------

Rows = list[list[Row]]
"""For each place of the plan, a row for each seed; those of a learner that failed have an `error` alone."""


Measures = dict[str, dict[str, Any]]
"""The yardsticks of each task."""


def _trained(
    plan: Sequence[Planned], asked: Sequence[Task], who: Examinee, folder: Path | None, running: Running
) -> tuple[Rows, Measures]:
    if who.place is None:
        return [_here(planned, who) for planned in plan], {exam_id(t): baselines.measured(t, EPISODES) for t in asked}
    with tempfile.TemporaryDirectory() as scratch, Store((folder or Path(scratch)) / "exam.sqlite") as store:
        return _elsewhere(plan, asked, store, running)


def _here(planned: Planned, who: Examinee) -> list[Row]:
    try:
        return run_trial(planned.trial, who.train)
    except LearnerFailed as error:
        return _failed(planned, str(error))


def _failed(planned: Planned, message: str) -> list[Row]:
    return [{"seed": seed, "error": message} for seed in planned.trial.seeds]


def _elsewhere(plan: Sequence[Planned], asked: Sequence[Task], store: Store, running: Running) -> tuple[Rows, Measures]:
    measures = {exam_id(task): _measuring(task) for task in asked}
    known = run(measures.values(), store, workers=running.workers, cluster=running.cluster, retry_failed=True).rows
    for job in measures.values():
        if known[job.key].status != "done":
            raise SpecError([Diagnostic("E713", None, f"{job.name} cannot be examined: {known[job.key].message}")])
    trials = [Job(planned.trial.key, planned.name, run_trial, (planned.trial,)) for planned in plan]
    done = run(
        trials, store, workers=running.workers, cluster=running.cluster, seconds=running.seconds,
        retry_failed=running.retry, progress=running.progress,
    ).rows  # fmt: skip
    rows = [_rows(planned, done[job.key]) for planned, job in zip(plan, trials, strict=True)]
    return rows, {task: known[job.key].value for task, job in measures.items()}


def _measuring(task: Task) -> Job:
    """Return the job that works out the yardsticks of a task."""
    limits = written()
    key = baselines.key(task.content_hash, EPISODES, limits)
    return Job(key, task.instance_id, baselines.measured_within, (task, EPISODES, limits))


def _rows(planned: Planned, result: JobResult) -> list[Row]:
    if result.status == "done":
        found: list[Row] = result.value
        return found
    return _failed(planned, result.message or result.status)


# -- what was found -----------------------------------------------------------------------------------------------


def _exam(who: Examinee, suite: str, plan: Sequence[Planned], rows: Rows, tasks: dict[str, Examined]) -> Exam:
    pairs = [(p, row) for p, block in zip(plan, rows, strict=True) for row in block]
    for planned, row in pairs:
        if planned.twin is None and not planned.trial.negated:
            tasks[exam_id(planned.task)]["cannot"] = row.get("cannot")
    scores = [_score(p, row, tasks[exam_id(p.task)]) for p, row in pairs if "cannot" not in row]
    terms = plan[0].trial.terms
    seeds = list(dict.fromkeys(seed for p in plan for seed in p.trial.seeds))
    cost = {
        name: float(sum(s[name] or 0 for s in scores)) for name in ("steps", "demonstrations", "comparisons", "seconds")
    }
    where = machine()
    return Exam(
        exam=FORMAT, learner=who.name, learns_from=list(who.learns_from), suite=suite, steps=terms.steps,
        transitions=terms.transitions, seeds=seeds, versions=where.pop("versions"), machine=where,
        command=shlex.join(["taskspec", *sys.argv[1:]]) if Path(sys.argv[0]).name == "taskspec" else "",
        tasks=tasks, scores=scores, verdicts={}, flags=[],
        diagnoses=[], cost=cost,
    )  # fmt: skip


def _concluded(found: Exam, suite: str, baseline: Exam | None, folder: Path | None) -> Exam:
    """Return what follows from the scores; kept in the folder."""
    found["verdicts"] = verdicts(found["tasks"], found["scores"])
    found["flags"] = flags(found["tasks"], found["scores"], baseline)
    found["diagnoses"] = diagnose(found, suite)
    if folder is not None:
        write(found, folder)
    return found


def _examined(task: Task, found: dict[str, Any]) -> Examined:
    return Examined(
        capability=task.capability or task.name, title=task.title, content_hash=task.content_hash,
        random=_finite(found["random"]), expert=_finite(found["expert"]), optimal=_finite(found["optimal"]),
        worst=_finite(found["worst"]), constant=found["constant"], cannot=None,
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    """Return a number as JSON has it; None for others."""
    return value if value is not None and math.isfinite(value) else None


def _score(planned: Planned, row: Row, about: Examined) -> Score:
    """Return a row of results on the scale of its task. Twins have the scale of the task: every return is the same."""
    ends = about["random"], about["expert"]

    def scaled(value: float | None) -> float | None:
        return None if value is None else baselines.score(value, *ends)

    unit = abs((ends[1] or 0) - (ends[0] or 0)) or 1.0
    curve = row.get("curve")
    half = _finite(row.get("deterministic_half"))
    return {
        "task": exam_id(planned.task), "twin": None if planned.twin is None else "+".join(planned.twin),
        "probe": "negated" if planned.trial.negated else None, "seed": row["seed"],
        "deterministic": scaled(row.get("deterministic")), "stochastic": scaled(row.get("stochastic")),
        "half": (half or 0.0) / unit, "return": _finite(row.get("deterministic")), "error": row.get("error"),
        "steps": row.get("steps", 0), "demonstrations": row.get("demonstrations", 0),
        "comparisons": row.get("comparisons", 0), "seconds": row.get("seconds"), "starc": row.get("starc"),
        "reward_regret": None if (lost := row.get("reward_regret")) is None else lost / unit,
        "curve": None if curve is None else [[steps, scaled(value)] for steps, value in curve],
    }  # fmt: skip
