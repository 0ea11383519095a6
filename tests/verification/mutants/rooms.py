"""The rooms whose source is changed, and the tests that are asked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class Room:
    """A folder of the source, and the folders of tests that are asked first, since they are about it."""

    folder: str
    tests: tuple[str, ...]


ROOMS = {
    "expressions": Room("taskspec/language/expressions", ("expressions", "source", "base")),
    "draws": Room("taskspec/language/draws", ("draws", "expressions")),
    "model": Room("taskspec/exact/model", ("model", "solve", "scores")),
    "solve": Room("taskspec/exact/solve", ("solve", "scores", "rules", "verification")),
    "soundness": Room("taskspec/exact/soundness", ("check", "rules")),
    "abstraction": Room("taskspec/exact/abstraction", ("check",)),
    "scores": Room("taskspec/exact/scores", ("scores", "policies")),
    "policies": Room("taskspec/exact/policies", ("policies", "scores", "data")),
    "rules": Room("taskspec/exact/rules", ("rules", "exam")),
    "check": Room("taskspec/exact/check", ("check",)),
    "printers": Room("taskspec/show/printers", ("printers", "pages")),
}

OF_ALL = ("test_oracle", "test_invariants", "test_generated_source")
"""Files of tests that are asked about every room, last."""

NOT_CHANGED = ("taskspec/language/expressions/operators/entry.py",)
"""Files that hold what tests are given."""


def asked(room: Room) -> list[Path]:
    """Return the files of tests that are asked about a room."""
    return [path for path in sorted(ROOT.glob("tests/**/test_*.py")) if is_own(room, path) or path.stem in OF_ALL]


def is_own(room: Room, path: Path) -> bool:
    """Return whether a file of tests is about a room."""
    return path.parent.name in room.tests
