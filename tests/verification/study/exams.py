"""Exams of the study: what was flagged, with twins and without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec.exam import Exam, examine, read
from taskspec.exam.findings import diagnose
from taskspec.exam.verdicts import flags
from taskspec.policies.files import function_of
from tests.verification.study.bugs import LEARNERS, Bug, content

ROOT = Path(__file__).parents[3]
BASELINES, BUILD = ROOT / "tasks/derail/baselines", ROOT / "build/study"
FINITE = ("RiskyPath", "EarlyTermPos", "EarlyTermNeg", "Branching", "InitShiftLearner")
SEEDS, TWINS = 6, 1
TRANSITIONS = 2_000
OF_BASELINES, OF_BUGS, OF_RIGHT_ONES = 1000, 2000, (3000, 4000, 5000)
"""The first seeds of what the repository has, of learners with mistakes, and of those without, again."""
TUNED_ON = "100 to 107"
"""Seeds on which the right versions were written, and some mistakes tried."""


@dataclass(frozen=True)
class Terms:
    """The exam of a learner: its steps, and tasks."""

    steps: int
    tasks: tuple[str, ...] = FINITE


TERMS = {
    "q_learning": Terms(3_000),
    "bc": Terms(1_000, (*FINITE, "LargestSum")),
    "ppo": Terms(32_000),
    "gail": Terms(25_600),
    "drlhp": Terms(19_200),
}


@dataclass(frozen=True)
class Found:
    """What an exam flagged: pairs of a kind (that of a flag, or "diagnosis") and a task (or the name of the diagnosis)."""

    printed: list[tuple[str, str]]
    whole: list[tuple[str, str]]

    @property
    def by_twins(self) -> list[tuple[str, str]]:
        """What twins have shown: all that is not of the tasks as printed."""
        return [
            each for each in self.whole if each not in self.printed or self.whole.count(each) > self.printed.count(each)
        ]


def examined(learner: str, path: Path, first: int, folder: Path, against: Path | None) -> Exam:
    """The exam of a learner in a file, on seeds from `first` on. One that was held before is read again."""
    if (folder / "exam.json").exists():
        return read(folder)
    terms, train = TERMS[learner], function_of(f"{path}:train")
    return examine(
        train, tasks=terms.tasks, seeds=range(first, first + SEEDS), steps=terms.steps, transitions=TRANSITIONS, twins=TWINS,
        against=against, out=folder,
    )  # fmt: skip


def baseline(learner: str) -> Path:
    """Where the repository has the exam of a right version."""
    return BASELINES / f"{learner}.json"


def right(learner: str, first: int, against: Path | None) -> Exam:
    """The exam of a right version."""
    folder = BUILD / content() / f"{learner}-right-{first}"
    return examined(learner, LEARNERS / f"{learner}.py", first, folder, against)


def wrong(bug: Bug, first: int) -> Exam:
    """The exam of a learner with a mistake."""
    folder = BUILD / content() / f"{bug.learner}-{bug.name}-{first}"
    path = folder / f"{bug.learner}.py"
    folder.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != bug.source():
        (folder / "exam.json").unlink(missing_ok=True)
        path.write_text(bug.source(), encoding="utf-8")
    return examined(bug.learner, path, first, folder, baseline(bug.learner))


def found(exam: Exam, learner: str) -> Found:
    """What the exam flags against the right version: with twins, and as if there were none."""
    return Found(*(_found(_side(exam, twins), _side(read(baseline(learner)), twins)) for twins in (False, True)))


def _side(exam: Exam, twins: bool) -> Exam:
    kept: Any = {**exam, "scores": [s for s in exam["scores"] if twins or s["twin"] is None]}
    if not twins:
        kept["flags"] = [flag for flag in exam["flags"] if flag["kind"] != "twin"]
    return kept  # type: ignore[no-any-return]


def _found(exam: Exam, against: Exam) -> list[tuple[str, str]]:
    flagged = [(flag["kind"], flag["task"]) for flag in flags(exam["tasks"], exam["scores"], against)]
    now, then = ({str(d["name"]) for d in diagnose(e, "derail")} for e in (exam, against))
    return [*flagged, *(("diagnosis", name) for name in sorted(now - then))]


def chosen(all_: Sequence[Bug], learners: Sequence[str] | None) -> list[Bug]:
    """The bugs of some learners."""
    return [bug for bug in all_ if not learners or bug.learner in learners]
