"""The specs in the repository's folders, without what lies beside them: experiments, exams, findings."""

from __future__ import annotations

from pathlib import Path

from taskspec import scan

ROOT = Path(__file__).parents[2]


def specs(*patterns: str) -> list[Path]:
    """The specs that patterns of paths, from the root of the repository, lead to; sorted."""
    found = (path for pattern in patterns for path in ROOT.glob(pattern))
    return sorted(path for path in found if scan.kind(path.read_text(encoding="utf-8", errors="replace")) == "taskspec")
