"""What exams of the calibration said, in `results.json`, and the page of it, docs/explain/calibration.md."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from docs.tools.markdown import filled, table
from taskspec.learn.statistics import rate_interval
from tests.verification.calibration.exams import Asked, Told, is_named
from tests.verification.calibration.wrong import mistakes

RESULTS = Path(__file__).parent / "results.json"
PAGE = Path(__file__).parents[3] / "docs/explain/calibration.md"
TITLES = {
    "q_learning": "Q-learning", "sarsa": "SARSA", "expected_sarsa": "expected SARSA", "double_q": "double Q-learning",
    "dyna_q": "Dyna-Q", "monte_carlo": "Monte Carlo", "n_step": "3-step SARSA", "q_lambda": "Q(lambda)",
    "reinforce_alone": "REINFORCE", "reinforce_baseline": "REINFORCE with a baseline", "bc": "behavioural cloning",
    "gail": "GAIL", "airl": "AIRL", "maxent_irl": "MaxEnt IRL", "preference_learner": "preferences (Bradley-Terry)",
    "torch_ppo": "PPO in PyTorch", "torch_dqn": "DQN in PyTorch", "torch_a2c": "A2C in PyTorch",
}  # fmt: skip
ACTOR_CRITIC = "A2C over tables: lambda 0, 0.95, 1, critics of several rates"
BUDGETS = (0.1, 1.0, 5.0)
UNSEEN = "unseen"
SEEDS_OF_AN_EXAM = 1000
"""An exam is compared with the one whose seeds begin so many before its own, where there is one."""
One = tuple[float, bool, bool, bool]
"""The budget of an exam, and whether it names a mistake, has a diagnosis, and flags."""
Results = dict[str, dict[str, Any]]
"""By kind of exam, learner, mistake, budget and first seed: names and diagnoses, and flags."""


def results() -> Results:
    """Return what exams said so far."""
    if not RESULTS.exists():
        return {}
    found: Results = json.loads(RESULTS.read_text(encoding="utf-8"))
    return found


def store(kind: str, asked: Asked, said: Sequence[Told]) -> None:
    """Add what exams said to what is kept.

    Args:
        kind: `right`, or the file of a mistake.
    """
    known = results()
    for each in said:
        mistake = "" if asked.mistake is None else f" {asked.mistake.name}"
        key = f"{kind} {asked.learner}{mistake} {asked.budget:g} {each.first}"
        known[key] = {name: value for name, value in asdict(each).items() if name != "first"}
    rows = [f" {json.dumps(key)}: {json.dumps(known[key])}" for key in sorted(known)]
    RESULTS.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


def written() -> None:
    """Write the page."""
    known = results()
    right = {tuple(key.split()[1:]): said for key, said in known.items() if key.startswith("right ")}
    parts = {"right": _right(right), "unseen": _unseen(known)}
    PAGE.write_text(filled(PAGE, parts), encoding="utf-8")


def _right(right: Mapping[tuple[str, ...], Mapping[str, Any]]) -> str:
    """Return a table of right learners, and how many exams say something of them."""
    groups: dict[str, list[One]] = {}
    for (learner, budget, _), said in right.items():
        one = (float(budget), bool(said["names"]), bool(said["diagnoses"]), bool(said["flags"]))
        groups.setdefault(TITLES.get(learner, ACTOR_CRITIC), []).append(one)
    everything = [one for group in groups.values() for one in group]
    rows = [_row(title, groups.get(title, [])) for title in (*TITLES.values(), ACTOR_CRITIC)]
    rows.append(_row("all", everything))
    names = sum(named for _, named, _, _ in everything)
    alarms = sum(flagged for _, _, _, flagged in everything)
    _, most_names = rate_interval(names, len(everything))
    compared = 0
    for learner, budget, first in right:
        compared += (learner, budget, str(int(first) - SEEDS_OF_AN_EXAM)) in right
    _, most_alarms = rate_interval(alarms, compared)
    summary = (
        f"The 95 % interval of the rate of wrong names in {len(everything)} exams ends at {100 * most_names:.1f} %, "
        f"of wrong flags in the {compared} exams that have an earlier one at {100 * most_alarms:.1f} %."
    )
    header = ("learner", "a tenth", "whole", "five times", "named", "with a diagnosis", "flagged")
    return f"{table(header, rows)}\n\n{summary}"


def _row(title: str, exams: Sequence[One]) -> list[str]:
    numbers = [sum(one[0] == each for one in exams) for each in BUDGETS]
    numbers += [sum(bool(one[part]) for one in exams) for part in (1, 2, 3)]
    return [title, *map(str, numbers)]


def _unseen(known: Results) -> str:
    """Return a table of the mistakes that the rules were not written for."""
    rows = []
    counts = {"flagged": 0, "rightly": 0, "wrongly": 0}
    examined = 0
    for mistake in mistakes(UNSEEN):
        prefix = f"{UNSEEN} {mistake.learner} {mistake.name} 1 "
        for said in [said for key, said in known.items() if key.startswith(prefix)][:1]:
            examined += 1
            told = Told(0, **said)
            notes = [f"({name})" for name in told.notes]
            names = ", ".join([*told.names, *notes, *told.diagnoses]) or "–"
            named = is_named(mistake.causes, told)
            if named is not None:
                counts["rightly" if named else "wrongly"] += 1
            if named is False:
                names = f"wrongly: {names}"
            counts["flagged"] += bool(said["flags"])
            flagged = "yes" if said["flags"] else "no"
            rows.append((TITLES.get(mistake.learner, "A2C over tables"), mistake.what, flagged, names))
    summary = (
        f"Of {examined}, {counts['flagged']} are flagged, {counts['rightly']} named rightly, "
        f"{counts['wrongly']} wrongly, and {examined - counts['rightly'] - counts['wrongly']} not."
    )
    return f"{summary}\n\n{table(('learner', 'mistake', 'flagged', 'named'), rows)}"
