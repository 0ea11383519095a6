"""Interval reasoning over core nodes: bounds that hold for every element of a value, whatever is read and drawn.

There are two kinds. `bounds` follow the arithmetic of float64, each operation rounded as the run time rounds it: they serve
proofs, spaces and widths. `certain` bounds rest on integer arithmetic alone, so that they hold in any precision of reals, on
every backend, and even if a real has left its declared range: only these may drop an index clamp or a zero guard.

Sound, not tight: an operator without a rule gives (-inf, inf). Nan is outside every interval's promise: bounds speak of the
numbers only, and `Range.finite` says whether there is nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from taskspec.lang import reference
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, plain, walk
from taskspec.lang.types import INT_MAX, INT_WIDEST, Kind

INF = math.inf
NORMAL_REACH = 6.67
"""No standard normal that is drawn lies further out: its radius comes from 31 bits."""
Interval = tuple[float, float]
"""Ends of an int are ints, or infinite; those of a real are floats."""
EVERYTHING: Interval = (-INF, INF)
_HUGE = 1e300
_FACTORS = 10_000
"""Products of more elements are not followed factor by factor."""


class Range(NamedTuple):
    """What is known of every element of a value: its bounds, and whether it is always a finite number."""

    low: float
    high: float
    finite: bool = True

    @property
    def bounded(self) -> bool:
        return math.isfinite(self.low) and math.isfinite(self.high)

    def holds_zero(self) -> bool:
        return self.low <= 0 <= self.high


Args = Sequence[Range]


def bounds(root: Node, known: dict[int, Range]) -> Interval:
    """Bounds of a node; `known` (by node id) carries results from call to call."""
    return ranges(root, known)[:2]


def ranges(root: Node, known: dict[int, Range], rule: Callable[[Node, Args], Range] | None = None) -> Range:
    """What is known of a node; `rule` gives that of a node from its arguments, `step` unless it is given."""
    rule = rule or step
    if id(root) not in known:
        for node in walk([root]):
            if id(node) not in known:
                known[id(node)] = rule(node, [known[id(c)] for c in children(node)])
    return known[id(root)]


def step(node: Node, args: Args) -> Range:
    """What is known of a node from what is known of its arguments."""
    match node:
        case Const():
            return _constant(node)
        case Read(role=role):
            edge: Interval = (0, 1)
            if node.type.kind is not Kind.BOOL:
                edge = _tidy((node.low, node.high), node.type.kind)
            # States, actions and times are numbers; a variable may stand for any value.
            return Range(*edge, role is not Role.VARIABLE or all(map(math.isfinite, edge)))
        case Draw():
            return Range(*_tidy(_drawn(node, args), node.type.kind))
        case Apply(type=t) if t.kind is Kind.BOOL:
            return Range(0, 1)
        case Apply(op=op):
            rule = _RULES.get(op, _UNKNOWN)
            found = _tidy(rule.bounds(args, node), node.type.kind)
            return Range(*found, node.type.kind is Kind.INT or rule.finite(args, found))


def certain(root: Node, known: dict[int, Range]) -> Interval:
    """Bounds that integer arithmetic alone gives: nothing is known of a real, nor of an int that may leave 64 bits."""
    return ranges(root, known, _certain_step)[:2]


def _certain_step(node: Node, args: Args) -> Range:
    found = step(node, args)
    match node:
        case Apply(op=op) if op in ROUNDING:
            return Range(-INT_MAX, INT_MAX)
        case _ if node.type.kind is Kind.REAL:
            return Range(*EVERYTHING, False)
        case Draw() | Read(role=Role.TIME):  # counts, which stay within 32 bits
            return Range(found.low, min(found.high, INT_MAX))
        case Apply(op=op) if op in _WRAPPING and max(-found.low, found.high) > INT_WIDEST:
            return Range(*EVERYTHING)
        case _:
            return found


def _tidy(edge: Interval, kind: Kind) -> Interval:
    """Without nan, and without ints so large that computing with them takes long."""
    low, high = edge
    low = -INF if low != low or low < -_HUGE else min(low, _HUGE)
    high = INF if high != high or high > _HUGE else max(high, -_HUGE)
    if kind is Kind.REAL:
        return float(low), float(high)
    return (low if math.isinf(low) else math.floor(low)), (high if math.isinf(high) else math.ceil(high))


def _constant(node: Const) -> Range:
    if node.type.kind is not Kind.REAL:  # a table may have a million of them
        return Range(*_tidy((min(node.flat), max(node.flat)), node.type.kind), True)
    flat = [plain(v) for v in node.flat]
    numbers = [v for v in flat if v == v]
    edge = (min(numbers), max(numbers)) if numbers else EVERYTHING
    return Range(*_tidy(edge, node.type.kind), all(map(math.isfinite, flat)))


def _drawn(node: Draw, args: Args) -> Interval:
    match node.base:
        case "uniform" | "bernoulli" | "dirichlet":
            return (0, 1)
        case "index":
            return (0, max(0, args[0].high - 1))
        case "categorical":
            return (0, node.args[0].type.shape[-1] - 1)
        case "permutation":
            return (0, max(0, node.type.shape[-1] - 1))
        case "normal":
            return (-NORMAL_REACH, NORMAL_REACH)
        case "poisson" | "exponential":
            return (0, INF)
        case _:
            return EVERYTHING


# -- bounds of operators --------------------------------------------------------------------------------------------
# Rounding to nearest never turns the order of two numbers round. So where an operation grows, or falls, with each of its
# arguments, its values at the corners, worked out as the run time does, bound all of its values.


def _mul(a: float, b: float) -> float:
    return 0 if a == 0 or b == 0 else a * b


def _product(args: Args, node: Apply) -> Interval:
    (a, b), (c, d) = args[0][:2], args[1][:2]
    corners = [_mul(a, c), _mul(a, d), _mul(b, c), _mul(b, d)]
    return min(corners), max(corners)


def _quotient(args: Args, node: Apply) -> Interval:
    if args[1].holds_zero() or not args[1].bounded:
        return EVERYTHING
    (a, b), (c, d) = args[0][:2], args[1][:2]
    corners = [a / c, a / d, b / c, b / d]
    return min(corners), max(corners)


def _floor_quotient(args: Args, node: Apply) -> Interval:
    (a, b), (c, d) = args[0][:2], args[1][:2]
    if not (args[0].bounded and args[1].bounded):
        return EVERYTHING
    if args[1].holds_zero():
        most = max(abs(a), abs(b))
        return (-most, most) if node.type.kind is Kind.INT else EVERYTHING
    corners = [a // c, a // d, b // c, b // d]
    return _loose((min(corners), max(corners))) if node.type.kind is Kind.REAL else (min(corners), max(corners))


def _loose(edge: Interval) -> Interval:
    """Wider by what a quotient that is too large for its last digits may be off."""
    low, high = edge
    return (
        low if abs(low) < 2**50 else low - abs(low) * 2**-50,
        high if abs(high) < 2**50 else high + abs(high) * 2**-50,
    )


def _remainder(args: Args, node: Apply) -> Interval:
    (a, b), (c, d) = args[0][:2], args[1][:2]
    integral = node.type.kind is Kind.INT
    if c > 0:
        return (a, b) if integral and a >= 0 and b < c else (0, d - 1 if integral else d)
    if d < 0:
        return (c + 1 if integral else c, 0)
    return EVERYTHING if not integral else (min(0, c + 1), max(0, d - 1))


def _union(args: Args, node: Apply) -> Interval:
    return min(a.low for a in args), max(a.high for a in args)


def _extreme(pick: Callable[[float, float], float]) -> Callable[[Args, Apply], Interval]:
    """Of two ints, or of two reals one of which may be nan and then gives way to the other.

    It counts as such unless it is a constant, also where it is known to be a number: how many words a draw of Poisson takes
    follows from the bound of its rate, and `docs/seeding.md` states this rule.
    """

    def rule(args: Args, node: Apply) -> Interval:
        a, b = args
        found = [(pick(a.low, b.low), pick(a.high, b.high))]
        if node.type.kind is Kind.REAL:
            found += [other[:2] for i, other in ((0, b), (1, a)) if not isinstance(node.args[i], Const)]
        return min(low for low, _ in found), max(high for _, high in found)

    return rule


def _magnitude(args: Args, node: Apply) -> Interval:
    (a, b) = args[0][:2]
    return (0 if a <= 0 <= b else min(abs(a), abs(b))), max(abs(a), abs(b))


def _sum_of(value: float, n: int) -> float:
    """A number added n times, from left to right."""
    if isinstance(value, int) or n == 0:
        return _mul(value, n)
    with np.errstate(over="ignore"):
        return float(np.add.accumulate(np.full(n, value))[-1])


def _total(args: Args, node: Apply) -> Interval:
    n = node.args[0].type.size
    return _sum_of(args[0].low, n), _sum_of(args[0].high, n)


def _running(args: Args, node: Apply) -> Interval:
    (a, b), n = args[0][:2], node.type.size
    return min(a, _sum_of(a, n)), max(b, _sum_of(b, n))


def _power(args: Args, node: Apply) -> Interval:
    """Of all elements multiplied, one after the other."""
    n = node.args[0].type.size
    if n == 0:
        return (1, 1)
    if not args[0].bounded or n > _FACTORS:
        return EVERYTHING
    beyond = INF if node.type.kind is Kind.REAL else _HUGE  # a real product may overflow; a wide int is refused
    edge: Interval = args[0][:2]
    for _ in range(n - 1):
        wider = _product([Range(*edge), args[0]], node)
        if wider == edge:
            return edge
        edge = wider
        if max(abs(v) for v in edge) > _HUGE:
            return (0 if args[0].low >= 0 else -beyond), beyond
    return edge


def _to_int(function: Callable[[float], int]) -> Callable[[Args, Apply], Interval]:
    """Of a monotone function to ints, 0 for nan: saturating where the bounds are finite."""

    def rule(args: Args, node: Apply) -> Interval:
        low, high = (function(x) if math.isfinite(x) else x for x in args[0][:2])
        return (low, high) if args[0].finite else (min(low, 0), max(high, 0))

    return rule


def _root(args: Args, node: Apply) -> Interval:
    low, high = (math.sqrt(max(0.0, x)) if x < INF else INF for x in args[0][:2])
    return low, high


def _same(args: Args, node: Apply) -> Interval:
    return args[0][:2]


def _fixed(low: float, high: float) -> Callable[[Args, Apply], Interval]:
    return lambda args, node: (low, high)


def _place(args: Args, node: Apply) -> Interval:
    """A place among the elements of the first argument."""
    return 0, max(0, node.args[0].type.size - 1)


# -- when values are finite numbers ---------------------------------------------------------------------------------


def _closed(args: Args, found: Interval) -> bool:
    return all(a.finite for a in args)


def _bounded(args: Args, found: Interval) -> bool:
    return _closed(args, found) and all(map(math.isfinite, found))


def _divided(args: Args, found: Interval) -> bool:
    return _bounded(args, found) and not args[1].holds_zero()


def _never(args: Args, found: Interval) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Rule:
    """Bounds of an operator's value from what is known of its arguments, and whether the value is finite where these are."""

    bounds: Callable[[Args, Apply], Interval]
    finite: Callable[[Args, Interval], bool] = _closed


