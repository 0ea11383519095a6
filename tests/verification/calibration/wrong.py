"""Wrong learners: changes of the text of one function of a right one."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

HERE = Path(__file__).parent
RUN_AS = {"actor_critic": "a2c_gae"}
"""Learners that call the function which is changed, where it is no learner itself."""
FILES = ("right.py", "imitators.py", "deep.py")


@dataclass(frozen=True)
class Mistake:
    """A mistake in a learner.

    Attributes:
        learner: its text is changed.
        what: what is wrong, in a sentence.
        changes: texts of the function, each of which stands there once, and what stands there instead.
        causes: names of operators that say what is wrong.
        why: none does, where that is so.
    """

    learner: str
    name: str
    what: str
    changes: dict[str, str]
    causes: tuple[str, ...] = ()
    why: str = ""

    @property
    def function(self) -> str:
        """The name of the function that is changed."""
        return self.learner.removeprefix("torch_")

    def source(self) -> str:
        """Return the program with the mistake. Raises ValueError where a text does not stand in the function once."""
        text, own = program(self.learner)
        changed = own
        for right, wrong in self.changes.items():
            if changed.count(right) != 1:
                raise ValueError(f"{self.learner}, {self.name}: {right!r} stands there {changed.count(right)} times")
            changed = changed.replace(right, wrong)
        return text.replace(own, changed)

    def train(self) -> Callable[[Any], Any]:
        """Return the learner with the mistake."""
        space: dict[str, Any] = {"__name__": f"{self.function}_{self.name}"}
        exec(compile(self.source(), self.name, "exec"), space)
        found: Callable[[Any], Any] = space[RUN_AS.get(self.function, self.function)]
        return found


@cache
def program(learner: str) -> tuple[str, str]:
    """Return the program of a right learner, and the text of its function."""
    files = FILES[-1:] if learner.startswith("torch_") else FILES[:-1]
    for file in files:
        text = (HERE / file).read_text(encoding="utf-8")
        for each in ast.parse(text).body:
            if isinstance(each, ast.FunctionDef) and each.name == learner.removeprefix("torch_"):
                own = ast.get_source_segment(text, each)
                assert own is not None
                return text, own
    raise ValueError(f"there is no learner {learner}")


def mistakes(name: str = "wrong") -> list[Mistake]:
    """Return all mistakes of a file of this folder."""
    written = yaml.safe_load((HERE / f"{name}.yaml").read_text(encoding="utf-8"))
    found = []
    for learner, entries in written.items():
        for name, entry in entries.items():
            causes = tuple(entry.pop("causes", ()))
            found.append(Mistake(learner, name, **entry, causes=causes))
    return found
