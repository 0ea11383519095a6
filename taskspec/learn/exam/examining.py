"""An exam: a trial for every task, twin and block of seeds, and what follows from the scores."""

from __future__ import annotations

import itertools
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import duration, plural
from taskspec.base.limits import written
from taskspec.language.modifiers import modify
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.documents.document_models import ExamDocument
from taskspec.learn.exam.asked_tasks import Modifiers, described_of, exam_id, suites_of, tasks_of, twins_of
from taskspec.learn.exam.case import ExamTerms
from taskspec.learn.exam.changes import almost, check_comparable
from taskspec.learn.exam.examinee import Examinee, learner_of
from taskspec.learn.exam.findings import diagnose, diagnosis_flag, new_diagnoses, undecided
from taskspec.learn.exam.flags import flags
from taskspec.learn.exam.laws import LAWS, changed_tasks, law_flags, law_scores
from taskspec.learn.exam.learned import learned_flags
from taskspec.learn.exam.results import FORMAT, Exam, Examined, LawScore, Score, ShownExam, finite, read, write
from taskspec.learn.exam.trial import (
    SEEDS,
    LearnerFailed,
    Row,
    Trial,
    baselines,
    key_of,
    run_trial,
    score,
    seeds_and_steps,
)
from taskspec.learn.exam.verdicts import verdicts
from taskspec.learn.jobs.code_hash import machine
from taskspec.learn.jobs.engines import Workers
from taskspec.learn.jobs.running import Running, run
from taskspec.learn.jobs.store import Job, Store

WIDEST = 16
"""Seeds of a block, for learners that train many together."""
PEEK_SEEDS = 5
"""Seeds that are tried with a withheld reward negated."""
EPISODES = 1000
"""For scores that cannot be computed."""
PRINTED = "printed.txt"
"""The file beside the results that has what the learner printed, the last of each trial."""
STEPS = 500_000
"""Environment steps of each training run, unless a number is given or the suite's `exam.yaml` has one."""


@dataclass(frozen=True)
class Planned:
    """One line of the plan: a task, or a twin of it, or one whose reward is negated, and a block of seeds."""

    task: Task
    twin: Modifiers | None
    trial: Trial

    @property
    def name(self) -> str:
        kind = ""
        if self.twin is not None:
            kind = f"+{'+'.join(self.twin)}"
        if self.trial.negated:
            kind = " negated"
        first, *others = self.trial.seeds
        if not others:
            return f"{self.task.instance_id}{kind}, seed {first}"
        return f"{self.task.instance_id}{kind}, seeds {first} to {others[-1]}"


LOOKS = (4, 17, 30)
"""Seeds after which an exam that goes on until it is sure looks at its results: all that fail, and all that pass, show at the
first and at the second. Each look has an equal share of the risk, so that all together err as rarely as one."""


