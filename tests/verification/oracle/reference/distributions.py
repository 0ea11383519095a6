"""The distributions, by name: each makes values of what chance gives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import comb

from tests.verification.oracle.reference import random
from tests.verification.oracle.reference.chance import Chance, Key
from tests.verification.oracle.reference.values import (
    Choice,
    Number,
    Shape,
    Value,
    Wrong,
    as_float,
    common_shape,
    joint_kind,
    number,
    scalar,
    settled,
    spread,
)


@dataclass
class Call:
    """A draw as written: its arguments, or the outcomes that it lists."""

    args: list[Value]
    keywords: dict[str, Value]
    outcomes: list[Value] = field(default_factory=list)
    shares: list[Value] = field(default_factory=list)
    shape: Shape | None = None

    def argument(self, at: int, name: str, default: Number | None = None) -> Value:
        if at < len(self.args):
            return number(self.args[at])
        if name in self.keywords:
            return number(self.keywords[name])
        if default is None:
            raise Wrong(f"{name} is missing")
        return scalar(default)

    def size(self, *arguments: Value) -> tuple[Shape, int]:
        """The shape of what is drawn one by one, and how many these are."""
        shape = common_shape(arguments) if self.shape is None else self.shape
        count = 1
        for n in shape:
            count *= n
        return shape, count


Draw = Callable[[Call, Chance, Key], Value]
DISTRIBUTIONS: dict[str, Draw] = {}


def distribution(name: str) -> Callable[[Draw], Draw]:
    def register(f: Draw) -> Draw:
        DISTRIBUTIONS[name] = f
        return f

    return register


def drawn(kind: str, shape: Shape, data: Sequence[Number]) -> Value:
    return settled(kind, shape, data, fixed=False)


def floats(value: Value, shape: Shape) -> list[float]:
    return [as_float(x) for x in spread(value, shape)]


@distribution("Categorical")
def categorical(call: Call, chance: Chance, key: Key) -> Value:
    shape, count = call.size()
    if not call.outcomes:
        p = call.argument(0, "p")
        return drawn("int", shape, chance.category(key, p.data, count, fixed=p.fixed))
    shares = [number(p) for p in call.shares]
    fixed = all(p.fixed for p in shares)
    picked = chance.category(key, [p.item for p in shares], count, fixed=fixed)
    return arranged(call.outcomes, picked, shape)


def arranged(outcomes: Sequence[Value], picked: Sequence[int], shape: Shape) -> Value:
    """The chosen values of a list of outcomes, all of one kind, as one value."""
    values = [outcomes[i] for i in picked]
    choice: Choice | None = outcomes[0].choice
    if all(v.kind == "choice" and v.choice == choice for v in outcomes):
        return Value("choice", shape, tuple(v.data[0] for v in values), False, choice=choice)
    numbers = [number(v) for v in outcomes]
    chosen = [numbers[i] for i in picked]
    data = [x for v in chosen for x in v.data]
    rough = any(v.rough for v in chosen)
    return settled(joint_kind(numbers), shape + numbers[0].shape, data, fixed=False, rough=rough)


@distribution("Uniform")
def uniform(call: Call, chance: Chance, key: Key) -> Value:
    if call.outcomes:
        shape, count = call.size()
        return arranged(call.outcomes, chance.index(key, [len(call.outcomes)] * count), shape)
    low = call.argument(0, "low")
    high = call.argument(1, "high")
    shape, count = call.size(low, high)
    return scaled(chance.uniform(key, count), low, high, shape)


def scaled(units: Sequence[float], low: Value, high: Value, shape: Shape) -> Value:
    """`low + (high - low) * u`, the difference as exact as its ends are known."""
    ends = list(zip(spread(low, shape), spread(high, shape), strict=True))
    exact = low.fixed and high.fixed
    widths = [as_float(b - a) if exact else as_float(b) - as_float(a) for a, b in ends]
    data = [as_float(a) + width * u for (a, _), width, u in zip(ends, widths, units, strict=True)]
    return settled("real", shape, data, fixed=False, rough=low.rough or high.rough)


@distribution("UniformInt")
def uniform_int(call: Call, chance: Chance, key: Key) -> Value:
    low = call.argument(0, "low")
    high = call.argument(1, "high")
    shape, _ = call.size(low, high)
    lows = [int(x) for x in spread(low, shape)]
    sizes = [int(b) - a + 1 for a, b in zip(lows, spread(high, shape), strict=True)]
    return drawn("int", shape, [a + i for a, i in zip(lows, chance.index(key, sizes), strict=True)])


@distribution("Normal")
def normal(call: Call, chance: Chance, key: Key) -> Value:
    mean = call.argument(0, "mean", 0)
    std = call.argument(1, "std", 1)
    shape, count = call.size(mean, std)
    rows = zip(floats(mean, shape), floats(std, shape), chance.normal(key, count), strict=True)
    return settled("real", shape, [m + s * z for m, s, z in rows], fixed=False, rough=mean.rough or std.rough)


@distribution("Bernoulli")
def bernoulli(call: Call, chance: Chance, key: Key) -> Value:
    p = call.argument(0, "p")
    shape, _ = call.size(p)
    return drawn("bool", shape, chance.flags(key, spread(p, shape), fixed=p.fixed))


@distribution("Binomial")
def binomial(call: Call, chance: Chance, key: Key) -> Value:
    """A count, with the probabilities of all counts."""
    n = int(call.argument(0, "n").item)
    p = call.argument(1, "p")
    shape, count = call.size()
    shares = [comb(n, k) * (p.item**k * (1 - p.item) ** (n - k)) for k in range(n + 1)]
    return drawn("int", shape, chance.category(key, shares, count, fixed=p.fixed))


@distribution("Exponential")
def exponential(call: Call, chance: Chance, key: Key) -> Value:
    rate = call.argument(0, "rate", 1)
    shape, count = call.size(rate)
    pairs = zip(chance.exponential(key, count), floats(rate, shape), strict=True)
    return settled("real", shape, [x / r for x, r in pairs], fixed=False, rough=rate.rough)


@distribution("Poisson")
def poisson(call: Call, chance: Chance, key: Key) -> Value:
    rate = call.argument(0, "rate")
    shape, _ = call.size(rate)
    return drawn("int", shape, chance.poisson(key, spread(rate, shape), fixed=rate.fixed))


@distribution("Dirichlet")
def dirichlet(call: Call, chance: Chance, key: Key) -> Value:
    alpha = call.argument(0, "alpha")
    return settled("real", alpha.shape, chance.dirichlet(key, alpha.data), fixed=False, rough=True)


@distribution("Beta")
def beta(call: Call, chance: Chance, key: Key) -> Value:
    """The first of two shares."""
    alpha = [call.argument(0, "a").item, call.argument(1, "b").item]
    return settled("real", (), chance.dirichlet(key, alpha)[:1], fixed=False, rough=True)


@distribution("Permutation")
def permutation(call: Call, chance: Chance, key: Key) -> Value:
    n = call.argument(0, "n").item
    shape, count = call.size()
    return drawn("int", (*shape, n), chance.permutation(key, n, count))


@distribution("Subset")
def subset(call: Call, chance: Chance, key: Key) -> Value:
    """Which places of a permutation hold one of the first k numbers."""
    n = call.argument(0, "n").item
    k = call.argument(1, "k").item
    shape, count = call.size()
    return drawn("bool", (*shape, n), [i < k for i in chance.permutation(key, n, count)])


@distribution("Gamma")
def gamma(call: Call, chance: Chance, key: Key) -> Value:
    a = call.argument(0, "a")
    rate = call.argument(1, "rate", 1)
    shape, _ = call.size(a, rate)
    drawn_ = chance.gamma(key, spread(a, shape))
    return settled(
        "real", shape, [x / r for x, r in zip(drawn_, floats(rate, shape), strict=True)], fixed=False, rough=True
    )


@distribution("Geometric")
def geometric(call: Call, chance: Chance, key: Key) -> Value:
    """How many trials it takes; what is rarer than anything that words show counts as one."""
    p = call.argument(0, "p")
    shape, count = call.size()
    shares: list[Number] = []
    rest: Number = 1
    while rest >= 2.0**-60:
        shares.append(rest * p.item)
        rest = rest * (1 - p.item)
    picked = chance.category(key, [*shares, rest], count, fixed=p.fixed)
    return drawn("int", shape, [1 + k for k in picked])


@distribution("TruncatedNormal")
def truncated_normal(call: Call, chance: Chance, key: Key) -> Value:
    arguments = [call.argument(i, name) for i, name in enumerate(("mean", "std", "low", "high"))]
    shape, count = call.size(*arguments)
    rows = zip(*(floats(a, shape) for a in arguments), chance.uniform(key, count), strict=True)
    data = [
        min(max(mean + std * random.truncated(u, (low - mean) / std, (high - mean) / std), low), high)
        for mean, std, low, high, u in rows
    ]
    return settled("real", shape, data, fixed=False, rough=True)
