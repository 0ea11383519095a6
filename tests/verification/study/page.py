"""The page of the study, docs/mutation_study.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tests.verification.study.bugs import Bug
from tests.verification.study.exams import (
    OF_BASELINES,
    OF_BUGS,
    OF_RIGHT_ONES,
    ROOT,
    SEEDS,
    TERMS,
    TUNED_ON,
    TWINS,
    Found,
)

PAGE = ROOT / "docs/mutation_study.md"
NAMES = {"q_learning": "Q-learning", "bc": "Behavioural cloning", "ppo": "PPO", "gail": "GAIL", "drlhp": "DRLHP"}
TEXT = """\
# A mutation study of the exam

Does the [exam](exam.md) notice mistakes? Five small learners, correct as far as we know, are given typical
mistakes, one at a time: {bugs} in all. Each is examined against the stored results of the correct version (`--against`).
It counts as flagged where the exam flags something (a regression, a twin that differs, peeking, a failure), or reports a
diagnosis that the correct version does not get.

| | |
|---|---|
| mistakes flagged | {flagged} of {bugs} |
| flagged without twins | {printed} of {bugs} |
| correct versions flagged, on fresh seeds | {false} of {exams} |
| steps | {steps} |
| seeds | {seeds}, and {twins} of each task |

The learners were written, and three of the mistakes tried, on seeds {tuned}; nothing in the exam, its diagnoses or the list of
mistakes was adjusted to the results below. Stored results are of seeds {baselines}, mistakes of seeds {mistakes}, and correct
versions were examined again on seeds {fresh}. An exam has 15 seeds by default: a mistake that
affects only some seeds is often not flagged with {seeds}.

```sh
python -m tests.verification.study --baselines  # the stored results: tasks/derail/baselines
python -m tests.verification.study              # the study, and this page
```

The learners are in `tests/verification/study/learners`, the mistakes in `tests/verification/study/bugs.yaml`. The tables list
tasks with regressions, as printed and on twins, other flags with their kind, and diagnoses that the correct version does not get.
"""
HEAD = "| mistake | as printed | twins | diagnoses |\n|---|---|---|---|"


def written(wrong: Sequence[tuple[Bug, Found]], right: Mapping[tuple[str, int], Found]) -> None:
    """Write the page, from what was found of learners with mistakes, and of right ones by learner and first seed."""
    parts = [_summary(wrong, right)]
    for learner, title in NAMES.items():
        rows = [_row(bug, found) for bug, found in wrong if bug.learner == learner]
        parts.append("\n".join([f"## {title}", "", HEAD, *rows]))
    parts.append(_unseen(wrong))
    parts.append(_right(right))
    PAGE.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")


def _summary(wrong: Sequence[tuple[Bug, Found]], right: Mapping[tuple[str, int], Found]) -> str:
    return TEXT.format(
        bugs=len(wrong), flagged=sum(bool(found.whole) for _, found in wrong),
        printed=sum(bool(found.printed) for _, found in wrong), false=sum(bool(found.whole) for found in right.values()),
        exams=len(right), tuned=TUNED_ON, baselines=_seeds(OF_BASELINES), mistakes=_seeds(OF_BUGS), seeds=SEEDS,
        fresh=", ".join(map(_seeds, OF_RIGHT_ONES)), twins="one twin" if TWINS == 1 else f"{TWINS} twins",
        steps=", ".join(f"{terms.steps:,} ({NAMES[learner]})" for learner, terms in TERMS.items()),
    )  # fmt: skip


def _seeds(first: int) -> str:
    return f"{first} to {first + SEEDS - 1}"


def _row(bug: Bug, found: Found) -> str:
    diagnoses = [f"`{name}`" for kind, name in found.whole if kind == "diagnosis"]
    cells = (bug.what, _tasks(found.printed), _tasks(found.by_twins), ", ".join(diagnoses))
    return f"| {' | '.join(cells)} |"


def _tasks(found: Sequence[tuple[str, str]]) -> str:
    """The tasks that something is flagged of; with the kind, where it is no regression."""
    named = {}
    for kind, task in found:
        if kind != "diagnosis":
            name = task.removeprefix("derail/").removesuffix("-v0")
            named[name if kind == "regression" else f"{name} ({kind})"] = None
    return ", ".join(named)


def _unseen(wrong: Sequence[tuple[Bug, Found]]) -> str:
    rows = [f"| {NAMES[bug.learner]} | {bug.what} | {bug.why} |" for bug, found in wrong if not found.whole]
    return "\n".join(["## What was not flagged, and why", "", "| learner | mistake | why |", "|---|---|---|", *rows])


def _right(right: Mapping[tuple[str, int], Found]) -> str:
    rows = [
        f"| {NAMES[learner]} | {_seeds(first)} | {', '.join(f'{kind}: {name}' for kind, name in found.whole) or 'nothing'} |"
        for (learner, first), found in right.items()
    ]
    return "\n".join(["## Correct versions again", "", "| learner | seeds | flagged |", "|---|---|---|", *rows])
