"""The page of the study, docs/exam_study.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tests.verification.exam_study.bugs import Bug, bugs
from tests.verification.exam_study.exams import OF_BUGS, PARTS, ROOT, SEEDS, TERMS, Found

PAGE = ROOT / "docs/exam_study.md"
NAMES = {
    "q_learning": "Q-learning", "bc": "Behavioural cloning", "ppo": "PPO", "gail": "GAIL", "drlhp": "DRLHP",
    "replay": "Q-learning with replay", "actor_critic": "Actor-critic", "traces": "Q(lambda)",
}  # fmt: skip
TEXT = """\
# Which mistakes the exam notices

Small learners, correct as far as we know, are given typical mistakes, one at a time. Each is [examined](exam.md) on finite tasks
of DERAIL and on the probes, against stored results of the right version (`--against`), on {seeds} seeds not used before.

| | first mistakes | new mistakes | all |
|---|---|---|---|
{summary}

The first mistakes were known when operators, probes and diagnoses were written. The new ones were written afterwards, and
nothing was adjusted to their results. An earlier exam, of DERAIL and its scores alone, flagged 39 of the 55 first mistakes.

| part of the exam | what counts |
|---|---|
| old tasks | lower scores, twins that differ, peeking, failures and diagnoses, on DERAIL |
| probes | the same on the suite `probes` |
| values | other numbers that differ: learned values and rewards, learning curves, drawn actions, a longer horizon |
| fingerprints | learned values or rewards that a known mistake explains; this needs no right version |

The cause is named where the [explanation of learned values or rewards](learned.md), or a [diagnosis](diagnoses.md), is among
those that are written beside the mistake. It is named wrongly where values or rewards are explained by another mistake. Many
mistakes have no operator and no diagnosis of their own: then no name is right.

```sh
python -m tests.verification.exam_study
```

The learners are in `tests/verification/exam_study/learners`, the mistakes in `bugs.yaml` and `new_bugs.yaml` beside them. Steps
of training:
{steps}.
"""
HEAD = f"| mistake | {' | '.join(PARTS)} | named | cause |\n|---|---|---|---|---|---|---|"


def written(wrong: Sequence[tuple[Bug, Found]], right: Mapping[tuple[str, int], Found]) -> None:
    """Write the page, from what was found of learners with mistakes, and of right ones by learner and first seed."""
    parts = [_summary(wrong, right)]
    for learner, title in NAMES.items():
        rows = [_row(bug, found) for bug, found in wrong if bug.learner == learner]
        missing = sum(bug.learner == learner for bug in bugs()) - len(rows)
        if missing:
            parts.append(
                f"## {title}: {missing} mistakes not examined\n\nThey are written down, and wait for the next run."
            )
        if rows:
            parts.append("\n".join([f"## {title}", "", HEAD, *rows]))
    parts.append(_missed(wrong))
    parts.append(_right(right))
    PAGE.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")


def _summary(wrong: Sequence[tuple[Bug, Found]], right: Mapping[tuple[str, int], Found]) -> str:
    old = [(bug, found) for bug, found in wrong if not bug.is_new]
    new = [(bug, found) for bug, found in wrong if bug.is_new]
    groups = (old, new, list(wrong))
    rows = [["flagged", *(_share([found.is_flagged for _, found in group]) for group in groups)]]
    for part in PARTS:
        rows.append([f"flagged by {part}", *(_share([bool(found.flagged[part]) for _, found in g]) for g in groups)])
    for cause in ("right", "wrong"):
        rows.append([f"cause named: {cause}", *(_share([f.cause(bug) == cause for bug, f in g]) for g in groups)])
    alarms = sum(found.is_flagged for found in right.values())
    rows.append(["right versions flagged", "", "", f"{alarms} of {len(right)}"])
    steps = ",\n".join(f"{terms.steps:,} ({NAMES[learner]})" for learner, terms in TERMS.items())
    summary = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return TEXT.format(seeds=SEEDS, summary=summary, steps=steps)


def _share(holds: Sequence[bool]) -> str:
    return f"{sum(holds)} of {len(holds)}"


def _row(bug: Bug, found: Found) -> str:
    marks = ["✓" if found.flagged[part] else "" for part in PARTS]
    new = " (new)" if bug.is_new else ""
    cells = (f"{bug.what}{new}", *marks, ", ".join(found.named), found.cause(bug))
    return f"| {' | '.join(cells)} |"


def _missed(wrong: Sequence[tuple[Bug, Found]]) -> str:
    rows = [f"| {NAMES[bug.learner]} | {bug.what} | {bug.why} |" for bug, found in wrong if not found.is_flagged]
    head = ["## What was not flagged, and why", "", "| learner | mistake | why |", "|---|---|---|"]
    return "\n".join([*head, *rows])


def _right(right: Mapping[tuple[str, int], Found]) -> str:
    rows = []
    for (learner, first), found in right.items():
        flagged = [text for texts in found.flagged.values() for text in texts]
        if flagged:
            rows.append(f"| {NAMES[learner]} | {first} to {first + SEEDS - 1} | {', '.join(flagged)} |")
    counts = {learner: sum(name == learner for name, _ in right) for learner in TERMS}
    exams = ", ".join(f"{number} of {NAMES[learner]}" for learner, number in counts.items() if number)
    lines = ["## Right versions again", "", f"Exams on fresh seeds: {exams}. Seeds of mistakes begin at {OF_BUGS}."]
    if rows:
        lines += ["", "| learner | seeds | flagged |", "|---|---|---|", *rows]
    return "\n".join(lines)
