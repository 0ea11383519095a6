"""Random parameters, constants and components, and the terms by which expressions read them."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from tests.verification.oracle.generator.terms import Shape, Term

Data = dict[str, Any]

STATE = frozenset({"state"})
ACTION = frozenset({"action"})
PRIME = frozenset({"prime"})
WORDS = ("red", "green", "blue", "on", "no", "north", "x y")


@dataclass
class Component:
    """A component as declared, and what a generator wants to know of it."""

    name: str
    kind: str
    shape: Shape
    data: Data
    low: str = ""
    high: str = ""
    size: float = 1
    labels: tuple[str, ...] = ()
    numbers: bool = False
    """Whether its labels stand for numbers."""
    means: Shape = ()
    """The shape of these numbers."""

    def terms(self, text: str, reads: frozenset[str]) -> list[Term]:
        """What reading the component under this name gives: its value, and its label."""
        found = []
        if self.kind != "choice":
            found.append(Term(text, self.kind, self.shape, size=self.size, reads=reads, rows=self.rows(text)))
        elif self.numbers:
            found.append(Term(text, "int", self.means, size=5, reads=reads, rows=()))
        elif self.labels:
            position = f"{text} + 0"  # bare, it would be a label
            found.append(Term(position, "int", level=5, size=len(self.labels), reads=reads, rows=()))
        if self.labels:
            found.append(Term(text, "label", size=1 + self.numbers, reads=reads, labels=self.labels))
        return found

    def rows(self, text: str) -> tuple[int, ...]:
        """Values for rows of a table: of a present value within the bounds that are written as numbers, else any."""
        if not self.low or text != self.name or self.shape or self.kind != "int":
            return (0, 1, 7)
        least = int(self.low)
        return tuple(range(least, int(self.high) + 1)) if self.high.isdigit() else (least, least + 1, least + 6)


@dataclass
class Declared:
    """What the sections before the dynamics declare."""

    rng: random.Random
    parameters: Data = field(default_factory=dict)
    constants: Data = field(default_factory=dict)
    known: list[Term] = field(default_factory=list)
    """Parameters and constants as terms."""
    small: list[str] = field(default_factory=list)
    """Int parameters that are small and positive: for bounds and lengths."""

    def chance(self, p: float) -> bool:
        return self.rng.random() < p


def parameters(d: Declared) -> None:
    rng = d.rng
    if d.chance(0.55):
        low = rng.randint(1, 2)
        high = rng.randint(3, 4)
        d.parameters["L"] = {"type": "int", "default": rng.randint(low, high), "low": low, "high": high}
        d.known.append(Term("L", "int", size=high))
        d.small.append("L")
    if d.chance(0.2):
        d.parameters["B"] = {"type": "int", "default": 1, "low": 0, "high": "L" if d.small else 3, "symbol": "\\beta"}
        d.known.append(Term("B", "int", size=4))
        if d.small and d.chance(0.5):
            d.parameters["require"] = [{"condition": "B <= L", "message": "B is at most L"}]
    if d.chance(0.25):
        d.parameters["chance_p"] = {"type": "real", "default": rng.choice((0.25, 0.1, 0.5)), "low": 0, "high": 1}
        d.known.append(Term("chance_p", "real", size=1))
    if d.chance(0.2):
        d.parameters["sticky"] = {"type": "bool", "default": d.chance(0.5)}
        d.known.append(Term("sticky", "bool"))
    if d.chance(0.15):
        d.parameters["mode"] = {"type": "choice", "values": ["slow", "fast"], "default": rng.choice(("slow", "fast"))}
        d.known.append(Term("mode", "label", labels=("slow", "fast")))
    if d.chance(0.15):
        d.parameters["instance_seed"] = {"type": "int", "default": rng.randint(0, 99), "low": 0}


def constants(d: Declared) -> None:
    rng = d.rng
    if d.chance(0.4):
        n = rng.choice((2, 3, 3, 4, 34))
        add_constant(d, "table", [rng.randint(-3, 9) for _ in range(n)], Term("table", "int", (n,), size=9))
    if d.chance(0.2):
        add_constant(
            d, "share", rng.choice(("1/3", "L / 7" if d.small else "2/7", 0.25)), Term("share", "real", size=1)
        )
    if d.chance(0.2):
        values = rng.choice(([0.5, "1/3", 2], "(1, 0.5, 1/4)", "[i / 4 for i in range(3)]"))
        add_constant(d, "weights", values, Term("weights", "real", (3,), size=2))
    if d.chance(0.15):
        rows = rng.choice(([[1, 2], [3, 4]], "((0, 1), (1, 0))", {"grid": ["ab", "ba"], "legend": {"a": 0, "b": 3}}))
        add_constant(d, "grid", rows, Term("grid", "int", (2, 2), size=4))
    if d.small and d.chance(0.15):
        add_constant(d, "ramp", "[2 * i for i in range(L)]", Term("ramp", "int", ("L",), size=8))
    if "instance_seed" in d.parameters:
        drawn_constants(d)


def drawn_constants(d: Declared) -> None:
    if d.chance(0.6):
        add_constant(d, "shuffle", "Permutation(3)", Term("shuffle", "int", (3,), size=2))
    if d.chance(0.6):
        add_constant(d, "lottery", "UniformInt(0, 3) + UniformInt(0, 1, shape=2)", Term("lottery", "int", (2,), size=4))
    if d.chance(0.3):
        add_constant(d, "noise_level", "Uniform(0, 1)", Term("noise_level", "real", size=1))


def add_constant(d: Declared, name: str, data: Any, term: Term) -> None:
    d.constants[name] = data
    d.known.append(term)


# ------------------------------------------------------------------------------ components


def component(d: Declared, name: str, *, action: bool, wide: bool = False) -> Component:
    """A random component; of an action they are mostly finite and small."""
    rng = d.rng
    weights = (2, 4, 0.5, 3) if action else (4, 5, 1.5, 2.5)
    kind = rng.choices(("bool", "int", "real", "choice"), weights)[0]
    if kind == "choice":
        return choice(d, name)
    shape = component_shape(d, action=action, wide=wide and kind != "real")
    data: Data = {"type": kind}
    if shape:
        data["shape"] = shape[0] if len(shape) == 1 and d.chance(0.5) else list(shape)
    made = Component(name, kind, shape, data)
    if kind == "int":
        int_bounds(d, made, action=action)
    elif kind == "real":
        real_bounds(d, made, action=action)
    return made


def component_shape(d: Declared, *, action: bool, wide: bool) -> Shape:
    rng = d.rng
    if wide and not action:
        return (rng.choice((33, 40, 50)),)
    if d.chance(0.85 if action else 0.75):
        return ()
    if d.small and not action and d.chance(0.2):
        return ("L",)
    return rng.choice(((1,), (2,), (2,), (3,), (2, 2))) if not action else rng.choice(((1,), (2,)))


def int_bounds(d: Declared, c: Component, *, action: bool) -> None:
    if not action and d.chance(0.05):
        c.size = 2**31
        return
    low = d.rng.choice((0, 0, 0, 1, -1))
    high = d.rng.choice((1, 2, 2, 3))
    c.low = str(low)
    c.high = str(max(low, high))
    c.size = 4
    if d.small and d.chance(0.4):
        c.high = d.rng.choice(("L", "L + 1", "2 * L"))
        c.size = 8
    c.data |= {"low": low, "high": c.high if "L" in c.high else int(c.high)}
    if len(c.shape) == 1 and c.shape[0] in (2, 3) and d.chance(0.3):
        ends = [int(c.low) + 1 + i % 2 for i in range(int(c.shape[0]))]
        c.data["high"] = ends
        c.high = f"({', '.join(map(str, ends))})"


def real_bounds(d: Declared, c: Component, *, action: bool) -> None:
    if not action and d.chance(0.1):
        c.size = 1e9
        return
    low = d.rng.choice((-1, -2.5, 0))
    high = d.rng.choice((1, 2, 1.5))
    c.data |= {"low": low, "high": high}
    c.low = str(low)
    c.high = str(high)
    c.size = 3


def choice(d: Declared, name: str) -> Component:
    labels = tuple(d.rng.sample(WORDS, d.rng.choice((2, 2, 3))))
    if d.chance(0.4):
        labels = WORDS[:2]  # so that choices can be compared and copied
    if d.chance(0.35):
        means: Shape = (2,) if d.chance(0.25) else ()
        stands = {label: numbers(d, means) for label in labels}
        data = {"type": "choice", "values": stands}
        return Component(name, "choice", (), data, labels=labels, numbers=True, means=means)
    return Component(name, "choice", (), {"type": "choice", "values": list(labels)}, labels=labels)


def numbers(d: Declared, shape: Shape) -> Any:
    """What a label stands for: a number, or a vector of two."""
    return [d.rng.randint(-1, 1) for _ in range(2)] if shape else d.rng.randint(-2, 3)
