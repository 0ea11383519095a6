"""What the learners of the study learned, as tables: kept beside each exam, so that it is explained again without training."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, wraps
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.exact.policies.values import is_table
from taskspec.exam import Case, Learned
from taskspec.language.registry import load
from taskspec.language.task.task import Task
from taskspec.learn.exam import fingerprints
from taskspec.learn.exam.asked_tasks import exam_id
from taskspec.learn.exam.case import ExamTerms
from taskspec.learn.exam.learned import compare_with_extended, learned_fields
from taskspec.learn.exam.results import Exam, read, write

NAME = "learned.npz"
EXPLAINED = "explained.txt"
FIELDS = ("policy", "q", "values", "reward", "discount")


@dataclass
class Tables:
    """Arrays by task, seed and field of `Learned`."""

    arrays: dict[str, Any] = field(default_factory=dict)

    def write(self, folder: Path, exam: Exam) -> None:
        """Write an exam, and the tables of what was learned in it."""
        folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(folder / NAME, **self.arrays)
        (folder / EXPLAINED).write_text(_explaining())
        write(exam, folder)

    @classmethod
    def explained(cls, folder: Path) -> Exam:
        """Return an exam with the distances of what was learned as they are computed now."""
        exam = read(folder)
        known = folder / EXPLAINED
        if known.exists() and known.read_text() == _explaining():
            return exam
        with np.load(folder / NAME) as found:
            tables = cls(dict(found))
        exam = tables._explained(exam)
        tables.write(folder, exam)
        return exam

    def keeping(self, train: Callable[[Case], Any]) -> Callable[[Case], Any]:
        """Return a learner that keeps what it learns, first of the tasks that are not negated."""

        @wraps(train)
        def learner(case: Case) -> Any:
            learned = train(case)
            key = f"{exam_id(case.task)} {case.seed}"
            is_first = not any(name.startswith(f"{key} ") for name in self.arrays)
            if is_first and case.task.observation_layout.form == "discrete":
                for name, table in _tables(case, learned).items():
                    self.arrays[f"{key} {name}"] = table
            return learned

        return learner

    def _explained(self, exam: Exam) -> Exam:
        scores = []
        for score in exam["scores"]:
            task = score["task"] if score["twin"] is None else f"{score['task']}+{score['twin']}"
            learned = self._learned(task, score["seed"])
            if learned is not None and score["peek"] is None and score["error"] is None:
                terms = ExamTerms(exam["steps"], tuple(exam["learns_from"]), exam["transitions"])
                now = _fields(load(task), learned, score["seed"], terms)
                score = {
                    **score,
                    **{
                        name: now.get(name)
                        for name in ("operators", "told", "unread", "explained", "rewards", "pairings")
                    },
                }
            scores.append(score)
        compare_with_extended(scores)
        return {**exam, "scores": scores}

    def _learned(self, task: str, seed: int) -> Learned | None:
        found = {name: self.arrays.get(f"{task} {seed} {name}") for name in FIELDS}
        if found["policy"] is None:
            return None
        paid = found["reward"]
        if paid is not None:
            found["reward"] = lambda obs, acts, _: paid[obs, acts]
        if found["discount"] is not None:
            found["discount"] = float(found["discount"])
        return Learned(**found)


def _fields(task: Task, learned: Learned, seed: int, terms: ExamTerms) -> dict[str, Any]:
    """Return what `learned_fields` says of what was learned in a case."""
    shown = None
    if "demonstrations" in terms.learns_from:
        shown = Case(task, (seed,), terms).demonstrations
    return learned_fields(task, learned, "reward" in terms.learns_from, shown)


@cache
def _explaining() -> str:
    """Return a hash of the files that distances depend on."""
    found = hashlib.sha256()
    for path in sorted(Path(fingerprints.__file__).parent.glob("*.py")):
        if path.stem in ("dynamics", "fingerprints", "learned", "operators", "pairings", "starc", "ways"):
            found.update(path.read_bytes())
    return found.hexdigest()


def _tables(case: Case, learned: Any) -> dict[str, Any]:
    """Return what was learned of a task with discrete observations, by field of `Learned`."""
    if not isinstance(learned, Learned):
        learned = Learned(learned)
    observations = np.arange(case.observation_space.n)
    policy = learned.policy
    if hasattr(policy, "probabilities"):
        policy = policy.probabilities(observations)
    if not is_table(policy):
        return {}
    found = {"policy": policy, "q": learned.q, "values": learned.values, "discount": learned.discount}
    if learned.reward is not None:
        rows = [learned.reward(observations, np.full_like(observations, a), None) for a in range(case.action_space.n)]
        found["reward"] = np.stack(rows, axis=1)
    return {name: np.array(each) for name, each in found.items() if each is not None}
