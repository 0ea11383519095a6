"""Rewriting of surface syntax: names, parameters by their values, draws by letters, vectors by their elements."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import DISTS, is_distribution
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import Writer
from taskspec.show.printers.tree import mapped

MAX_POWER = 64
_EXACT: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.floordiv, "//": operator.floordiv, "%": operator.mod,
    "**": operator.pow,
}  # fmt: skip


def renamed(node: Any, old: str, new: str) -> Any:
    if isinstance(node, s.Name) and node.id == old:
        return s.Name(new, node.primed, node.place)
    return mapped(node, partial(renamed, old=old, new=new))


def substitute(node: Any, values: Mapping[str, Any]) -> Any:
    """Replace names by numbers and fold constant arithmetic."""
    if isinstance(node, s.Name):
        if node.primed or node.id not in values:
            return node
        return _literal(values[node.id], node.place) or node
    if isinstance(node, s.Comprehension):
        values = dict(values)
        for clause in node.clauses:
            for name in clause.targets:
                values.pop(name, None)
    return _fold(mapped(node, partial(substitute, values=values)))


def _literal(value: Any, place: s.Place) -> s.Expr | None:
    if isinstance(value, bool):
        return s.Boolean(value, place)
    if not isinstance(value, int | float) or value != value:
        return None
    digits = str(abs(value))
    if isinstance(value, float):
        digits = f"{abs(value):.10g}"
    number = s.Number(abs(value), digits, place)
    if value < 0:
        return s.Unary("-", number, place)
    return number


def _fold(node: Any) -> Any:
    """Compute arithmetic of two integers, and x for x * 1 and x + 0; anything else stays as written."""
    if not isinstance(node, s.Binary):
        return node
    a = _integer(node.left)
    b = _integer(node.right)
    if a is not None and b is not None:
        value = _compute(node.op, a, b)
        if value is None:
            return node
        return _literal(value, node.place)
    if (node.op, a) in (("*", 1), ("+", 0)):
        return node.right
    if (node.op, b) in (("*", 1), ("+", 0), ("-", 0)):
        return node.left
    return node


def _integer(expr: s.Expr) -> int | None:
    match expr:
        case s.Number(value=int(value)):
            return value
        case s.Unary(op="-", operand=s.Number(value=int(value))):
            return -value
        case _:
            return None


def _compute(op: str, a: int, b: int) -> int | None:
    if op in ("//", "%") and b == 0:
        return 0
    if op == "**" and not (0 <= b <= MAX_POWER and abs(a) <= 1000):
        return None
    if op == "/" and (b == 0 or a % b):
        return None
    return int(_EXACT[op](a, b))


def from_start(w: Writer, vector: s.Expr, axis: int, index: s.Expr) -> s.Expr:
    """Count an index from the start of its axis: `x[-1]` is element `len(x) - 1`."""
    match index:
        case s.Unary(op="-", operand=s.Number() as back) if back.value > 0:
            return _fold(s.Binary("-", _length(w, vector, axis), back, index.place))
        case _:
            return index


def _length(w: Writer, vector: s.Expr, axis: int) -> s.Expr:
    if axis == 0 and isinstance(vector, s.Name) and vector.id in w.notation.lengths:
        return w.notation.lengths[vector.id]
    first = s.Number(0, "0", vector.place)
    for _ in range(axis):
        vector = s.Subscript(vector, (first,), vector.place)
    return s.Call("len", (vector,), (), vector.place, vector.place)


@dataclass(frozen=True, slots=True)
class Drawn:
    """An expression whose draws have names, in a comprehension with an index, and each name with its distribution."""

    expr: s.Expr
    draws: tuple[tuple[s.Name | s.Subscript, s.Expr], ...]


def is_draw(expr: s.Expr) -> bool:
    return isinstance(expr, s.Weights) or (isinstance(expr, s.Call) and is_distribution(expr.function))


def draws(expr: s.Expr) -> bool:
    return any(map(is_draw, m.parts(expr)))


def shows_probabilities(expr: s.Expr) -> bool:
    """Test whether an expression is printed as cases with probabilities, which need no name."""
    if isinstance(expr, s.Call) and expr.function == "Categorical":
        return s.Weights in map(type, expr.args)
    return isinstance(expr, s.Weights)


def take_apart(expr: s.Expr, prefix: str = "xi") -> Drawn:
    """Name the draws inside an expression, in written order."""
    draws: list[tuple[s.Name | s.Subscript, s.Expr]] = []

    def go(node: Any, indices: tuple[str, ...] = ()) -> Any:
        if isinstance(node, s.Call) and is_distribution(node.function) and not shows_probabilities(node):
            name: s.Name | s.Subscript = s.Name(f"{prefix}_{len(draws) + 1}", False, node.place)
            if indices:
                name = s.Subscript(name, tuple(s.Name(i, False, node.place) for i in indices), node.place)
            draws.append((name, node))
            return name
        if isinstance(node, s.Comprehension):
            for clause in node.clauses:
                indices += clause.targets
        return mapped(node, partial(go, indices=indices))

    inner = go(expr)
    if len(draws) == 1:  # one draw needs no number
        name, draw = draws[0]
        return Drawn(renamed(inner, f"{prefix}_1", prefix), ((renamed(name, f"{prefix}_1", prefix), draw),))
    return Drawn(inner, tuple(draws))


_LETTERS = "ijkmlnrqu"


def rank(w: Writer, expr: s.Expr) -> int:
    """Count the axes of an expression: 0 for a number or a condition, 1 for a vector, 2 for a matrix."""
    match expr:
        case s.Name():
            return _axes_of_name(w, expr)
        case s.Call():
            return _axes_of_call(w, expr)
        case s.Subscript():
            slices = list(map(type, expr.indices)).count(s.Slice)
            if not _is_known(w, expr.value):
                return slices
            picked = sum(map(partial(_picked_axes, w), expr.indices))
            return max(rank(w, expr.value) - len(expr.indices) + slices, 0) + picked
        case s.Vector(items=items):  # a single element is written like a number
            return _widest(w, items) + (len(items) > 1 or s.Vector in map(type, items))
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
    return max(map(partial(rank, w), parts), default=0)


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
        return function.axes(list(map(partial(rank, w), call.args)))
    if call.function not in w.notation.bodies:
        return 0
    arguments, body = w.notation.bodies[call.function]
    ranks = {}
    for name, a in zip(arguments, call.args, strict=False):
        ranks[name] = rank(w, a)
    return rank(w.with_axes(ranks), body)


def _axes_of_distribution(w: Writer, call: s.Call) -> int:
    given = dict(call.keywords)
    shape = given.pop("shape", None)
    if isinstance(shape, s.Vector):
        return len(shape.items)
    if shape is not None:
        return 1
    dist = DISTS.get(call.function)
    if dist is not None and not dist.shaped:
        return 1
    values: list[s.Expr] = []
    for a in call.args:
        if isinstance(a, s.SetOf):
            values += a.items
        else:
            values += s.alternatives(a)
    if dist is None:  # values with their probabilities, or probabilities alone
        return _widest(w, [v for v in values if v not in call.args])
    return _widest(w, [*values, *given.values()])


def _picked_axes(w: Writer, index: s.Expr | s.Slice) -> int:
    """Axes of an index: a vector of indices picks several rows."""
    if isinstance(index, s.Slice) or not _is_known(w, index):
        return 0
    return rank(w, index)


def _is_known(w: Writer, expr: s.Expr) -> bool:
    known = {*w.notation.axes, *s.targets(expr)}
    return all(n.id in known for n in s.names(expr) if isinstance(n, s.Name))


def is_vector(w: Writer, expr: s.Expr) -> bool:
    return _is_known(w, expr) and rank(w, expr) > 0


def has_conditions(w: Writer, expr: s.Expr) -> bool:
    """Test whether conditions on elements decide about a vector, so that it is written with an index."""
    if not is_vector(w, expr):
        return False
    match expr:
        case s.Compare() | s.Logical() | s.Unary(op="not"):
            return True
        case s.Call(function="where", args=(test, *_)) if is_vector(w, test):
            return True
        case s.Call(function=name, args=args) if name in FUNCTIONS and not FUNCTIONS[name].whole:
            return any(map(partial(has_conditions, w), args))
        case s.Unary() | s.Binary() | s.IfElse() | s.Piecewise():
            return any(map(partial(has_conditions, w), m.children(expr)))
        case _:
            return False


def under(w: Writer, expr: s.Comprehension) -> Writer:
    """Make a writer that knows the axes of a comprehension's variables."""
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
    """Choose indices: them, an element at them and its writer, for a vector or a matrix; None for a single value."""
    axes = rank(w, expr)
    if axes == 0:
        return None
    own = _variable(expr)
    at = indices(w, expr, axes)
    if axes == 1 and own is not None:  # the author has named it
        at = (s.Name(own, False, expr.place),)
    inner = w.with_axes({index.id: 0 for index in at})
    return inner, w.joined_names(at), element(inner, expr, at)


