"""The reference interpreter: walks core nodes on plain Python values. Slow and obvious; every backend is tested against it.

Values are flat row-major tuples (scalars: one element), so that one rule serves every shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from taskspec.language.expressions.ir import Apply, Const, Draw, Read, exact, plain, walk
from taskspec.language.expressions.operators import OPERATORS, STRUCTURES
from taskspec.language.expressions.types import Expression, Role, Type

Flat = tuple[Any, ...]
Sampler = Callable[[Draw, list[Flat]], Flat]
"""Gives the value of a draw from its evaluated arguments."""


def no_draws(draw: Draw, args: list[Any]) -> Any:
    raise AssertionError(f"a draw ({draw.base}) where none can be")


def evaluate(
    roots: Iterable[Expression], reads: Mapping[tuple[Role, str], Flat], sample: Sampler = no_draws
) -> list[Flat]:
    """Return values of the roots.

    Args:
        roots: nodes to evaluate; a node shared between them is evaluated once, a draw is drawn once.
        reads: the flat value of every component, time or variable that is read.
        sample: called once for each draw.
    """
    roots = tuple(roots)
    values: dict[int, Flat] = {}
    for node in walk(roots):
        match node:
            case Const():
                values[id(node)] = node.flat
                continue
            case Read(role=role, name=name):
                value = reads[role, name]
            case Apply(op=op, args=args, static=static, type=type_):
                flats = [values[id(a)] for a in args]
                if (
                    op in OPERATORS
                ):  # fractions stay exact in constants, which are folded; what is computed with is a real
                    flats = [tuple(map(plain, flat)) for flat in flats]
                value = apply_flat(op, flats, tuple(a.type for a in args), static, type_)
            case Draw(args=args):
                value = sample(node, [values[id(a)] for a in args])
        values[id(node)] = tuple(exact(v, node.type.kind) for v in value)
    return [values[id(root)] for root in roots]


def apply_flat(name: str, args: Sequence[Flat], types: tuple[Type, ...], static: tuple[int, ...], result: Type) -> Flat:
    """Compute one operator on flat values; elementwise operators stretch scalars."""
    if name in STRUCTURES:
        return STRUCTURES[name].reference(args, types, static)
    op = OPERATORS[name]
    if not op.elementwise:
        value = op.reference(*args)
        if result.shape:
            return tuple(value)
        return (value,)
    size = result.size
    stretched = []
    for arg, t in zip(args, types, strict=True):
        if t.shape == result.shape:
            stretched.append(arg)
        else:
            stretched.append(arg * size)
    return tuple(op.reference(*row) for row in zip(*stretched, strict=True))
