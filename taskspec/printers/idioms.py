"""Hand-written forms that templates cannot give: sums over slices, element-wise conditions, sets, distributions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from taskspec.lang import syntax as s
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.lang.operators import INFIX
from taskspec.lang.operators.levels import Level
from taskspec.printers import piecewise
from taskspec.printers import tree as m
from taskspec.printers.notation import Writer
from taskspec.printers.pieces import Piece, applied, fill, operands

_VECTORS = frozenset({"sort", "argsort", "cumsum", "reverse", "concat", "swap", "put"})
_INDICES = "ijkmlnrqu"


# -- element by element -----------------------------------------------------------------------------------------------


def is_vector(w: Writer, expr: s.Expr) -> bool:
    """Whether an expression is a vector as far as its form tells."""
    match expr:
        case s.Name(id=name, primed=primed):
            known = name in w.notation.lengths
            return name not in w.notation.singles and (known or (name not in w.notation.symbols and not primed
                                                                 and w.notation.label(name, w.of) is None))  # fmt: skip
        case s.Call(function=name):
            return name in _VECTORS
        case s.Subscript(indices=indices):
            return any(isinstance(i, s.Slice) for i in indices)
        case s.Binary(left=a, right=b):
            return is_vector(w, a) or is_vector(w, b)
        case s.Unary(operand=a):
            return is_vector(w, a)
        case s.Compare(first=a, rest=rest):
            return is_vector(w, a) or any(is_vector(w, x) for _, x in rest)
        case _:
            return False


def element(w: Writer, expr: s.Expr, index: s.Name) -> s.Expr:
    """The element at an index of a vector expression, with the index on its leaves."""
    if not is_vector(w, expr):
        return expr
    match expr:
        case s.Binary(left=a, right=b):
            return replace(expr, left=element(w, a, index), right=element(w, b, index))
        case s.Unary(operand=a):
            return replace(expr, operand=element(w, a, index))
        case s.Compare(first=a, rest=rest):
            return replace(expr, first=element(w, a, index), rest=tuple((op, element(w, x, index)) for op, x in rest))
        case _:
            return s.Subscript(expr, (index,), expr.place)


def _index(w: Writer, expr: s.Expr) -> s.Name:
    """A letter for an index that the expression does not use, neither as a name nor as what a name looks like."""
    used = [x for x in s.names(expr) if isinstance(x, s.Name)]
    taken: set[object] = {x.id for x in used} | {w.notation.symbol(x.id) for x in used}
    letters = (i for i in _INDICES if i not in taken and m.Ident(i) not in taken)
    return s.Name(next(letters, "ι"), False, expr.place)


def _pointwise(w: Writer, expr: s.Expr) -> tuple[m.Math, s.Expr] | None:
    """An index and the element at it, for a vector that is best written element by element."""
    if not is_vector(w, expr):
        return None
    index = _index(w, expr)
    return w.notation.symbol(index.id), element(w, expr, index)


def _quantifier(sign: str, conjunction: str) -> Callable[[Writer, s.Call], Piece | None]:
    def write(w: Writer, call: s.Call) -> Piece | None:
        (arg,) = call.args
        if isinstance(arg, s.Vector):
            return (
                w.piece(s.Logical(conjunction, arg.items, call.place)) if len(arg.items) > 1 else w.truth(arg.items[0])
            )
        if isinstance(arg, s.Comprehension):
            head = m.Row((m.Sym(sign), m.joined([*_domains(w, arg), *_conditions(w, arg)])))
            return applied("quantifier", m.Row((head, m.Sym(":"), m.Gap(), w.truth(arg.element).tree)))
        found = _pointwise(w, arg)
        if found is None:
            return None
        index, inner = found
        if conjunction == "and" and isinstance(arg, s.Compare) and [op for op, _ in arg.rest] == ["=="]:
            return w.piece(arg)  # two vectors are equal
        return applied("quantifier", m.Row((m.Sym(sign), index, m.Sym(":"), m.Gap(), w.truth(inner).tree)))

    return write


def _count(w: Writer, call: s.Call) -> Piece | None:
    (arg,) = call.args
    if isinstance(arg, s.Comprehension):
        if not all(_are_distinct(clause.domain) for clause in arg.clauses):
            return _over_domains(w, arg, "∑")
        such = m.joined([*_conditions(w, arg), w.truth(arg.element).tree])
        return Piece(m.Row((m.Words("#"), m.braces(m.Row((m.joined(_domains(w, arg)), m.Sym(":"), m.Gap(), such))))))
    found = _pointwise(w, arg)
    if found is None:
        return None
    index, inner = found
    return Piece(m.Row((m.Words("#"), m.braces(m.Row((index, m.Sym(":"), m.Gap(), w.truth(inner).tree))))))


def _total(sign: str) -> Callable[[Writer, s.Call], Piece | None]:
    def write(w: Writer, call: s.Call) -> Piece | None:
        (arg,) = call.args
        ranged = _over_range(w, arg, sign) or _over_slice(w, arg, sign) or _over_name(w, arg, sign)
        if ranged is None and isinstance(arg, s.Comprehension):
            ranged = _over_domains(w, arg, sign)
        if ranged is not None:
            return ranged
        found = _pointwise(w, arg)
        if found is None:
            return None
        index, inner = found
        return _big(m.Big(sign, index), w.number(inner))

    return write


def _big(sign: m.Big, body: Piece) -> Piece:
    return applied("big", m.Row((sign, *operands("big", [body]))))


def _over_range(w: Writer, arg: s.Expr, sign: str) -> Piece | None:
    """Sum of `[e for i in range(n)]`."""
    match arg:
        case s.Comprehension(is_set=False, element=inner, clauses=(s.Clause((name,), s.Call("range", (n,)), ()),)):
            index = w.notation.symbol(name)
            low, high = m.Row((index, m.Sym("="), m.Num("0"))), less_one(w, n)
            return _big(m.Big(sign, low, high), w.number(inner))
        case _:
            return None


def _over_domains(w: Writer, arg: s.Comprehension, sign: str) -> Piece:
    """Sum of any other comprehension: one term for each value of its variables, equal ones included."""
    return _big(m.Big(sign, m.joined([*_domains(w, arg), *_conditions(w, arg)])), w.number(arg.element))


def _over_slice(w: Writer, arg: s.Expr, sign: str) -> Piece | None:
    """Sum of `x[a:b]`, where the end can be told."""
    match arg:
        case s.Subscript(value=s.Name() as name, indices=(s.Slice(start=start, stop=stop, step=None),)):
            end = stop if stop is not None else w.notation.lengths.get(name.id)
            if end is None or name.id in w.notation.singles:
                return None
            index = _index(w, s.Vector((name, end, start or end), arg.place))
            first = m.Num("0") if start is None else w.number(start).tree
            low = m.Row((w.notation.symbol(index.id), m.Sym("="), first))
            return _big(m.Big(sign, low, less_one(w, end)), w.piece(s.Subscript(name, (index,), arg.place)))
        case _:
            return None


def _over_name(w: Writer, arg: s.Expr, sign: str) -> Piece | None:
    if not isinstance(arg, s.Name) or arg.id not in w.notation.lengths:
        return None
    everything = s.Subscript(arg, (s.Slice(None, None, None, arg.place),), arg.place)
    return _over_slice(w, everything, sign)


def _extreme(name: str) -> Callable[[Writer, s.Call], Piece | None]:
    def write(w: Writer, call: s.Call) -> Piece | None:
        found = _pointwise(w, call.args[0]) or _row_of(w, call.args[0])
        if found is None:
            return None
        index, inner = found
        head = m.Script(m.upright(name), index)
        return applied("extreme", m.Row((head, m.Gap(), *operands("extreme", [w.number(inner)]))))

    return write


def _row_of(w: Writer, expr: s.Expr) -> tuple[m.Math, s.Expr] | None:
    """A row of a matrix, `x[i]`, as a vector."""
    match expr:
        case s.Subscript(value=s.Name(id=name), indices=indices) if name in w.notation.lengths:
            index = _index(w, expr)
            return w.notation.symbol(index.id), replace(expr, indices=(*indices, index))
        case _:
            return None


def _where(w: Writer, call: s.Call) -> Piece | None:
    if len(call.args) != 3:
        return None
    test, then, otherwise = call.args
    return w.piece(s.IfElse(test, then, otherwise, call.place))


def _range(w: Writer, call: s.Call) -> Piece | None:
    match call.args:
        case (stop,):
            return Piece(interval(m.Num("0"), less_one(w, stop)))
        case (start, stop):
            return Piece(interval(w.number(start).tree, less_one(w, stop)))
        case _:
            return None  # it has a step


def _box(w: Writer, call: s.Call) -> Piece | None:
    if len(call.args) != 3:
        return None
    low, high, n = (w.number(a).tree for a in call.args)
    return Piece(m.Script(interval(low, high), sup=n))


def _joined(w: Writer, call: s.Call) -> Piece:
    """One list of all that is joined: the elements of lists that are written out, and what nested calls join."""
    return w.piece(s.Vector(tuple(_parts(w, call.args)), call.place))


def _parts(w: Writer, parts: Iterable[s.Expr]) -> Iterator[s.Expr]:
    for part in parts:
        match part:
            case s.Call(function="concat", args=inner):
                yield from _parts(w, inner)
            case s.Vector(items=items) if not any(isinstance(x, s.Comprehension) or is_vector(w, x) for x in items):
                yield from items
            case _:
                yield part


IDIOMS: dict[str, Callable[[Writer, s.Call], Piece | None]] = {
    "any": _quantifier("∃", "or"), "all": _quantifier("∀", "and"), "count": _count,
    "sum": _total("∑"), "prod": _total("∏"), "argmax": _extreme("arg max"), "argmin": _extreme("arg min"),
    "where": _where, "range": _range, "box": _box, "concat": _joined,
}  # fmt: skip


# -- numbers and sets -------------------------------------------------------------------------------------------------


def less_one(w: Writer, n: s.Expr) -> m.Math:
    """n - 1, worked out where n is a number or already ends in a number."""
    match n:
        case s.Number(value=int(value)) if value > 0:
            return m.Num(str(value - 1))
        case s.Binary(op="+", left=left, right=s.Number(value=1)):
            return w.number(left).tree
        case _:
            one = s.Number(1, "1", n.place)
            return w.number(s.Binary("-", n, one, n.place)).tree


def interval(low: m.Math, high: m.Math) -> m.Math:
    """The integers from low to high; few of them are written out."""
    try:
        first, last = (int(str(getattr(x, "text", "?"))) for x in (low, high))
    except ValueError:
        return m.braces(m.joined((low, m.Sym("…"), high)))
    if last - first > 3:
        return m.braces(m.joined((low, m.Sym("…"), high)))
    return m.braces(m.joined(m.Num(str(i)) for i in range(first, last + 1)))


def comprehension(w: Writer, expr: s.Comprehension) -> m.Math:
    """A set-builder; a vector's comprehension as a family with its index below."""
    targets, domains, conditions = [_target(w, c) for c in expr.clauses], _domains(w, expr), _conditions(w, expr)
    inner = w.number(expr.element).tree
    if not expr.is_set:
        return m.Script(m.brackets(inner), m.joined([*domains, *conditions]))
    if len(targets) == 1 and targets[0] == inner:
        if not conditions:
            return w.piece(expr.clauses[0].domain).tree
        return m.braces(m.Row((domains[0], m.Sym(":"), m.Gap(), m.joined(conditions))))
    return m.braces(m.Row((inner, m.Sym(":"), m.Gap(), m.joined([*domains, *conditions]))))


