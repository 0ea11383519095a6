"""The page of the study, docs/explain/exam_study.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from taskspec.learn.statistics import rate_interval
from tests.verification.exam_study.bugs import Bug, bugs
from tests.verification.exam_study.exams import PARTS, ROOT, SEEDS, Found

PAGE = ROOT / "docs/explain/exam_study.md"
NAMES = {
    "q_learning": "Q-learning", "bc": "Behavioural cloning", "ppo": "PPO", "gail": "GAIL", "drlhp": "DRLHP",
    "replay": "Q-learning with replay", "actor_critic": "Actor-critic", "traces": "Q(lambda)",
    "sb3_dqn": "DQN of Stable-Baselines3", "sb3_ppo": "PPO of Stable-Baselines3",
    "imitation_bc": "Cloning of imitation",
}  # fmt: skip
TEXT = """\
# Which mistakes the exam notices

Typical mistakes, one at a time, in small learners of our own and in those of Stable-Baselines3 and imitation. Each is
[examined](exam.md) on finite tasks of DERAIL and on the probes, against stored results of the right version, on {seeds} new
seeds; learners of libraries on three or four probes alone.

Commit 6d3c8c89 made these results. Later versions [name fewer mistakes](calibration.md), rightly and wrongly.

| | first mistakes | new mistakes | all |
|---|---|---|---|
{summary}

The probes were made before the new mistakes were written; some operators of [learned values](learned.md), pairings of policies
and two diagnoses afterwards.

{right}

- old tasks: lower scores, twins that differ, peeking, failures and new diagnoses, on DERAIL
- probes: the same on the suite `probes`
- values: other numbers that differ: learned values and rewards, learning curves, drawn actions, a longer horizon
- fingerprints: learned values, rewards or policies that a known mistake explains, without a right version

Mistakes that are not flagged, each with the reason, and those that are named wrongly:
"""


def written(results: Mapping[str, Found]) -> None:
    """Write the page from what exams found, as `exams.results` has it."""
    known = {f"{bug.learner} {bug.name}": bug for bug in bugs()}
    wrong = [(bug, results[name]) for name, bug in known.items() if name in results]
    right = {name: found for name, found in results.items() if name not in known}
    rows = [_row(bug, found) for bug, found in wrong if _is_listed(bug, found)]
    parts = [_summary(wrong, right), "\n".join(rows)]
    waiting = []
    for learner, title in NAMES.items():
        missing = sum(bug.learner == learner for bug in bugs()) - sum(bug.learner == learner for bug, _ in wrong)
        if missing:
            waiting.append(f"{missing} of {title}")
    if waiting:
        parts.append(
            f"## Not examined\n\n{', '.join(waiting)}: these mistakes are written down, and wait for the next run."
        )
    PAGE.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")


def _summary(wrong: Sequence[tuple[Bug, Found]], right: Mapping[str, Found]) -> str:
    old = [(bug, found) for bug, found in wrong if not bug.is_new]
    new = [(bug, found) for bug, found in wrong if bug.is_new]
    groups = (old, new, list(wrong))
    rows = [["flagged", *(_share([found.is_flagged for _, found in group]) for group in groups)]]
    for part in PARTS:
        rows.append([f"flagged by {part}", *(_share([bool(found.flagged[part]) for _, found in g]) for g in groups)])
    rows.append(["cause named", *(_share([found.cause(bug) == "right" for bug, found in group]) for group in groups)])
    rows.append(["as one of several", *(_share([_is_one_of(bug, found) for bug, found in group]) for group in groups)])
    rows.append(
        ["another cause named", *(_share([found.cause(bug) == "wrong" for bug, found in group]) for group in groups)]
    )
    summary = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return TEXT.format(seeds=SEEDS, summary=summary, right=_right(right))


def _is_one_of(bug: Bug, found: Found) -> bool:
    return found.is_group and found.cause(bug) == "right"


def _share(holds: Sequence[bool]) -> str:
    return f"{sum(holds)} of {len(holds)}"


def _is_listed(bug: Bug, found: Found) -> bool:
    """Return whether a mistake is named wrongly, or not flagged."""
    return found.cause(bug) == "wrong" or not found.is_flagged


def _row(bug: Bug, found: Found) -> str:
    text = f"- {NAMES[bug.learner]}, {bug.what}: "
    if found.cause(bug) == "wrong":
        return f"{text}named *{', '.join(found.named)}*"
    return f"{text}not flagged; {bug.why}"


def _right(right: Mapping[str, Found]) -> str:
    """Return how many exams of right versions are flagged, and by what."""
    alarms = sum(found.is_flagged for found in right.values())
    low, high = rate_interval(alarms, len(right))
    rate = f"95 % interval {100 * low:.1f} to {100 * high:.1f} %"
    lines = [
        f"{len(right)} exams of right versions on other seeds were compared with the one before: {alarms} flagged",
        f"({rate}).",
    ]
    for name, found in right.items():
        learner, first = name.split()
        flagged = [text for texts in found.flagged.values() for text in texts]
        if flagged:
            lines.append(f"{NAMES[learner]}, seeds from {first}: {', '.join(flagged)}.")
    return " ".join(lines)
