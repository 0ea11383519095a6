"""Distributions that an author may draw from.

A distribution is arithmetic over a *base variate* whose random words do not depend on the state: `Normal(m, s)` is
`m + s * normal`. Backends implement the few of `lang.variates`; everything else is ordinary operators. One entry per
distribution; the language reference, the printers and the statistical tests follow from the table.

The distribution function is Numerical Recipes' rational Chebyshev fit of erfc (relative error below 1.2e-7, in the tails as
well), its inverse Acklam's rational approximation (1.2e-9). Bounds with more mass above 0 than below are mirrored,
so that the digits of small probabilities are not lost beside 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from taskspec.base.limits import Limits
from taskspec.base.named import all_names, entries_by_name
from taskspec.language.expressions.ir import Const, Node
from taskspec.language.expressions.operators.entry import ENCLOSED, Brackets, Level, NodeMaker
from taskspec.language.expressions.types import INT, INT_MAX, Kind, Refused, Shape, Type

if TYPE_CHECKING:
    from taskspec.language.expressions.builder import Builder

ERFC = (
    -1.26551223, 1.00002368, 0.37409196, 0.09678418, -0.18628806, 0.27886807, -1.13520398, 1.48851587, -0.82215223,
    0.17087277,
)  # fmt: skip
A = (
    -39.69683028665376, 220.9460984245205, -275.9285104469687, 138.3577518672690, -30.66479806614716,
    2.506628277459239,
)  # fmt: skip
B = (-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572, 1.0)
C = (
    -0.007784894002430293, -0.3223964580411365, -2.400758277161838, -2.549732539343734, 4.374664141464968,
    2.938163982698783,
)  # fmt: skip
D = (0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416, 1.0)
TAIL = 0.02425


def truncated(b: NodeMaker, u: Node, low: Node, high: Node) -> Node:
    """Truncate a standard normal: between `low` and `high`, from a uniform number."""
    mirrored = b.apply("lt", b.scalar(0.0), b.apply("add", low, high))
    left = b.apply("where", mirrored, b.apply("neg", high), low)
    right = b.apply("where", mirrored, b.apply("neg", low), high)
    bottom = _distribution(b, left)
    top = _distribution(b, right)
    p = b.apply("add", bottom, b.apply("mul", u, b.apply("sub", top, bottom)))
    value = b.apply("where", b.apply("lt", b.scalar(0.0), p), _quantile(b, p), right)  # no float holds what is rarer
    return b.apply("where", mirrored, b.apply("neg", value), value)


def _distribution(b: NodeMaker, x: Node) -> Node:
    z = b.apply("mul", b.apply("abs", x), b.scalar(math.sqrt(0.5)))
    t = b.apply("div", b.scalar(1.0), b.apply("add", b.scalar(1.0), b.apply("mul", b.scalar(0.5), z)))
    inner = b.apply("sub", _polynomial(b, t, ERFC[::-1]), b.apply("mul", z, z))
    tail = b.apply("mul", b.apply("mul", b.scalar(0.5), t), b.apply("exp", inner))
    return b.apply("where", b.apply("lt", x, b.scalar(0.0)), tail, b.apply("sub", b.scalar(1.0), tail))


def _quantile(b: NodeMaker, p: Node) -> Node:
    q = b.apply("sub", p, b.scalar(0.5))
    r = b.apply("mul", q, q)
    middle = b.apply("div", b.apply("mul", _polynomial(b, r, A), q), _polynomial(b, r, B))
    rest = b.apply("where", b.apply("lt", p, b.scalar(0.5)), p, b.apply("sub", b.scalar(1.0), p))
    s = b.apply("sqrt", b.apply("mul", b.scalar(-2.0), b.apply("log", rest)))
    tail = b.apply("div", _polynomial(b, s, C), _polynomial(b, s, D))
    tail = b.apply("where", b.apply("lt", p, b.scalar(0.5)), tail, b.apply("neg", tail))
    return b.apply("where", b.apply("lt", rest, b.scalar(TAIL)), tail, middle)


def _polynomial(b: NodeMaker, x: Node, coefficients: Sequence[float]) -> Node:
    value: Node = b.scalar(coefficients[0])
    for c in coefficients[1:]:
        value = b.apply("add", b.apply("mul", value, x), b.scalar(c))
    return value


@dataclass(frozen=True, slots=True)
class Argument:
    """A named argument of a distribution; one without a default must be given.

    It must lie between `low` and `high`, and above `low` where that is `open`.
    """

    name: str
    default: int | None = None
    low: float = -math.inf
    high: float = math.inf
    open: bool = False
    static: bool = False  # a constant int once parameters are bound
    vector: bool = False

    @property
    def is_probability(self) -> bool:
        return self.high == 1


@dataclass(frozen=True, slots=True)
class Dist:
    """A distribution as authors write it."""

    name: str
    arguments: tuple[Argument, ...]
    build: Callable[[Builder, Mapping[str, Node], Shape], Node]
    doc: str
    latex: str
    brackets: Brackets = ENCLOSED
    shaped: bool = True  # takes `shape=`
    samples: tuple[Mapping[str, float | tuple[float, ...]], ...] = ()

    @property
    def signature(self) -> str:
        return f"{self.name}({', '.join(all_names(self.arguments))})"

    @property
    def squared(self) -> tuple[str, ...]:
        """The arguments that stand squared in mathematics."""
        squared = []
        for a in self.arguments:
            if f"{{{a.name}}}^2" in self.latex:
                squared.append(a.name)
        return tuple(squared)


def _uniform(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    unit = b.draw("uniform", (), Type(Kind.REAL, shape))
    width = b.apply("sub", a["high"], a["low"])
    return _moved(b, a["low"], b.apply("mul", width, unit))


def _moved(b: Builder, by: Node, value: Node) -> Node:
    if isinstance(by, Const) and not any(by.flat) and by.type.is_scalar:
        return value
    return b.apply("add", by, value)


def _uniform_int(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    count = b.apply("add", b.apply("sub", a["high"], a["low"]), b.scalar(1))
    if INT_MAX < b.bounds(count)[1] < math.inf:  # no backend holds it, and its product with a word leaves 64 bits
        raise Refused(f"UniformInt takes one of at most {INT_MAX:,} values", "E408")
    count = b.within(count, 1, INT_MAX)  # what it says where `high` comes to lie below `low` is reported by `check`
    return b.apply("add", a["low"], b.draw("index", (count,), Type(Kind.INT, shape)))


def _normal(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    standard = b.draw("normal", (), Type(Kind.REAL, shape))
    return _moved(b, a["mean"], b.apply("mul", a["std"], standard))


def _truncated_normal(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    """Draw by the inverse of the distribution function; rejection might not end."""
    mean = b.cast(a["mean"], Kind.REAL)
    std = b.cast(a["std"], Kind.REAL)
    low = b.cast(a["low"], Kind.REAL)
    high = b.cast(a["high"], Kind.REAL)
    unit = b.draw("uniform", (), Type(Kind.REAL, shape))
    lowest = b.apply("div", b.apply("sub", low, mean), std)
    highest = b.apply("div", b.apply("sub", high, mean), std)
    value = b.apply("add", mean, b.apply("mul", std, truncated(b, unit, lowest, highest)))
    return b.apply("min2", b.apply("max2", value, low), high)


def _gamma(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    return b.apply("div", b.draw("gamma", (b.cast(a["a"], Kind.REAL),), Type(Kind.REAL, shape)), a["rate"])


def _geometric(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    """Draw an index with the probabilities of failures, plus one; the last one collects all rarer than RARE."""
    p = b.cast(a["p"], Kind.REAL)
    if isinstance(p, Const):
        least = min(map(float, p.flat), default=1.0)
    else:
        least = b.bounds(p)[0]
    most = Limits.trials
    if isinstance(p, Const):
        most = Limits.waiting
    counts = math.inf
    if least >= 1:
        counts = 1
    elif least > 0:
        counts = 2 + math.log(RARE) / math.log1p(-least)
    if counts >= most + 1:
        raise Refused(f"Geometric waits for up to {most:,} trials, and with this 'p' for more", "E408",
                      None if isinstance(p, Const) else "give it a bound: `Geometric(clip(p, 0.1, 1))`")  # fmt: skip
    count = int(counts)
    return b.apply("add", b.scalar(1), _drawn(b, p, shape, lambda q: _failures(b, count, q)))


RARE = 2.0**-60
"""Waiting times of a smaller probability, all together, are one."""


def _failures(b: Builder, count: int, p: Node) -> Node:
    type_ = Type(Kind.REAL, (count,))
    if isinstance(p, Const):
        q = Fraction(p.value)
        row = [q * (1 - q) ** k for k in range(count - 1)] + [(1 - q) ** (count - 1)]
        return _row(b, row, not isinstance(p.value, float))
    fails = b.apply("pow", b.apply("sub", b.scalar(1), p), b.const(list(range(count)), type_))
    stops = b.structure("concat", [b.structure("fill", [p], (count - 1,)), b.const([1], Type(Kind.REAL, (1,)))])
    return b.apply("mul", stops, fails)


def _poisson(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    rate = b.cast(a["rate"], Kind.REAL)
    high = b.bounds(rate)[1]
    if not high <= Limits.poisson:
        raise Refused(
            f"the rate of Poisson is not known to stay below {Limits.poisson:,}", "E408",
            "give it a bound: `Poisson(clip(rate, 0, 100))`",
        )  # fmt: skip
    args = (rate,) if isinstance(rate, Const) else (rate, b.const(high, Type(Kind.REAL)))
    return b.draw("poisson", args, Type(Kind.INT, shape))


def _permutation(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    n = a["n"]
    assert isinstance(n, Const)
    return b.draw("permutation", (), Type(Kind.INT, (*shape, int(n.value))))


def _subset(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    n = a["n"]
    k = a["k"]
    assert isinstance(n, Const) and isinstance(k, Const)
    if k.value > n.value:
        raise Refused(f"Subset takes k = {k.value} of n = {n.value}, which are fewer", "E408")
    return b.apply("lt", _permutation(b, a, shape), k)


def _beta(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    one = _elements(b, b.cast(a["a"], Kind.REAL), shape)
    other = _elements(b, b.cast(a["b"], Kind.REAL), shape)
    shares = []
    for concentrations in zip(one, other, strict=True):
        pair = b.structure("vector", concentrations)
        draw = b.draw("dirichlet", (pair,), pair.type)
        shares.append(b.structure("element", [draw], (0,)))
    if shape:
        return b.structure("reshape", [b.structure("vector", shares)], shape)
    return shares[0]


def _binomial(b: Builder, a: Mapping[str, Node], shape: Shape) -> Node:
    n = a["n"]
    p = b.cast(a["p"], Kind.REAL)
    assert isinstance(n, Const)
    if n.value > Limits.trials:
        raise Refused(f"Binomial takes at most {Limits.trials:,} trials", "E408")
    trials = int(n.value)
    return _drawn(b, p, shape, lambda q: _counts(b, trials, q))


def _counts(b: Builder, n: int, p: Node) -> Node:
    """Probabilities of 0, ..., n successes in n trials; exact where p is, unless they have very many digits."""
    type_ = Type(Kind.REAL, (n + 1,))
    ways = [math.comb(n, k) for k in range(n + 1)]
    if isinstance(p, Const) and not isinstance(p.value, float):
        q = Fraction(p.value)
        row = []
        for k, c in enumerate(ways):
            row.append(c * q**k * (1 - q) ** (n - k))
        return _row(b, row, True)
    heads = b.apply("pow", p, b.const(list(range(n + 1)), type_))
    tails = b.apply("pow", b.apply("sub", b.scalar(1), p), b.const(list(range(n, -1, -1)), type_))
    return b.apply("mul", b.const(ways, type_), b.apply("mul", heads, tails))


def _row(b: Builder, values: list[Fraction], exact: bool) -> Node:
    """Constant of probabilities; floats where they are not `exact`, or have very many digits."""
    type_ = Type(Kind.REAL, (len(values),))
    if exact and all(v.denominator.bit_length() <= Limits.bits for v in values):
        return b.const(values, type_)
    return b.const(list(map(float, values)), type_)


def _drawn(b: Builder, p: Node, shape: Shape, row: Callable[[Node], Node]) -> Node:
    """Draw indices with the probabilities that `row` gives of p, one for each element of a draw."""
    if p.type.is_scalar:
        return b.draw("categorical", (row(p),), Type(Kind.INT, shape))
    drawn = [b.draw("categorical", (row(q),), INT) for q in _elements(b, p, shape)]
    return b.structure("reshape", [b.structure("vector", drawn)], shape)


def _elements(b: Builder, node: Node, shape: Shape) -> list[Node]:
    if not shape:
        return [node]
    size = math.prod(shape)
    flat = b.structure("reshape", [b.stretch(node, shape)], (size,))
    return [b.structure("element", [flat], (i,)) for i in range(size)]


_P = Argument("p", low=0, high=1)
DISTS: dict[str, Dist] = entries_by_name((
    Dist("Uniform", (Argument("low"), Argument("high")), _uniform,
         "Uniform real between `low` and `high`; `Uniform({a, b, ...})` is uniform over a finite set.",
         r"\operatorname{Unif}({low}, {high})", samples=({"low": -1, "high": 3}, {"low": 2.5, "high": 2.5})),
    Dist("UniformInt", (Argument("low"), Argument("high")), _uniform_int,
         "Uniform integer from `low` to `high`, both included.",
         r"\operatorname{Unif}\{{low}, \ldots, {high}\}",
         samples=({"low": -2, "high": 5}, {"low": 3, "high": 3})),
    Dist("Normal", (Argument("mean", 0), Argument("std", 1, low=0)), _normal, "Normal (Gaussian) real.",
         r"\mathcal{N}({mean}, {std}^2)", samples=({"mean": 1, "std": 2}, {"mean": 0.5, "std": 0}),
         brackets=Brackets(Level.ATOM, (Level.SCOPE, Level.ATOM))),
    Dist("TruncatedNormal", (Argument("mean"), Argument("std", low=0, open=True), Argument("low"), Argument("high")),
         _truncated_normal, "Normal real between `low` and `high`; `mean` and `std` are those before truncation.",
         r"\mathcal{N}_{[{low}, {high}]}({mean}, {std}^2)",
         samples=({"mean": 1, "std": 2, "low": 0, "high": 2}, {"mean": 0, "std": 1, "low": 3, "high": 5}),
         brackets=Brackets(Level.ATOM, (Level.SCOPE, Level.ATOM, Level.SCOPE, Level.SCOPE))),
    Dist("Bernoulli", (_P,), lambda b, a, shape: b.draw("bernoulli", (b.cast(a["p"], Kind.REAL),), Type(Kind.BOOL, shape)),
         "A condition that holds with probability `p`.",
         r"\operatorname{Bernoulli}({p})", samples=({"p": 0.3}, {"p": 0}, {"p": 1})),
    Dist("Binomial", (Argument("n", static=True, low=0), _P), _binomial,
         "Number of successes in `n` trials that each succeed with probability `p`.",
         r"\operatorname{Binomial}({n}, {p})",
         samples=({"n": 6, "p": 0.3}, {"n": 1, "p": 0.5}, {"n": 4, "p": 0}, {"n": 40, "p": 0.9})),
    Dist("Exponential", (Argument("rate", 1, low=0, open=True),),
         lambda b, a, shape: b.apply("div", b.draw("exponential", (), Type(Kind.REAL, shape)), a["rate"]),
         "Exponential real with mean 1/`rate`.",
         r"\operatorname{Exp}({rate})", samples=({"rate": 2},)),
    Dist("Gamma", (Argument("a", low=0, open=True), Argument("rate", 1, low=0, open=True)), _gamma,
         "A positive real with mean `a / rate` and variance `a / rate**2`.", r"\operatorname{Gamma}({a}, {rate})",
         samples=({"a": 2.5, "rate": 2}, {"a": 0.25, "rate": 1})),
    Dist("Geometric", (Argument("p", low=0, high=1, open=True),), _geometric,
         "Number of trials up to the first success, where each succeeds with probability `p`: 1 or more.",
         r"\operatorname{Geometric}({p})", samples=({"p": 0.5}, {"p": 0.2}, {"p": 1})),
    Dist("Poisson", (Argument("rate", low=0),), _poisson, "Number of events, with mean `rate`.",
         r"\operatorname{Poisson}({rate})", samples=({"rate": 4}, {"rate": 0}, {"rate": 0.25})),
    Dist("Dirichlet", (Argument("alpha", vector=True, low=0, open=True),),
         lambda b, a, shape: b.draw("dirichlet", (b.cast(a["alpha"], Kind.REAL),), Type(Kind.REAL, a["alpha"].type.shape)),
         "A vector of probabilities with concentrations `alpha`.", r"\operatorname{Dirichlet}({alpha})",
         shaped=False, samples=({"alpha": (1.0, 0.5, 3.0)},)),
    Dist("Beta", (Argument("a", low=0, open=True), Argument("b", low=0, open=True)), _beta,
         "A real between 0 and 1 with mean `a / (a + b)`.", r"\operatorname{Beta}({a}, {b})",
         samples=({"a": 2, "b": 5}, {"a": 0.5, "b": 0.25})),
    Dist("Permutation", (Argument("n", static=True, low=0),), _permutation,
         "A uniform permutation of 0, ..., n - 1; `shape=` gives a vector of permutations.",
         r"\operatorname{Perm}({n})", samples=({"n": 5}, {"n": 1})),
    Dist("Subset", (Argument("n", static=True, low=0), Argument("k", static=True, low=0)), _subset,
         "`n` conditions of which `k` hold, all choices equally likely; `shape=` gives a vector of choices.",
         r"\operatorname{Subset}({n}, {k})",
         samples=({"n": 5, "k": 2}, {"n": 3, "k": 3})),
))  # fmt: skip

CATEGORICAL = Dist(
    "Categorical", (Argument("p"),), lambda b, a, shape: b.draw("categorical", (a["p"],), Type(Kind.INT, shape)),
    "`Categorical({value: p, ...})` draws a value; `Categorical(p)` with a vector of probabilities draws an index.",
    r"\operatorname{Categorical}({p})", samples=({"p": (0.25, 0.0, 0.75)}, {"p": (0.5, 0.5)}, {"p": (1.0,)}),
)  # fmt: skip


def is_distribution(name: str) -> bool:
    return name in DISTS or name == CATEGORICAL.name