def _domains(w: Writer, expr: s.Comprehension) -> list[m.Math]:
    """Where the variables of a comprehension go."""
    sets = operands("domain", (w.piece(c.domain) for c in expr.clauses))
    return [m.Row((_target(w, c), m.Sym("∈"), domain)) for c, domain in zip(expr.clauses, sets, strict=True)]


def _conditions(w: Writer, expr: s.Comprehension) -> list[m.Math]:
    return [w.truth(x).tree for c in expr.clauses for x in c.conditions]


def _are_distinct(domain: s.Expr) -> bool:
    """Whether a variable goes to no value twice, so that values can be counted in its place."""
    match domain:
        case s.Call(function="range" | "box") | s.SetOf() | s.Comprehension(is_set=True):
            return True
        case _:
            return False


def _target(w: Writer, clause: s.Clause) -> m.Math:
    names = [w.notation.symbol(name) for name in clause.targets]
    return names[0] if len(names) == 1 else m.brackets(m.joined(names))


def divisible(w: Writer, expr: s.Compare) -> m.Math | None:
    """`x % n == 0` as a congruence."""
    match expr:
        case s.Compare(first=s.Binary(op="%", left=x, right=n), rest=(("==" | "!=" as op, s.Number(value=0)),)):
            sign = m.Sym("≡") if op == "==" else m.Sym("≢")
            left, right = operands("congruence", [w.number(x), w.number(n)])
            modulus = m.brackets(m.Row((m.upright("mod"), m.Gap(), right)))
            return m.Row((left, sign, m.Num("0"), m.Gap("thin"), m.Gap("thin"), modulus))
        case _:
            return None


