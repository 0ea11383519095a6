"""Evaluate core nodes over a batch with array operations, and the array forms longer than one expression.

Arrays carry the batch axis last, so that a scalar of every lane, shape (N,), broadcasts against a vector of every
lane, shape (n, N). `xp` is NumPy or a namespace like it (`jax.numpy`).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache, partial, reduce
from typing import Any, NamedTuple

import numpy as np

from taskspec.base.arrays import AnyArray, Array
from taskspec.language.expressions.evaluate import no_draws
from taskspec.language.expressions.ir import Apply, Const, Draw, Read, plain, walk
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.types import INT_MAX, Expression, Kind, Role

UNSORTED = 16
"""Vectors up to this many elements are sorted by a network."""


@cache
def network(n: int) -> list[tuple[int, int]]:
    """List the comparators of Batcher's odd-even merge sort (Knuth, TAOCP 3, algorithm 5.2.2M)."""
    pairs = []
    t = max(1, (n - 1).bit_length())
    p = 1 << (t - 1)
    while p > 0:
        q = 1 << (t - 1)
        r = 0
        d = p
        while d > 0:
            for i in range(n - d):
                if i & p == r:
                    pairs.append((i, i + d))
            d = q - p
            q = q >> 1
            r = p
        p >>= 1
    return pairs


