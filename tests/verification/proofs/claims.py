"""Random claims that are true or false by construction, from numbers that brute force found."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from tests.verification.proofs.brute import Rule, Solved, Unsettled, expert, greedy, uniform
from tests.verification.proofs.soft import maxent, soft
from tests.verification.proofs.subjects import Subject

Data = dict[str, Any]
EQUAL = Fraction(1, 10**9)
OPERATORS = ("==", "==", "!=", "<", "<=", ">", ">=")
OFF = tuple(
    map(Fraction, (0, 0, 0, "1/4503599627370496", "1e-15", "1e-12", "9e-10", "11e-10", "1e-6", "1e-3", "1/7", "1"))
)
ROUGHLY = tuple(map(Fraction, ("1e-4", "1e-3", "1/7", "1")))
DIGITS = 120
LARGEST = 10**300
"""Numbers up to this, and down to its inverse, are sometimes written as decimals: smaller floats have fewer digits."""


class Unclear(Exception):
    """Whether it holds is not for brute force to say."""


@dataclass(frozen=True)
class Claim:
    """A claim as a spec has it, and its truths: one for each case of its `for:`, None where decimals decide it."""

    kind: str
    data: Data
    truths: list[bool | None]


@dataclass(frozen=True)
class Number:
    """A number as a claim has it, and its value in each world."""

    text: str
    values: list[Fraction]
    decoys: tuple[Fraction, ...] = ()
    """Values that a wrong stand-in would give it."""


@dataclass(frozen=True)
class Statement:
    """As a claim has it, and whether it holds in each world."""

    text: str
    holds: list[bool]


@dataclass
class Maker:
    """Makes claims about one subject. `worlds`: for each case of parameters those of each reading, one after the other."""

    subject: Subject
    rng: random.Random
    worlds: list[Solved]
    tolerance: Fraction | None = None
    under: str | None = None
    used: set[str] = field(default_factory=set)

    # -- numbers ------------------------------------------------------------------------------------------------------

    def number(self, depth: int = 1) -> Number:
        if self.under is not None:
            return self.probability()
        if depth and self.rng.random() < 0.15:
            return self.compound()
        pick = self.rng.random()
        if pick < 0.08:
            return Number("states", [Fraction(len(w.process.states)) for w in self.worlds])
        if pick < 0.12:
            return Number("actions", [Fraction(w.process.actions) for w in self.worlds])
        if pick < 0.4 and self.subject.condition is not None:
            return self.probability()
        names = ("optimal_return", "optimal_return", "worst_return", "random_return", "expert_return")
        return self.result(self.rng.choice(names))

    def result(self, name: str) -> Number:
        found = [w.returns.get(name) for w in self.worlds]
        if any(v is None for v in found):
            raise Unclear
        decoy = self.subject.decoy.returns.get(name) if self.subject.decoy is not None else None
        return Number(name, [v for v in found if v is not None], () if decoy is None else (decoy,))

    def compound(self) -> Number:
        a = self.number(0)
        b = self.number(0)
        make: tuple[str, Callable[[Fraction, Fraction], Fraction]] = self.rng.choice((
            (f"{a.text} - {b.text}", lambda x, y: x - y), (f"{a.text} + 2 * {b.text}", lambda x, y: x + 2 * y),
            (f"abs({a.text} - {b.text})", lambda x, y: abs(x - y)), (f"{a.text} * {b.text}", lambda x, y: x * y),
            (f"-{a.text} / 3", lambda x, y: -x / 3), (f"({a.text}) ** 2", lambda x, y: x**2),
        ))  # fmt: skip
        return Number(make[0], [make[1](x, y) for x, y in zip(a.values, b.values, strict=True)])

    def probability(self) -> Number:
        if self.subject.condition is None:
            raise Unclear
        text, holds = self.subject.condition(self.rng)
        rules = [self.rule(w) if self.under is None else soft(w, 1) for w in self.worlds]
        values = [w.probability(rule, holds) for w, rule in zip(self.worlds, rules, strict=True)]
        if self.under is not None or rules[0].text == "uniform":
            return Number(f"probability({text})", values)
        return Number(f"probability({text}, under={rules[0].text})", values)

    def rule(self, world: Solved) -> Rule:
        """The same rule for all worlds: the choice is that of the first."""
        if world is self.worlds[0]:
            self._picked = self.rng.random()
        pick = self._picked
        process = world.process
        if pick < 0.3:
            return uniform(process.actions)
        if pick < 0.6:
            return greedy()
        if pick < 0.7 and process.horizon is not None:
            return greedy("zero_terminal_value(1)", Fraction(1))
        if pick < 0.9:
            return soft(world, 2) if pick < 0.8 else maxent(world, 1)
        if process.expert is None:
            raise Unclear
        return expert(process)

    # -- statements ---------------------------------------------------------------------------------------------------

    def statement(self, depth: int = 1) -> Statement:
        pick = self.rng.random()
        if depth and pick < 0.12:
            return self.logical()
        if self.under is None and self.subject.condition is not None:
            if pick < 0.17:
                return self.reachable()
            if pick < 0.25 and self.subject.family != "any":
                return self.prefers()
        return self.chain() if pick < 0.4 else self.comparison()

    def logical(self) -> Statement:
        self.used.add("logic")
        a = self.statement(0)
        b = self.statement(0)
        pairs = list(zip(a.holds, b.holds, strict=True))
        return self.rng.choice((
            Statement(f"({a.text}) and ({b.text})", [x and y for x, y in pairs]),
            Statement(f"({a.text}) or ({b.text})", [x or y for x, y in pairs]),
            Statement(f"not ({a.text})", [not x for x in a.holds]),
        ))  # fmt: skip

    def comparison(self) -> Statement:
        number = self.number()
        op = self.rng.choice(OPERATORS)
        other = self.near(number)
        if self.rng.random() < 0.2:
            number, other = other, number
        return Statement(f"{number.text} {op} {other.text}", self.compared(number, op, other))

    def chain(self) -> Statement:
        self.used.add("chain")
        number = self.number()
        ops = self.rng.choice((("<", "<"), ("<=", "<"), ("<", "<="), ("<=", "<="), (">", ">="), ("==", "<=")))
        first = self.near(number)
        last = self.near(number)
        pairs = zip(self.compared(first, ops[0], number), self.compared(number, ops[1], last), strict=True)
        return Statement(f"{first.text} {ops[0]} {number.text} {ops[1]} {last.text}", [x and y for x, y in pairs])

    def near(self, number: Number) -> Number:
        """A constant: the value of a number in one of the worlds, or one that is a little off."""
        value = self.rng.choice((*number.values, *number.decoys))
        size = max(abs(value), self.scale()) if self.subject.rough else abs(value)
        off = self.rng.choice(ROUGHLY if self.subject.rough else OFF) * self.rng.choice((1, -1))
        if self.subject.rough and self.rng.random() < 0.3 and abs(value) > size / 1000:
            off = Fraction(0)
        if not self.subject.rough and self.rng.random() < 0.1:
            size = max(size, Fraction(1))
        if self.rng.random() < 0.05:
            value = self.rng.choice((Fraction(0), Fraction(1), Fraction(1, 2**40), -value))
            off = Fraction(0)
        return self.written(value + off * size)

    def scale(self) -> Fraction:
        return max((abs(v) for w in self.worlds for v in w.returns.values()), default=Fraction(1))

    def written(self, value: Fraction) -> Number:
        """A constant in as many digits as may be; sometimes a decimal, which is read as such or as the float."""
        if self.rng.random() < 0.15 and (not value or Fraction(1, LARGEST) < abs(value) < LARGEST):
            text = f"{float(value):.6g}"
            readings = [Fraction(text), Fraction(float(text))]
            return Number(
                text, [readings[i % 2] for i in range(len(self.worlds))] if self.has_readings() else readings[:1]
            )
        if max(abs(value.numerator), value.denominator) > 10**DIGITS:
            value = cut(value)
        over = abs(value.numerator)
        under = value.denominator
        text = str(over) if under == 1 else f"({over} / {under})"
        return Number(f"-{text}" if value < 0 else text, [value] * len(self.worlds))

    def has_readings(self) -> bool:
        return not self.subject.rough and len(self.subject.worlds()) == 2

    def compared(self, a: Number, op: str, b: Number) -> list[bool]:
        pairs = zip(a.values, b.values, strict=True)
        if (
            self.subject.rough
            and op != "=="
            and any(self.is_close(x, y) for x, y in zip(a.values, b.values, strict=True))
        ):
            raise Unclear
        return [compare(op, x, y, self.tolerance) for x, y in pairs]

    def is_close(self, x: Fraction, y: Fraction) -> bool:
        """Whether rough numbers may be either way."""
        return abs(x - y) < Fraction(1, 10**7) * max(self.scale(), abs(x), abs(y))

    def reachable(self) -> Statement:
        assert self.subject.condition is not None
        self.used.add("reachable")
        text, holds = self.subject.condition(self.rng)
        return Statement(f"reachable({text})", [any(map(holds, w.process.states)) for w in self.worlds])

    def prefers(self) -> Statement:
        assert self.subject.condition is not None
        self.used.add("prefers")
        text, holds = self.subject.condition(self.rng)
        actions = self.worlds[0].process.actions
        wanted = self.rng.randrange(actions)
        rules = [self.rule(w) for w in self.worlds]
        found = [
            w.prefers(rule, {a for a in range(actions) if a == wanted}, holds)
            for w, rule in zip(self.worlds, rules, strict=True)
        ]
        return Statement(f"prefers({rules[0].text}, a == {wanted}, at={text})", found)


def compare(op: str, x: Fraction, y: Fraction, tolerance: Fraction | None) -> bool:
    """Whether a comparison holds, as the language reference says it. Unclear: that depends on whose size counts."""
    slack = tolerance or Fraction(0)
    match op:
        case "==" | "!=":
            within = {abs(x - y) <= (EQUAL * abs(size) if tolerance is None else tolerance) for size in (x, y)}
            if len(within) > 1:
                raise Unclear
            return within.pop() is (op == "==")
        case "<":
            return x < y
        case ">":
            return x > y
        case "<=":
            return x <= y + slack
        case _:
            return x >= y - slack


def cut(value: Fraction) -> Fraction:
    """The same in fewer digits."""
    bits = value.denominator.bit_length() - value.numerator.bit_length()
    shift = math.floor(bits * math.log10(2)) + DIGITS // 2 - 1
    power = Fraction(10) ** shift
    return Fraction(round(value * power)) / power


def claims(subject: Subject, count: int) -> list[Claim]:
    """So many claims about a subject."""
    rng = random.Random(f"claims {subject.case.seed}")
    made = []
    for _ in range(100 * count):
        if len(made) == count:
            break
        try:
            made.append(claim(subject, rng))
        except (Unclear, Unsettled):
            continue
    return made


def claim(subject: Subject, rng: random.Random) -> Claim:
    cases: list[int | None] = [None]
    data: Data = {}
    if subject.horizon is not None and subject.horizon < 20 and rng.random() < 0.12:
        cases = list(rng.sample(range(1, 8), rng.choice((1, 2, 3))))
        data["for"] = [{"H": h} for h in cases]
    worlds = [w for h in cases for w in subject.worlds(h)]
    maker = Maker(subject, rng, worlds)
    if rng.random() < 0.1:
        data["tolerance"] = rng.choice((0.5, 0.001953125, 2.0**-30))
        maker.tolerance = Fraction(data["tolerance"])
    elif subject.condition is not None and rng.random() < 0.06:
        maker.under = data["under"] = "soft(1)"
    made = maker.statement()
    per = len(worlds) // len(cases)
    truths = [settled(made.holds[i : i + per]) for i in range(0, len(worlds), per)]
    kinds = [*data, *sorted(maker.used)] or ["comparison"]
    if subject.family.startswith("stand-in"):
        kinds = [subject.family]
    return Claim(kinds[0], {"claim": made.text} | data, truths)


def settled(holds: list[bool]) -> bool | None:
    return holds[0] if len(set(holds)) == 1 else None
