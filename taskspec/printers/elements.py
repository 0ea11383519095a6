"""How many axes an expression has, and its element at indices, with the indices on its leaves.

The axes of names are those of the built task (`Notation.axes`), the axes of functions those of the operator table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from taskspec.lang import syntax as s
from taskspec.lang.dists import DISTS, is_distribution
from taskspec.lang.operators import FUNCTIONS
from taskspec.printers import tree as m
from taskspec.printers.names import Writer
from taskspec.printers.rewrites import renamed

_LETTERS = "ijkmlnrqu"


def rank(w: Writer, expr: s.Expr) -> int:
    """Return the number of axes of an expression: 0 for a number or a condition, 1 for a vector, 2 for a matrix."""
    match expr:
        case s.Name():
            return _axes_of_name(w, expr)
        case s.Call():
            return _axes_of_call(w, expr)
        case s.Subscript():
            slices = sum(isinstance(i, s.Slice) for i in expr.indices)
            if not _is_known(w, expr.value):
                return slices
            picked = sum(_picked_axes(w, i) for i in expr.indices)
            return max(rank(w, expr.value) - len(expr.indices) + slices, 0) + picked
        case s.Vector(items=items):  # a single element is written like a number
            return _widest(w, items) + (len(items) > 1 or any(isinstance(i, s.Vector) for i in items))
        case s.Comprehension(is_set=False, element=inner):
            return 1 + rank(under(w, expr), inner)
        case s.Compare(rest=((op, _),)) if op in ("in", "not in"):
            return 0
        case s.Weights() | s.Table():
            return _widest(w, list(s.alternatives(expr)))
        case s.Unary() | s.Binary() | s.Logical() | s.Compare() | s.IfElse() | s.Piecewise():
            return _widest(w, m.children(expr))
        case _:
            return 0


def _widest(w: Writer, parts: Sequence[s.Expr]) -> int:
    return max((rank(w, part) for part in parts), default=0)


def _axes_of_name(w: Writer, name: s.Name) -> int:
    known = w.notation.axes.get(name.id)
    if known is not None:
        return known
    if name.id in w.notation.lengths:
        return 1
    # where nothing is known of a name, what is added up or counted is taken for a vector
    return int(name.id not in w.notation.symbols and not name.primed and w.notation.label(name.id, w.of) is None)


def _axes_of_call(w: Writer, call: s.Call) -> int:
    if is_distribution(call.function):
        return _axes_of_distribution(w, call)
    if call.function in ("fold", "scan"):
        return _widest(w, call.args[1:2]) + (call.function == "scan")
    function = FUNCTIONS.get(call.function)
    if function is not None and function.accepts(len(call.args)):
        return function.axes([rank(w, a) for a in call.args])
    if call.function not in w.notation.bodies:
        return 0
    arguments, body = w.notation.bodies[call.function]
    return rank(w.with_axes({name: rank(w, a) for name, a in zip(arguments, call.args, strict=False)}), body)


def _axes_of_distribution(w: Writer, call: s.Call) -> int:
    """Return the number of axes of a distribution, by its `shape` or its parameters."""
    given = dict(call.keywords)
    shape = given.pop("shape", None)
    if shape is not None:
        return len(shape.items) if isinstance(shape, s.Vector) else 1
    dist = DISTS.get(call.function)
    if dist is not None and not dist.shaped:
        return 1
    values: list[s.Expr] = []
    for a in call.args:
        values += a.items if isinstance(a, s.SetOf) else s.alternatives(a)
    if dist is None:  # values with their probabilities, or probabilities alone
        return _widest(w, [v for v in values if v not in call.args])
    return _widest(w, [*values, *given.values()])


def _picked_axes(w: Writer, index: s.Expr | s.Slice) -> int:
    """Return the axes of an index: a vector of indices picks several rows."""
    return 0 if isinstance(index, s.Slice) or not _is_known(w, index) else rank(w, index)


def _is_known(w: Writer, expr: s.Expr) -> bool:
    return all(n.id in w.notation.axes for n in s.names(expr) if isinstance(n, s.Name))


def under(w: Writer, expr: s.Comprehension) -> Writer:
    """Return a writer that knows the axes of a comprehension's variables."""
    for clause in expr.clauses:
        match clause.domain:
            case s.Call(function="range"):
                axes = 0
            case s.Call(function="box"):
                axes = 1
            case s.SetOf(items=items):
                axes = _widest(w, items)
            case s.Comprehension(is_set=True, element=inner) as domain:
                axes = rank(under(w, domain), inner)
            case domain:
                axes = max(rank(w, domain) - 1, 0)
        if len(clause.targets) > 1:
            axes = 0
        w = w.with_axes(dict.fromkeys(clause.targets, axes))
    return w


