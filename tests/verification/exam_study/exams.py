"""Exams of the study: what is flagged, by which part of the exam, and which cause is named."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from taskspec.exact.policies.python_files import function_of
from taskspec.exam import Case, Exam, examine
from taskspec.learn.exam.findings import new_diagnoses
from taskspec.learn.exam.flags import flags
from taskspec.learn.exam.learned import explanations, learned_flags
from tests.verification.exam_study.bugs import LEARNERS, Bug, content
from tests.verification.exam_study.tables import Tables

ROOT = Path(__file__).parents[3]
BASELINES = ROOT / "tasks/derail/baselines"
BUILD = ROOT / "build/exam_study"
FINITE = ("RiskyPath", "EarlyTermPos", "EarlyTermNeg", "Branching", "InitShiftLearner")
PROBES = (
    "EndInPlace", "Hazard", "ValueLeft", "SecondThought", "Slip", "CoinToss", "Sizes", "Patience", "Echo", "LookAlikes",
)  # fmt: skip
"""The probes whose observations and actions are finite."""
FEW = ("EndInPlace", "ValueLeft", "SecondThought")
"""Those for learners that are slow."""
SEEDS = 6
TRANSITIONS = 2_000
OF_BASELINES = 21000
OF_BUGS = 22000
"""The first seeds of right versions, and of learners with mistakes."""
OF_RIGHT_ONES = range(23000, 123000, 1000)
"""The first seeds of right versions, again: each exam is compared with the one before it."""
PARTS = ("old tasks", "probes", "values", "fingerprints")


@dataclass(frozen=True)
class Terms:
    """The exam of a learner.

    Attributes:
        steps: of each training run.
        tasks: those of DERAIL; the probes come with them.
        is_shipped: whether the repository has its results.
        right: exams of the right version, beside the one that those with mistakes are compared with.
        probes, seeds: of the exam.
    """

    steps: int
    tasks: tuple[str, ...] = FINITE
    twins: int = 1
    is_shipped: bool = True
    right: int = 7
    probes: tuple[str, ...] = PROBES
    seeds: int = SEEDS


TERMS = {
    "q_learning": Terms(3_000, right=40),
    "bc": Terms(1_000, (*FINITE, "LargestSum"), right=40),
    "ppo": Terms(32_000, twins=0),
    "gail": Terms(25_600, twins=0),
    "drlhp": Terms(19_200, twins=0, right=6),
    "replay": Terms(4_000, twins=0, is_shipped=False, right=50),
    "actor_critic": Terms(12_800, (), twins=0, is_shipped=False, right=50),
    "traces": Terms(3_000, (), twins=0, is_shipped=False, right=100),
    "sb3_dqn": Terms(5_000, (), 0, False, 3, FEW),
    "sb3_ppo": Terms(4_000, (), 0, False, 4, FEW),
    "imitation_bc": Terms(1_000, (), 1, False, 5, ("SecondThought", "Echo", "Slip", "Patience")),
}


@dataclass(frozen=True)
class Found:
    """What an exam found against that of the right version.

    Attributes:
        flagged: by part of the exam, what it flags.
        named: the mistakes that learned values and rewards are explained by.
        told: names of diagnoses that the right version does not get, and kinds of flags.
    """

    flagged: dict[str, list[str]]
    named: Sequence[str]
    told: Sequence[str]

    @property
    def is_flagged(self) -> bool:
        return any(self.flagged.values())

    def cause(self, bug: Bug) -> str:
        """Return whether the cause is named: `right`, `wrong`, or an empty text."""
        if self.named and not set(bug.causes) & set(self.named):
            return "wrong"
        if set(bug.causes) & {*self.named, *self.told}:
            return "right"
        return ""

    @property
    def is_group(self) -> bool:
        """Whether several mistakes are named, which the tasks cannot tell apart."""
        return len(self.named) > 1


def examined(learner: str, train: Any, first: int, folder: Path, shipped: bool = False) -> Exam:
    """Return the exam of a learner on seeds from `first` on. One that was held before is read again."""
    if (folder / "exam.json").exists():
        return Tables.explained(folder)
    terms = TERMS[learner]
    tables = Tables()
    tasks = tuple(f"derail/{task}" for task in terms.tasks)
    if not shipped:
        tasks += tuple(f"probes/{task}" for task in terms.probes)
    exam = examine(
        tables.keeping(train), suite="derail" if shipped else "probes", tasks=tasks, seeds=range(first, first + terms.seeds),
        steps=terms.steps, transitions=TRANSITIONS, twins=1 if shipped else terms.twins,
    )  # fmt: skip
    tables.write(folder, exam)
    return exam


def shipped(learner: str) -> Exam:
    """Return the exam of a right version on the tasks of DERAIL, which the repository has."""
    return examined(learner, _right_version(learner), OF_BASELINES, _folder(learner, "shipped"), True)


@cache
def right(learner: str, first: int) -> Exam:
    """Return the exam of a right version."""
    return examined(learner, _right_version(learner), first, _folder(learner, f"right-{first}"))


def wrong(bug: Bug) -> Exam:
    """Return the exam of a learner with a mistake."""
    folder = _folder(bug.learner, bug.name)
    path = folder / f"{bug.learner}.py"
    folder.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != bug.source():
        (folder / "exam.json").unlink(missing_ok=True)
        path.write_text(bug.source(), encoding="utf-8")
    return examined(bug.learner, function_of(f"{path}:train"), OF_BUGS, folder)


def _folder(learner: str, name: str) -> Path:
    return BUILD / f"{learner}-{content(learner)}" / name


def _right_version(learner: str) -> Callable[[Case], Any]:
    return function_of(f"{LEARNERS / learner}.py:train")


def found(exam: Exam, baseline: Exam) -> Found:
    """Return what an exam flags against that of the right version."""
    flagged: dict[str, list[str]] = {part: [] for part in PARTS}
    for flag in flags(exam["tasks"], exam["scores"], baseline):
        part = _part(flag["kind"], flag["task"])
        flagged[part].append(f"{_short(flag['task'])} ({flag['kind']})")
    flagged["fingerprints"] += [flag["kind"] for flag in learned_flags(exam["scores"])]
    told = [flag["kind"] for flag in exam["flags"]]
    for suite, part in (("derail", "old tasks"), ("probes", "probes")):
        new = [each["name"] for each in new_diagnoses(_on(exam, suite), _on(baseline, suite), suite)]
        flagged[part] += [f"`{name}`" for name in new]
        told += new
    named = [name for each in explanations(exam["scores"]) if each.is_mistake for name in each.names]
    return Found(flagged, tuple(named), tuple(told))


def of_bug(bug: Bug) -> Found:
    """Return what the exam of a learner with a mistake finds."""
    return found(wrong(bug), right(bug.learner, OF_BASELINES))


def of_right(learner: str, number: int) -> Found:
    """Return what an exam of the right version finds against another one."""
    before = OF_RIGHT_ONES[number - 1] if number else OF_BASELINES
    return found(right(learner, OF_RIGHT_ONES[number]), right(learner, before))


def _part(kind: str, task: str) -> str:
    if kind == "changed":
        return "values"
    if task.startswith("probes/"):
        return "probes"
    return "old tasks"


def _short(task: str) -> str:
    return task.rpartition("/")[2].removesuffix("-v0")


def _on(exam: Exam, suite: str) -> Exam:
    """Return the part of an exam that is about the tasks of a suite."""
    tasks = {name: about for name, about in exam["tasks"].items() if name.startswith(f"{suite}/")}
    scores = [score for score in exam["scores"] if score["task"] in tasks]
    return {**exam, "tasks": tasks, "scores": scores}


# -- results, which the page is made of -------------------------------------------------------------------------------

RESULTS = Path(__file__).parent / "results.json"


def results() -> dict[str, Found]:
    """Return what exams found so far: by `learner name` of a mistake, or `learner first` of seeds of a right version."""
    if not RESULTS.exists():
        return {}
    return {name: Found(**known) for name, known in json.loads(RESULTS.read_text(encoding="utf-8")).items()}


def store(name: str, one: Found) -> None:
    """Add a result to those that are kept."""
    known = {**results(), name: one}
    rows = [f" {json.dumps(name)}: {json.dumps(vars(known[name]))}" for name in sorted(known)]
    RESULTS.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
