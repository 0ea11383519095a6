"""What makers of terms have in common, whatever the kind of value that they make."""

from __future__ import annotations

from collections.abc import Callable

from tests.verification.oracle.generator import conditions, scalars, vectors
from tests.verification.oracle.generator.terms import Context, Term, call, conditional, joined, number

LIMIT = 10**4
"""Ints above this are brought back, so that nothing comes near the limits of the backends."""

Maker = Callable[[Context, int], Term]


def pick(c: Context, options: list[tuple[float, Maker]], depth: int) -> Term:
    """One of several makers, by weight."""
    weights = [w for w, _ in options]
    return c.rng.choices([m for _, m in options], weights)[0](c, depth - 1)


def chosen(kind: str) -> Maker:
    """A case distinction, as `if` or as `where`."""

    def make(c: Context, depth: int) -> Term:
        test = conditions.condition(c, depth)
        x = scalars.term(c, kind, (), depth)
        y = scalars.term(c, kind, (), depth)
        if c.chance(0.3):
            return call("where", [test, x, y], kind, size=max(x.size, y.size))
        return conditional(test, x, y, kind)

    return make


def defined(kind: str) -> Maker:
    """A call of a definition with arguments."""

    def make(c: Context, depth: int) -> Term:
        known = [f for f in c.functions if f.gives.kind == kind and f.gives.shape == ()]
        if not known:
            return scalars.term(c, kind, (), depth)
        f = c.rng.choice(known)
        args = [limited(scalars.term(c, k, shape, depth)) for k, shape in f.takes]
        return joined(f"{f.name}({', '.join(a.text for a in args)})", kind, (*args, f.gives), size=f.gives.size)

    return make


def element(kind: str) -> Maker:
    """An element of a vector or matrix."""

    def make(c: Context, depth: int) -> Term:
        return vectors.element(c, kind, depth)

    return make


def limited(made: Term) -> Term:
    """Brought back if it may have grown too large for ints of 32 bits."""
    if made.size <= LIMIT or made.kind == "bool":
        return made
    if made.kind == "int":
        return joined(f"{made.at(6)} % 97", "int", (made,), shape=made.shape, level=6, size=97)
    if made.finite and made.size <= 1e9:
        return made
    return call("clip", [made, number(-10.0), number(10.0)], "real", shape=made.shape, size=10, finite=made.finite)
