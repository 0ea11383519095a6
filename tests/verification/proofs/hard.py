"""Random specs whose numbers are hard: tiny chances, rewards that cancel, slow ends, discounts near 1, decimals, mixed sizes.

They are tables over one state and one action, so that brute force has their numbers without reading the spec: as they are
written, and as the floats that a program makes of them.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any

from tests.verification.proofs.process import Key, Outcome, Process, Shares

Data = dict[str, Any]


@dataclass(frozen=True)
class Number:
    """A number as a spec has it."""

    text: str

    @property
    def written(self) -> Fraction:
        return Fraction(self.text)

    @property
    def held(self) -> Fraction:
        """A decimal is a float where the program runs; a fraction stays one until it is paid."""
        return self.written if self.is_fraction else Fraction(float(self.text))

    @property
    def paid(self) -> Fraction:
        return Fraction(float(self.written if self.is_fraction else self.held))

    @property
    def is_fraction(self) -> bool:
        return "." not in self.text and "e" not in self.text

    def read(self, reading: str) -> Fraction:
        return self.written if reading == "written" else self.held


@dataclass(frozen=True)
class Theme:
    """A kind of difficulty: which numbers occur. `chances` lists rows of probabilities."""

    name: str
    rewards: tuple[str, ...] = ("0", "1", "-1", "2", "1/3", "-5")
    chances: tuple[tuple[str, ...], ...] = (("1",), ("1/2", "1/2"), ("1/3", "2/3"), ("1/7", "2/7", "4/7"))
    discounts: tuple[str, ...] = ("1", "1", "1/2", "9/10")
    horizons: tuple[int | None, ...] = (1, 2, 3, 5, 8)
    ends: bool | None = None
    """Whether every step may end the episode; None: as it comes."""


def rare(n: int) -> tuple[str, str]:
    return f"1/{n}", f"{n - 1}/{n}"


DECIMALS = (("0.1", "0.9"), ("0.3", "0.7"), ("0.25", "0.75"), ("0.2", "0.3", "0.5"), ("1",))
THEMES = (
    Theme("plain"),
    Theme("decimals", ("0.1", "-0.1", "0.3", "1.1", "0.7", "0"), DECIMALS, ("1", "0.9", "0.5")),
    Theme("tiny", ("1", "0", "1e12", "1e-12", "-1"), (rare(2**40), rare(2**20), ("1",), rare(10**9))),
    Theme("cancelling", ("1e17", "-1e17", "1", "3", "0", "1e300", "-1e300"), horizons=(2, 3, 4, 6)),
    Theme("long", ("1", "0", "-1", "0.1"), (("1",), ("1/2", "1/2"), rare(1024)), ("1", "1", "1023/1024"), (50, 200, 400)),
    Theme("endless", discounts=("1/2", "0.9", "99/100"), horizons=(None,)),
    Theme("near one", ("1", "0", "-1", "0.3"), discounts=("0.999", "0.99999", "999999/1000000"), horizons=(None,)),
    Theme("slow", ("1", "0", "-1", "0.5"), (rare(1000), rare(10**6), rare(10**9), ("1/2", "1/2")), ("1",), (None,), True),
    Theme("resting", ("0", "0", "1", "-1"), discounts=("1",), horizons=(None,)),
)  # fmt: skip
SIZES = (
    ("1e300", "-1e300"), ("1e17", "-1e17"), ("9007199254740992", "-9007199254740991"),
    ("1125899906842624", "1125899906842623", "1125899906842625"), ("-1125899906842624", "-1125899906842623"),
    ("1e9", "-1e9"), ("1", "-1", "1/3", "0.1"), ("1e-9", "-1e-9"), ("1/1152921504606846976", "-1/1152921504606846976"),
    ("1e-17", "-1e-17"), ("1e-300", "-1e-300"), ("1e-320", "-5e-324"), ("0",),
)  # fmt: skip
"""Rewards by their size."""
SELDOM = ("1/3", "1/1000", "1/1000000000", "1e-12", f"1/{2**53}", f"1/{2**60}", "1e-30", "1e-300", "1e-310")


def mixed(rng: random.Random) -> Theme:
    """Numbers of very different size in one spec."""
    sizes = rng.sample(SIZES, rng.randint(2, 4))
    chances = tuple(beside(rng.sample(SELDOM, rng.randint(0, 2))) for _ in range(6))
    discounts = ("1", "1", "1/2", "0.9", "1/1000000", "999999/1000000")
    if rng.random() < 0.7:
        return Theme("mixed", tuple(sum(sizes, ())), chances, discounts, (1, 2, 3, 5, 8, 40))
    ends = rng.random() < 0.5
    return Theme(
        "mixed, endless", tuple(sum(sizes, ())), chances, discounts[:2] if ends else discounts[2:], (None,), ends
    )


def beside(seldom: list[str]) -> tuple[str, ...]:
    """A row of chances: these, and one that leaves nothing over where they are fractions."""
    fractions = [Fraction(p) for p in seldom if "e" not in p]
    return (*seldom, str(1 - sum(fractions, Fraction(0))))


@dataclass
class Hard:
    """A spec in tables: what each action does in each state, what it pays, and what the expert does."""

    theme: Theme
    states: int
    actions: int
    horizon: int | None
    discount: Number
    rows: dict[tuple[int, int], dict[int, Number]]
    rewards: dict[tuple[int, int], Number]
    late: dict[tuple[int, int], tuple[int, Number]]
    """Rewards that change at a time."""
    last: bool
    """Whether the last state ends the episode."""
    expert: dict[int, dict[int, Number]] | None = None
    start: dict[int, Number] = field(default_factory=dict)

    @property
    def spec(self) -> Data:
        data: Data = {"taskspec": 1, "name": "Hard"}
        if self.horizon is not None:
            data["parameters"] = {"H": {"type": "int", "default": self.horizon, "low": 1, "high": 1000}}
        data |= {
            "state": {"s": {"type": "int", "low": 0, "high": self.states - 1}},
            "action": {"a": {"type": "int", "low": 0, "high": self.actions - 1}},
            "horizon": "none" if self.horizon is None else "H",
            "discount": self.discount.text,
            "initial": {"s": drawn(self.start)},
            "dynamics": {"s'": self._table({k: drawn(row) for k, row in self.rows.items()})},
            "reward": self._table({k: self._paid(k) for k in self.rewards}),
        }
        if self.last:
            data["terminal"] = f"s' == {self.states - 1}"
        if self.expert is not None:
            data["expert"] = {"a": {"by": "s", "rows": {s: drawn(row) for s, row in self.expert.items()}}}
        return data

    def _table(self, cells: dict[tuple[int, int], Any]) -> Data:
        rows: dict[int, dict[int | str, Any]] = {}
        for s in range(self.states):
            last = self.actions - 1
            rows[s] = {a: cells[s, a] for a in range(last)}
            rows[s]["else"] = cells[s, last]  # rows without it might be a draw
        return {"by": ["s", "a"], "rows": rows}

    def _paid(self, at: tuple[int, int]) -> str:
        if at not in self.late:
            return self.rewards[at].text
        time, number = self.late[at]
        return f"{self.rewards[at].text} if t < {time} else {number.text}"

    def process(self, reading: str, horizon: int | None) -> Process:
        """What brute force is given, for decimals as they are `written` or as the program has them."""

        def reward(at: tuple[int, int], t: int) -> Fraction:
            number = self.late[at][1] if at in self.late and t >= self.late[at][0] else self.rewards[at]
            return number.written if reading == "written" else number.paid

        @cache
        def row(key: Key, action: int, t: int) -> list[Outcome]:
            at = key[0], action
            return [
                Outcome(p, (s,), reward(at, t), self.last and s == self.states - 1)
                for s, p in shares(self.rows[at], reading).items()
            ]

        def choose(key: Key, t: int) -> Shares:
            assert self.expert is not None
            return shares(self.expert[key[0]], reading)

        start: dict[Key, Fraction] = {(s,): p for s, p in shares(self.start, reading).items()}
        discount = self.discount.written if reading == "written" else self.discount.paid
        return Process(self.actions, horizon, discount, start, row, choose if self.expert is not None else None)


def shares(row: dict[int, Number], reading: str) -> dict[int, Fraction]:
    """Probabilities relative to their total."""
    total = sum(n.read(reading) for n in row.values())
    return {k: n.read(reading) / total for k, n in row.items()}


def drawn(row: dict[int, Number]) -> Any:
    """One value, or a draw."""
    return next(iter(row)) if len(row) == 1 else {k: n.text for k, n in row.items()}


def hard(rng: random.Random) -> Hard:
    """A random one."""
    theme = mixed(rng) if rng.random() < 0.3 else rng.choice(THEMES)
    states = rng.choice((2, 3, 3, 4))
    actions = rng.choice((1, 2, 2, 3))
    if theme.name == "long":
        states = min(states, 3)
        actions = min(actions, 2)
    pairs = [(s, a) for s in range(states) for a in range(actions)]
    horizon = rng.choice(theme.horizons)
    made = Hard(
        theme, states, actions, horizon, Number(rng.choice(theme.discounts)),
        {at: random_row(rng, theme, states) for at in pairs}, {at: Number(rng.choice(theme.rewards)) for at in pairs},
        {}, theme.ends or rng.random() < 0.5,
    )  # fmt: skip
    if horizon is not None and rng.random() < 0.3:
        made.late = {rng.choice(pairs): (rng.randint(1, horizon), Number(rng.choice(theme.rewards)))}
    if rng.random() < 0.6:
        made.expert = {s: random_row(rng, theme, actions) for s in range(states)}
    made.start = random_row(rng, theme, max(1, states - 1))
    return made


def random_row(rng: random.Random, theme: Theme, among: int) -> dict[int, Number]:
    """Chances of some of the first numbers; where every step may end, the rarest one is that of the last."""
    row = rng.choice([r for r in theme.chances if len(r) <= among] or [("1",)])
    picked = rng.sample(range(among), len(row))
    if theme.ends and among > 1 and len(row) > 1:
        picked = [among - 1, *[s for s in picked if s != among - 1]][: len(row)]
    return {k: Number(p) for k, p in zip(picked, row, strict=True)}