def pointwise(w: Writer, expr: s.Expr) -> tuple[Writer, m.Math, s.Expr] | None:
    """Return indices and the element at them with what writes it, for a vector or a matrix; None for a single value."""
    axes = rank(w, expr)
    if axes == 0:
        return None
    own = _variable(expr)
    at = indices(w, expr, axes)
    if axes == 1 and own is not None:  # the author has named it
        at = (s.Name(own, False, expr.place),)
    inner = w.with_axes({index.id: 0 for index in at})
    return inner, m.joined(w.notation.symbol(index.id) for index in at), element(inner, expr, at)


def indices(w: Writer, expr: s.Expr, count: int = 1) -> tuple[s.Name, ...]:
    """Return letters for indices that the expression does not use, neither as a name nor as what a name looks like."""
    used = {x.id for x in s.names(expr) if isinstance(x, s.Name)} | {*s.targets(expr)} | {*w.notation.symbols}
    looks = {w.notation.symbol(name) for name in used}
    free = [i for i in _LETTERS if i not in used and m.Ident(i) not in looks]
    return tuple(s.Name(letter, False, expr.place) for letter in [*free, "ι", "κ"][:count])


def element(w: Writer, expr: s.Expr, at: tuple[s.Name, ...]) -> s.Expr:
    """Return the element of an expression at indices; a single value is the same at all of them."""
    if rank(w, expr) == 0:
        return expr
    go = partial(element, w, at=at)
    match expr:
        case s.Binary() | s.Unary() | s.Logical() | s.Compare() | s.IfElse() | s.Piecewise():
            found: s.Expr = m.mapped(expr, go)
            return found
        case s.Call(function="onehot", args=(place, _)):
            return s.Compare(at[0], (("==", place),), expr.place)
        case s.Call(function=name, args=args) if name in FUNCTIONS and not FUNCTIONS[name].whole:
            return replace(expr, args=tuple(map(go, args)))
        case s.Comprehension(element=inner) if own := _variable(expr):
            return element(w, renamed(inner, own, at[0].id), at[1:])
        case s.Subscript():
            return _entry(w, expr, at)
        case _:
            return s.Subscript(expr, at, expr.place)


def _entry(w: Writer, expr: s.Subscript, at: tuple[s.Name, ...]) -> s.Expr:
    """Return an element of a row, a column or a part; its indices go together if they are the whole's."""
    left = list(at)
    found: list[s.Expr] = []
    for index in expr.indices:
        if isinstance(index, s.Slice):
            if (index.start, index.stop, index.step) != (None, None, None):
                return s.Subscript(expr, at, expr.place)
            found.append(left.pop(0))
        elif count := _picked_axes(w, index):
            found.append(element(w, index, tuple(left[:count])))
            del left[:count]
        else:
            found.append(index)
    return replace(expr, indices=(*found, *left))


def _variable(expr: s.Expr) -> str | None:
    """Return the variable of `[e for i in range(n)]`, which is the index of its elements."""
    match expr:
        case s.Comprehension(is_set=False, clauses=(s.Clause((name,), s.Call("range", (_,)), ()),)):
            return name
        case _:
            return None
