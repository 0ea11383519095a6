"""Array evaluation of core nodes over a batch: the array forms of the operator table, node by node.

Used where many points are needed once (sets, soundness, exact models); a backend that steps environments generates
source from the same templates instead. Values have shape (*shape, N): the batch axis is last, and is 1 for constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from taskspec.lang.arrays import Runtime
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, plain, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.types import Kind

Array = np.ndarray[Any, Any]
DTYPES: dict[Kind, Any] = {Kind.BOOL: np.bool_, Kind.INT: np.int64, Kind.REAL: np.float64}
RUNTIME = Runtime(np, np.int64, np.float64)


@lru_cache(maxsize=4096)
def array(node: Const) -> Array:
    """A constant as a read-only array with a batch axis of one."""
    values = [plain(v) for v in node.flat] if node.type.kind is Kind.REAL else node.flat
    made = np.array(values, dtype=DTYPES[node.type.kind]).reshape(*node.type.shape, 1)
    made.setflags(write=False)
    return made


def no_draws(draw: Draw, args: list[Array]) -> Array:
    raise AssertionError(f"a draw ({draw.base}) where none can be")


def evaluate(
    roots: Iterable[Node],
    reads: Mapping[tuple[Role, str], Array],
    sample: Callable[[Draw, list[Array]], Array] = no_draws,
) -> list[Array]:
    """Values of the roots over a batch.

    Args:
        roots: nodes; shared ones are evaluated once.
        reads: arrays (*shape, N) or (*shape, 1) for every name that is read.
        sample: the value of a draw, (*shape, N), from its evaluated arguments.

    Returns:
        Arrays (*shape, N), or (*shape, 1) where nothing depends on the batch.
    """
    plan = _planned(tuple(roots))
    values = plan.values.copy()
    for place, key in plan.reads:
        values[place] = reads[key]
    with np.errstate(all="ignore"):
        for place, operation, args in plan.steps:
            found = [values[i] for i in args]
            values[place] = sample(operation, found) if isinstance(operation, Draw) else operation(*found)
    return [values[i] for i in plan.roots]


class _Plan(NamedTuple):
    """How nodes are evaluated: values by place, constants in theirs, then reads, then operators and draws in order."""

    values: list[Any]
    reads: list[tuple[int, tuple[Role, str]]]
    steps: list[tuple[int, Callable[..., Array] | Draw, tuple[int, ...]]]
    roots: list[int]


@lru_cache(maxsize=64)
def _planned(roots: tuple[Node, ...]) -> _Plan:
    """Kept, since the same step is evaluated at thousands of times of an episode."""
    places: dict[int, int] = {}
    plan = _Plan([], [], [], [])
    for node in walk(roots):
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
    """One operator over a batch, as a function of its arguments."""
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
            return getattr(RUNTIME, node.op)  # type: ignore[no-any-return]


@cache
def function(op: str, kind: Kind) -> Callable[..., Any]:
    """The array form of an operator as a function of (xp, rt, *arguments)."""
    entry = OPERATORS[op]
    form = entry.array
    template = form.real if kind is Kind.REAL and form.real else form.template
    names = [f"a{i}" for i in range(3)]
    used = [n for i, n in enumerate(names) if f"{{{i}}}" in template]
    source = f"lambda xp, rt, {', '.join(used)}: {template.format(*names)}"
    return eval(source, {})  # type: ignore[no-any-return]  # noqa: S307  # our own table, never a spec's text
