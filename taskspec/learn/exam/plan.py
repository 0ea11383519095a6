"""The trials of an exam: how they are planned and run, and their rows as scores."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.display import duration, plural
from taskspec.base.limits import written
from taskspec.language.modifiers import modify
from taskspec.language.task.task import Task
from taskspec.learn.documents.document_models import ExamDocument
from taskspec.learn.exam.asked_tasks import Modifiers, exam_id, twins_of
from taskspec.learn.exam.case import ExamTerms
from taskspec.learn.exam.examinee import Examinee
from taskspec.learn.exam.results import Examined, Score, finite
from taskspec.learn.exam.trial import LearnerFailed, Row, Trial, baselines, key_of, run_trial, score
from taskspec.learn.jobs.engines import Workers
from taskspec.learn.jobs.running import Running, run
from taskspec.learn.jobs.store import Job, Store

WIDEST = 16
"""Seeds of a block, for learners that train many together."""
PEEK_SEEDS = 5
"""Seeds that are tried with a withheld reward negated."""
EXTENDED, LOOK_SEEDS = 4, 3
"""How many times longer training is where values may not be finished, and the seeds that are tried."""
EPISODES = 1000
"""For scores that cannot be computed."""
PRINTED = "printed.txt"
"""The file beside the results that has what the learner printed, the last of each trial."""
STEPS = 500_000
"""Environment steps of each training run, unless a number is given or the suite's `exam.yaml` has one."""


@dataclass(frozen=True)
class Planned:
    """One line of the plan: a task, or a twin of it, and a block of seeds.

    Attributes:
        peek: whether its reward is negated, or it is trained longer: one of `SIDES` in rules; None for neither.
    """

    task: Task
    twin: Modifiers | None
    trial: Trial
    peek: Literal["negated", "extended"] | None

    @property
    def name(self) -> str:
        kind = ""
        if self.twin is not None:
            kind = f"+{'+'.join(self.twin)}"
        if self.peek is not None:
            kind = f" {self.peek}"
        first, *others = self.trial.seeds
        if not others:
            return f"{self.task.instance_id}{kind}, seed {first}"
        return f"{self.task.instance_id}{kind}, seeds {first} to {others[-1]}"


@dataclass
class Trials:
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

    @property
    def asks_for_longer(self) -> bool:
        """True where a diagnosis of some suite rests on longer training."""
        documents = self.described.values()
        rules = [entry.when for document in documents for entry in document.diagnoses.values()]
        return any("left(" in rule or "extended" in rule for rule in rules)

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
            plan += [self._planned(task, None, block, "negated") for block in peeking]
        return plan

    def extended(self, asked: Iterable[Task], seeds: tuple[int, ...]) -> list[Planned]:
        """Return trials with `EXTENDED` times the steps."""
        return [self._planned(task, None, (seed,), "extended") for task in asked for seed in seeds]

    def _planned(
        self,
        task: Task,
        twin: Modifiers | None,
        block: tuple[int, ...],
        peek: Literal["negated", "extended"] | None = None,
    ) -> Planned:
        about = modify(task, *(twin or ()))
        steps = self.granted(task)
        if peek == "extended":
            steps *= EXTENDED
        terms = ExamTerms(steps, self.who.learns_from, self.transitions)
        evaluate = self._suite(task).evaluate
        horizon = None
        if evaluate is not None:
            horizon = evaluate.longer_than(task.horizon)
        place = self.who.place or ""
        trial = Trial(
            about,
            peek == "negated",
            place,
            self.who.content,
            terms,
            block,
            EPISODES,
            written(),
            horizon,
            self.is_compared,
        )
        return Planned(task, twin, trial, peek)

    def estimate(self, asked: Sequence[Task], seeds: tuple[int, ...], processes: int) -> str:
        """Return in a line how long the exam will take, after one trial or two of every task, which are a part of it.

        The first one of each form of a task also prepares what the others use.
        """
        plan = self.plan(asked, seeds, self.twins, self.peeks)
        tried: dict[str, list[Planned]] = {}
        for planned in plan:
            some = tried.setdefault(exam_id(planned.task), [])
            if len(some) < 2 and planned.twin is None and planned.peek is None:
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


# -- scores ------------------------------------------------------------------------------------------------------------


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


def score_of(planned: Planned, row: Row, about: Examined) -> Score:
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
        "task": exam_id(planned.task), "twin": twin, "peek": planned.peek,
        "seed": row["seed"],
        "deterministic": scaled(row.get("deterministic")), "stochastic": scaled(row.get("stochastic")),
        "half": (finite(row.get("deterministic_half")) or 0.0) / unit, "return": finite(row.get("deterministic")),
        "error": row.get("error"), "steps": row.get("steps", 0), "demonstrations": row.get("demonstrations", 0),
        "comparisons": row.get("comparisons", 0), "seconds": row.get("seconds"), "starc": row.get("starc"),
        "reward_regret": in_units(row.get("reward_regret")), "curve": curve,
        "operators": row.get("operators"), "told": row.get("told"), "unread": row.get("unread"),
        "rewards": row.get("rewards"), "pairings": row.get("pairings"),
        "value": in_units(row.get("value")), "longer": row.get("longer"), "explained": row.get("explained"),
        "reseeded": row.get("reseeded"), "tried": row.get("tried"), "agrees": row.get("agrees"),
        "at_ends": row.get("at_ends"), "before_ends": row.get("before_ends"), "moved": row.get("moved"),
        "apart": row.get("apart"), "worst_step": row.get("worst_step"),
        "spent": row.get("steps", 0) / planned.trial.terms.steps,
    }  # fmt: skip
