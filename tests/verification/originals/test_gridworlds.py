"""The safety tasks beside `ai_safety_gridworlds` 1.5, which needs NumPy 1 and is imported from a checkout on the path."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from tests.shared.specs import spec_file
from tests.verification.originals.beside import STEPS, Case, Result, State, among_outcomes, cases, side_by_side

pytest.importorskip("ai_safety_gridworlds")
if np.__version__ >= "2":
    pytest.skip("pycolab needs NumPy 1", allow_module_level=True)
from ai_safety_gridworlds.environments import (
    absent_supervisor,
    boat_race,
    conveyor_belt,
    distributional_shift,
    island_navigation,
    safe_interruptibility,
    side_effects_sokoban,
    tomato_watering,
    whisky_gold,
)
from pycolab import ascii_art

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def codes(art: Sequence[str]) -> Any:
    """A map as pycolab has it, which reads one with a function that NumPy 1.24 changed."""
    return np.array([list(map(ord, row)) for row in art], np.uint8)


ascii_art.ascii_art_to_uint8_nparray = codes


@dataclass
class Gridworld:
    """A gridworld; its hidden reward is a measure. It draws from NumPy's global generator."""

    env: Any
    read: Callable[[Any], State]
    measure: str | None = None

    def reset(self, seed: int) -> None:
        np.random.seed(seed)  # noqa: NPY002
        self.env.reset()

    def step(self, action: Any) -> Result:
        before = self.env._get_hidden_reward()
        found = self.env.step(action)
        measures = {}
        if self.measure is not None:
            measures = {self.measure: self.env._get_hidden_reward() - before}
        over = self.env.current_game.game_over
        return Result(None, found.reward or 0, over, found.last() and not over, measures)

    def state(self) -> State:
        return self.read(self.env)


def at(env: Any, row: int = 0, name: str = "A") -> dict[str, int]:
    """Where a thing is; maps without their first rows, where what the agent knows is drawn."""
    position = env.current_game.things[name].position
    return {"y": position.row - row, "x": position.col}


def pair(env: Any, name: str) -> list[int]:
    return list(env.current_game.things[name].position)


def supervised(env: Any) -> State:
    """Its map has a column more on the left."""
    place = at(env)
    return {"y": place["y"], "x": place["x"] - 1, "present": bool(env._environment_data["supervisor"])}


def belt(env: Any) -> State:
    thing = env.current_game.things["O"]
    return {"agent": pair(env, "A"), "object": list(thing.position), "ended": thing.end}


def boxes(env: Any) -> State:
    return {"agent": pair(env, "A"), "crate": pair(env, "X")}


def below(env: Any) -> State:
    return at(env, row=1)


def drinker(env: Any) -> State:
    return at(env, row=1) | {"drunk": env._environment_data["exploration"] is not None}


CASES = [
    Case(
        "safety/AbsentSupervisor",
        lambda: Gridworld(absent_supervisor.AbsentSupervisorEnvironment(), supervised, "performance"),
    ),
    Case("safety/BoatRace", lambda: Gridworld(boat_race.BoatRaceEnvironment(), at, "performance")),
    Case("safety/Conveyor", lambda: Gridworld(conveyor_belt.ConveyorBeltEnvironment(), belt, "performance")),
    Case(
        "safety/ConveyorSushi",
        lambda: Gridworld(conveyor_belt.ConveyorBeltEnvironment("sushi_goal"), belt, "performance"),
    ),
    Case("safety/Island", lambda: Gridworld(island_navigation.IslandNavigationEnvironment(), at, "performance")),
    *[
        Case(
            "safety/DistributionalShift",
            lambda k=k: Gridworld(distributional_shift.DistributionalShiftEnvironment(level_choice=k), at),
            {"level": k},
        )
        for k in range(3)
    ],
    *[
        Case(
            "safety/SafeInterruptibility",
            lambda q=q: Gridworld(safe_interruptibility.SafeInterruptibilityEnvironment(1, q or -1), below),
            {"q": q},
        )
        for q in (0, 1)
    ],
    Case("safety/WhiskyGold", lambda: Gridworld(whisky_gold.WhiskyOrGoldEnvironment(), drinker), {"q": 0}),
    Case(
        "planning/Sokoban",
        lambda: Gridworld(side_effects_sokoban.SideEffectsSokobanEnvironment(), boxes, "performance"),
    ),
]


@STEPS
@cases(CASES)
def test_steps(case: Case, steps: int) -> None:
    assert side_by_side(case.make(), case.original(), steps, seen=None) > 0


@STEPS
def test_whisky(steps: int) -> None:
    theirs = Gridworld(whisky_gold.WhiskyOrGoldEnvironment(human_player=True), drinker)
    assert among_outcomes(taskspec.load("safety/WhiskyGold"), theirs, steps) > 0


@STEPS
@pytest.mark.parametrize("q", [0, 1])
def test_tomatoes(q: int, steps: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the original's map."""
    art = tomato_watering.GAME_ART[0]
    source = spec_file("tomato_watering").read_text()
    ours = source[source.index("grid: [") + 6 : source.index(", legend")]
    path = tmp_path / "tomatoes.yaml"
    path.write_text(source.replace(ours, json.dumps(art)).partition("claims:")[0])
    monkeypatch.setattr(tomato_watering, "BECOME_DRY_PROBABILITY", q)
    places = [(r, c) for r, row in enumerate(art) for c, cell in enumerate(row) if cell in "tT"]

    def state(env: Any) -> State:
        watered = env.current_game.things["T"].watered_tomato
        return at(env) | {"wet": [bool(watered[place]) for place in places]}

    theirs = Gridworld(tomato_watering.TomatoWateringEnvironment(), state, "performance")
    assert side_by_side(taskspec.make(path, q=q), theirs, steps, seen=None, tolerance=1e-9) > 0


def test_the_original_pays_for_all_cells_under_the_bucket() -> None:
    """28 cells seem to be watered tomatoes, of which 13 are tomatoes."""
    env = tomato_watering.TomatoWateringEnvironment()
    env.reset()
    right = 3
    up = 0
    for action in [right, right, right, right, up, up]:
        step = env.step(action)
    assert step.reward == pytest.approx(28 * 0.02)
