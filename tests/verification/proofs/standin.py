"""Random tasks with a finite stand-in that is right, or wrong in one place: a weight, a rare reward, a late step, the expert."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

Data = dict[str, Any]
WRONG = ("weight", "rare", "late", "reward", "expert", "terminal", "initial", "map", "real")
WEIGHTS = (("1/2", "1/2"), ("99/100", "1/100"), ("1/3", "2/3"), ("999/1000", "1/1000"))
OTHER = {"1/2": ("501/1000", "499/1000"), "99/100": ("1", "0"), "1/3": ("1/2", "1/2"), "999/1000": ("1", "0")}


@dataclass(frozen=True)
class StandIn:
    """A spec with an abstraction, and what is wrong with it, if anything."""

    spec: Data
    wrong: str | None

    @property
    def real(self) -> Data:
        """The spec alone: what claims are about."""
        return {k: v for k, v in self.spec.items() if k != "abstraction"}

    @property
    def alone(self) -> Data:
        """The stand-in as a task of its own."""
        taken = {k: v for k, v in self.spec["abstraction"].items() if k != "map"}
        return {k: v for k, v in self.real.items() if k != "terminal"} | taken


@dataclass(frozen=True)
class Parts:
    """What a pursuit is made of, in terms of the distance `d` and what is added to it in the next step."""

    horizon: int
    weights: tuple[str, str]
    reward: str
    ends: bool

    def moved(self, name: str, weights: tuple[str, str]) -> Any:
        step = f"{name} + a - 1"
        return step if weights[1] == "0" else {step: weights[0], name: weights[1]}


REWARDS = ("-abs(Z')", "Z' == 0", "Z' * Z'", "1 if Z' >= 2 else 0", "0.1 * Z'")
EXPERT = "2 if Z < 0 else 1 if Z == 0 else 0"


def standin(rng: random.Random) -> StandIn:
    """A pursuer at x and its aim at y, which only their distance matters for; x - y stands for both."""
    parts = Parts(rng.choice((2, 3, 5, 6)), rng.choice(WEIGHTS), rng.choice(REWARDS), rng.random() < 0.5)
    wrong = rng.choice((None, *WRONG))
    start = dict(zip(rng.sample(range(-2, 4), 2), rng.choice(WEIGHTS), strict=True))
    spec: Data = {
        "taskspec": 1,
        "name": "StandIn",
        "state": {name: {"type": "int", "low": -30, "high": 30} for name in "xy"},
        "action": {"a": {"type": "int", "low": 0, "high": 2}},
        "horizon": parts.horizon,
        "initial": {"x": start, "y": 0},
        "dynamics": {"x'": parts.moved("x", parts.weights)},
        "reward": distance(parts.reward, "x", "y"),
        "expert": {"a": distance(EXPERT, "x", "y")},
        "abstraction": abstraction(rng, parts, start, wrong),
    }
    if wrong == "real":  # what the task does depends on more than the distance
        spec["dynamics"]["y'"] = "y + (x == 2)"
    if parts.ends:
        spec["terminal"] = "x' == y'"
    return StandIn(spec, wrong)


def distance(text: str, x: str, y: str) -> str:
    return text.replace("Z'", f"({x}' - {y}')").replace("Z", f"({x} - {y})")


def abstraction(rng: random.Random, parts: Parts, start: Data, wrong: str | None) -> Data:
    """The stand-in, with one mistake."""
    weights = OTHER[parts.weights[0]] if wrong == "weight" else parts.weights
    expert = "2 if Z < 0 else 0" if wrong == "expert" else EXPERT
    found: Data = {
        "state": {"z": {"type": "int", "low": -60, "high": 60}},
        "map": {"z": "y - x" if wrong == "map" else "x - y" if rng.random() < 0.7 else "clip(x - y, -60, 60)"},
        "initial": {"z": next(iter(start)) if wrong == "initial" else start},
        "dynamics": {"z'": parts.moved("z", weights)},
        "reward": reward(parts, wrong),
        "expert": {"a": expert.replace("Z", "z")},
    }
    if parts.ends != (wrong == "terminal"):
        found["terminal"] = "z' == 0"
    return found


def reward(parts: Parts, wrong: str | None) -> str:
    text = parts.reward.replace("Z", "z")
    if wrong == "rare":
        return f"({text}) + 5 * (z' == 3)"
    if wrong == "late":
        return f"({text}) + (t == {parts.horizon - 1})"
    return f"({text}) + 1 / 1000" if wrong == "reward" else text