# -- distributions ----------------------------------------------------------------------------------------------------


def distribution(w: Writer, call: s.Call) -> Piece:
    """A distribution by name; independent draws of one shape as a power."""
    first = call.args[0] if len(call.args) == 1 and not call.keywords else None
    if call.function == CATEGORICAL.name and isinstance(first, s.Weights):
        return applied("cases", piecewise.cases(w, first))
    if call.function == "Uniform" and isinstance(first, s.SetOf | s.Comprehension):
        return Piece(m.Row((m.upright("Unif"), w.piece(first).tree)))
    dist = DISTS.get(call.function, CATEGORICAL)
    given = dict(zip((a.name for a in dist.arguments), call.args, strict=False)) | dict(call.keywords)
    shape = given.pop("shape", None)
    trees = operands(dist.name, (_argument(w, given.get(a.name), a.default) for a in dist.arguments))
    holes = dict(zip((a.name for a in dist.arguments), trees, strict=True))
    if call.function == "UniformInt":  # a few integers are written out
        tree: m.Math = m.Row((m.upright("Unif"), interval(holes["low"], holes["high"])))
    else:
        tree = fill(dist.latex, holes.items())
    return Piece(tree) if shape is None else applied("**", m.Script(m.row(tree), sup=_shape(w, shape)))


def _argument(w: Writer, expr: s.Expr | None, default: int | None) -> Piece:
    return Piece(m.Num(str(default))) if expr is None else w.number(expr)


def _shape(w: Writer, shape: s.Expr) -> m.Math:
    items = shape.items if isinstance(shape, s.Vector) else (shape,)
    return m.joined((w.number(i).at(Level.ATOM if len(items) > 1 else Level.SCOPE) for i in items), "×")


assert {"==", "!="} <= INFIX.keys()
