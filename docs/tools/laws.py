"""Write `docs/explain/laws.md`, the table of laws and learners: `python -m docs.tools.laws`; needs Stable-Baselines3.

Results are stored in `build/laws`; a run that was stopped goes on from there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from docs.tools.law_learners import LEARNERS
from docs.tools.markdown import code, filled, table
from taskspec.exam import Running, examine
from taskspec.learn.documents.seed_scores import short_name
from taskspec.learn.exam.laws import LAWS, Law

SEEDS = 5
SHOWN = 0.1
"""The least change of a score that the table shows."""
HERE = Path(__file__).parent
PAGE = HERE.parent / "explain" / "laws.md"


def exams() -> dict[str, dict[str, Any]]:
    """Return the exam of each learner."""
    found: dict[str, dict[str, Any]] = {}
    for name, (function, steps, tasks) in LEARNERS.items():
        learner = f"{HERE / 'law_learners.py'}:{function}"
        exam = examine(
            learner, tasks=tasks, seeds=SEEDS, steps=steps, twins=0, laws=True, out=Path("build/laws") / function,
            running=Running(1),
        )  # fmt: skip
        found[name] = dict(exam)
    return found


def page() -> str:
    """Return the page."""
    laws = [(_named(law), law.cause) for law in LAWS.values()]
    found = exams()
    rows = []
    for law in LAWS:
        cells = [_cell(exam["laws"], law) for exam in found.values()]
        if any(cells):
            rows.append((code(law), *cells))
    header = ("law", "usual causes of a breach")
    parts = {"laws": table(header, laws), "learners": table(("law", *found), rows)}
    return filled(PAGE, parts)


def _named(law: Law) -> str:
    """Return the name of a law, with its modifier where that has another name."""
    if law.modifier == law.name:
        return code(law.name)
    return f"{code(law.name)} ({code(law.modifier)})"


def _cell(scores: list[dict[str, Any]], law: str) -> str:
    """Return what became of a law: a dot, or the tasks on which it is broken."""
    own = [score for score in scores if score["law"] == law]
    texts = []
    for score in own:
        name = short_name(score["task"])
        if score["error"] is not None:
            texts.append(f"{name}: no result")
        elif abs(score["changed"] - score["printed"]) >= SHOWN:
            mark = "*" if score["broken"] else ""
            texts.append(f"{name} {score['printed']:.2f} → {score['changed']:.2f}{mark}")
    if own and not texts:
        return "·"
    return "; ".join(texts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