def examine(
    learner: str | Callable[[Any], Any], *, suite: str | None = None, tasks: Sequence[TaskLike] | None = None,
    seeds: int | Iterable[int] | None = None, steps: int | None = None, transitions: int = 10_000, twins: int = 2,
    peeks: bool = True, learns_from: Sequence[str] | None = None, against: Path | str | None = None,
    within: float | None = None, until_sure: bool = False, out: Path | str | None = None, running: Running | None = None,
    laws: bool | None = None, announce: Callable[[str], None] | None = None,
) -> Exam:  # fmt: skip
    """Examine a learner; the result is what `exam.json` holds.

    Args:
        learner: `"file.py:train"` or `"module:train"`, which is run in other processes, or a function, which is run in this one.
        suite: whose tasks are asked; probes unless given.
        tasks: those that are asked instead of all of the suite, by name (in derail or probes, unless a suite is given) or as
            anything that `taskspec.load` takes.
        seeds: how many, or which; 15 unless given.
        steps: of the environment, for each seed on each task; unless given, those that the suite's `exam.yaml` names, or 500,000.
        transitions: that the expert demonstrates, at least; whole episodes.
        twins: of every task that has some.
        peeks: whether it is tried if a reward that is withheld makes a difference.
        learns_from: what is granted, some of "reward", "demonstrations", "preferences", in place of what the learner says.
        against: a folder with an earlier exam: changes since then are flagged.
        within: seconds for the whole exam: seeds and steps that are not given are chosen, from two short trials.
        until_sure: seeds are added until each capability is mastered or failed, at most 30: group-sequential, with 3 looks.
        out: a folder for `exam.json`, and for the results on the way to it, from which an exam that was stopped goes on.
        running: for a learner in other processes: how many, time limits, a cluster.
        laws: whether all laws of learning are tried, or none; those that the learner declares unless given.
        announce: called with a line about how long it will take, once two seeds have been trained on every task; for a learner
            in other processes of this machine.

    Returns:
        Tasks, scores of each run, flags and diagnoses.

    Raises:
        SpecError: E710, E711, E713 for a learner or an option that cannot be; E701 for a task that is unknown.
        Interrupted: Ctrl-C; what is done is kept.
    """
    if until_sure and (seeds is not None or within is not None):
        raise spec_error("E713", "an exam until it is sure chooses its own seeds, and takes its time")
    numbers = _numbers(seeds, until_sure)
    _check_counts({"seeds": len(numbers), "steps": steps, "transitions": transitions})
    who = learner_of(learner, learns_from)
    suites = suites_of(suite, tasks)
    asked = {exam_id(task): task for task in tasks_of(suites, tasks)}
    baseline = None
    if against is not None:
        baseline = read(against)
        if within is not None and steps is None:
            steps = baseline["steps"]
    folder = None if out is None else Path(out)
    kept = None if who.place is None else folder
    described = {name: described_of(name) for name in suites}
    running = running or Running()
    with (
        tempfile.TemporaryDirectory() as scratch,
        Store((kept or Path(scratch)) / "exam.sqlite") as store,
        _processes(who, running) as workers,
    ):
        trials = _Trials(who, store, running, transitions, twins, peeks, described, steps)
        trials.workers = workers
        trials.kept = kept
        if within is not None:
            affordable = _within(within, trials, list(asked.values()), steps)
            numbers = _numbers(affordable if seeds is None else seeds, until_sure)
        if baseline is not None:
            hashes = {name: task.content_hash for name, task in asked.items()}
            most = max(trials.granted(task) for task in asked.values())
            check_comparable(baseline, str(against), hashes, {"steps": most, "transitions": transitions})
        about = trials.examined(asked)
        is_tried = within is not None
        if announce is not None and workers is not None and not is_tried:
            announce(trials.estimate(list(asked.values()), numbers, workers.count))
            is_tried = True
        if is_tried and not trials.has_scores:  # the report says why, without more runs
            numbers = numbers[:1]
            trials.twins = 0
            trials.peeks = False
        exam = _looked_at(trials, asked, numbers, about, " and ".join(suites), until_sure)
        declared = getattr(who.train, "obeys", ())
        laws_found = _with_laws(trials, asked, _tried(laws, declared), exam)
    exam["flags"] = [*flags(exam["tasks"], exam["scores"], baseline), *learned_flags(exam["scores"])]
    if laws_found:
        exam["laws"] = laws_found
        exam["flags"] += law_flags(laws_found, declared)
    _diagnose(exam, suites, baseline)
    if folder is not None:
        write(exam, folder)
    return exam


def _check_counts(counts: Mapping[str, int | None]) -> None:
    for name, number in counts.items():
        if number is not None and number < 1:
            raise SpecError([Diagnostic("E713", None, f"an exam needs 1 or more {name}, not {number}")])


def _processes(who: Examinee, running: Running) -> AbstractContextManager[Workers | None]:
    """Return the processes of this machine that do all jobs of an exam; none where it is done here, or on a cluster."""
    if who.place is None or running.cluster is not None:
        return nullcontext()
    return Workers(running.workers)


def _diagnose(exam: Exam, suites: Iterable[str], baseline: Exam | None) -> None:
    """Add diagnoses, those that are nearly made, and flags for those that the baseline does not get."""
    exam["undecided"] = []
    for name in suites:
        exam["diagnoses"] += diagnose(exam, name)
        exam["undecided"] += undecided(exam, name)
    if baseline is not None:
        exam["undecided"] += almost(exam["tasks"], exam["scores"], baseline)
        for name in suites:
            exam["flags"] += [diagnosis_flag(exam, each) for each in new_diagnoses(exam, baseline, name)]


