"""Array evaluation of core nodes over a batch: the array forms of the operator table, node by node.

Used where many points are needed once (sets, soundness, exact models); a backend that steps environments generates
source from the same templates instead. Values have shape (*shape, N): the batch axis is last, and is 1 for constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

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
    roots = tuple(roots)
    values: dict[int, Array] = {}
    with np.errstate(all="ignore"):
        for node in _in_order(roots):
            match node:
                case Const():
                    value = array(node)
                case Read(role=role, name=name):
                    value = reads[role, name]
                case Apply():
                    value = apply(node, [values[id(a)] for a in node.args])
                case Draw(args=args):
                    value = sample(node, [values[id(a)] for a in args])
            values[id(node)] = value
    return [values[id(root)] for root in roots]


@lru_cache(maxsize=64)
def _in_order(roots: tuple[Node, ...]) -> tuple[Node, ...]:
    """Kept, since the same step is evaluated at thousands of times of an episode."""
    return tuple(walk(roots))


def apply(node: Apply, args: Sequence[Array]) -> Any:
    """One operator over a batch."""
    if node.op in OPERATORS:
        return function(node.op, node.type.kind)(np, RUNTIME, *args)
    static = node.static
    match node.op:
        case "vector":
            return RUNTIME.stack(*args)
        case "concat":
            return RUNTIME.concat(*args)
        case "slice":
            start, count, step = static
            stop = start + count * step
            return args[0][start : None if stop < 0 else stop : step]
        case "element":
            return args[0][static[0]]
        case "reshape":
            return args[0].reshape(*static, args[0].shape[-1])
        case "fill":
            return np.broadcast_to(args[0], (*static, args[0].shape[-1]))
        case _:
            return getattr(RUNTIME, node.op)(*args)


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
