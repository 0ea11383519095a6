"""The page of the library: its suites, and what their tasks were compared with."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from statistics import median
from typing import NamedTuple

from docs.tools.markdown import code, entries, filled
from taskspec.language import registry
from taskspec.show.record import SUITES

PAGE = Path(__file__).parents[1] / "reference" / "library.md"
SPEEDS = Path(__file__).with_name("library_speed.json")
"""How many times faster tasks are than their originals, as `python -m tests.benchmarks.originals` measured."""
COMPARED = (
    "textbook", "toy_text", "classic_control", "bsuite", "memory", "pomdp", "safety", "irl", "planning", "operations",
)  # fmt: skip
"""The suites whose tasks were known before, and were compared with their originals."""


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
    counts = Counter(name.partition("/")[0] for name in registry.task_ids())
    suites = entries((code(name), f"{about.line} ({counts[name]})") for name, about in SUITES.items())
    return filled(PAGE, {"suites": suites, "compared": _compared(), "speed": _speed()})


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
    rows = [*compared.items(), ("nothing that could be compared", [f"the {len(argued)} other tasks"])]
    return entries((evidence, ", ".join(names)) for evidence, names in rows)


def _speed() -> str:
    """Return how much faster tasks are than their originals."""
    ratios = list(json.loads(SPEEDS.read_text(encoding="utf-8")).values())
    least, middle, most = (f"{float(f'{ratio:.1g}'):,.0f}" for ratio in (min(ratios), median(ratios), max(ratios)))
    return (
        f"With 1,024 lanes, NumPy makes {least} to {most} times as many steps a second as a loop over the original "
        f"(median {middle}, {len(ratios)} tasks; `python -m tests.benchmarks.originals`)."
    )
