"""An exam: a trial for every task, twin and block of seeds, and what follows from the scores."""

from __future__ import annotations

import math
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from taskspec import registry
from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.extras import machine
from taskspec.base.ids import InstanceId
from taskspec.base.limits import written
from taskspec.data import demonstrations
from taskspec.exam.case import ExamTerms
from taskspec.exam.examinee import Examinee, learner_of
from taskspec.exam.findings import diagnose
from taskspec.exam.flags import check_comparable, flags
from taskspec.exam.laws import LAWS, changed_tasks, law_flags, law_scores
from taskspec.exam.learned import learned_flags
from taskspec.exam.results import FORMAT, Exam, Examined, Score, read, write
from taskspec.exam.trial import LearnerFailed, Row, Trial, baselines, key_of, run_trial, score
from taskspec.exam.verdicts import verdicts
from taskspec.jobs.running import JobProgress, run
from taskspec.jobs.store import Job, Store
from taskspec.modifiers import keeps_observers, modify
from taskspec.rules.rule_books import EXAM, file_of, read_exam
from taskspec.task.schema.experiments import ExamDocument
from taskspec.task.task import Task, TaskLike

WIDEST = 16
"""Seeds of a block, for learners that train many together."""
PROBED = 5
"""Seeds that are tried with a withheld reward negated."""
EPISODES = 1000
"""For scores that cannot be computed."""
SUITES = ("derail", "probes")
"""The suites of an exam, unless one is named."""
STEPS = 500_000
"""Environment steps of each training run, unless a number is given or the suite's `exam.yaml` has one."""

Modifiers = tuple[str, ...]


@dataclass(frozen=True)
class Planned:
    """One line of the plan: a task, or a twin of it, or its probe, and a block of seeds."""

    task: Task
    twin: Modifiers | None
    trial: Trial

    @property
    def name(self) -> str:
        kind = "" if self.twin is None else f"+{'+'.join(self.twin)}"
        if self.trial.negated:
            kind = " negated"
        return f"{self.task.instance_id}{kind}, seeds {self.trial.seeds[0]} to {self.trial.seeds[-1]}"


@dataclass(frozen=True)
class Running:
    """How jobs are run: see `taskspec.jobs.running.run`."""

    workers: int | None = None
    cluster: str | None = None
    seconds: float | None = None
    retry: bool = False
    progress: Callable[[JobProgress], None] | None = None


def examine(
    learner: str | Callable[[Any], Any], *, suite: str | None = None, tasks: Sequence[TaskLike] | None = None,
    seeds: int | Iterable[int] = 15, steps: int | None = None, transitions: int = 10_000, twins: int = 2,
    probes: bool = True, learns_from: Sequence[str] | None = None, against: Path | str | None = None,
    out: Path | str | None = None, running: Running | None = None, laws: bool | None = None,
) -> Exam:  # fmt: skip
    """Examine a learner; the result is what `exam.json` holds.

    Args:
        learner: `"file.py:train"` or `"module:train"`, which is run in other processes, or a function, which is run in this one.
        suite: whose tasks are asked; derail and probes unless given.
        tasks: those that are asked instead of all of the suite, by name or as anything that `taskspec.load` takes.
        seeds: how many, or which.
        steps: of the environment, for each seed on each task; unless given, those that the suite's `exam.yaml` names, or 500,000.
            Where neither a suite nor tasks are named, those of `exam.yaml` are the most.
        transitions: that the expert demonstrates, at least; whole episodes.
        twins: of every task that has some.
        probes: whether it is tried if a reward that is withheld makes a difference.
        learns_from: what is granted, some of "reward", "demonstrations", "preferences", in place of what the learner says.
        against: a folder with an earlier exam: regressions since then are flagged.
        out: a folder for `exam.json`, and for the results on the way to it, from which an exam that was stopped goes on.
        running: for a learner in other processes: how many, time limits, a cluster.
        laws: whether all laws of learning are tried, or none; those that the learner declares unless given.

    Raises:
        SpecError: E710, E711, E713 for a learner or an option that cannot be; E701 for a task that is unknown.
        Interrupted: Ctrl-C; what is done is kept.
    """
    numbers = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
    for name, number in {"seeds": len(numbers), "steps": steps, "transitions": transitions}.items():
        if number is not None and number < 1:
            raise SpecError([Diagnostic("E713", None, f"an exam needs 1 or more {name}, not {number}")])
    who = learner_of(learner, learns_from)
    suites = SUITES if suite is None else (suite,)
    asked = {exam_id(task): task for task in tasks_of(suites, tasks)}
    described = {name: _described(name) for name in suites}
    is_most = suite is None and tasks is None
    terms = {}
    for name, task in asked.items():
        own = described.get(task.source.suite, ExamDocument(exam=1))
        terms[name] = ExamTerms(_granted(own, steps, is_most), who.learns_from, transitions)
    baseline = None
    if against is not None:
        baseline = read(against)
        hashes = {name: task.content_hash for name, task in asked.items()}
        most = max(each.steps for each in terms.values())
        check_comparable(baseline, str(against), hashes, {"steps": most, "transitions": transitions})
    plan = _plan(asked.values(), who, numbers, terms, twins, probes, described)
    folder = None if out is None else Path(out)
    found = _taken(who, " and ".join(suites), asked, plan, twins, folder, running or Running())
    found["verdicts"] = verdicts(found["tasks"], found["scores"])
    found["flags"] = [*flags(found["tasks"], found["scores"], baseline), *learned_flags(found["scores"])]
    found["diagnoses"] = [each for name in suites for each in diagnose(found, name)]
    declared = getattr(who.train, "obeys", ())
    if laws:
        changed = changed_tasks(asked, LAWS, exam_id)
    else:
        changed = changed_tasks(asked, declared, exam_id)
    if changed and laws is not False:
        others = {each.name: each.changed for each in changed}
        plan = _plan(
            others.values(), who, numbers, {each.name: terms[each.task] for each in changed}, 0, False, described
        )
        with_laws = _taken(who, "", others, plan, 0, folder, running or Running())
        found["laws"] = law_scores(changed, found, with_laws)
        found["flags"] += law_flags(found["laws"], declared)
    if folder is not None:
        write(found, folder)
    return found


