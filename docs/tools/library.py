"""The page of the library: every task beside those of the paper, with exact values, and what it was compared with."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from docs.tools.markdown import code, table
from taskspec import registry
from taskspec.base.display import number
from taskspec.exact import Results, Return, difficulty, verdicts
from taskspec.task.record import size
from taskspec.task.task import Task

PROSE = Path(__file__).with_suffix(".md")
SUITES = {
    "textbook": "Textbook",
    "toy_text": "Gymnasium's toy text",
    "classic_control": "Classic control",
    "bsuite": "Behaviour suite",
    "memory": "Memory",
    "pomdp": "Partially observable",
    "safety": "Safety",
    "irl": "What identifies a reward",
    "planning": "Planning",
    "operations": "Operations",
}
"""Headings of the suites of the library."""
PARITY = "tests/originals/test_gymnasium.py"
ORIGINALS = "tests/tasks/test_written_by_others.py"
BSUITE = "tests/originals/test_bsuite.py"
COMPARED = {
    "toy_text/FrozenLake": ("Gymnasium's FrozenLake-v1", "every state, action and outcome; episodes", PARITY),
    "toy_text/Taxi": ("Gymnasium's Taxi-v3", "every state and action; the distribution of starts", PARITY),
    "toy_text/CliffWalking": ("Gymnasium's CliffWalking", "every state and action; 100,000 steps", PARITY),
    "toy_text/Blackjack": ("Gymnasium's Blackjack-v1", "100,000 steps, with the same cards", PARITY),
    "classic_control/CartPole": ("Gymnasium's CartPole-v1", "trajectories, in float32", PARITY),
    "classic_control/MountainCar": ("Gymnasium's MountainCar-v0", "100,000 steps", PARITY),
    "classic_control/MountainCarContinuous": ("Gymnasium's MountainCarContinuous-v0", "trajectories", PARITY),
    "classic_control/Pendulum": ("Gymnasium's Pendulum-v1", "trajectories", PARITY),
    "classic_control/Acrobot": ("Gymnasium's Acrobot-v1", "100,000 steps", PARITY),
    "textbook/CarRental": ("value iteration in NumPy", "the optimal policy", ORIGINALS),
    "planning/Life": ("the rules in NumPy", "random boards", ORIGINALS),
    "planning/LightsOut": ("linear algebra over two elements", "solvable boards", ORIGINALS),
    "planning/TicTacToe": ("minimax in Python", "all positions", ORIGINALS),
    "bsuite/Bandit": ("bsuite 0.3.6", "rewards of all arms", BSUITE),
    "bsuite/CartPole": ("bsuite 0.3.6", "10,000 steps", BSUITE),
    "bsuite/Catch": ("bsuite 0.3.6", "10,000 steps", BSUITE),
    "bsuite/DeepSea": ("bsuite 0.3.6", "1,000 episodes", BSUITE),
    "bsuite/DiscountingChain": ("bsuite 0.3.6", "10,000 steps for each order", BSUITE),
    "bsuite/MemoryLength": ("bsuite 0.3.6", "10,000 steps at three sizes", BSUITE),
    "bsuite/MountainCar": ("bsuite 0.3.6", "10,000 steps", BSUITE),
    "bsuite/Umbrella": ("bsuite 0.3.6", "10,000 steps, without the random rewards and bits", BSUITE),
}
"""What tests compare a task with, how, and the file of the test."""


def library() -> str:
    """Return the page of the library."""
    parts = []
    errata = []
    for suite, heading in SUITES.items():
        tasks = [registry.load(name) for name in registry.task_ids() if name.startswith(f"{suite}/")]
        parts.append(f"## {heading}\n\n{_values(tasks)}")
        for task in tasks:
            if task.source.merged.variant is None:
                errata += [f"- **{task.name}**: {e.source}; here {e.here}." for e in task.spec.errata]
    compared = [f"| {name} | {original} | {how} (`{test}`) |" for name, (original, how, test) in COMPARED.items()]
    text = PROSE.read_text(encoding="utf-8").replace("<!-- tables -->", "\n\n".join(parts))
    return text.replace("<!-- compared -->", "\n".join(compared)).replace("<!-- errata -->", "\n".join(errata))


def _values(tasks: Iterable[Task]) -> str:
    header = ("task", "isolates", "what it is", "size", "optimal", "random", "look-ahead", "claims")
    return table(header, [_row(task) for task in tasks])


def _row(task: Task) -> tuple[str, ...]:
    results = Results(task)
    measured = difficulty(task, ["lookahead"])["lookahead"]
    lookahead = "" if measured is None else number(measured)
    proved = sum(verdict.status == "proved" for verdict in verdicts(task))
    values = (_shown(results.optimal), _shown(results.random))
    return (code(task.id), task.capability, task.summary, size(task), *values, lookahead, str(proved or ""))


def _shown(found: Return | None) -> str:
    """Return an exact value, or the mean of episodes as such."""
    if found is None:
        return ""
    if found.exact:
        return number(found.value)
    return f"≈ {found.value:.3g}"
