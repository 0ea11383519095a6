"""The page of measures of difficulty: prose from `difficulty.md` beside this file, and the table that they are worked out by."""

from __future__ import annotations

from pathlib import Path

from taskspec.cli.manual.markdown import code, table
from taskspec.scores.difficulty import MEASURES

MARK = "<!-- measures -->"


def difficulty() -> str:
    """`docs/difficulty.md`, without the outputs of its examples."""
    prose = Path(__file__).with_name("difficulty.md").read_text(encoding="utf-8")
    rows = [(code(m.name), m.doc, f"${m.formula}$", m.unit, m.source) for m in MEASURES.values()]
    return prose.replace(MARK, table(("measure", "what it is", "", "unit", "after"), rows))