def _numbers(seeds: int | Iterable[int] | None, until_sure: bool) -> tuple[int, ...]:
    if until_sure:
        return tuple(range(LOOKS[-1]))
    if seeds is None:
        return tuple(range(SEEDS))
    if isinstance(seeds, int):
        return tuple(range(seeds))
    return tuple(seeds)


def _within(seconds: float, trials: _Trials, asked: list[Task], steps: int | None) -> int:
    def pilot(steps: int) -> bool:
        trials.steps = steps
        trials.run(trials.plan(asked, (0,), 0, False))
        return trials.has_scores

    runs = 1.0 + trials.twins + trials.peeks * PEEK_SEEDS / SEEDS
    most = steps or max(trials.granted(task) for task in asked)
    seeds, trials.steps = seeds_and_steps(seconds, pilot, runs, most, steps is not None)
    return seeds


def _looked_at(
    trials: _Trials, asked: Mapping[str, Task], seeds: tuple[int, ...], about: dict[str, Examined], suite: str,
    until_sure: bool,
) -> Exam:  # fmt: skip
    """Return scores and verdicts; if it goes on until it is sure, seeds are added where it is not."""
    ends = LOOKS if until_sure else (len(seeds),)
    plan: list[Planned] = []
    rows: list[list[Row]] = []
    open_tasks = list(asked)
    begin = 0
    for end in ends:
        left = [asked[name] for name in open_tasks]
        added = trials.plan(left, seeds[begin:end], trials.twins, trials.peeks and not begin)
        plan += added
        rows += trials.run(added)
        begin = end
        exam = _exam(trials.who, suite, plan, rows, about)
        exam["verdicts"] = verdicts(exam["tasks"], exam["scores"], len(ends))
        open_tasks = []
        for each in exam["verdicts"].values():
            if each["verdict"] == "unsure":
                open_tasks += each["tasks"]
        if not open_tasks:
            break
    return exam


def _tried(laws: bool | None, declared: Iterable[str]) -> Iterable[str]:
    """Return the laws to try: those that the learner declares, all, or none."""
    if laws is None:
        return declared
    if laws:
        return LAWS
    return ()


def _with_laws(trials: _Trials, asked: Mapping[str, Task], laws: Iterable[str], exam: Exam) -> list[LawScore]:
    changed = changed_tasks(asked, laws, exam_id)
    if not changed:
        return []
    others = {each.name: each.changed for each in changed}
    trials.is_compared = False
    plan = trials.plan(others.values(), tuple(exam["seeds"]), 0, False)
    rows = trials.run(plan)
    trials.twins = 0
    return law_scores(changed, exam, _exam(trials.who, "", plan, rows, trials.examined(others)))


# The plan, and the jobs that it consists of.


