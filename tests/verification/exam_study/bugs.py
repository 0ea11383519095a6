"""Learners with a mistake, as changes of the text of one without."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

HERE = Path(__file__).parent
LEARNERS = HERE / "learners"


@dataclass(frozen=True)
class Bug:
    """A mistake in a learner.

    Attributes:
        what: what is wrong, in a sentence.
        causes: names of operators, rewards, diagnoses or flags that say what is wrong.
        changes: texts of the right version, each of which stands there once, and what stands there instead.
        why: nothing is flagged, where that is so.
    """

    learner: str
    name: str
    what: str
    changes: dict[str, str]
    causes: tuple[str, ...] = ()
    why: str = ""
    is_new: bool = False

    def source(self) -> str:
        """The program with the mistake. Raises ValueError where a text does not stand in the right version once."""
        text = (LEARNERS / f"{self.learner}.py").read_text(encoding="utf-8")
        for right, wrong in self.changes.items():
            if text.count(right) != 1:
                raise ValueError(f"{self.learner}, {self.name}: {right!r} stands there {text.count(right)} times")
            text = text.replace(right, wrong)
        return text


def bugs() -> list[Bug]:
    """All of them: the first ones, then those that were written when the exam was fixed."""
    found = []
    for name, is_new in (("bugs.yaml", False), ("new_bugs.yaml", True), ("library_bugs.yaml", True)):
        written = yaml.safe_load((HERE / name).read_text(encoding="utf-8"))
        for learner, entries in written.items():
            found += [Bug(learner, bug, **entry, is_new=is_new) for bug, entry in entries.items()]
    return found


@cache
def content(learner: str) -> str:
    """Return a hash of a right version, and of the one that it builds on."""
    text = (LEARNERS / f"{learner}.py").read_text(encoding="utf-8")
    if "learners.ppo" in text:
        text += (LEARNERS / "ppo.py").read_text(encoding="utf-8")
    return hashlib.sha256(text.encode()).hexdigest()[:8]