def _taken(
    who: Examinee, suite: str, asked: Mapping[str, Task], plan: Sequence[Planned], twins: int, folder: Path | None,
    running: Running,
) -> Exam:  # fmt: skip
    """Run a plan, and return the exam with its scores, without verdicts.

    Args:
        asked: the tasks of the plan, by their names in results.
        folder: where results are stored on the way.
    """
    variants = {}
    for name, task in asked.items():
        variants[name] = [task, *(modify(task, *twin) for twin in twins_of(task, twins))]
    if who.place is None:
        rows = [_trained_here(planned, who) for planned in plan]
        measured = {}
        for name, tasks_measured in variants.items():
            measured[name] = [baselines(task, EPISODES, written()) for task in tasks_measured]
    else:
        with tempfile.TemporaryDirectory() as scratch, Store((folder or Path(scratch)) / "exam.sqlite") as store:
            measured = _measured(variants, store, running)
            rows = _trained(plan, store, running)
    return _exam(who, suite, plan, rows, {name: _examined(task, measured[name]) for name, task in asked.items()})


# The tasks that an exam asks.


def tasks_of(suites: Sequence[str], wanted: Sequence[TaskLike] | None) -> list[Task]:
    """Return the tasks of an exam, in the variants in which a learner acts.

    Args:
        wanted: those to ask, by their names in one of the suites, or as anything that `taskspec.load` takes; None for those that
            each suite's `exam.yaml` names, or all where it names none.

    Raises:
        SpecError: E701 for what is none; E713 for an unknown suite.
    """
    known: dict[str, str] = {}
    for suite in reversed(suites):
        known |= {e.name: e.id for e in registry.known().values() if e.suite == suite}
    if wanted is None:
        wanted = [name for suite in suites for name in _names_in(suite)]
    found = [registry.load(known.get(task, task) if isinstance(task, str) else task) for task in wanted]
    ids = [exam_id(task) for task in found]
    for i, name in enumerate(ids):
        if name in ids[:i]:
            raise SpecError([Diagnostic("E713", None, f"{name} is given twice", "an exam has each task once")])
    return found


def _names_in(suite: str) -> list[str]:
    """Return the ids of the tasks that the exam of a suite asks."""
    known = {e.name: e.id for e in registry.known().values() if e.suite == suite}
    if not known:
        suites = {e.suite for e in registry.known().values()}
        raise SpecError([Diagnostic("E713", None, f"there is no suite '{suite}'", suggest(suite, suites))])
    asked = _described(suite).tasks
    return [known[name] for name in asked or known]


def _described(suite: str) -> ExamDocument:
    """Return the suite's `exam.yaml`; an empty one where it has none."""
    path = file_of(suite, EXAM)
    if path is None:
        return ExamDocument(exam=1)
    described = read_exam(path).described
    assert isinstance(described, ExamDocument)
    return described


def _granted(described: ExamDocument, steps: int | None, is_most: bool) -> int:
    """Return the steps of a training run on a task of a suite.

    Args:
        steps: that are asked for.
        is_most: whether the suite's own number is the most.
    """
    granted = steps or described.steps or STEPS
    if is_most and described.steps is not None:
        return min(granted, described.steps)
    return granted


