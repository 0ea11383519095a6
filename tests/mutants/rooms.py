"""The rooms whose source is changed, and the tests that are asked."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Room:
    """A folder of the source, and the files of tests that are asked first, since they are about it."""

    folder: str
    tests: tuple[str, ...]


ROOMS = {
    "lang": Room("taskspec/lang", (
        "functions", "bounds", "linearity", "operators", "operands", "indices", "foreign", "diagnostics", "errors", "limits",
        "refused_forms", "distributions", "variates", "labels", "printers_text",
    )),
    "draws": Room("taskspec/draws", ("draws*", "dirichlet", "seeding*")),
    "exact": Room("taskspec/exact", (
        "exact_*", "enclosures", "reach", "lint*", "accept", "examples", "proofs", "yardsticks", "symmetries*", "difficulty*",
        "shared_draws", "api_expert",
    )),
    "printers": Room("taskspec/printers", ("printers_*", "printed_mathematics", "appendix_page")),
}  # fmt: skip

OF_ALL = ("oracle", "invariants", "generated_source")
"""Files of tests that are asked about every room, last."""

NOT_CHANGED = ("taskspec/lang/operators/samples.py",)
"""Files that hold what tests are given."""


def asked(room: Room) -> list[Path]:
    """The files of tests that are asked about a room; what is slow and sees little that these do not is left out."""
    found = sorted([*ROOT.glob("tests/test_*.py"), *ROOT.glob("tests/*/test_*.py")])
    return [path for path in found if is_own(room, path) or _is_one_of(path, OF_ALL)]


def is_own(room: Room, path: Path) -> bool:
    return _is_one_of(path, room.tests)


def _is_one_of(path: Path, patterns: tuple[str, ...]) -> bool:
    return any(fnmatch(path.stem.removeprefix("test_"), pattern) for pattern in patterns)
