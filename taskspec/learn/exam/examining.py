"""An exam: a trial for every task, twin and block of seeds, and what follows from the scores."""

from __future__ import annotations

import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, cast

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.exam.asked_tasks import described_of, exam_id, suites_of, tasks_of
from taskspec.learn.exam.changes import almost, check_comparable
from taskspec.learn.exam.examinee import Examinee, learner_of
from taskspec.learn.exam.findings import diagnose, diagnosis_flag, new_diagnoses, undecided
from taskspec.learn.exam.flags import flags
from taskspec.learn.exam.laws import LAWS, changed_tasks, law_flags, law_scores
from taskspec.learn.exam.learned import DOUBTFUL, compare_with_extended, learned_flags, unfinished
from taskspec.learn.exam.plan import EXTENDED, LOOK_SEEDS, PEEK_SEEDS, Planned, Trials, score_of
from taskspec.learn.exam.results import FORMAT, Exam, Examined, LawScore, Score, ShownExam, read, write
from taskspec.learn.exam.trial import SEEDS, Row, seeds_and_steps
from taskspec.learn.exam.verdicts import verdicts
from taskspec.learn.jobs.code_hash import machine
from taskspec.learn.jobs.engines import Workers
from taskspec.learn.jobs.running import Running
from taskspec.learn.jobs.store import Store

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
        trials = Trials(who, store, running, transitions, twins, peeks, described, steps)
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


def _within(seconds: float, trials: Trials, asked: list[Task], steps: int | None) -> int:
    def pilot(steps: int) -> bool:
        trials.steps = steps
        trials.run(trials.plan(asked, (0,), 0, False))
        return trials.has_scores

    looks = EXTENDED * LOOK_SEEDS * min(DOUBTFUL, len(asked)) / (SEEDS * len(asked))
    runs = 1.0 + trials.twins + trials.peeks * PEEK_SEEDS / SEEDS + looks
    most = steps or max(trials.granted(task) for task in asked)
    seeds, trials.steps = seeds_and_steps(seconds, pilot, runs, most, steps is not None)
    return seeds


def _looked_at(
    trials: Trials, asked: Mapping[str, Task], seeds: tuple[int, ...], about: dict[str, Examined], suite: str,
    until_sure: bool,
) -> Exam:  # fmt: skip
    """Return scores and verdicts; if it goes on until it is sure, seeds are added where it is not.

    Tasks are trained longer, too, where learned values may not be finished.
    """
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
    doubtful = []
    if trials.asks_for_longer:
        doubtful = [asked[name] for name in unfinished(exam["scores"])]
    if doubtful:
        again = trials.extended(doubtful, seeds[:LOOK_SEEDS])
        for planned, block in zip(again, trials.run(again), strict=True):
            if "error" not in block[0]:  # such as a time limit, which is not meant for so many steps
                plan.append(planned)
                rows.append(block)
        verdicts_so_far = exam["verdicts"]
        exam = _exam(trials.who, suite, plan, rows, about)
        exam["verdicts"] = verdicts_so_far
        compare_with_extended(exam["scores"])
    return exam


def _tried(laws: bool | None, declared: Iterable[str]) -> Iterable[str]:
    """Return the laws to try: those that the learner declares, all, or none."""
    if laws is None:
        return declared
    if laws:
        return LAWS
    return ()


def _with_laws(trials: Trials, asked: Mapping[str, Task], laws: Iterable[str], exam: Exam) -> list[LawScore]:
    changed = changed_tasks(asked, laws, exam_id)
    if not changed:
        return []
    others = {each.name: each.changed for each in changed}
    trials.is_compared = False
    plan = trials.plan(others.values(), tuple(exam["seeds"]), 0, False)
    rows = trials.run(plan)
    trials.twins = 0
    return law_scores(changed, exam, _exam(trials.who, "", plan, rows, trials.examined(others)))


def _exam(
    who: Examinee, suite: str, plan: Sequence[Planned], rows: Sequence[list[Row]], tasks: dict[str, Examined]
) -> Exam:
    scores: list[Score] = []
    seeds: dict[int, None] = {}
    for planned, block in zip(plan, rows, strict=True):
        seeds |= dict.fromkeys(planned.trial.seeds)
        about = tasks[exam_id(planned.task)]
        for row in block:
            if planned.twin is None and planned.peek is None:
                about["cannot"] = row.get("cannot")
            if "cannot" not in row:
                scores.append(score_of(planned, row, about))
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