class Runtime:
    """Helpers over an array namespace, with the integer and real types that the backend computes in."""

    def __init__(self, xp: Any, int_dtype: Any, real_dtype: Any) -> None:
        self.xp = xp
        self.int = int_dtype
        self.real = real_dtype

    # -- conversions ----------------------------------------------------------------------------------------------

    def as_int(self, x: AnyArray) -> AnyArray:
        return self.xp.asarray(x).astype(self.int)

    def as_real(self, x: AnyArray) -> AnyArray:
        return self.xp.asarray(x).astype(self.real)

    def to_int(self, x: AnyArray) -> AnyArray:
        """Convert whole-numbered reals to ints: saturating, nan to 0. The clamp is a hair wider, for float32."""
        xp = self.xp
        inside = xp.clip(xp.where(xp.isnan(x), 0, x), -INT_MAX, INT_MAX)
        if self.real != xp.float32:
            return inside.astype(self.int)
        whole = xp.where(xp.abs(inside) < INT_MAX, inside, 0).astype(self.int)
        return xp.where(x >= INT_MAX, INT_MAX, xp.where(x <= -INT_MAX, -INT_MAX, whole))

    # -- arithmetic at the awkward points -------------------------------------------------------------------------

    def _is_int(self, a: AnyArray, b: AnyArray) -> bool:
        return all(self.xp.asarray(v).dtype.kind in "iub" for v in (a, b))

    def floordiv(self, a: AnyArray, b: AnyArray) -> AnyArray:
        xp = self.xp
        zero = b == 0
        if self._is_int(a, b):
            return xp.where(zero, 0, a // xp.where(zero, 1, b))
        finite = xp.isfinite(a) & xp.isfinite(b)
        quotient = xp.where(finite, a, 0) // xp.where(finite & ~zero, b, 1)
        return xp.where(zero, a / b, xp.where(finite, quotient, xp.nan))

    def mod(self, a: AnyArray, b: AnyArray) -> AnyArray:
        xp = self.xp
        zero = b == 0
        if self._is_int(a, b):
            return xp.where(zero, 0, a % xp.where(zero, 1, b))
        usable = xp.isfinite(a) & ~zero
        return xp.where(usable, xp.where(usable, a, 0) % xp.where(usable, b, 1), xp.nan)

    def pow(self, a: AnyArray, b: AnyArray) -> AnyArray:
        a = self.as_real(a)
        b = self.as_real(b)
        # With a single exponent for all NumPy takes short cuts, and a square root differs from a power at -0.0 and -inf.
        return self.xp.power(a, b + self.xp.zeros_like(a))

    def min2(self, a: AnyArray, b: AnyArray) -> AnyArray:
        """Take the first of equals; `fmin` takes either of 0.0 and -0.0."""
        return self.xp.where((a <= b) | (b != b), a, b)

    def max2(self, a: AnyArray, b: AnyArray) -> AnyArray:
        return self.xp.where((a >= b) | (b != b), a, b)

    def sign(self, x: AnyArray) -> AnyArray:
        x = self.xp.asarray(x)
        return (x > 0).astype(x.dtype) - (x < 0).astype(x.dtype)

    # -- reductions over all elements of each lane ----------------------------------------------------------------

    def rows(self, x: AnyArray) -> AnyArray:
        """Flatten all axes but the lanes."""
        return x.reshape(-1, x.shape[-1])

    def sum(self, x: AnyArray) -> AnyArray:
        """Left to right, as the reference adds."""
        return reduce(operator.add, self.rows(x))

    def prod(self, x: AnyArray) -> AnyArray:
        return reduce(operator.mul, self.rows(x))

    def count(self, x: AnyArray) -> AnyArray:
        return self.rows(x).astype(self.int).sum(axis=0)

    def any(self, x: AnyArray) -> AnyArray:
        return self.rows(x).any(axis=0)

    def all(self, x: AnyArray) -> AnyArray:
        return self.rows(x).all(axis=0)

    def argmin(self, x: AnyArray) -> AnyArray:
        """Nan counts as +inf, which ties with a real +inf only where nothing smaller exists."""
        return self._best(self.rows(x), 1)

    def argmax(self, x: AnyArray) -> AnyArray:
        return self._best(self.rows(x), -1)

    def _best(self, rows: AnyArray, direction: int) -> AnyArray:
        """Index of the first best number; of the first element where every element is nan."""
        xp = self.xp
        best = xp.argmax
        if direction > 0:
            best = xp.argmin
        if rows.dtype.kind in "iub":
            return best(rows, axis=0).astype(self.int)
        place = best(xp.where(rows != rows, direction * xp.inf, rows), axis=0)
        first_number = xp.argmax(rows == rows, axis=0)
        hidden = xp.take_along_axis(rows, place[None], axis=0)[0]
        return xp.where(hidden != hidden, first_number, place).astype(self.int)

    def min(self, x: AnyArray) -> AnyArray:
        rows = self.rows(x)
        return self.xp.take_along_axis(rows, self.argmin(x)[None], axis=0)[0]

    def max(self, x: AnyArray) -> AnyArray:
        rows = self.rows(x)
        return self.xp.take_along_axis(rows, self.argmax(x)[None], axis=0)[0]

    # -- vectors --------------------------------------------------------------------------------------------------

    def sort(self, x: AnyArray) -> AnyArray:
        """Ascending along the first axis; short vectors by a network, which takes a few operations for all lanes."""
        n = x.shape[0]
        x = self.without_sign(x)
        if n > UNSORTED:
            return self.xp.sort(x, axis=0)
        rows = list(x)
        # Of two, fmin passes over nan and maximum keeps it: so nan moves last.
        if x.dtype.kind in "iub":
            least = self.xp.minimum
        else:
            least = self.xp.fmin
        for i, j in network(n):
            rows[i], rows[j] = least(rows[i], rows[j]), self.xp.maximum(rows[i], rows[j])
        return self.xp.stack(rows)

    def without_sign(self, x: AnyArray) -> AnyArray:
        """Replace -0.0 by 0.0. Adding 0.0 would do, but XLA leaves the number as it is."""
        if x.dtype.kind in "iub":
            return x
        return self.xp.where(x == 0, 0.0, x)

    def argsort(self, x: AnyArray) -> AnyArray:
        return self.xp.argsort(x, axis=0, kind="stable").astype(self.int)

    def cumsum(self, x: AnyArray) -> AnyArray:
        return self.xp.cumsum(x, axis=0)

    # -- structure ------------------------------------------------------------------------------------------------

    def stack(self, *parts: AnyArray) -> AnyArray:
        if any(p.shape != parts[0].shape for p in parts):
            parts = self.xp.broadcast_arrays(*parts)
        return self.xp.stack(parts)

    def fill(self, x: AnyArray, shape: tuple[int, ...]) -> AnyArray:
        """Repeat a scalar of every lane in each place of a shape."""
        return self.xp.broadcast_to(x, (*shape, self.xp.asarray(x).shape[-1]))

    def concat(self, *parts: AnyArray) -> AnyArray:
        lanes = max(p.shape[-1] for p in parts)
        return self.xp.concatenate([self.xp.broadcast_to(p, (*p.shape[:-1], lanes)) for p in parts])

    def index(self, x: AnyArray, i: AnyArray) -> AnyArray:
        """Pick rows of x (n, ..., N) at the indices i (..., N) of each lane."""
        xp = self.xp
        if x.shape[-1] == 1:
            picked = xp.take(x[..., 0], i, axis=0)  # (*i.shape, *row)
            return xp.moveaxis(picked, i.ndim - 1, -1)
        lanes = xp.arange(x.shape[-1])
        picked = x[(i, *(slice(None),) * (x.ndim - 2), lanes)]
        if x.ndim == 2:
            return picked
        return xp.moveaxis(picked, i.ndim - 1, -1)

    def put(self, x: AnyArray, i: AnyArray, value: AnyArray) -> AnyArray:
        xp = self.xp
        here = xp.arange(x.shape[0]).reshape(-1, *(1,) * (x.ndim - 1)) == i
        return xp.where(here, value, x)

    def swap(self, x: AnyArray, i: AnyArray, j: AnyArray) -> AnyArray:
        at_i = self.index(x, i)
        at_j = self.index(x, j)
        return self.put(self.put(x, i, at_j), j, at_i)


# Array evaluation of core nodes over a batch: the array forms of the operator table, node by node.
#
# Used where many points are needed once (sets, soundness, exact models); a backend that steps environments generates
# source from the same templates instead. Values have shape (*shape, N): the batch axis is last, and is 1 for constants.

DTYPES: dict[Kind, Any] = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}
RUNTIME = Runtime(np, np.int64, np.float64)
NOTHING: Mapping[int, Array] = {}