_UNKNOWN = Rule(lambda args, node: EVERYTHING, _never)
_WRAPPING = frozenset(("add", "sub", "mul", "neg", "abs", "floordiv", "sum", "prod", "cumsum"))
"""Operators that may give an int which no argument is."""
ROUNDING = ("floor", "ceil", "round")
"""Operators from reals to ints."""
_RULES: dict[str, Rule] = {
    "add": Rule(lambda a, n: (a[0].low + a[1].low, a[0].high + a[1].high), _bounded),
    "sub": Rule(lambda a, n: (a[0].low - a[1].high, a[0].high - a[1].low), _bounded),
    "neg": Rule(lambda a, n: (-a[0].high, -a[0].low)),
    "mul": Rule(_product, _bounded),
    "div": Rule(_quotient, _divided),
    "floordiv": Rule(_floor_quotient, _divided),
    "mod": Rule(_remainder, _divided),
    "abs": Rule(_magnitude),
    "sign": Rule(_to_int(reference.sign)),
    "min2": Rule(_extreme(min)),
    "max2": Rule(_extreme(max)),
    "where": Rule(lambda a, n: _union(a[1:], n)),
    "floor": Rule(_to_int(reference.floor)),
    "ceil": Rule(_to_int(reference.ceil)),
    "round": Rule(_to_int(reference.round_)),
    "sqrt": Rule(_root, lambda args, found: args[0].finite and args[0].low >= 0),
    "exp": Rule(_fixed(0, INF), lambda args, found: args[0].finite and args[0].high < 700),
    "log": Rule(_fixed(*EVERYTHING), lambda args, found: args[0].finite and args[0].low > 0),
    "sin": Rule(_fixed(-1, 1)),
    "cos": Rule(_fixed(-1, 1)),
    "tanh": Rule(_fixed(-1, 1)),
    "atan2": Rule(_fixed(-math.pi, math.pi)),
    "sum": Rule(_total, _bounded),
    "prod": Rule(_power, _bounded),
    "cumsum": Rule(_running, _bounded),
    "count": Rule(lambda a, n: (0, n.args[0].type.size)),
    **dict.fromkeys(("argmin", "argmax", "argsort"), Rule(_place)),
    **dict.fromkeys(("vector", "concat"), Rule(_union)),
    "put": Rule(lambda a, n: _union((a[0], a[2]), n)),
    **dict.fromkeys(
        ("to_int", "to_real", "min", "max", "sort", "slice", "element", "reshape", "fill", "index", "swap"), Rule(_same)
    ),
}
