"""The project's own benchmarks: the suite beside seals, with targets, and games beside those who have them, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from taskspec.base.extras import is_installed
from taskspec.language.registry import load
from taskspec.language.task.task import Task
from taskspec.programs import backend_table
from taskspec.programs.backend_table import QUICKEST
from tests.benchmarks import peers
from tests.benchmarks.race import Contestant, label, ours
from tests.shared.specs import spec_file

# -- seals --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Pair:
    """One of our tasks, the environment of seals that it equals step for step, and how many times faster it has to be."""

    ours: str
    theirs: str
    target: float

    @property
    def task(self) -> str:
        return f"derail/{self.ours}-v0"

    @property
    def rival(self) -> str:
        return f"seals/{self.theirs}-v0"


PAIRS = (
    Pair("RiskyPathSeals", "RiskyPath", 30),
    Pair("BranchingSeals", "Branching", 30),
    Pair("EarlyTermPosSeals", "EarlyTermPos", 30),
    Pair("EarlyTermNegSeals", "EarlyTermNeg", 30),
    Pair("InitShiftExpertSeals", "InitShiftTrain", 30),
    Pair("InitShiftLearnerSeals", "InitShiftTest", 30),
    Pair("ParabolaSeals", "Parabola", 20),
    Pair("ProcGoalSeals", "ProcGoal", 20),
    Pair("LargestSumSeals", "LargestSum", 20),
    Pair("SortSeals", "Sort", 15),
    Pair("NoisyObsSeals", "NoisyObs", 10),
)
"""The tasks of seals. Each step of LargestSum is an episode: of 1.2 microseconds (29 in seals), 0.5 are for 50 random numbers and
their sums, 0.2 for arrays that are handed out, 0.2 for the calls of `reset` and `step` alone."""


def pair(each: Pair, lanes: int | None, backend: str = "auto") -> tuple[Contestant, Contestant]:
    """Both sides as `gymnasium.make` gives them, or, for a number of lanes, `gymnasium.make_vec`."""
    if lanes is None:
        mine = Contestant(each.task, "scalar", 1, lambda: peers.registered_scalar(each.task), each.target)
        return mine, peers.seals_scalar(each.rival, each.task)
    make = peers.registered_vector(each.task, lanes, backend=backend)
    return Contestant(each.task, backend, lanes, make), peers.seals_sync(each.rival, each.task, lanes)


# -- the suite ----------------------------------------------------------------------------------------------------

SEALS_LANES = 64
SUITE = {
    "RiskyPath": "tabular",
    "Branching": "tabular",
    "EarlyTermPos": "tabular",
    "EarlyTermNeg": "tabular",
    "InitShiftExpert": "tabular",
    "Parabola": "plain",
    "ProcGoal": "plain",
    "LargestSum": None,
    "Sort": "sort",
    "NoisyObs": "noisy",
}
"""The tasks of DERAIL, and the group whose targets they have to reach."""
TARGETS: dict[tuple[str, int], dict[str, float]] = {
    ("numpy", 1024): {"tabular": 40e6, "plain": 10e6, "sort": 8e6, "noisy": 1.2e6},
    ("numba", 64): {"tabular": 30e6, "plain": 30e6, "sort": 25e6, "noisy": 10e6},
    ("numba", 4096): {"tabular": 300e6, "plain": 200e6, "sort": 100e6, "noisy": 15e6},
    ("jax-scan", 4096): {"tabular": 150e6, "plain": 50e6, "sort": 12e6, "noisy": 2.5e6},
}
"""Steps per second on one core, by program and lanes."""
STARTS = ("RiskyPath", "Sort", "NoisyObs")
"""From the smallest to the largest kernel: what starting is measured with."""


def target_of(task: Task, program: str, lanes: int) -> float | None:
    """Steps per second that a program of a task has to reach; None where nothing is said."""
    group = SUITE.get(task.name) if label(task) == f"derail/{task.name}-v0" else None
    return TARGETS.get((program, lanes), {}).get(group or "")


def own() -> list[list[Contestant]]:
    """The suite on the backends that are installed, a group for each task; where seals is installed, beside its own."""
    return [_suite(load(f"derail/{name}-v0")) for name in SUITE]


def _suite(task: Task) -> list[Contestant]:
    found = [ours(task, "scalar", name=task.name)]
    if is_installed("seals"):
        theirs = next(p.rival for p in PAIRS if p.ours == f"{task.name}Seals")
        found += [peers.seals_scalar(theirs, task.name), peers.seals_sync(theirs, task.name, SEALS_LANES)]
    for program, lanes in TARGETS:
        if backend_table.installed(program.removesuffix("-scan")):
            found.append(ours(task, program, lanes, name=task.name, target=target_of(task, program, lanes)))
    return found


# -- games --------------------------------------------------------------------------------------------------------

GAMES = Path(__file__).parents[1] / "specs"
GAME_LANES = 4096
CART_POLE_LANES = (1024, 16384)


@dataclass(frozen=True, slots=True)
class Game:
    """A spec, with parameters, of what gymnax has under this id with these options and parameters."""

    spec: str
    gymnax: str
    lanes: tuple[int, ...] = (GAME_LANES,)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    params: Mapping[str, Any] = field(default_factory=dict)


CHOSEN = (
    Game("cart_pole", "CartPole-v1", CART_POLE_LANES),
    Game("deep_sea", "DeepSea-bsuite", parameters={"N": 8}),
    Game("catch", "Catch-bsuite"),
    Game("memory_len", "MemoryChain-bsuite", parameters={"length": 5}),
    Game("umbrella", "UmbrellaChain-bsuite", options={"n_distractor": 20}, params={"chain_length": 20}),
)


def games() -> list[list[Contestant]]:
    """Games on the compiled backends that are installed, beside what others make of the same; a group for each game."""
    return [_game(game, load(spec_file(game.spec), **game.parameters)) for game in CHOSEN]


def _game(game: Game, task: Task) -> list[Contestant]:
    found = []
    for program in QUICKEST:
        if backend_table.installed(program.removesuffix("-scan")):
            found += [ours(task, program, lanes, name=task.name) for lanes in game.lanes]
    if is_installed("gymnax"):
        found += [peers.gymnax(game.gymnax, task.name, lanes, game.options, game.params) for lanes in game.lanes]
    if task.name == "CartPole":
        found += [peers.gymnasium_cart_pole(lanes) for lanes in game.lanes]
        if is_installed("envpool"):
            found.append(peers.envpool_cart_pole(game.lanes[0]))
    return found