@lru_cache(maxsize=4096)
def array(node: Const) -> Array:
    """Convert a constant to a read-only array (*shape, 1)."""
    values = list(map(plain, node.flat)) if node.type.kind is Kind.REAL else node.flat
    made = np.array(values, dtype=DTYPES[node.type.kind]).reshape(*node.type.shape, 1)
    made.setflags(write=False)
    return made


def evaluate(
    roots: Iterable[Expression],
    reads: Mapping[tuple[Role, str], Array],
    sample: Callable[[Draw, list[Array]], Array] = no_draws,
    drawn: Mapping[int, Array] = NOTHING,
) -> list[Array]:
    """Return values of the roots over a batch.

    Args:
        roots: nodes; shared ones are evaluated once.
        reads: arrays (*shape, N) or (*shape, 1) for every name that is read.
        sample: the value of a draw, (*shape, N), from its evaluated arguments.
        drawn: values of draws by site, (*shape, N) or (*shape, 1), for which arguments are not needed.

    Returns:
        Arrays (*shape, N), or (*shape, 1) where nothing depends on the batch.
    """
    plan = _planned(tuple(roots), frozenset(drawn))
    values = plan.values.copy()
    for place, site in plan.drawn:
        values[place] = drawn[site]
    for place, key in plan.reads:
        values[place] = reads[key]
    with np.errstate(all="ignore"):
        for place, operation, args in plan.steps:
            arguments = [values[i] for i in args]
            if isinstance(operation, Draw):
                values[place] = sample(operation, arguments)
            else:
                values[place] = operation(*arguments)
    return [values[i] for i in plan.roots]


class _Plan(NamedTuple):
    """The order of evaluation of nodes: values by place, constants in theirs, then draws whose values are known, then reads, then
    operators and draws in order.
    """

    values: list[Any]
    drawn: list[tuple[int, int]]
    reads: list[tuple[int, tuple[Role, str]]]
    steps: list[tuple[int, Callable[..., Array] | Draw, tuple[int, ...]]]
    roots: list[int]


@lru_cache(maxsize=64)
def _planned(roots: tuple[Expression, ...], drawn: frozenset[int]) -> _Plan:
    """Kept, since the same step is evaluated at thousands of times of an episode."""
    places: dict[int, int] = {}
    plan = _Plan([], [], [], [], [])
    for node in walk(roots):
        if isinstance(node, Draw) and node.site in drawn:
            places[id(node)] = len(plan.values)
            plan.drawn.append((len(plan.values), node.site))
            plan.values.append(None)
    for node in walk(roots, known=frozenset(places)):
        place = places[id(node)] = len(plan.values)
        plan.values.append(array(node) if isinstance(node, Const) else None)
        match node:
            case Read(role=role, name=name):
                plan.reads.append((place, (role, name)))
            case Apply(args=args):
                plan.steps.append((place, _operation(node), tuple(places[id(a)] for a in args)))
            case Draw(args=args):
                plan.steps.append((place, node, tuple(places[id(a)] for a in args)))
    plan.roots.extend(places[id(root)] for root in roots)
    return plan


def _operation(node: Apply) -> Callable[..., Array]:
    if node.op in OPERATORS:
        return partial(function(node.op, node.type.kind), np, RUNTIME)
    static = node.static
    match node.op:
        case "vector":
            return RUNTIME.stack
        case "slice":
            start, count, step = static
            stop = start + count * step
            rows = slice(start, None if stop < 0 else stop, step)
            return lambda x: x[rows]
        case "element":
            return lambda x: x[static[0]]
        case "reshape":
            return lambda x: x.reshape(*static, x.shape[-1])
        case "fill":
            return lambda x: np.broadcast_to(x, (*static, x.shape[-1]))
        case _:
            return getattr(RUNTIME, node.op)


@cache
def function(op: str, kind: Kind) -> Callable[..., Any]:
    """Compile the array form of an operator: a function of (xp, rt, *arguments)."""
    entry = OPERATORS[op]
    form = entry.array
    template = form.template
    if kind is Kind.REAL and form.real:
        template = form.real
    names = [f"a{i}" for i in range(3)]
    used = []
    for i, n in enumerate(names):
        if f"{{{i}}}" in template:
            used.append(n)
    source = f"lambda xp, rt, {', '.join(used)}: {template.format(*names)}"
    return eval(source, {})  # noqa: S307  # our own table, never a spec's text
