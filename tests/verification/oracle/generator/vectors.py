"""Random vectors and matrices, and what makes single values of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from tests.verification.oracle.generator import conditions, draws, scalars
from tests.verification.oracle.generator.makers import limited
from tests.verification.oracle.generator.terms import INFINITE, Context, Shape, Term, call, infix, joined, number

Maker = Callable[[Context, str, int, int], Term]


def vector(c: Context, kind: str, shape: Shape, depth: int) -> Term:
    """A vector or matrix of a kind and shape."""
    known = c.readable((kind,), shape)
    if known and (depth <= 0 or c.chance(0.35)):
        return c.rng.choice(known)
    if len(shape) == 2:
        return matrix(c, kind, shape, depth)
    n = shape[0]
    if isinstance(n, str):
        return by_number(c, kind, n, depth)
    if depth <= 0:
        return written_out(c, kind, n, 0) if n <= 5 else comprehension(c, kind, n, 0)
    options: list[tuple[float, Maker]] = [
        (3, written_out if n <= 6 else comprehension),
        (2, comprehension),
        (3, elementwise),
        (1.5, rearranged),
        (1, replaced),
        (1, chosen),
        (0.7, put_together),
        (0.7, ordered if kind == "int" else rearranged),
        (1, of_matrix),
        (1 if c.may_draw else 0, drawn_vector),
    ]
    maker = c.rng.choices([m for _, m in options], [w for w, _ in options])[0]
    return limited(maker(c, kind, n, depth - 1))


def any_vector(c: Context, kind: str, depth: int) -> Term:
    """A vector of whatever length: of one that can be read, or a short one."""
    known = [n for n in c.names if n.kind == kind and len(n.shape) >= 1]
    if known and c.chance(0.6):
        return c.rng.choice(known)
    lengths = [n.shape for n in c.names if len(n.shape) == 1 and n.kind in ("bool", "int", "real")]
    shape: Shape = c.rng.choice(lengths) if lengths and c.chance(0.4) else (c.rng.randint(1, 3),)
    return vector(c, kind, shape, min(depth, 2))


def by_number(c: Context, kind: str, n: str, depth: int) -> Term:
    """A vector whose length is a parameter."""
    index = Term("i", "int", size=10)
    inner = scalars.term(c.with_names([index]).without_draws(), kind, (), min(depth, 1))
    return joined(f"[{inner.text} for i in range({n})]", kind, (inner,), shape=(n,), size=inner.size)


def written_out(c: Context, kind: str, n: int, depth: int) -> Term:
    parts = [scalars.term(c, kind, (), depth if i < 2 else 0) for i in range(n)]
    inside = ", ".join(p.text for p in parts)
    text = f"[{inside}]" if c.chance(0.5) else f"({inside}{',' if n == 1 else ''})"
    return joined(text, kind, parts, shape=(n,), size=max(p.size for p in parts))


def comprehension(c: Context, kind: str, n: int, depth: int) -> Term:
    """An element for each index; a draw in it is made for each of them."""
    index = Term("i", "int", size=n)
    inside = c.with_names([index]) if n <= 2 else c.with_names([index]).without_draws()
    inner = scalars.term(inside, kind, (), min(depth, 2))
    fan = min(INFINITE, inner.fan**n) if inner.fan > 1 else 1
    if n in (2, 4, 6) and c.chance(0.3):
        text = f"[{inner.text} for k in range(2) for i in range({n // 2})]"
        return replace(joined(text, kind, (inner,), shape=(n,), size=inner.size), fan=fan)
    return replace(joined(f"[{inner.text} for i in range({n})]", kind, (inner,), shape=(n,), size=inner.size), fan=fan)


def elementwise(c: Context, kind: str, n: int, depth: int) -> Term:
    left = vector(c, kind, (n,), depth)
    right = scalars.term(c, kind, (n,) if c.chance(0.5) else (), depth)
    if c.chance(0.3):
        left, right = right, left
    if kind == "bool":
        return bool_operator(c, n, left, right, depth)
    if c.chance(0.2):
        return call(c.rng.choice(("min", "max")), [left, right], kind, shape=(n,), size=max(left.size, right.size))
    if kind == "int" and c.chance(0.3):
        op = c.rng.choice(("//", "%"))
        return infix(left, op, right, kind, size=max(left.size, right.size))
    op = c.rng.choice("+-*")
    size = left.size * right.size if op == "*" else left.size + right.size
    return infix(left, op, right, kind, size=size)


def bool_operator(c: Context, n: int, left: Term, right: Term, depth: int) -> Term:
    if c.chance(0.5):
        x = vector(c, "int", (n,), depth)
        y = scalars.term(c, "int", (n,) if c.chance(0.3) else (), depth)
        of_labels = not (x.rows or y.rows)  # whether two choices are equal is one condition
        return infix(x, "<" if of_labels else c.rng.choice(conditions.RELATIONS), y, "bool", size=1)
    if left.shape == right.shape:
        return infix(left, c.rng.choice(("and", "or", "==", "!=")), right, "bool", size=1)
    inner = left if left.shape else right
    return joined(f"not {inner.at(3)}", "bool", (inner,), shape=(n,), level=3)


def rearranged(c: Context, kind: str, n: int, depth: int) -> Term:
    which = c.rng.choice(("reverse", "sort", "slice", "gather", "swap"))
    if which in ("reverse", "sort"):
        x = vector(c, kind, (n,), depth)
        return call(which, [x], kind, shape=(n,), size=x.size)
    if which == "slice":
        x = vector(c, kind, (n + 1,), depth)
        cut = c.rng.choice((":-1", "1:", f":{n}", f"-{n}:"))
        return joined(f"{x.at(9)}[{cut}]", kind, (x,), shape=(n,), level=9, size=x.size)
    if which == "gather":
        x = any_vector(c, kind, depth)
        places = vector(c, "int", (n,), depth)
        if len(x.shape) == 1 and (places.text.isidentifier() or places.text.endswith(")")):
            return joined(f"{x.at(9)}[{moving(places)}]", kind, (x, places), shape=(n,), level=9, size=x.size)
    x = vector(c, kind, (n,), depth)
    return call("swap", [x, place(c, depth), place(c, depth)], kind, shape=(n,), size=x.size)


def moving(places: Term) -> str:
    """An index that is known early must be inside the vector; one that is not may be anywhere."""
    known = places.text.isidentifier() and places.reads and places.reads <= {"state", "action"}
    return places.text if known else f"abs({places.text}) % 1"


def place(c: Context, depth: int) -> Term:
    """An index for functions that move it to the nearest place."""
    return scalars.term(c, "int", (), min(depth, 1))


def replaced(c: Context, kind: str, n: int, depth: int) -> Term:
    if kind == "int" and c.chance(0.3):
        return call("onehot", [place(c, depth), number(n)], "int", shape=(n,), size=1)
    x = vector(c, kind, (n,), depth)
    new = scalars.term(c, kind, (), depth)
    return call("put", [x, place(c, depth), new], kind, shape=(n,), size=max(x.size, new.size))


def chosen(c: Context, kind: str, n: int, depth: int) -> Term:
    x = vector(c, kind, (n,), depth)
    y = vector(c, kind, (n,), depth)
    if c.chance(0.5):
        test = vector(c, "bool", (n,), depth)
        return call("where", [test, x, y], kind, shape=(n,), size=max(x.size, y.size))
    test = conditions.condition(c, depth)
    text = f"{x.at(1)} if {test.at(1)} else {y.at(0)}"
    return joined(text, kind, (x, test, y), shape=(n,), level=0, size=max(x.size, y.size))


def put_together(c: Context, kind: str, n: int, depth: int) -> Term:
    if n == 1:
        return call("concat", [scalars.term(c, kind, (), depth)], kind, shape=(1,), size=1e3)
    first = c.rng.randint(1, n - 1)
    parts = [scalars.term(c, kind, (k,) if k > 1 or c.chance(0.5) else (), depth) for k in (first, n - first)]
    return call("concat", parts, kind, shape=(n,), size=max(p.size for p in parts))


def ordered(c: Context, kind: str, n: int, depth: int) -> Term:
    which = c.rng.choice(("argsort", "cumsum", "sign", "abs", "scan"))
    x = vector(c, "int", (n,), depth)
    if which == "scan" and c.folds and x.size < 1e6:
        return joined(f"scan(mix, {c.rng.randint(-1, 3)}, {x.text})", "int", (x,), shape=(n,), size=max(10, x.size))
    which = "abs" if which == "scan" else which
    return call(which, [x], "int", shape=(n,), size=max(n * x.size, n))


def drawn_vector(c: Context, kind: str, n: int, depth: int) -> Term:
    return draws.vector(c, kind, n, depth)


def of_matrix(c: Context, kind: str, n: int, depth: int) -> Term:
    """A column, a part, or all elements of a matrix; or what it makes of a vector."""
    which = c.rng.choice(("column", "block", "row", "product", "all"))
    if which == "all" and n % 2 == 0:
        x = matrix(c, kind, (2, n // 2), depth)
        return call("reshape", [x, number(n)], kind, shape=(n,), size=x.size)
    if which == "product" and kind != "bool" and n <= 3:
        x = matrix(c, kind, (n, 2), depth)
        y = vector(c, kind, (2,), min(depth, 1))
        args = [x, y] if c.chance(0.6) else [y, matrix(c, kind, (2, n), depth)]
        size = 2 * args[0].size * args[1].size
        if size < 2**62:
            return call("dot", args, kind, shape=(n,), size=size)
    rows, columns = (n, 2) if which == "column" else (2, n)
    known = [t for t in c.names if t.kind == kind and t.shape == (rows, columns)]
    x = c.rng.choice(known) if known else matrix(c, kind, (rows, columns), depth)
    at = subscript(c, 2)
    cut = c.rng.choice((":", "::-1", f":{n}"))
    places = f"{cut}, {at.text}" if which == "column" else f"{at.text}, {cut}"
    text = f"{x.at(9)}[{places}]"
    if which == "block":
        text = f"{x.at(9)}[{c.rng.choice(('::-1', ':1', '1:', ':'))}, {cut}][0]"
    return joined(text, kind, (x, at), shape=(n,), level=9, size=x.size)


def matrix(c: Context, kind: str, shape: Shape, depth: int) -> Term:
    rows, columns = shape
    if isinstance(rows, int) and isinstance(columns, int) and c.chance(0.3):
        return made_of(c, kind, (rows, columns), min(depth, 1))
    known = c.readable((kind,), shape)
    if known and c.chance(0.6):
        x = c.rng.choice(known)
        if kind != "bool" and c.chance(0.5):
            return infix(x, "+", scalars.term(c, kind, (), 1), kind, size=x.size + 100)
        return x
    rows = [vector(c, kind, shape[1:], min(depth, 1)) for _ in range(int(shape[0]))]
    text = f"({', '.join(r.text for r in rows)}{',' if len(rows) == 1 else ''})"
    return joined(text, kind, rows, shape=shape, size=max(r.size for r in rows))


def made_of(c: Context, kind: str, shape: tuple[int, int], depth: int) -> Term:
    """A vector in another shape, or a matrix with an element replaced."""
    if c.chance(0.5):
        x = vector(c, kind, (shape[0] * shape[1],), depth)
        return joined(f"reshape({x.text}, ({shape[0]}, {shape[1]}))", kind, (x,), shape=shape, size=x.size)
    rows = [vector(c, kind, shape[1:], depth) for _ in range(shape[0])]
    new, *places = scalars.term(c, kind, (), depth), place(c, depth), place(c, depth)
    inside = ", ".join(r.text for r in rows) + "," * (len(rows) == 1)
    text = f"put(({inside}), ({', '.join(p.text for p in places)}), {new.text})"
    return joined(text, kind, (*rows, new, *places), shape=shape, size=max(t.size for t in (*rows, new)))


# ------------------------------------------------------------------------------ single values from vectors


def element(c: Context, kind: str, depth: int) -> Term:
    known = [n for n in c.names if n.kind == kind and n.shape]
    x = vector(c, kind, (c.rng.randint(1, 3),), min(depth, 1)) if not known or c.chance(0.2) else c.rng.choice(known)
    places = [subscript(c, n) for n in x.shape]
    text = f"{x.at(9)}[{', '.join(p.text for p in places)}]"
    return joined(text, kind, (x, *places), level=9, size=x.size)


def subscript(c: Context, n: int | str) -> Term:
    """An index: a place in the vector, or something that is moved into it."""
    if isinstance(n, int) and c.chance(0.3):
        return number(c.rng.randint(-n, n - 1))
    moves = [t for t in c.readable(("int",), ()) if t.reads in ({"state"}, {"action"}) and len(t.text) == 1]
    if not moves:
        return number(0)
    name = c.rng.choice(moves)
    shifted = infix(name, c.rng.choice("-*+"), number(c.rng.randint(1, 2)), "int", size=name.size * 2 + 2)
    return c.rng.choice((name, name, shifted, joined(f"-{name.at(7)}", "int", (name,), level=7)))


def reduction(c: Context, kind: str, depth: int) -> Term:
    x = any_vector(c, kind, depth)
    lengths = [n if isinstance(n, int) else 8 for n in x.shape]
    count = lengths[0] * (lengths[1] if len(lengths) > 1 else 1)
    which = c.rng.choice(("sum", "sum", "norm1", "prod", "dot"))
    if which == "prod" and (count > 4 or x.size > 20):
        which = "sum"
    if which == "dot" and len(x.shape) == 1:
        y = vector(c, kind, x.shape, min(depth, 1))
        if x.size * y.size * count < 2**62:
            return call("dot", [x, y], kind, size=x.size * y.size * count)
    which = "sum" if which == "dot" else which
    return call(which, [x], kind, size=max(1, x.size) ** count if which == "prod" else x.size * count)