def broadcast(w: Writer, expr: s.Expr) -> m.Math | None:
    """Index of a component, if an expression is the one value of all its elements."""
    axes = w.notation.axes.get(w.of or "", 0)
    if not axes or w.of in w.notation.labels or not _is_known(w, expr) or rank(w, expr):
        return None
    return w.joined_names(indices(w, expr, axes))


def indices(w: Writer, expr: s.Expr, count: int = 1) -> tuple[s.Name, ...]:
    """Choose letters for indices that the expression neither names nor prints."""
    used = {*s.targets(expr), *w.notation.symbols}
    for x in s.names(expr):
        if isinstance(x, s.Name):
            used.add(x.id)
    looks = set(map(w.notation.symbol, used))
    free = []
    for letter in _LETTERS:
        if letter not in used and m.Ident(letter) not in looks:
            free.append(s.Name(letter, False, expr.place))
    for letter in "ικ":
        free.append(s.Name(letter, False, expr.place))
    return tuple(free[:count])


def element(w: Writer, expr: s.Expr, at: tuple[s.Name, ...]) -> s.Expr:
    """Element of an expression at indices; a single value is the same at all of them."""
    if rank(w, expr) == 0:
        return expr
    go = partial(element, w, at=at)
    match expr:
        case s.Binary() | s.Unary() | s.Logical() | s.Compare() | s.IfElse() | s.Piecewise():
            return m.mapped(expr, go)
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
    """Element of a row, a column or a part; its indices go together if they are the whole's."""
    left = list(at)
    entries: list[s.Expr] = []
    for index in expr.indices:
        if isinstance(index, s.Slice):
            if (index.start, index.stop, index.step) != (None, None, None):
                return s.Subscript(expr, at, expr.place)
            entries.append(left.pop(0))
        elif count := _picked_axes(w, index):
            entries.append(element(w, index, tuple(left[:count])))
            del left[:count]
        else:
            entries.append(index)
    return replace(expr, indices=(*entries, *left))


def _variable(expr: s.Expr) -> str | None:
    match expr:
        case s.Comprehension(is_set=False, clauses=(s.Clause((name,), s.Call("range", (_,)), ()),)):
            return name
        case _:
            return None
