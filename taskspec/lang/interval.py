"""Interval reasoning over core nodes: bounds that hold for every element of a value, whatever is read and drawn.

Used to drop index clamps and zero guards that cannot matter, and to prove that next states stay in their domain
where the state space cannot be enumerated. Sound, not tight: an operator without a rule gives (-inf, inf).
Nan is outside every interval's promise: bounds speak of the numbers only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from taskspec.lang import reference
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, children, walk
from taskspec.lang.types import Kind

INF = math.inf
NORMAL_REACH = 6.67
"""No standard normal that is drawn lies further out: its radius comes from 31 bits."""
Interval = tuple[float, float]
EVERYTHING: Interval = (-INF, INF)
_HUGE = 1e300


def bounds(root: Node, known: dict[int, Interval]) -> Interval:
    """Bounds of a node; `known` (by node id) carries results from call to call."""
    if id(root) in known:
        return known[id(root)]
    for node in walk([root]):
        if id(node) not in known:
            known[id(node)] = step(node, [known[id(c)] for c in children(node)])
    return known[id(root)]


def step(node: Node, args: list[Interval]) -> Interval:
    """Bounds of a node from those of its arguments."""
    match node:
        case Const():
            numbers = [v for v in node.flat if v == v]
            return (min(numbers), max(numbers)) if numbers else EVERYTHING
        case Read(low=low, high=high):
            return (0, 1) if node.type.kind is Kind.BOOL else (low, high)
        case Draw(base=base):
            return _draw_bounds(base, node, args)
        case Apply(op=op):
            if node.type.kind is Kind.BOOL:
                return (0, 1)
            rule = _RULES.get(op)
            return EVERYTHING if rule is None else _safe(rule(args, node))


def _safe(value: Interval) -> Interval:
    """Without nan, and without ints so large that computing with them takes long."""
    low, high = value
    low = -INF if low != low or low < -_HUGE else min(low, _HUGE)
    high = INF if high != high or high > _HUGE else max(high, -_HUGE)
    return low, high


def _draw_bounds(base: str, node: Draw, args: list[Interval]) -> Interval:
    match base:
        case "uniform" | "bernoulli":
            return (0, 1)
        case "index":
            return (0, max(0, args[0][1] - 1))
        case "categorical":
            return (0, node.args[0].type.shape[-1] - 1)
        case "permutation":
            return (0, max(0, node.type.shape[-1] - 1))
        case "normal":
            return (-NORMAL_REACH, NORMAL_REACH)
        case "poisson" | "exponential" | "gamma":
            return (0, INF)
        case _:
            return EVERYTHING


def _mul(a: float, b: float) -> float:
    return 0.0 if a == 0 or b == 0 else a * b


def _product(args: list[Interval], node: Any) -> Interval:
    (a, b), (c, d) = args
    corners = [_mul(a, c), _mul(a, d), _mul(b, c), _mul(b, d)]
    return min(corners), max(corners)


def _quotient(args: list[Interval], node: Any) -> Interval:
    (a, b), (c, d) = args
    if c <= 0 <= d or math.isinf(c) or math.isinf(d):
        return EVERYTHING
    corners = [a / c, a / d, b / c, b / d]
    return min(corners), max(corners)


def _floor_quotient(args: list[Interval], node: Any) -> Interval:
    (a, b), (c, d) = args
    if not all(map(math.isfinite, (a, b, c, d))):
        return EVERYTHING
    if c <= 0 <= d:
        most = max(abs(a), abs(b))
        return (-most, most) if node.type.kind is Kind.INT else EVERYTHING
    corners = [a // c, a // d, b // c, b // d]
    return min(corners), max(corners)


def _remainder(args: list[Interval], node: Any) -> Interval:
    (a, b), (c, d) = args
    integral = node.type.kind is Kind.INT
    if c > 0:
        return (a, b) if integral and a >= 0 and b < c else (0, d - 1 if integral else d)
    if d < 0:
        return (c + 1 if integral else c, 0)
    return EVERYTHING if not integral else (min(0, c + 1), max(0, d - 1))


def _union(args: list[Interval], node: Any) -> Interval:
    return min(a for a, _ in args), max(b for _, b in args)


def _extreme(pick: Callable[[float, float], float], args: list[Interval], node: Any) -> Interval:
    """Of two ints, or of two reals one of which may be nan and then gives way to the other."""
    (a, b), (c, d) = args
    found = [(pick(a, c), pick(b, d))]
    if node.type.kind is Kind.REAL:
        found += [other for own, other in ((0, (c, d)), (1, (a, b))) if not isinstance(node.args[own], Const)]
    return min(low for low, _ in found), max(high for _, high in found)


def _chosen(args: list[Interval], node: Any) -> Interval:
    return _union(args[1:], node)


def _magnitude(args: list[Interval], node: Any) -> Interval:
    ((a, b),) = args
    return (0 if a <= 0 <= b else min(abs(a), abs(b))), max(abs(a), abs(b))


def _total(args: list[Interval], node: Any) -> Interval:
    n = node.args[0].type.size
    return _mul(args[0][0], n), _mul(args[0][1], n)


def _running(args: list[Interval], node: Any) -> Interval:
    (a, b), n = args[0], node.type.size
    return min(a, _mul(a, n)), max(b, _mul(b, n))


def _power(args: list[Interval], node: Any) -> Interval:
    """Of all elements multiplied."""
    (a, b), n = args[0], node.args[0].type.size
    if not (math.isfinite(a) and math.isfinite(b)):
        return EVERYTHING
    most = max(abs(a), abs(b), 1)
    beyond = INF if node.type.kind is Kind.REAL else _HUGE  # a real product may overflow; a wide int is refused
    most = beyond if n * math.log2(most) > 990 else max(most, most**n)
    return (0 if a >= 0 else -most), most


def _to_int(function: Callable[[float], int]) -> Callable[[list[Interval], Any], Interval]:
    """Of a monotone function to ints, 0 for nan: saturating where the bounds are finite."""

    def rule(args: list[Interval], node: Any) -> Interval:
        ((a, b),) = args
        low, high = (function(x) if math.isfinite(x) else x for x in (a, b))
        return (min(low, 0), max(high, 0)) if _may_be_nan(node.args[0], args[0]) else (low, high)

    return rule


def _may_be_nan(node: Node, edge: Interval) -> bool:
    """Whether a value within bounds may also be nan; not tight."""
    return node.type.kind is Kind.REAL and (not all(map(math.isfinite, edge)) or any(map(_makes_nan, walk([node]))))


def _makes_nan(node: Node) -> bool:
    match node:
        case Const():
            return not all(math.isfinite(v) for v in node.flat)
        case Read():
            return node.type.kind is Kind.REAL and not (math.isfinite(node.low) and math.isfinite(node.high))
        case Apply(op="div", args=(_, Const() as divisor)):
            return 0 in divisor.flat
        case Apply(op=op):
            return op in ("div", "floordiv", "mod", "pow", "log", "sqrt") and node.type.kind is Kind.REAL
        case _:
            return False


def _same(args: list[Interval], node: Any) -> Interval:
    return args[0]


_RULES: dict[str, Callable[[list[Interval], Any], Interval]] = {
    "add": lambda a, n: (a[0][0] + a[1][0], a[0][1] + a[1][1]),
    "sub": lambda a, n: (a[0][0] - a[1][1], a[0][1] - a[1][0]),
    "neg": lambda a, n: (-a[0][1], -a[0][0]),
    "mul": _product,
    "div": _quotient,
    "floordiv": _floor_quotient,
    "mod": _remainder,
    "abs": _magnitude,
    "sign": _to_int(reference.sign),
    "min2": lambda a, n: _extreme(min, a, n),
    "max2": lambda a, n: _extreme(max, a, n),
    "where": _chosen,
    "floor": _to_int(reference.floor),
    "ceil": _to_int(reference.ceil),
    "round": _to_int(reference.round_),
    "to_int": _same,
    "to_real": _same,
    "sqrt": lambda a, n: (
        math.sqrt(max(0.0, a[0][0])),
        math.sqrt(max(0.0, a[0][1])) if a[0][1] < INF else INF,
    ),
    "exp": lambda a, n: (0, INF),
    "sin": lambda a, n: (-1, 1),
    "cos": lambda a, n: (-1, 1),
    "tanh": lambda a, n: (-1, 1),
    "atan2": lambda a, n: (-math.pi, math.pi),
    "sum": _total,
    "prod": _power,
    "cumsum": _running,
    "count": lambda a, n: (0, n.args[0].type.size),
    "min": _same,
    "max": _same,
    "argmin": lambda a, n: (0, n.args[0].type.size - 1),
    "argmax": lambda a, n: (0, n.args[0].type.size - 1),
    "sort": _same,
    "argsort": lambda a, n: (0, max(0, n.args[0].type.size - 1)),
    "vector": _union,
    "concat": _union,
    "slice": _same,
    "element": _same,
    "reshape": _same,
    "fill": _same,
    "index": _same,
    "position": lambda a, n: (0, n.static[0] - 1),
    "put": lambda a, n: _union([a[0], a[2]], n),
    "swap": _same,
}
