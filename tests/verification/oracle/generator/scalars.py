"""Random single values: ints and reals."""

from __future__ import annotations

from tests.verification.oracle.generator import conditions, draws, vectors
from tests.verification.oracle.generator.makers import Maker, chosen, defined, element, limited, pick
from tests.verification.oracle.generator.terms import (
    Context,
    Shape,
    Term,
    call,
    infix,
    joined,
    number,
)


def term(c: Context, kind: str, shape: Shape, depth: int) -> Term:
    """A random term of a kind and shape."""
    if shape:
        return vectors.vector(c, kind, shape, depth)
    made = {"bool": conditions.condition, "int": integer, "real": real}[kind](c, depth)
    return bracketed(c, made)


def bracketed(c: Context, made: Term) -> Term:
    return joined(f"({made.text})", made.kind, (made,), size=made.size) if made.level < 9 and c.chance(0.04) else made


# ------------------------------------------------------------------------------ ints


def small_int(c: Context) -> Term:
    return number(c.rng.choice((0, 1, 1, 2, 3, -1, -2)))


def integer(c: Context, depth: int) -> Term:
    if depth <= 0 or c.chance(0.15):
        known = c.readable(("int", "int", "bool"), ())
        return c.rng.choice(known) if known and c.chance(0.75) else small_int(c)
    return limited(pick(c, INTEGERS, depth))


def arithmetic(kind: str) -> Maker:
    def make(c: Context, depth: int) -> Term:
        op = c.rng.choice("++--**")
        left = mixed(c, kind, depth)
        right = term(c, kind, (), depth)
        size = left.size * right.size if op == "*" else left.size + right.size
        return infix(left, op, right, kind, size=size)

    return make


def mixed(c: Context, kind: str, depth: int) -> Term:
    """An operand: of the kind, or of one below it that counts as it."""
    below = {"int": ("int", "int", "bool"), "real": ("real", "real", "int")}[kind]
    return term(c, c.rng.choice(below), (), depth)


def fold(c: Context, depth: int) -> Term:
    if not c.folds:
        return integer(c, depth)
    start = integer(c, min(depth, 1))
    x = vectors.any_vector(c, "int", min(depth, 1))
    if len(x.shape) != 1 or start.size > 1e6 or x.size > 1e6:
        return start
    return joined(f"fold(mix, {start.text}, {x.text})", "int", (start, x), size=max(10, start.size, x.size))


def quotient(c: Context, depth: int) -> Term:
    left = integer(c, depth)
    right = integer(c, depth)
    op = c.rng.choice(("//", "%"))
    return infix(left, op, right, "int", size=left.size if op == "//" else right.size)


def int_power(c: Context, depth: int) -> Term:
    base = integer(c, depth)
    if base.size > 99:
        return base
    exponent = c.rng.randint(0, 2)
    return infix(base, "**", number(exponent), "int", size=max(1, base.size**exponent))


def sign_or_size(kind: str) -> Maker:
    def make(c: Context, depth: int) -> Term:
        x = term(c, kind, (), depth)
        which = c.rng.choice(("-", "-", "+", "abs", "sign"))
        if which in "+-":
            return joined(which + x.at(7), kind, (x,), level=7, size=x.size)
        return call(which, [x], kind, size=1 if which == "sign" else x.size)

    return make


def extremum(kind: str) -> Maker:
    def make(c: Context, depth: int) -> Term:
        which = c.rng.choice(("min", "max"))
        if c.chance(0.3):
            x = vectors.any_vector(c, kind, depth)
            return call(which, [x], kind, size=x.size)
        args = [mixed(c, kind, depth) for _ in range(c.rng.choice((2, 2, 3)))]
        args[-1] = term(c, kind, (), depth)
        return call(which, args, kind, size=max(a.size for a in args))

    return make


def clip(kind: str) -> Maker:
    def make(c: Context, depth: int) -> Term:
        args = [term(c, kind, (), depth), mixed(c, kind, depth - 1), mixed(c, kind, depth - 1)]
        return call("clip", args, kind, size=max(a.size for a in args))

    return make


def rounding(c: Context, depth: int) -> Term:
    x = term(c, "real" if c.chance(0.9) else "int", (), depth)
    size = x.size + 1 if x.finite else 2**31
    return call(c.rng.choice(("floor", "ceil", "round")), [x], "int", size=size, finite=True)


def reduction(kind: str) -> Maker:
    def make(c: Context, depth: int) -> Term:
        return vectors.reduction(c, kind, depth)

    return make


