"""Values with alternatives: branches, outcomes of draws, and decision tables."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

from taskspec.base.limits import limits
from taskspec.base.records import dataclass
from taskspec.lang import scope as basechecker
from taskspec.lang import syntax as s
from taskspec.lang.dists import is_distribution
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import BaseChecker, FunctionDef, Lazy, Poisoned, Scope, Value, check_comparable, numbered
from taskspec.lang.types import BOOLEAN_LABELS, Domain, Kind, Refused, Shape, Type

# ---------- alternatives
# Values with alternatives: branches, cells of tables, outcomes of draws, and those that parameters exclude.


def excluded_by_parameters(conditions: Sequence[tuple[s.Expr, Node]], scope: Scope) -> list[bool]:
    """Return whether each alternative is excluded by conditions known once parameters are; the last is what is left
    without them.
    """
    found = []
    decided = False
    for expr, node in conditions:
        known = isinstance(node, Const) and not basechecker.varies(expr, scope)
        found.append(decided or (known and not node.value))  # type: ignore[union-attr]
        decided |= known and node.value  # type: ignore[union-attr]
    return [*found, decided]


def excluded_value(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> Value | None:
    """Return the value of an excluded alternative; None where it has none, and draws nothing that would take random words."""
    with checker.lenient(), checker.builder.written() as made:
        found = checker.check(expr, scope, want)
    if found is None and (made or _draws(checker, expr, scope, set())):
        return checker.value(expr, scope, want)
    return found


def _draws(checker: BaseChecker, expr: s.Expr, scope: Scope, known: set[str]) -> bool:
    """Return whether something is drawn in an expression, or in what it names."""
    with checker.builder.written(apart=True) as made:
        for part in s.below(expr):
            if isinstance(part, s.Weights) or (isinstance(part, s.Call) and is_distribution(part.function)):
                return True
            if not isinstance(part, s.Name | s.Call):
                continue
            binding = scope.lookup(part.written if isinstance(part, s.Name) else part.function)
            match binding:
                case Lazy() if isinstance(part, s.Name):
                    _resolve(binding, part)
                case FunctionDef(name=name, body=body, scope=own) if name not in known:
                    if _draws(checker, body, own, {*known, name}):
                        return True
    return bool(made)


def _resolve(binding: Lazy, at: s.Name) -> None:
    try:
        binding.resolve(at)
    except Poisoned:
        return


# One of several values is taken: branches, cells of a table, outcomes of a draw. All are of one choice, or all numbers.


def select(
    checker: BaseChecker,
    branches: Iterable[tuple[s.Expr, s.Expr]],
    otherwise: s.Expr,
    scope: Scope,
    want: Domain | None,
) -> Value:
    """Return the first branch whose condition holds; one that parameters exclude may be without a value."""
    branches = tuple(branches)
    where = partial(_where, checker, branches, otherwise, scope) if want is None else None
    conditions = checker.each([partial(checker.condition, c, scope, where) for c, _ in branches])
    exprs = [*(e for _, e in branches), otherwise]
    without = excluded_by_parameters([(c, node) for (c, _), node in zip(branches, conditions, strict=True)], scope)
    jobs = [
        partial(excluded_value if no else _value, checker, e, scope, w)
        for e, w, no in zip(exprs, wanted(exprs, scope, want), without, strict=True)
    ]
    found = [(v, e, c) for v, e, c in zip(checker.each(jobs), exprs, [*conditions, None], strict=True) if v is not None]
    nodes, domain = unify(checker, [v for v, _, _ in found], [e for _, e, _ in found], want)
    result = nodes[-1]  # where that of `otherwise` is missing, a condition above holds
    for (_, _, condition), node in zip(reversed(found[:-1]), reversed(nodes[:-1]), strict=True):
        result = _either(checker, condition, node, result)
    return Value(result, domain)


def _where(
    checker: BaseChecker, branches: Sequence[tuple[s.Expr, s.Expr]], otherwise: s.Expr, scope: Scope, shape: Shape
) -> str | None:
    """Return how one of two numbers is chosen for each element, where the condition is of some shape; None where
    that is impossible.
    """
    condition, then = branches[0]
    found = [checker.check(e, scope) for e in (then, otherwise)]
    if len(branches) > 1 or any(v is None or v.domain or v.node.type.shape not in ((), shape) for v in found):
        return None
    each = f"`where({', '.join(e.place.written for e in (condition, then, otherwise))})`"
    return f"{each} chooses element by element; `all(...)` or `any(...)` makes one condition of several"


def _value(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> Value | None:
    return checker.value(expr, scope, want)


def _either(checker: BaseChecker, condition: Node | None, node: Node, otherwise: Node) -> Node:
    """Return one of two values. Between vectors of different shapes a condition decides when the task is built, or
    it is an error.
    """
    assert condition is not None  # that is `otherwise`, the last one
    shapes = {node.type.shape, otherwise.type.shape}
    if isinstance(condition, Const) and len(shapes - {()}) == 2:
        return node if condition.value else otherwise
    return checker.builder.apply("where", condition, node, otherwise)


def alternative_values(checker: BaseChecker, exprs: Sequence[s.Expr], scope: Scope, want: Domain | None) -> list[Value]:
    """Return the values of alternatives."""
    wants = wanted(exprs, scope, want)
    return checker.each([partial(checker.value, e, scope, w) for e, w in zip(exprs, wants, strict=True)])


def wanted(exprs: Sequence[s.Expr], scope: Scope, want: Domain | None) -> list[Domain | None]:
    """Return the domain in which each of several alternatives finds its labels.

    That is `want`, if something is wanted; else bare labels mean what the first component among the others makes of them.
    """
    if want is not None or len(exprs) < 2:
        return [want] * len(exprs)
    parts = [tuple(s.alternatives(e)) for e in exprs]
    beside = next((d for group in parts for part in group if (d := domain_of(part, scope)) is not None), None)
    return [beside if all(_is_label(part, scope) for part in group) else None for group in parts]


def domain_of(expr: s.Expr, scope: Scope) -> Domain | None:
    """Return the domain of a choice that is named."""
    binding = scope.lookup(expr.written) if isinstance(expr, s.Name) else None
    return binding.domain if isinstance(binding, Value | Lazy) else None


def _is_label(expr: s.Expr, scope: Scope) -> bool:
    return isinstance(expr, s.Quoted) or (isinstance(expr, s.Name) and scope.lookup(expr.written) is None)


def unify(
    checker: BaseChecker, values: Sequence[Value], exprs: Sequence[s.Expr], want: Domain | None = None
) -> tuple[list[Node], Domain | None]:
    """Return nodes of alternatives that may stand for each other: all of one choice, or all numbers.

    Beside numbers, labels of another choice than is wanted are refused (E306): as numbers they would pass for its positions.
    """
    domains = {v.domain for v in values}
    if len(domains) == 1:
        return [v.node for v in values], values[0].domain
    if want is not None and want.values is None and want in domains:
        return [_labelled(checker, v, e, want) for v, e in zip(values, exprs, strict=True)], want
    for value, expr in zip(values, exprs, strict=True):
        if value.domain != want:
            _comparable(checker, value, expr, want)
    return [checker.number_of(v) for v in values], None


def _comparable(checker: BaseChecker, value: Value, expr: s.Expr, want: Domain | None) -> None:
    try:
        check_comparable(value.domain, want)
    except Refused as refused:
        checker.fail(refused.code, expr, refused.message, refused.hint)


def _labelled(checker: BaseChecker, value: Value, expr: s.Expr, want: Domain) -> Node:
    try:
        return numbered(checker, value, expr, want)
    except Refused as refused:
        checker.fail(refused.code, expr, refused.message, refused.hint)


# ---------- tables
# Probability rows (`{value: p, ...}`) and decision tables (`by:`/`rows:`) as core nodes.
#
# A table whose cells are constants becomes one look-up in a constant array; a table of probability rows becomes one
# draw whose probabilities are looked up; anything else becomes a chain of selects, first row first.

TOLERANCE = 1e-9
"""How far a row of floating-point probabilities may be from 1; rows of fractions must sum to 1 exactly."""


def check_row(checker: BaseChecker, p: Node, expr: s.Expr) -> None:
    """Refuse a constant row of probabilities that is not a distribution."""
    if not isinstance(p, Const):
        return
    problem = row_problem(p.flat)
    if problem is not None:
        checker.fail(*problem[:1], expr, *problem[1:])


def row_problem(row: Sequence[Any]) -> tuple[str, str] | None:
    """Code and message for a row that is not a distribution, or None."""
    for value in row:
        if not 0 <= value <= 1:
            return "E402", f"{_shown(value)} is not a probability; it must be between 0 and 1"
    total = sum(row)
    exact = all(isinstance(v, Fraction) or v in (0, 1) for v in row)
    if (exact and total != 1) or not abs(total - 1) <= _rounding(row):
        return "E401", f"these probabilities sum to {_shown(total)}, not 1"
    return None


def _rounding(row: Sequence[Any]) -> float:
    """Return how far from 1 a row may be: shares that were drawn in float32, as Dirichlet draws them, add up to it
    that nearly.
    """
    single = all(struct.unpack("f", struct.pack("f", value))[0] == value for value in row)
    return max(TOLERANCE, len(row) * 2**-24) if single else TOLERANCE


def _shown(value: Fraction | float) -> str:
    return f"{float(value):.10g}" + (f" ({value})" if isinstance(value, Fraction) and value.denominator != 1 else "")


@dataclass(frozen=True, slots=True)
class _WeightedValues:
    """A cell: its values and their probabilities (one value with probability 1 when nothing is drawn)."""

    values: list[Value]
    exprs: list[s.Expr]
    p: list[Node]


def weighted(checker: BaseChecker, expr: s.Weights, scope: Scope, want: Domain | None) -> Value:
    """Return a value drawn with the probabilities written beside each."""
    outcomes = _outcomes(checker, expr, scope, want)
    nodes, domain = unify(checker, outcomes.values, outcomes.exprs, want)
    _same_shape(checker, nodes, expr)
    b = checker.builder
    index = b.draw("categorical", (b.structure("vector", outcomes.p),), Type(Kind.INT))
    return Value(b.structure("index", [b.structure("vector", nodes), index]), domain)


def _outcomes(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> _WeightedValues:
    if not isinstance(expr, s.Weights):
        return _WeightedValues([checker.value(expr, scope, want)], [expr], [checker.builder.const(1, Type(Kind.REAL))])
    if scope.draws is not None:
        checker.fail("E311", expr, f"values with probabilities are a random draw; {scope.draws}")
    exprs = [value for value, _ in expr.pairs]
    values = alternative_values(checker, exprs, scope, want)
    p = [checker.builder.cast(n, Kind.REAL) for n in checker.numerics([q for _, q in expr.pairs], scope)]
    for node, (_, q) in zip(p, expr.pairs, strict=True):
        if not node.type.is_scalar:
            checker.fail("E307", q, "a probability is a single number")
    check_row(checker, checker.builder.structure("vector", p), expr)
    return _WeightedValues(values, exprs, p)


def _same_shape(checker: BaseChecker, nodes: Sequence[Node], expr: s.Expr) -> None:
    shapes = sorted({n.type.shape for n in nodes})
    if len(shapes) > 1:
        checker.fail(
            "E307",
            expr,
            f"these values have different shapes: {' and '.join(str(list(x)) for x in shapes)}",
        )


# -- decision tables ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Column:
    """A `by:` entry: its node, its domain if it is a choice, and the finite range of its values (None if endless).

    `ends` are its least and its greatest value by declaration. A row for a value beyond them is a mistake; one for a value
    that merely does not come up is none, since that may depend on parameters.
    """

    expr: s.Expr
    node: Node
    domain: Domain | None
    values: range | None
    ends: tuple[float, float]

    def shown(self, value: int) -> str:
        if self.domain is not None:
            return self.domain.labels[value]
        return BOOLEAN_LABELS[value] if self.node.type.kind is Kind.BOOL else str(value)


_Leaf = tuple[tuple["_Key", ...], s.Expr]
_Key = int | None  # the value of one column, None for `else` or a cell that spans it


def table(checker: BaseChecker, expr: s.Table, scope: Scope, want: Domain | None) -> Value:
    """Return the value of the first row that matches."""
    columns = checker.each([(lambda e=e: _column(checker, e, scope)) for e in expr.by])  # type: ignore[misc]
    leaves = _leaves(checker, expr.rows, columns, scope)
    wants = wanted([e for _, e in leaves], scope, want)
    cells = checker.each([partial(_outcomes, checker, e, scope, w) for (_, e), w in zip(leaves, wants, strict=True)])
    values = [v for cell in cells for v in cell.values]
    exprs = [e for cell in cells for e in cell.exprs]
    nodes, domain = unify(checker, values, exprs, want)
    _same_shape(checker, nodes, expr)
    taken = iter(nodes)
    outcomes = [([next(taken) for _ in cell.values], cell.p) for cell in cells]
    keys = [key for key, _ in leaves]
    grid = _grid(checker, expr, columns, keys, scope)
    return Value(_node(checker, columns, keys, outcomes, grid), domain)


def _column(checker: BaseChecker, expr: s.Expr, scope: Scope) -> _Column:
    value = checker.value(expr, scope)
    node = value.node
    if not node.type.is_scalar or node.type.kind is Kind.REAL:
        checker.fail("E306", expr, f"a table can only be looked up by choices, ints and conditions, not by {node.type}",
                     "write cases: a list of `if:`/`then:`")  # fmt: skip
    low, high = checker.builder.bounds(node)
    ends = value.ends
    if value.domain is not None:
        low, high = ends = 0, len(value.domain.labels) - 1
    elif node.type.kind is Kind.BOOL:
        ends = 0, 1
    if not high - low < limits().cells:
        return _Column(expr, node, value.domain, None, ends)
    node = checker.builder.within(node, low, high)
    return _Column(expr, node, value.domain, range(int(low), int(high) + 1), ends)


def _leaves(checker: BaseChecker, rows: Sequence[s.TableRow], columns: Sequence[_Column], scope: Scope) -> list[_Leaf]:
    """Return cells with their keys, in written order; a cell that stops early spans the columns left."""
    if not columns:
        checker.fail("E307", rows[0].body if not isinstance(rows[0].body, tuple) else _some(rows[0]),
                     "this table has more levels of rows than names in `by`")  # fmt: skip
    column = columns[0]
    rest = columns[1:]
    leaves: list[_Leaf] = []
    seen: dict[_Key, s.TableRow] = {}
    for row in rows:
        key = None if row.key is None else _key(checker, row.key, column, scope)
        if key in seen and row.key is not None:
            checker.fail("E309", row.key, f"the row '{column.shown(key or 0)}' is given twice")
        seen[key] = row
        if isinstance(row.body, tuple):
            leaves += [((key, *deeper), cell) for deeper, cell in _leaves(checker, row.body, rest, scope)]
        else:
            leaves.append(((key, *(None for _ in rest)), row.body))
    return leaves


def _some(row: s.TableRow) -> s.Expr:
    body = row.body
    while isinstance(body, tuple):
        body = body[0].body
    return body


def _key(checker: BaseChecker, expr: s.Expr, column: _Column, scope: Scope) -> int:
    value = checker.value(expr, scope, column.domain)
    node = value.node if value.domain == column.domain else checker.number_of(value)
    if not isinstance(node, Const) or not node.type.is_scalar:
        checker.fail("E312", expr, "a row of a table must be a constant")
    is_label = value.domain is not None and value.domain.values is None
    if node.type.kind is Kind.REAL or (value.domain != column.domain and (column.domain is not None or is_label)):
        checker.fail("E313", expr, f"'{node.value}' is not a value of this column", _known(column))
    if not column.ends[0] <= int(node.value) <= column.ends[1]:
        checker.fail("E313", expr, f"'{node.value}' is not a value of this column", _known(column))
    return int(node.value)


def _known(column: _Column) -> str | None:
    if column.values is None:
        return None
    shown = [column.shown(v) for v in column.values[:6]]
    return "its values are " + ", ".join(shown) + (", ..." if len(column.values) > 6 else "")


def _grid(
    checker: BaseChecker, expr: s.Table, columns: Sequence[_Column], keys: Sequence[tuple[_Key, ...]], scope: Scope
) -> list[int] | None:
    """Return for every combination of column values the number of its cell; None where the combinations are endless or many.

    A combination without a cell is reported, at the row that lacks it.
    """
    size = 1
    most = limits().cells
    for column in columns:
        size *= most + 1 if column.values is None else len(column.values)
    if size > most:
        if not _covers(keys, columns):
            message = "this table needs a last row `else:`, since its columns have infinitely many values"
            checker.fail("E410", expr, message)
        return None
    rows = {keys[n]: n for n in reversed(_by_precision(keys))}
    masks = dict.fromkeys(tuple(k is None for k in keys[n]) for n in _by_precision(keys))
    grid = []
    for values in itertools.product(*(c.values or () for c in columns)):
        asked = (tuple(None if m else v for m, v in zip(mask, values, strict=True)) for mask in masks)
        cell = next((rows[key] for key in asked if key in rows), None)
        if cell is None:
            missing = ", ".join(f"{_name(c)} = {c.shown(v)}" for c, v in zip(columns, values, strict=True))
            place = _lacking(checker, expr, columns, values, scope)
            checker.fail("E410", place, f"this table has no row for {missing}", "add the row, or `else:`")
        grid.append(cell)
    return grid


def _lacking(
    checker: BaseChecker, expr: s.Table, columns: Sequence[_Column], values: Sequence[int], scope: Scope
) -> s.Expr:
    """Return the key of the innermost row for some column values in which no row follows for the next of them, or the table."""
    place: s.Expr = expr
    rows = expr.rows
    for column, value in zip(columns, values, strict=True):
        row = next((r for r in rows if r.key is not None and _key(checker, r.key, column, scope) == value), None)
        if row is None or row.key is None or not isinstance(row.body, tuple):
            return place
        place = row.key
        rows = row.body
    return place


def _covers(keys: Sequence[tuple[_Key, ...]], columns: Sequence[_Column]) -> bool:
    """Return whether there is a cell for all values of the columns."""
    if not columns or not keys:
        return bool(keys)
    values = columns[0].values
    named: set[_Key] = {k[0] for k in keys if k[0] is not None and (values is None or k[0] in values)}
    if values is None or len(named) < len(values):
        named.add(None)  # stands for the values without a row of their own
    return all(_covers([k[1:] for k in keys if k[0] is None or k[0] == v], columns[1:]) for v in named)


def _by_precision(keys: Sequence[tuple[_Key, ...]]) -> list[int]:
    """Return rows in the order in which they are tried: a named value goes before `else`, the leftmost column first."""
    return sorted(range(len(keys)), key=lambda n: tuple(k is None for k in keys[n]))


def _name(column: _Column) -> str:
    return column.expr.written if isinstance(column.expr, s.Name) else "the column"


_Cell = tuple[list[Node], list[Node]]


def _node(
    checker: BaseChecker,
    columns: Sequence[_Column],
    keys: Sequence[tuple[_Key, ...]],
    outcomes: Sequence[_Cell],
    grid: list[int] | None,
) -> Node:
    b = checker.builder
    most = max(len(values) for values, _ in outcomes)
    if most == 1:
        return _look_up(checker, columns, keys, [values[0] for values, _ in outcomes], grid)
    zero = b.const(0, Type(Kind.REAL))
    padded = [(v + [v[-1]] * (most - len(v)), p + [zero] * (most - len(p))) for v, p in outcomes]
    values = _look_up(checker, columns, keys, [b.structure("vector", v) for v, _ in padded], grid)
    p = _look_up(checker, columns, keys, [b.structure("vector", p) for _, p in padded], grid)
    return b.structure("index", [values, b.draw("categorical", (p,), Type(Kind.INT))])


def _look_up(
    checker: BaseChecker,
    columns: Sequence[_Column],
    keys: Sequence[tuple[_Key, ...]],
    cells: Sequence[Node],
    grid: list[int] | None,
) -> Node:
    """Return the cell of the present row: a look-up in a constant array where possible, else a chain of selects."""
    b = checker.builder
    if all(c is cells[0] for c in cells) and grid is not None:
        return cells[0]
    if grid is not None and all(isinstance(c, Const) for c in cells):
        kind = max(c.type.kind for c in cells)
        rows = b.structure("vector", [b.cast(cells[n], kind) for n in grid])
        return b.structure("index", [rows, _code(checker, columns)])
    order = _by_precision(keys)
    result = cells[order[-1]]
    for number in reversed(order[:-1]):
        condition = _condition(checker, columns, keys[number])
        result = b.apply("where", condition, cells[number], result)
    return result


def _code(checker: BaseChecker, columns: Sequence[_Column]) -> Node:
    """Return the number of the present combination of column values, row-major."""
    b = checker.builder
    code: Node = b.scalar(0)
    for column in columns:
        assert column.values is not None
        digit = b.apply("sub", b.cast(column.node, Kind.INT), b.scalar(column.values.start))
        code = b.apply("add", b.apply("mul", code, b.scalar(len(column.values))), digit)
    return code


def _condition(checker: BaseChecker, columns: Sequence[_Column], key: tuple[_Key, ...]) -> Node:
    b = checker.builder
    result: Node = b.scalar(True)
    for column, value in zip(columns, key, strict=True):
        if value is not None:
            here = b.apply("eq", b.cast(column.node, Kind.INT), b.scalar(value))
            result = b.apply("and", result, here)
    return result
