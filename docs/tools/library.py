"""The page of the library: every task beside those of the paper, with exact values, and what it was compared with."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from statistics import median
from typing import NamedTuple

from docs.tools.markdown import code, entries, filled
from taskspec.base.display import number
from taskspec.exact import Results, Return
from taskspec.language import registry
from taskspec.language.task.record import size
from taskspec.language.task.task import Task

PAGE = Path(__file__).parents[1] / "reference" / "library.md"
SPEEDS = Path(__file__).with_name("library_speed.json")
"""How many times faster tasks are than their originals, as `python -m tests.benchmarks.originals` measured."""
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


class Evidence(NamedTuple):
    """Why tasks are what they claim to be: with what they were compared and how, or, without a test, an argument."""

    suite: str
    names: str
    original: str
    how: str
    test: str | None = None

    @property
    def tasks(self) -> list[str]:
        return [f"{self.suite}/{name}" for name in self.names.split()]


RULES = "tests/tasks/test_written_by_others.py"
ARGUED = "argued"
EVIDENCE = (
    Evidence("toy_text", "FrozenLake CliffWalking Taxi", "Gymnasium 1.4", "100,000 steps; every row of `P`", "gymnasium"),
    Evidence("toy_text", "Blackjack", "Gymnasium 1.4", "100,000 steps with the same cards", "gymnasium"),
    Evidence("classic_control", "CartPole", "Gymnasium 1.4", "100,000 steps, to the last bit", "gymnasium"),
    Evidence("classic_control", "MountainCar Acrobot", "Gymnasium 1.4", "100,000 steps, within 1e-10", "gymnasium"),
    Evidence(
        "classic_control", "MountainCarContinuous Pendulum", "Gymnasium 1.4",
        "100,000 steps, within its float32 (1e-5)", "gymnasium",
    ),
    Evidence(
        "bsuite", "CartPole CartPoleSwingUp Catch DeepSea DiscountingChain MemoryLength MountainCar Umbrella", "bsuite 0.3.6",
        "100,000 steps for each setting; noise as its distribution", "bsuite",
    ),
    Evidence("bsuite", "Bandit", "bsuite 0.3.6", "the rewards of all arms", "bsuite"),
    Evidence("bsuite", "BernoulliBandit", "none", ARGUED),
    Evidence(
        "memory", "Autoencode Battleship Concentration HigherLower Minesweeper RepeatFirst RepeatPrevious", "POPGym 1.0.7",
        "100,000 steps, with whole decks and larger boards", "popgym",
    ),
    Evidence("memory", "NBack Simon", "none", ARGUED),
    Evidence("pomdp", "Shuttle Tiger Voicemail RockSample", "published files", "all probabilities and rewards", "pomdps"),
    Evidence("pomdp", "Hallway", "none", "argued: much smaller"),
    Evidence(
        "safety", "AbsentSupervisor BoatRace Conveyor Island TomatoWatering", "gridworlds 1.5",
        "100,000 steps, with the hidden reward", "gridworlds",
    ),
    Evidence(
        "safety", "DistributionalShift SafeInterruptibility WhiskyGold", "gridworlds 1.5", "100,000 steps", "gridworlds"
    ),
    Evidence("planning", "Sokoban", "gridworlds 1.5", "100,000 steps, with the hidden reward", "gridworlds"),
    Evidence("safety", "FriendOrFoe", "gridworlds 1.5", "argued: theirs estimates a policy over many episodes"),
    Evidence("safety", "OffSwitch Vases", "papers without code", ARGUED),
    Evidence("textbook", "WindyGrid", "S. Zhang's programs", "100,000 steps", "textbook"),
    Evidence("textbook", "RandomWalk", "the book", "all printed values", "textbook"),
    Evidence("textbook", "Gambler", "value iteration as in the book", "nine states", "textbook"),
    Evidence("textbook", "Baird", "the book", "the expected update diverges", "textbook"),
    Evidence("textbook", "CarRental", "value iteration in NumPy", "the optimal return", RULES),
    Evidence("textbook", "ContextualBandit DriftingBandit MaximisationBias Recycling", "books without numbers", ARGUED),
    Evidence("operations", "Inventory Secretary", "Puterman; Gilbert and Mosteller", "all printed values", "textbook"),
    Evidence("operations", "AssetSelling Queue", "books without numbers", ARGUED),
    Evidence("operations", "Epidemic Maintenance", "none", ARGUED),
    Evidence("planning", "Life LightsOut Queens TicTacToe", "their rules in NumPy", "games of random moves", RULES),
    Evidence("planning", "Hanoi KeyDoor RiverCrossing SlidingPuzzle ThreeInAColumn", "none", ARGUED),
    Evidence(
        "irl", "CausalConfusion FalseBelief MyopicExpert Scale Shaping SoftExpert StateOnly TwoGoals Unvisited",
        "papers without code", ARGUED,
    ),
)  # fmt: skip


def library() -> str:
    """Return the page of the library."""
    parts = []
    for suite, heading in SUITES.items():
        tasks = [registry.load(name) for name in registry.task_ids() if name.startswith(f"{suite}/")]
        bases = {task.source.document.origin.name: task for task in tasks if task.source.merged.variant is None}
        shown = [task for task in tasks if task in bases.values() or task.summary != _base(task, bases).summary]
        parts.append(f"## {heading}\n\n{_values(shown)}")
    return filled(PAGE, {"tables": "\n\n".join(parts), "compared": _compared(), "speed": _speed()})


def _base(task: Task, bases: dict[str, Task]) -> Task:
    return bases[task.source.document.origin.name]


def _compared() -> str:
    """Return what tasks were compared with, and how; at the end those without an original that could be compared."""
    compared: dict[str, list[str]] = {}
    argued = []
    for found in EVIDENCE:
        names = found.names.split()
        if found.test is None:
            argued += names
        else:
            compared.setdefault(f"{found.original}, {found.how}", []).extend(names)
    rows = [*compared.items(), ("nothing that could be compared", argued)]
    return entries((evidence, ", ".join(names)) for evidence, names in rows)


def _speed() -> str:
    """Return how much faster tasks are than their originals."""
    ratios = list(json.loads(SPEEDS.read_text(encoding="utf-8")).values())
    least, middle, most = (f"{float(f'{ratio:.1g}'):,.0f}" for ratio in (min(ratios), median(ratios), max(ratios)))
    return (
        f"With 1,024 lanes, NumPy makes {least} to {most} times as many steps a second as a loop over the original "
        f"(median {middle}, {len(ratios)} tasks; `python -m tests.benchmarks.originals`)."
    )


def _values(tasks: Iterable[Task]) -> str:
    return entries(map(_row, tasks))


def _row(task: Task) -> tuple[str, str]:
    """Return a task with its size and returns, and what it is."""
    results = Results(task)
    facts = [size(task).replace(" × ", "×")]
    if results.random is not None:
        best = "?" if results.optimal is None else _shown(results.optimal)
        facts.append(f"{_shown(results.random)}→{best}")
    return f"{code(task.name)} ({', '.join(facts)})", task.summary


def _shown(found: Return) -> str:
    """Return an exact value, or the mean of episodes as such."""
    if found.exact:
        return number(found.value)
    return f"≈{number(found.value, 3)}"
