"""Simulated teachers, who say which of two segments they prefer: noiseless, or with irrationalities, which may be combined.

The irrationalities are those of B-Pref: Lee, Smith, Dragan and Abbeel, "B-Pref: Benchmarking preference-based reinforcement
learning", NeurIPS Datasets and Benchmarks 2021, section 3 and algorithm 1, in the order of its algorithm.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from taskspec.data.transitions import Transitions
from taskspec.diagnostics import suggest
from taskspec.exact.model.failure import misused

Array = np.ndarray[Any, Any]
FIRST, EQUAL, SECOND = 1.0, 0.5, 0.0
"""Labels: the probability with which the first segment is said to be the better one."""
WORDS = 2
"""Random words that a label takes: one for the choice, one for the mistake."""


@dataclass(frozen=True, slots=True)
class Teacher:
    """Who compares segments by their returns; without arguments, without noise.

    Temperature and thresholds are shares of `unit`, the range of returns that `preferences` finds for the segments.

    Args:
        boltzmann: temperature of the Bradley-Terry model: the first is preferred with the probability
            1 / (1 + exp((G2 - G1) / (boltzmann * unit))).
        myopic: discounts steps that lie further back: the reward k steps before the end of a segment counts `myopic ** k`.
        mistaken: the probability with which the answer is turned round.
        skipping: gives no answer where neither return is above this share of the way from the lowest to the highest return.
        equal: calls segments equally good whose returns are less than this share apart.
    """

    boltzmann: float = 0.0
    myopic: float = 1.0
    mistaken: float = 0.0
    skipping: float | None = None
    equal: float = 0.0

    def __post_init__(self) -> None:
        for name in ("boltzmann", "equal"):
            _check(name, getattr(self, name), 0, math.inf)
        for name in ("myopic", "mistaken"):
            _check(name, getattr(self, name), 0, 1)
        if self.skipping is not None:
            _check("skipping", self.skipping, 0, 1)

    @property
    def needs_range(self) -> bool:
        """Whether answers depend on the range of returns."""
        return bool(self.boltzmann or self.equal or self.skipping is not None)

    def __str__(self) -> str:
        changed = [f for f in fields(self) if getattr(self, f.name) != f.default]
        return " + ".join(f"{f.name}({getattr(self, f.name):g})" for f in changed) or "noiseless"

    def labels(
        self, first: Array, second: Array, near: tuple[Array, Array], ends: tuple[float, float], words: Array
    ) -> Array:
        """Labels float64 (P,): 1 where the first segment is preferred, 0 the second, 0.5 where they are equal, nan for no answer.

        Args:
            first, second: the segments' true returns, (P,).
            near: their returns as a myopic teacher sees them.
            ends: the lowest and the highest return that a segment may have, from the exact model.
            words: uint32 (2, P), fresh for each pair.
        """
        low, unit = ends[0], ends[1] - ends[0]
        prefers = _preferred(near[0] - near[1], self.boltzmann * unit, words[0])
        wrong = words[1] * 2.0**-32 < self.mistaken
        found = np.where(wrong & (prefers != EQUAL), 1 - prefers, prefers)
        if self.equal:
            found = np.where(np.abs(first - second) < self.equal * unit, EQUAL, found)
        if self.skipping is not None:
            found = np.where(np.maximum(first, second) > low + self.skipping * unit, found, np.nan)
        return found

    def seen(self, segments: Transitions, discount: float) -> Array:
        """The returns (E,) of segments as a myopic teacher sees them."""
        if self.myopic == 1:
            return segments.returns(discount)
        before = segments.time - np.repeat(segments.time[segments.starts], segments.lengths)
        left = np.repeat(segments.lengths, segments.lengths) - 1 - before
        weights = discount ** before.astype(np.float64) * self.myopic ** left.astype(np.float64)
        return np.add.reduceat(weights * segments.rews, segments.starts)


def _preferred(ahead: Array, temperature: float, words: Array) -> Array:
    """Answers (P,) for how far the first segments are ahead; without a temperature, ties are equal."""
    if not temperature:
        return np.where(ahead > 0, FIRST, np.where(ahead < 0, SECOND, EQUAL))
    chance = 0.5 * (1 + np.tanh(ahead / (2 * temperature)))  # the logistic function, without overflow
    return np.where(words * 2.0**-32 < chance, FIRST, SECOND)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (low <= value <= high and math.isfinite(value)):
        span = f"between {low:g} and {high:g}" if math.isfinite(high) else f"a number from {low:g} on"
        misused(f"`{name}` of a teacher is {span}, not {value!r}")


# -- names --------------------------------------------------------------------------------------------------------

NAMES = {
    "noiseless": "prefers the higher return; equal returns are equal",
    "boltzmann(0.1)": "prefers by the Bradley-Terry model, at a temperature in units of the exact range of returns",
    "myopic(0.9)": "discounts earlier rewards of a segment",
    "mistaken(0.1)": "gives the opposite answer, with a probability",
    "skipping(0.2)": "gives no answer where neither return is above this fraction of the range",
    "equal(0.1)": "judges returns equal that differ by less than this fraction of the range",
}
"""The names of teachers, each with what it does; the numbers stand for any, and `+` combines several."""
_CALL = re.compile(r"(\w+)\(([^()]+)\)")


def teacher_of(text: str | Teacher) -> Teacher:
    """The teacher of a text such as `myopic(0.9) + mistaken(0.1)`.

    Raises:
        SpecError: E713 when it is none.
    """
    if isinstance(text, Teacher):
        return text
    found, given = Teacher(), set[str]()
    for part in map(str.strip, str(text).split("+")):
        if part == "noiseless":
            continue
        name, value = _read(part)
        if name in given:
            misused(f"the teacher '{text}' is {name} twice")
        given.add(name)
        found = replace(found, **{name: value})
    return found


def _read(part: str) -> tuple[str, float]:
    call, called = _CALL.fullmatch(part), {known.partition("(")[0]: known for known in NAMES}
    kind = part.partition("(")[0]
    try:
        if call and kind in called and kind != "noiseless":
            return kind, float(call[2])
    except ValueError:
        pass
    hint = f"for example: {called[kind]}" if kind in called else suggest(kind, called)
    misused(f"there is no teacher '{part}'", hint or ", ".join(NAMES))
