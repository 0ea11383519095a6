"""The specs in the repository's folders, without what lies beside them: experiments, exams, findings; and their tasks."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from taskspec import source
from taskspec.base.diagnostics import SpecError
from taskspec.source import scan
from taskspec.task.build import build
from taskspec.task.merge import variant_names
from taskspec.task.task import Task

ROOT = Path(__file__).parents[2]
SHIPPED = "tasks/*/*.yaml"
EVERY = (SHIPPED, "tests/specs/*.yaml")


def specs(*patterns: str) -> list[Path]:
    """The specs that patterns of paths, from the root of the repository, lead to; sorted."""
    found = (path for pattern in patterns for path in ROOT.glob(pattern))
    return sorted(path for path in found if scan.kind(path.read_text(encoding="utf-8", errors="replace")) == "taskspec")


@cache
def tasks(*patterns: str) -> tuple[Task, ...]:
    """The tasks of these specs, each variant, at their defaults; without bases that only their variants complete."""
    found = []
    for path in specs(*patterns):
        document = source.read(path)
        for variant in variant_names(document.data).values():
            try:
                found.append(build(document, variant))
            except SpecError:
                continue
    return tuple(found)
