"""Results of an exam that nobody ran: what `exam.json` holds, made of a few numbers."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from taskspec.learn.exam.findings import diagnose

TITLES = {
    "RiskyPath": "stochastic transitions", "EarlyTermPos": "early termination", "EarlyTermNeg": "early termination",
    "Branching": "exploration", "InitShiftLearner": "distribution shift", "NoisyObs": "robustness to noise",
    "Parabola": "continuous control", "LargestSum": "high dimensionality", "ProcGoal": "procedural generation",
    "Sort": "algorithmic complexity",
}  # fmt: skip
CONSTANT = {"RiskyPath": 1.0, "EarlyTermPos": 1.0, "EarlyTermNeg": 1.0, "Branching": 1.0, "InitShiftLearner": 1.0}
"""The score of the best constant action, where it is not that of random actions."""
Scores = Mapping[str, float | Sequence[float]]


def entry(task: str, seed: int, score: float | None, **others: Any) -> dict[str, Any]:
    """One result."""
    return {
        "task": id_of(task), "twin": None, "peek": None, "seed": seed, "deterministic": score, "stochastic": score,
        "half": 0.0, "return": score, "error": None if score is not None else "it failed", "steps": 50_000, "seconds": 2.5,
        "demonstrations": 10_000, "comparisons": 0, "starc": None, "reward_regret": None, "curve": None,
    } | others  # fmt: skip


def column(rows: Iterable[Mapping[str, Any]], name: str) -> list[Any]:
    """One value of each row."""
    return [row[name] for row in rows]


def flags(exam: Mapping[str, Any], *kinds: str) -> list[Any]:
    """The flags of an exam that are of these kinds."""
    return [flag for flag in exam["flags"] if flag["kind"] in kinds]


def diagnosed(exam: Any) -> list[str]:
    """The names of diagnoses of an exam on the suite of the paper."""
    return column(diagnose(exam, "derail"), "name")


def entries(scores: Scores, seeds: int, **others: Any) -> list[dict[str, Any]]:
    """A result for each task and seed."""
    results = []
    for task, each in scores.items():
        of_seeds = each if isinstance(each, Sequence) else [float(each)] * seeds
        for seed, score in enumerate(of_seeds):
            results.append(entry(task, seed, score, **others))
    return results


def id_of(task: str) -> str:
    """`derail/NoisyObs-v0?L=5` for `NoisyObs?L=5`."""
    name, mark, values = task.partition("?")
    return f"derail/{name}-v0{mark}{values}"


def exam(printed: Scores, twins: Scores | None = None, seeds: int = 15, **others: Any) -> dict[str, Any]:
    """Results with a score for each seed of each task, or one for all seeds; `twins` those on two twins of each."""
    scores = entries(printed, seeds)
    for k in (1, 2):
        scores += entries(twins or {}, seeds, twin=f"relabelled={k}+permuted_actions={k}")
    about = {}
    for t in {**TITLES, **printed}:
        about[id_of(t)] = {
            "capability": TITLES[t.partition("?")[0]], "title": t, "random": -10.0, "expert": 4.0, "optimal": 4.0,
            "worst": -250.0, "cannot": None, "constant": CONSTANT.get(t, 0.0), "content_hash": "0" * 64,
        }  # fmt: skip
    found = {
        "exam": 1, "learner": "bc", "learns_from": ["demonstrations"], "suite": "derail", "steps": 500_000,
        "transitions": 10_000, "tasks": about,
        "seeds": list(range(seeds)), "versions": {"taskspec": "0.1.0"}, "machine": {"cpu": "a processor"}, "scores": scores,
        "command": "taskspec exam bc --suite derail", "verdicts": _verdicts(scores), "flags": [], "diagnoses": [],
        "cost": {"steps": 7_500_000, "demonstrations": 150_000, "comparisons": 0, "seconds": 84.0},
    }  # fmt: skip
    return found | others


def _verdicts(scores: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """By capability, from a normal interval: this is only to have something to show."""
    found: dict[str, Any] = {}
    tasks_of: dict[str, list[str]] = {}
    for task, capability in TITLES.items():
        tasks_of.setdefault(capability, []).append(id_of(task))
    for capability, tasks in tasks_of.items():
        own = []
        for score in scores:
            if score["task"] in tasks and score["twin"] is None and score["error"] is None:
                own.append(score["deterministic"])
        if not own:
            continue
        mean = float(np.mean(own))
        half = 1.96 * float(np.std(own)) / len(own) ** 0.5
        verdict = "unsure"
        if mean - half >= 0.9:
            verdict = "masters"
        elif mean + half < 0.9:
            verdict = "fails"
        found[capability] = {
            "verdict": verdict, "tasks": tasks, "mean": mean, "low": mean - half, "high": mean + half,
            "seeds": len(own), "twins": None,
        }  # fmt: skip
    return found