def exam_id(task: Task) -> str:
    """Return the name of a task in results: its id, with modifiers and those parameters that are not at their defaults."""
    values = {p.name: p.value for p in task.parameters if p.value != p.default}
    return str(InstanceId(task.id, dict(sorted(values.items())), tuple(map(str, task.modifiers))))


# Twins: the same task in other words, where a learner that is right earns the same, and one that is right by luck does not.

TRIED = 16
"""Seeds that twins are chosen from, at least."""
WAYS = ("permuted_actions={seed},per_state=true", "permuted_actions={seed}")
"""How actions are permuted: the first way is taken that keeps what those can earn who see observations alone."""
SHOWN = 8
"""Episodes of the expert that show its actions in the states that it visits."""


@lru_cache(maxsize=64)
def twins_of(task: Task, wanted: int) -> tuple[Modifiers, ...]:
    """Return the modifiers of each twin; none where the task has no twins.

    In finite tasks observations are renamed, and the actions of each state are permuted, by a seed; in all states by the same
    permutation where two states look alike, so that those who see observations alone can earn what they could. Seeds are chosen
    among the first ones: such that no constant action is the expert's, where that can be, and that from twin to twin its actions
    differ in as many states as possible. Other tasks are seen and steered by the symmetries that they declare.
    """
    way = _way(task)
    if way is None:
        return tuple((f"symmetry={each.name}",) for each in task.annotations.symmetries[:wanted])
    if not wanted:
        return ()
    known = {seed: _expert_actions(task, way, seed) for seed in range(1, max(TRIED, 2 * wanted) + 1)}
    varied = [seed for seed, actions in known.items() if (actions != actions[0]).any()]
    left = varied if len(varied) >= wanted else list(known)
    chosen = [left[0]]
    while len(chosen) < wanted:
        others = [seed for seed in left if seed not in chosen]
        chosen.append(max(others, key=lambda seed: min(int((known[seed] != known[c]).sum()) for c in chosen)))
    return tuple(_modifiers(way, seed) for seed in chosen)


def _way(task: Task) -> str | None:
    """Return how the actions of a task are permuted; None where they or what is observed cannot be renamed."""
    try:
        return next((way for way in WAYS if keeps_observers(task, *_modifiers(way, 1))), None)
    except SpecError as error:
        if {d.code for d in error.diagnostics} <= {"E720"}:
            return None
        raise


def _modifiers(way: str, seed: int) -> Modifiers:
    return way.format(seed=seed), f"relabelled={seed}"


def _expert_actions(task: Task, way: str, seed: int) -> Array:
    """Return the names of the expert's actions, (steps,), in some episodes, which are the same under every seed."""
    twin = modify(task, way.format(seed=seed))
    policy = "optimal" if twin.annotations.expert is None else "expert"
    return np.asarray(demonstrations(twin, policy, episodes=SHOWN).acts)


# The plan, and the jobs that it consists of.