@dataclass
class _Trials:
    """The trials of a learner: how they are planned and run."""

    who: Examinee
    store: Store
    running: Running
    transitions: int
    twins: int
    peeks: bool
    described: Mapping[str, ExamDocument]
    steps: int | None
    workers: Workers | None = None
    kept: Path | None = None
    is_compared: bool = True
    """Whether what was learned is compared with known mistakes."""
    has_scores: bool = False
    """Whether a training run succeeded."""

    def granted(self, task: Task) -> int:
        """Return the steps of a training run on a task."""
        return self.steps or self._suite(task).steps or STEPS

    def _suite(self, task: Task) -> ExamDocument:
        return self.described.get(task.source.suite, ExamDocument(exam=1))

    def plan(self, asked: Iterable[Task], seeds: tuple[int, ...], twins: int, peeks: bool) -> list[Planned]:
        """Return a trial for every task, twin and block of seeds, and for the first seeds with withheld rewards negated."""
        width = WIDEST if self.who.together else 1
        blocks = [seeds[i : i + width] for i in range(0, len(seeds), width)]
        peeking = []
        if peeks and "reward" not in self.who.learns_from:
            peeking = blocks[: max(1, PEEK_SEEDS // width)]
        plan = []
        for task in asked:
            for twin in (None, *twins_of(task, twins)):
                plan += [self._planned(task, twin, block) for block in blocks]
            plan += [self._planned(task, None, block, negated=True) for block in peeking]
        return plan

    def _planned(self, task: Task, twin: Modifiers | None, block: tuple[int, ...], negated: bool = False) -> Planned:
        about = modify(task, *(twin or ()))
        terms = ExamTerms(self.granted(task), self.who.learns_from, self.transitions)
        evaluate = self._suite(task).evaluate
        horizon = None
        if evaluate is not None:
            horizon = evaluate.longer_than(task.horizon)
        place = self.who.place or ""
        trial = Trial(
            about, negated, place, self.who.content, terms, block, EPISODES, written(), horizon, self.is_compared
        )
        return Planned(task, twin, trial)

    def estimate(self, asked: Sequence[Task], seeds: tuple[int, ...], processes: int) -> str:
        """Return in a line how long the exam will take, after one trial or two of every task, which are a part of it.

        The first one of each form of a task also prepares what the others use.
        """
        plan = self.plan(asked, seeds, self.twins, self.peeks)
        tried: dict[str, list[Planned]] = {}
        for planned in plan:
            some = tried.setdefault(exam_id(planned.task), [])
            if len(some) < 2 and planned.twin is None and not planned.trial.negated:
                some.append(planned)
        self.run(list(itertools.chain.from_iterable(tried.values())))
        known = self.store.results(planned.trial.key for planned in plan)
        each: dict[str, float] = {}
        preparing: dict[str, float] = {}
        for name, some in tried.items():
            spent = [known[planned.trial.key].seconds for planned in some]
            each[name] = min(spent)
            preparing[name] = spent[0] - each[name]
        seconds = 0.0
        forms: dict[str, float] = {}
        for planned in plan:
            if planned.trial.key not in known:
                name = exam_id(planned.task)
                seconds += each[name]
                if planned.twin:
                    forms[planned.trial.about.content_hash] = preparing[name]
        seconds += sum(forms.values())
        trials = f"{plural(len(plan), 'trial')} of at most {max(map(self.granted, asked)):,} steps"
        return f"{trials}, {processes} at a time: about {duration(seconds / processes)}"

    def run(self, plan: Sequence[Planned]) -> list[list[Row]]:
        """Return rows for each line of the plan; those of a learner that failed have an `error` alone."""
        if self.who.place is None:
            rows = [_trained_here(planned, self.who) for planned in plan]
        else:
            rows = self._trained_apart(plan)
        for block in rows:
            self.has_scores |= any("deterministic" in row for row in block)
        return rows

    def _trained_apart(self, plan: Sequence[Planned]) -> list[list[Row]]:

        jobs = []
        for planned in plan:
            trial = planned.trial
            group = trial.about.content_hash
            jobs.append(Job(trial.key, planned.name, run_trial, (trial,), group, limits_itself=True))
        printed = None
        if self.kept is not None:
            printed = self.kept / PRINTED
        done = run(jobs, self.store, self.running, self.who.name, self.workers, printed)
        rows = []
        for job, planned in zip(jobs, plan, strict=True):
            result = done[job.key]
            if result.status == "done":
                rows.append(result.value)
            else:
                rows.append(_failed(planned, result.message or result.status))
        return rows

    def examined(self, asked: Mapping[str, Task]) -> dict[str, Examined]:
        """Return each task with its baselines, which are those of its twins, too."""
        variants = {}
        for name, task in asked.items():
            variants[name] = [task, *(modify(task, *twin) for twin in twins_of(task, self.twins))]
        measured = self._measured(itertools.chain.from_iterable(variants.values()))
        about = {}
        for name, tasks in variants.items():
            about[name] = _examined(asked[name], [measured[task.content_hash] for task in tasks])
        return about

    def _measured(self, tasks: Iterable[Task]) -> dict[str, dict[str, Any]]:
        """Return baselines by the content hash of a task."""
        if self.who.place is None:
            return {task.content_hash: baselines(task, EPISODES, written()) for task in tasks}
        jobs = {}
        for task in tasks:
            key = key_of("baselines and constants", task.content_hash, EPISODES, written())
            arguments = (task, EPISODES, written())
            jobs[task.content_hash] = Job(key, task.instance_id, baselines, arguments, task.content_hash)
        running = replace(self.running, seconds=None, retry=True)
        known = run(jobs.values(), self.store, running, f"{self.who.name}: baselines", self.workers)
        measured = {}
        for content_hash, job in jobs.items():
            result = known[job.key]
            if result.status != "done":
                raise SpecError([Diagnostic("E713", None, f"{job.name} cannot be examined: {result.message}")])
            measured[content_hash] = result.value
        return measured


def _trained_here(planned: Planned, who: Examinee) -> list[Row]:
    try:
        return run_trial(planned.trial, who.train)
    except LearnerFailed as error:
        return _failed(planned, str(error))


def _failed(planned: Planned, message: str) -> list[Row]:
    return [{"seed": seed, "error": message} for seed in planned.trial.seeds]


# Scores.


def _exam(
    who: Examinee, suite: str, plan: Sequence[Planned], rows: Sequence[list[Row]], tasks: dict[str, Examined]
) -> Exam:
    scores: list[Score] = []
    seeds: dict[int, None] = {}
    for planned, block in zip(plan, rows, strict=True):
        seeds |= dict.fromkeys(planned.trial.seeds)
        about = tasks[exam_id(planned.task)]
        for row in block:
            if planned.twin is None and not planned.trial.negated:
                about["cannot"] = row.get("cannot")
            if "cannot" not in row:
                scores.append(_score(planned, row, about))
    terms = plan[0].trial.terms
    cost: dict[str, float] = {}
    for name in ("steps", "demonstrations", "comparisons", "seconds"):
        cost[name] = float(sum(s[name] or 0 for s in scores))
    where = machine()
    command = ""
    if Path(sys.argv[0]).name == "taskspec":
        command = shlex.join(["taskspec", *sys.argv[1:]])
    exam = Exam(
        exam=FORMAT, learner=who.name, learns_from=list(who.learns_from), suite=suite, steps=terms.steps,
        transitions=terms.transitions, seeds=list(seeds), versions=where.pop("versions"), machine=where, command=command,
        tasks=tasks, scores=scores, verdicts={}, flags=[], diagnoses=[], cost=cost,
    )  # fmt: skip
    return cast(Exam, ShownExam(exam))


def _examined(task: Task, measured: list[dict[str, Any]]) -> Examined:
    own, *twins = measured
    constants = own["constants"]
    worst = constants
    if twins and constants:
        on_twins = np.mean([twin["constants"] for twin in twins], axis=0).tolist()
        worst = [min(pair) for pair in zip(constants, on_twins, strict=True)]
    return Examined(
        capability=task.capability or task.name, title=task.title, content_hash=task.content_hash,
        random=finite(own["random"]), expert=finite(own["expert"]), optimal=finite(own["optimal"]),
        worst=finite(own["worst"]), constant=max(constants, default=None), fixed=max(worst, default=None), cannot=None,
    )  # fmt: skip


def _score(planned: Planned, row: Row, about: Examined) -> Score:
    """Return a row of results on the scale of its task. Twins have the scale of the task: every return is the same."""
    random = about["random"]
    expert = about["expert"]

    def scaled(value: float | None) -> float | None:
        if value is None:
            return None
        return score(value, random, expert)

    unit = abs((expert or 0) - (random or 0)) or 1.0

    def in_units(value: float | None) -> float | None:
        if value is None:
            return None
        return value / unit

    curve = row.get("curve")
    if curve is not None:
        curve = [[steps, scaled(value)] for steps, value in curve]
    twin = None
    if planned.twin is not None:
        twin = "+".join(planned.twin)
    return {
        "task": exam_id(planned.task), "twin": twin, "peek": "negated" if planned.trial.negated else None,
        "seed": row["seed"],
        "deterministic": scaled(row.get("deterministic")), "stochastic": scaled(row.get("stochastic")),
        "half": (finite(row.get("deterministic_half")) or 0.0) / unit, "return": finite(row.get("deterministic")),
        "error": row.get("error"), "steps": row.get("steps", 0), "demonstrations": row.get("demonstrations", 0),
        "comparisons": row.get("comparisons", 0), "seconds": row.get("seconds"), "starc": row.get("starc"),
        "reward_regret": in_units(row.get("reward_regret")), "curve": curve,
        "operators": row.get("operators"), "told": row.get("told"), "unread": row.get("unread"),
        "rewards": row.get("rewards"), "pairings": row.get("pairings"),
        "value": in_units(row.get("value")), "longer": row.get("longer"), "explained": row.get("explained"),
        "reseeded": row.get("reseeded"),
    }  # fmt: skip
