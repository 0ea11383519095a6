"""Hand-written forms that templates cannot give: sums over slices, quantifiers, sets, distributions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from taskspec.base.named import all_names
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import CATEGORICAL, DISTS
from taskspec.language.expressions.operators.entry import Level
from taskspec.show.printers import tree as m
from taskspec.show.printers.cases import cases
from taskspec.show.printers.names import Writer
from taskspec.show.printers.pieces import Piece, applied, fill, operands
from taskspec.show.printers.rewrites import element, from_start, indices, pointwise, rank, under

Idiom = Callable[[Writer, s.Call], Piece | None]


def _quantifier(sign: str, conjunction: str) -> Idiom:
    def write(w: Writer, call: s.Call) -> Piece | None:
        (arg,) = call.args
        if isinstance(arg, s.Vector):
            if len(arg.items) == 1:
                return w.truth(arg.items[0])
            return w.piece(s.Logical(conjunction, arg.items, call.place))
        if isinstance(arg, s.Comprehension):
            truth = under(w, arg).truth(_of_elements(w, arg, call).element).tree
            return applied("quantifier", m.such_that(m.Row((m.Sym(sign), _over(w, arg))), truth))
        parts = pointwise(w, arg)
        if parts is None:
            return None
        of, index, inner = parts
        match arg:
            case s.Compare(first=first, rest=(("==", second),)) if conjunction == "and" and rank(w, first) == rank(
                w, second
            ):
                return w.piece(arg)  # two vectors are equal
        return applied("quantifier", m.Row((m.Sym(sign), *m.such_that(index, of.truth(inner).tree).items)))

    return write


def _of_elements(w: Writer, arg: s.Comprehension, call: s.Call) -> s.Comprehension:
    if not rank(under(w, arg), arg.element):
        return arg
    return replace(arg, element=replace(call, args=(arg.element,)))


def _count(w: Writer, call: s.Call) -> Piece | None:
    (arg,) = call.args
    if isinstance(arg, s.Comprehension) and rank(w, arg) > 1:
        return _total("∑")(w, replace(call, args=(_of_elements(w, arg, call),)))
    if isinstance(arg, s.Comprehension):
        if not all(_is_set(clause.domain) for clause in arg.clauses):
            return _over_domains(w, arg, "∑")
        such = m.joined([*_conditions(w, arg), under(w, arg).truth(arg.element).tree])
        return Piece(m.Row((m.Words("#"), m.braces(m.such_that(m.joined(_domains(w, arg)), such)))))
    parts = pointwise(w, arg)
    if parts is None:
        return None
    of, index, inner = parts
    if rank(w, arg) > 1:
        index = m.brackets(index)
    return Piece(m.Row((m.Words("#"), m.braces(m.such_that(index, of.truth(inner).tree)))))


def _total(sign: str) -> Idiom:
    def write(w: Writer, call: s.Call) -> Piece | None:
        (arg,) = call.args
        if isinstance(arg, s.Comprehension):
            arg = _of_elements(w, arg, call)
        match arg:
            case s.Comprehension(is_set=False, element=inner, clauses=(s.Clause((own,), s.Call("range", (n,)), ()),)):
                low = m.equal(w.notation.symbol(own), m.Num("0"))
                return _big(m.Big(sign, low, less_one(w, n)), under(w, arg).number(inner))
            case s.Comprehension():
                return _over_domains(w, arg, sign)
            case s.Subscript(value=s.Name() as vector, indices=(s.Slice(step=None) as part,)):
                ranged = _over_slice(w, vector, part, sign)
            case s.Name() if arg.id in w.notation.lengths:
                ranged = _over_slice(w, arg, s.Slice(None, None, None, arg.place), sign)
            case _:
                ranged = None
        parts = pointwise(w, arg)
        if ranged is not None or parts is None:
            return ranged
        of, index, inner = parts
        return _big(m.Big(sign, index), of.number(inner))

    return write


def _big(sign: m.Big, body: Piece) -> Piece:
    return applied("big", m.Row((sign, *operands("big", [body]))))


def _over_domains(w: Writer, arg: s.Comprehension, sign: str) -> Piece:
    return _big(m.Big(sign, _over(w, arg)), under(w, arg).number(arg.element))


def _over_slice(w: Writer, name: s.Name, part: s.Slice, sign: str) -> Piece | None:
    """Write the sum of `x[a:b]`, where its end is known."""
    end = part.stop or w.notation.lengths.get(name.id)
    if end is None or rank(w, name) != 1:
        return None
    start = from_start(w, name, 0, part.start or s.Number(0, "0", part.place))
    end = from_start(w, name, 0, end)
    (index,) = indices(w, s.Vector((name, end, start), name.place))
    low = m.equal(w.notation.symbol(index.id), w.number(start).tree)
    return _big(m.Big(sign, low, less_one(w, end)), w.piece(s.Subscript(name, (index,), name.place)))


def _extreme(name: str) -> Idiom:
    def write(w: Writer, call: s.Call) -> Piece | None:
        parts = None
        if rank(w, call.args[0]) == 1:
            parts = pointwise(w, call.args[0])
        if parts is None:
            return None  # of a matrix it is a place in all its rows, one after the other
        of, index, inner = parts
        head = m.Script(m.upright(name), index)
        return applied("extreme", m.Row((head, m.Gap(), *operands("extreme", [of.number(inner)]))))

    return write


def _where(w: Writer, call: s.Call) -> Piece | None:
    if len(call.args) != 3:
        return None
    test, then, otherwise = call.args
    parts = None
    if rank(w, test):
        parts = pointwise(w, call)
    if parts is None:
        return w.piece(s.IfElse(test, then, otherwise, call.place))
    of, index, inner = parts  # a vector as a family of its elements, with their index below
    return Piece(m.Script(m.brackets(of.number(inner).tree), index))


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
    low, high, n = w.numbers(call.args)
    return Piece(m.Script(interval(low, high), sup=n))


def _joined(w: Writer, call: s.Call) -> Piece:
    """Flatten nested `concat` calls and lists that are written out."""
    return w.piece(s.Vector(tuple(_parts(w, call.args)), call.place))


def _parts(w: Writer, parts: Iterable[s.Expr]) -> Iterator[s.Expr]:
    for part in parts:
        match part:
            case s.Call(function="concat", args=inner):
                yield from _parts(w, inner)
            case s.Vector(items=items) if all(isinstance(x, s.Vector) or not rank(w, x) for x in items):
                yield from items
            case _:
                yield part


IDIOMS: dict[str, Idiom] = {
    "any": _quantifier("∃", "or"), "all": _quantifier("∀", "and"), "count": _count,
    "sum": _total("∑"), "prod": _total("∏"), "argmax": _extreme("arg max"), "argmin": _extreme("arg min"),
    "where": _where, "range": _range, "box": _box, "concat": _joined,
}  # fmt: skip


def less_one(w: Writer, n: s.Expr) -> m.Math:
    """Write n - 1, worked out where n is a number or already ends in a number."""
    match n:
        case s.Number(value=int(value)) if value > 0:
            return m.Num(str(value - 1))
        case s.Binary(op="+", left=left, right=s.Number(value=1)):
            return w.number(left).tree
        case s.Binary(op="+" | "-" as sign, right=s.Number(value=int(value)) as right) if value:
            value += {"+": -1, "-": 1}[sign]
            return w.number(replace(n, right=replace(right, value=value, text=str(value)))).tree
        case _:
            one = s.Number(1, "1", n.place)
            return w.number(s.Binary("-", n, one, n.place)).tree


WRITTEN_OUT = 4


def interval(low: m.Math, high: m.Math) -> m.Math:
    """Write the integers from low to high; few of them are written out."""
    first = _int(low)
    last = _int(high)
    if first is not None and last is not None and last - first < WRITTEN_OUT:
        return m.braces(m.joined(m.signed(i < 0, m.Num(str(abs(i)))) for i in range(first, last + 1)))
    return m.braces(m.joined((low, m.Sym("…"), high)))


def _int(tree: m.Math) -> int | None:
    match tree:
        case m.Num(text=text) if text.isdecimal():
            return int(text)
        case m.Row(items=(m.Sym(text="−"), m.Num(text=text))) if text.isdecimal():
            return -int(text)
    return None


def comprehension(w: Writer, expr: s.Comprehension) -> m.Math:
    inner = under(w, expr).number(expr.element).tree
    if not expr.is_set:
        return m.Script(m.brackets(inner), _over(w, expr))
    if [_target(w, c) for c in expr.clauses] == [inner]:
        conditions = _conditions(w, expr)
        if not conditions:
            return w.piece(expr.clauses[0].domain).tree
        return m.braces(m.such_that(_domains(w, expr)[0], m.joined(conditions)))
    return m.braces(m.such_that(inner, _over(w, expr)))


def _over(w: Writer, expr: s.Comprehension) -> m.Math:
    return m.joined([*_domains(w, expr), *_conditions(w, expr)])


def _domains(w: Writer, expr: s.Comprehension) -> list[m.Math]:
    sets = operands("domain", (w.piece(c.domain) for c in expr.clauses))
    rows: list[m.Math] = []
    for c, domain in zip(expr.clauses, sets, strict=True):
        rows.append(m.Row((_target(w, c), m.Sym("∈"), domain)))
    return rows


def _conditions(w: Writer, expr: s.Comprehension) -> list[m.Math]:
    conditions = []
    for c in expr.clauses:
        for x in c.conditions:
            conditions.append(under(w, expr).truth(x).tree)
    return conditions


def _is_set(domain: s.Expr) -> bool:
    match domain:
        case s.Call(function="range" | "box") | s.SetOf() | s.Comprehension(is_set=True):
            return True
        case _:
            return False


def _target(w: Writer, clause: s.Clause) -> m.Math:
    return m.tupled(list(map(w.notation.symbol, clause.targets)))


def divisible(w: Writer, expr: s.Compare) -> m.Math | None:
    """Write `x % n == 0` as a congruence."""
    match expr:
        case s.Compare(first=s.Binary(op="%", left=x, right=n), rest=(("==" | "!=" as op, s.Number(value=0)),)):
            sign = m.Sym({"==": "≡", "!=": "≢"}[op])
            left, right = operands("congruence", [w.number(x), w.number(n)])
            modulus = m.brackets(m.Row((m.upright("mod"), m.Gap(), right)))
            return m.Row((left, sign, m.Num("0"), m.Gap("thin"), m.Gap("thin"), modulus))
        case _:
            return None


def distribution(w: Writer, call: s.Call) -> Piece:
    """Write a distribution by name; independent draws of one shape as a power."""
    first = None
    if len(call.args) == 1 and not call.keywords:
        first = call.args[0]
    if call.function == CATEGORICAL.name and isinstance(first, s.Weights):
        return applied("cases", cases(w, first))
    if call.function == "Uniform" and isinstance(first, s.SetOf | s.Comprehension):
        return Piece(m.Row((m.upright("Unif"), w.piece(first).tree)))
    dist = DISTS.get(call.function, CATEGORICAL)
    names = all_names(dist.arguments)
    given = dict(zip(names, call.args, strict=False)) | dict(call.keywords)
    shape = given.pop("shape", None)
    if any(rank(w, given[name]) for name in dist.squared if name in given):
        return _distributions(w, call, given)
    pieces = []
    for a in dist.arguments:
        if a.name in given:
            pieces.append(w.number(given[a.name]))
        else:
            pieces.append(Piece(m.Num(str(a.default))))
    holes = dict(zip(names, operands(dist.name, pieces), strict=True))
    if call.function == "UniformInt":  # a few integers are written out
        tree: m.Math = m.Row((m.upright("Unif"), interval(holes["low"], holes["high"])))
    else:
        tree = fill(dist.latex, holes.items())
    if shape is None:
        return Piece(tree)
    return applied("**", m.Script(tree, sup=_power(w, shape)))


def _power(w: Writer, shape: s.Expr) -> m.Math:
    if not isinstance(shape, s.Vector):
        return w.number(shape).tree
    level = Level.ATOM if len(shape.items) > 1 else Level.SCOPE
    return m.joined((w.number(item).at(level) for item in shape.items), "×")


def _distributions(w: Writer, call: s.Call, given: Mapping[str, s.Expr]) -> Piece:
    """Write a family of distributions with their index below: a matrix of deviations is squared element by element."""
    at = indices(w, call, max(rank(w, value) for value in given.values()))
    inner = w.with_axes({index.id: 0 for index in at})
    entries = []
    for name, value in given.items():
        entries.append((name, element(inner, value, at)))
    one = distribution(inner, replace(call, args=(), keywords=tuple(entries)))
    return Piece(m.Script(m.brackets(one.tree), w.joined_names(at)))