def _plan(
    asked: Iterable[Task],
    who: Examinee,
    seeds: tuple[int, ...],
    terms: Mapping[str, ExamTerms],
    twins: int,
    probes: bool,
    described: Mapping[str, ExamDocument],
) -> list[Planned]:
    width = WIDEST if who.together else 1
    blocks = [seeds[i : i + width] for i in range(0, len(seeds), width)]
    if probes and "reward" not in who.learns_from:
        probed = blocks[: max(1, PROBED // width)]
    else:
        probed = []
    plan = []

    def add(task: Task, twin: Modifiers | None, block: tuple[int, ...], negated: bool = False) -> None:
        about = modify(task, *(twin or ()))
        suite = described.get(task.source.suite, ExamDocument(exam=1))
        horizon = None if suite.evaluate is None else suite.evaluate.longer_than(task.horizon)
        place = who.place or ""
        trial = Trial(about, negated, place, who.content, terms[exam_id(task)], block, EPISODES, written(), horizon)
        plan.append(Planned(task, twin, trial))

    for task in asked:
        for twin in (None, *twins_of(task, twins)):
            for block in blocks:
                add(task, twin, block)
        for block in probed:
            add(task, None, block, negated=True)
    return plan


def _trained_here(planned: Planned, who: Examinee) -> list[Row]:
    try:
        return run_trial(planned.trial, who.train)
    except LearnerFailed as error:
        return _failed(planned, str(error))


def _failed(planned: Planned, message: str) -> list[Row]:
    return [{"seed": seed, "error": message} for seed in planned.trial.seeds]


def _measured(variants: dict[str, list[Task]], store: Store, running: Running) -> dict[str, list[dict[str, Any]]]:
    """Return the baselines of each task, and of each of its twins."""
    jobs = {}
    for tasks in variants.values():
        for task in tasks:
            key = key_of("baselines and constants", task.content_hash, EPISODES, written())
            jobs[task.content_hash] = Job(key, task.instance_id, baselines, (task, EPISODES, written()))
    known = run(jobs.values(), store, workers=running.workers, cluster=running.cluster, retry_failed=True).rows
    for job in jobs.values():
        if known[job.key].status != "done":
            raise SpecError([Diagnostic("E713", None, f"{job.name} cannot be examined: {known[job.key].message}")])
    found = {}
    for name, tasks in variants.items():
        found[name] = [known[jobs[task.content_hash].key].value for task in tasks]
    return found


def _trained(plan: Sequence[Planned], store: Store, running: Running) -> list[list[Row]]:
    """Return rows for each line of the plan; those of a learner that failed have an `error` alone."""
    keys = [planned.trial.key for planned in plan]
    jobs = [Job(key, each.name, run_trial, (each.trial,)) for key, each in zip(keys, plan, strict=True)]
    done = run(
        jobs, store, workers=running.workers, cluster=running.cluster, seconds=running.seconds,
        retry_failed=running.retry, progress=running.progress,
    ).rows  # fmt: skip
    rows = []
    for key, planned in zip(keys, plan, strict=True):
        result = done[key]
        failed = _failed(planned, result.message or result.status)
        rows.append(result.value if result.status == "done" else failed)
    return rows


# Scores.


def _exam(
    who: Examinee, suite: str, plan: Sequence[Planned], rows: list[list[Row]], tasks: dict[str, Examined]
) -> Exam:
    scores: list[Score] = []
    for planned, block in zip(plan, rows, strict=True):
        about = tasks[exam_id(planned.task)]
        for row in block:
            if planned.twin is None and not planned.trial.negated:
                about["cannot"] = row.get("cannot")
            if "cannot" not in row:
                scores.append(_score(planned, row, about))
    terms = plan[0].trial.terms
    seeds = list(dict.fromkeys(seed for p in plan for seed in p.trial.seeds))
    cost: dict[str, float] = {}
    for name in ("steps", "demonstrations", "comparisons", "seconds"):
        cost[name] = float(sum(s[name] or 0 for s in scores))
    where = machine()
    return Exam(
        exam=FORMAT, learner=who.name, learns_from=list(who.learns_from), suite=suite, steps=terms.steps,
        transitions=terms.transitions, seeds=seeds, versions=where.pop("versions"), machine=where,
        command=shlex.join(["taskspec", *sys.argv[1:]]) if Path(sys.argv[0]).name == "taskspec" else "",
        tasks=tasks, scores=scores, verdicts={}, flags=[], diagnoses=[], cost=cost,
    )  # fmt: skip


def _examined(task: Task, measured: list[dict[str, Any]]) -> Examined:
    """Return a task of the exam, from its baselines and those of its twins."""
    found, *twins = measured
    constants = found["constants"]
    worst = constants
    if twins and constants:
        on_twins = np.mean([twin["constants"] for twin in twins], axis=0).tolist()
        worst = [min(pair) for pair in zip(constants, on_twins, strict=True)]
    return Examined(
        capability=task.capability or task.name, title=task.title, content_hash=task.content_hash,
        random=_finite(found["random"]), expert=_finite(found["expert"]), optimal=_finite(found["optimal"]),
        worst=_finite(found["worst"]), constant=max(constants, default=None), fixed=max(worst, default=None), cannot=None,
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    """Return a number as JSON has it; None for others."""
    if value is not None and math.isfinite(value):
        return value
    return None


def _score(planned: Planned, row: Row, about: Examined) -> Score:
    """Return a row of results on the scale of its task. Twins have the scale of the task: every return is the same."""
    random = about["random"]
    expert = about["expert"]

    def scaled(value: float | None) -> float | None:
        if value is None:
            return None
        return score(value, random, expert)

    unit = abs((expert or 0) - (random or 0)) or 1.0
    curve = row.get("curve")
    lost = row.get("reward_regret")
    return {
        "task": exam_id(planned.task), "twin": None if planned.twin is None else "+".join(planned.twin),
        "probe": "negated" if planned.trial.negated else None, "seed": row["seed"],
        "deterministic": scaled(row.get("deterministic")), "stochastic": scaled(row.get("stochastic")),
        "half": (_finite(row.get("deterministic_half")) or 0.0) / unit, "return": _finite(row.get("deterministic")),
        "error": row.get("error"), "steps": row.get("steps", 0), "demonstrations": row.get("demonstrations", 0),
        "comparisons": row.get("comparisons", 0), "seconds": row.get("seconds"), "starc": row.get("starc"),
        "reward_regret": None if lost is None else lost / unit,
        "curve": None if curve is None else [[steps, scaled(value)] for steps, value in curve],
        "operators": row.get("operators"), "rewards": row.get("rewards"),
        "value": None if row.get("value") is None else row["value"] / unit, "longer": row.get("longer"),
    }  # fmt: skip