def place(c: Context, depth: int) -> Term:
    """The place of an extreme element, how many hold, a length."""
    which = c.rng.choice(("argmin", "argmax", "count", "len"))
    x = vectors.any_vector(c, "bool" if which == "count" else c.rng.choice(("int", "real")), depth)
    return call(which, [x], "int", size=50, finite=True)


def int_draw(c: Context, depth: int) -> Term:
    return draws.integer(c, depth) if c.may_draw else integer(c, depth)


INTEGERS: list[tuple[float, Maker]] = [
    (5, arithmetic("int")),
    (2, quotient),
    (1, fold),
    (0.7, int_power),
    (1, sign_or_size("int")),
    (1.2, extremum("int")),
    (1, clip("int")),
    (1, rounding),
    (1.2, reduction("int")),
    (1, place),
    (1.2, chosen("int")),
    (1.5, element("int")),
    (0.7, defined("int")),
    (1.5, int_draw),
]

# ------------------------------------------------------------------------------ reals


def real(c: Context, depth: int) -> Term:
    if depth <= 0 or c.chance(0.15):
        known = c.readable(("real", "real", "int"), ())
        return c.rng.choice(known) if known and c.chance(0.75) else literal(c)
    return limited(pick(c, REALS, depth))


def literal(c: Context) -> Term:
    if c.chance(0.3):
        top = number(c.rng.randint(1, 5))
        bottom = number(c.rng.choice((2, 3, 4, 10)))
        return infix(top, "/", bottom, "real", size=3)
    return number(c.rng.choice((0.5, 0.25, 1.5, -0.5, 0.1, 2.0, 0.0, 1e-3)))


def division(c: Context, depth: int) -> Term:
    left = mixed(c, "real", depth)
    if c.chance(0.75):
        return infix(left, "/", number(c.rng.choice((2, 3, 4, 10, 0.5, -3))), "real", size=left.size * 2)
    right = mixed(c, "real", depth)
    op = c.rng.choice(("/", "/", "//", "%"))
    real_right = right if op == "/" or right.kind == "real" else number(0.75)
    return infix(left, op, real_right, "real", size=1e6, finite=False)


def root(c: Context, depth: int) -> Term:
    x = mixed(c, "real", depth)
    inside = x if c.chance(0.3) else call("abs", [x], x.kind, size=x.size)
    return call("sqrt", [inside], "real", size=x.size + 1, finite=inside is not x and x.finite)


def smooth(c: Context, depth: int) -> Term:
    """The functions that are right to the last digit only."""
    which = c.rng.choice(("exp", "log", "sin", "cos", "tan", "tanh", "asinh", "atan2", "norm2", "**"))
    x = mixed(c, "real", depth)
    if which == "norm2":
        v = vectors.any_vector(c, "real", depth)
        if v.size < 2**28:  # squares fit into 64 bits
            return call("norm2", [v], "real", size=v.size * 8)
        which = "asinh"
    if which == "atan2":
        return call("atan2", [x, mixed(c, "real", depth)], "real", size=4)
    if which == "**":
        return infix(x, "**", number(c.rng.choice((2, 0.5, -1, 3, 1.5))), "real", size=1e9, finite=False)
    bounded = which in ("sin", "cos", "tanh") or (which == "exp" and x.size < 10)
    return call(which, [x], "real", size={"exp": 3e4, "asinh": 800}.get(which, 10), finite=bounded and x.finite)


def awkward(c: Context, depth: int) -> Term:
    """Powers of ints, infinities and what becomes of them."""
    if c.chance(0.5):
        base = integer(c, depth)
        exponent = integer(c, depth)
        if exponent.size <= 20 and base.size <= 20:
            return infix(base, "**", exponent, "real", size=1e9, finite=False)
    return Term(c.rng.choice(("inf", "pi", "-inf")), "real", level=7, size=1e9, finite=False)


def real_draw(c: Context, depth: int) -> Term:
    return draws.real(c, depth) if c.may_draw and not c.bounded else real(c, depth)


REALS: list[tuple[float, Maker]] = [
    (5, arithmetic("real")),
    (2.5, division),
    (0.7, root),
    (1, smooth),
    (0.3, awkward),
    (1, sign_or_size("real")),
    (1, extremum("real")),
    (1, clip("real")),
    (1, reduction("real")),
    (1.2, chosen("real")),
    (1.5, element("real")),
    (0.7, defined("real")),
    (2, real_draw),
]
