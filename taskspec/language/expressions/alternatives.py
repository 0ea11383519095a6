"""Values with alternatives: branches, rows of probabilities (`{value: p, ...}`), and decision tables (`by:`/`rows:`).

A table whose cells are constants becomes one look-up in a constant array; a table of probability rows becomes one
draw whose probabilities are looked up; anything else becomes a chain of selects, first row first.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from taskspec.base.limits import limits
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import is_distribution
from taskspec.language.expressions.ir import Const, Node, are_constant
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.scope import (
    BaseChecker,
    FunctionDef,
    Lazy,
    Poisoned,
    Scope,
    Value,
    check_comparable,
    numbered,
    varies,
)
from taskspec.language.expressions.types import BOOLEAN_LABELS, Domain, Kind, Type

TOLERANCE = 1e-9
"""How far a row of floating-point probabilities may be from 1; rows of fractions must sum to 1 exactly."""


# -- branches -----------------------------------------------------------------------------------------------------


def select(
    checker: BaseChecker,
    branches: Sequence[tuple[s.Expr, s.Expr]],
    otherwise: s.Expr,
    scope: Scope,
    want: Domain | None,
) -> Value:
    """Choose the first branch whose condition holds; a branch that parameters exclude may be without a value."""
    conditions = checker.each(checker.condition, [(condition, scope) for condition, _ in branches])
    exprs = [*(e for _, e in branches), otherwise]
    decided = False  # by conditions that are known once parameters are
    jobs = []
    for number, (expr, domain) in enumerate(zip(exprs, wanted(exprs, scope, want), strict=True)):
        excluded = decided
        if number < len(branches):
            node = conditions[number]
            if isinstance(node, Const) and not varies(branches[number][0], scope):
                excluded = decided or not node.value
                decided = decided or node.value
        jobs.append((checker, expr, scope, domain, excluded))
    values = checker.each(_branch, jobs)
    present = []
    for v, e, c in zip(values, exprs, [*conditions, None], strict=True):
        if v is not None:
            present.append((v, e, c))
    known, theirs, under = zip(*present, strict=True)
    nodes, domain = unify(checker, known, theirs, want)
    result = nodes[-1]  # without the node of `otherwise`, a condition above holds
    for condition, node in zip(reversed(under[:-1]), reversed(nodes[:-1]), strict=True):
        assert condition is not None  # that is `otherwise`, the last one
        if isinstance(condition, Const) and len({node.type.shape, result.type.shape} - {()}) == 2:
            if condition.value:  # vectors of different shapes: decided when the task is built
                result = node
        else:
            result = checker.builder.apply("where", condition, node, result)
    return Value(result, domain)


def _branch(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None, excluded: bool) -> Value | None:
    """Value of a branch; None for an excluded one that is broken, and has no draws that would take random words."""
    if not excluded:
        return checker.value(expr, scope, want)
    with checker.lenient(), checker.builder.written() as made:
        value = checker.check(expr, scope, want)
    if value is None and (made or _draws(checker, expr, scope, set())):
        return checker.value(expr, scope, want)
    return value


def _draws(checker: BaseChecker, expr: s.Expr, scope: Scope, known: set[str]) -> bool:
    with checker.builder.written(apart=True) as made:
        for part in s.below(expr):
            if isinstance(part, s.Weights) or (isinstance(part, s.Call) and is_distribution(part.function)):
                return True
            if not isinstance(part, s.Name | s.Call):
                continue
            match scope.lookup(part.written):
                case Lazy() if isinstance(part, s.Name):
                    checker.check(part, scope)
                case FunctionDef(name=name, body=body, scope=own) if name not in known:
                    if _draws(checker, body, own, {*known, name}):
                        return True
    return bool(made)


# -- one of several values: all are of one choice, or all numbers -------------------------------------------------


def alternative_values(checker: BaseChecker, exprs: Sequence[s.Expr], scope: Scope, want: Domain | None) -> list[Value]:
    domains = wanted(exprs, scope, want)
    jobs = [(e, scope, domain) for e, domain in zip(exprs, domains, strict=True)]
    return checker.each(checker.value, jobs)


def wanted(exprs: Sequence[s.Expr], scope: Scope, want: Domain | None) -> list[Domain | None]:
    """Domain in which each of several alternatives looks up its labels.

    That is `want`, if something is wanted; else bare labels mean what the first component among the others makes of them.
    """
    if want is not None or len(exprs) < 2:
        return [want] * len(exprs)
    parts = [tuple(s.alternatives(e)) for e in exprs]
    beside = None
    for part in itertools.chain(*parts):
        if beside is None:
            beside = domain_of(part, scope)
    wants: list[Domain | None] = []
    for group in parts:
        are_labels = all(may_be_label(part, scope) for part in group)
        wants.append(beside if are_labels else None)
    return wants


def domain_of(expr: s.Expr, scope: Scope) -> Domain | None:
    """Return the choice whose labels an expression has as its value, or as its elements."""
    match expr:
        case s.Name():
            binding = scope.lookup(expr.written)
            if isinstance(binding, Value | Lazy):
                return binding.domain
        case s.Subscript(value=vector):
            return domain_of(vector, scope)
        case s.Call(function=name, args=args) if name in FUNCTIONS:
            for i in FUNCTIONS[name].moved[:1]:
                return domain_of(args[i], scope) if i < len(args) else None
    return None


def may_be_label(expr: s.Expr, scope: Scope) -> bool:
    return isinstance(expr, s.Quoted) or (isinstance(expr, s.Name) and scope.lookup(expr.written) is None)


def unify(
    checker: BaseChecker, values: Sequence[Value], exprs: Sequence[s.Expr], want: Domain | None = None
) -> tuple[list[Node], Domain | None]:
    """Convert alternatives so that they can replace each other: all of one choice, or all numbers.

    Beside numbers, labels of another choice than is wanted are refused (E306): as numbers they would pass for its positions.
    """
    domains = {v.domain for v in values}
    if len(domains) == 1:
        return [v.node for v in values], values[0].domain
    labelled = want is not None and want.values is None and want in domains
    nodes = []
    for value, expr in zip(values, exprs, strict=True):
        with checker.refusing(expr):
            if labelled and want is not None:
                nodes.append(numbered(checker, value, want))
            else:
                if value.domain != want:
                    check_comparable(value.domain, want)
                nodes.append(checker.number_of(value))
    return nodes, want if labelled else None


# -- probabilities ------------------------------------------------------------------------------------------------


def check_row(checker: BaseChecker, p: Node, expr: s.Expr) -> None:
    """Refuse a constant row of probabilities that is not a distribution (E401, E402)."""
    if not isinstance(p, Const):
        return
    row: tuple[Any, ...] = p.flat
    for value in row:
        if not 0 <= value <= 1:
            checker.fail("E402", expr, f"{_shown(value)} is not a probability; it must be between 0 and 1")
    total = sum(row)
    tolerance = TOLERANCE
    if all(isinstance(v, Fraction) or v in (0, 1) for v in row):
        tolerance = 0
    elif all(struct.unpack("f", struct.pack("f", v))[0] == v for v in row):
        tolerance = max(TOLERANCE, len(row) * 2**-24)  # shares drawn in float32, as by Dirichlet
    if not abs(total - 1) <= tolerance:
        checker.fail("E401", expr, f"these probabilities sum to {_shown(total)}, not 1")


def _shown(value: Fraction | float) -> str:
    if isinstance(value, Fraction) and value.denominator != 1:
        return f"{float(value):.10g} ({value})"
    return f"{float(value):.10g}"


_Cell = list[tuple[Value, s.Expr, Node]]
"""The values of a cell, each with its probability: one value with probability 1 where nothing is drawn."""


def weighted(checker: BaseChecker, expr: s.Weights, scope: Scope, want: Domain | None) -> Value:
    """Draw one of several values, with the probabilities written beside them."""
    values, exprs, p = zip(*_outcomes(checker, expr, scope, want), strict=True)
    nodes, domain = unify(checker, values, exprs, want)
    _check_shape(checker, nodes, expr)
    b = checker.builder
    index = b.draw("categorical", (b.structure("vector", p),), Type(Kind.INT))
    return Value(b.structure("index", [b.structure("vector", nodes), index]), domain)


def _outcomes(checker: BaseChecker, expr: s.Expr, scope: Scope, want: Domain | None) -> _Cell:
    b = checker.builder
    if not isinstance(expr, s.Weights):
        return [(checker.value(expr, scope, want), expr, b.const(1, Type(Kind.REAL)))]
    if scope.draws is not None:
        checker.fail("E311", expr, f"values with probabilities are a random draw; {scope.draws}")
    exprs = [value for value, _ in expr.pairs]
    weights = [weight for _, weight in expr.pairs]
    values = alternative_values(checker, exprs, scope, want)
    p = [b.cast(node, Kind.REAL) for node in checker.numerics(weights, scope)]
    for node, weight in zip(p, weights, strict=True):
        if not node.type.is_scalar:
            checker.fail("E307", weight, "a probability is a single number")
    check_row(checker, b.structure("vector", p), expr)
    return list(zip(values, exprs, p, strict=True))


def _check_shape(checker: BaseChecker, nodes: Sequence[Node], expr: s.Expr) -> None:
    shapes = sorted({n.type.shape for n in nodes})
    if len(shapes) > 1:
        written = " and ".join(str(list(x)) for x in shapes)
        checker.fail("E307", expr, f"these values have different shapes: {written}")


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
        if self.node.type.kind is Kind.BOOL:
            return BOOLEAN_LABELS[value]
        return str(value)


_Key = int | None  # the value of one column, None for `else` or a cell that spans it
_Keys = Sequence[tuple[_Key, ...]]


def table(checker: BaseChecker, expr: s.Table, scope: Scope, want: Domain | None) -> Value:
    """Build the value of a decision table: the first row that matches."""
    columns = checker.each(_column, [(checker, e, scope) for e in expr.by])
    if scope.draws is None:
        checker.each(_refuse_unclear, [(checker, row, columns[1:], scope, want) for row in expr.rows])
    leaves = _leaves(checker, expr.rows, columns, scope)
    cells_of = [cell for _, cell in leaves]
    domains = wanted(cells_of, scope, want)
    jobs = [(checker, e, scope, w) for e, w in zip(cells_of, domains, strict=True)]
    cells = checker.each(_outcomes, jobs)
    values, exprs, _ = zip(*itertools.chain(*cells), strict=True)
    nodes, domain = unify(checker, values, exprs, want)
    _check_shape(checker, nodes, expr)
    taken = iter(nodes)
    lookup = _Table(checker, columns, [key for key, _ in leaves], expr)
    most = max(map(len, cells))
    if most == 1:
        return Value(lookup.look_up(nodes), domain)
    b = checker.builder
    zero = b.const(0, Type(Kind.REAL))
    rows = []
    probabilities = []
    for cell in cells:
        missing = most - len(cell)
        v = list(itertools.islice(taken, len(cell)))
        rows.append(b.structure("vector", v + [v[-1]] * missing))
        probabilities.append(b.structure("vector", [p for _, _, p in cell] + [zero] * missing))
    index = b.draw("categorical", (lookup.look_up(probabilities),), Type(Kind.INT))
    return Value(b.structure("index", [lookup.look_up(rows), index]), domain)


def _column(checker: BaseChecker, expr: s.Expr, scope: Scope) -> _Column:
    value = checker.value(expr, scope)
    node = value.node
    if not node.type.is_scalar or node.type.kind is Kind.REAL:
        message = f"a table can only be looked up by choices, ints and conditions, not by {node.type}"
        checker.fail("E306", expr, message, "write cases: a list of `if:`/`then:`")
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


def _refuse_unclear(
    checker: BaseChecker, row: s.TableRow, columns: Sequence[_Column], scope: Scope, want: Domain | None
) -> None:
    """Refuse (E319) a row that ends early with what may be rows for the columns left, or a draw."""
    if not isinstance(row.body, tuple) or not columns:
        return
    checker.each(_refuse_unclear, [(checker, deeper, columns[1:], scope, want) for deeper in row.body])
    weights = _probabilities(checker, row.body, scope)
    if not weights:
        return
    for deeper in row.body:
        if deeper.key is None or not _may_be_drawn(deeper.key, weights, columns[0], scope, want):
            return
    keys = [_written(deeper.key) for deeper in row.body]
    cells = [_written(deeper.body) for deeper in row.body]
    drawn = _mapping(keys, cells)
    message = f"`{drawn}` may be a draw, or rows for the values of `{_written(columns[0].expr)}`"
    draw = "{else: " * len(columns) + drawn + "}" * len(columns)
    rows = _mapping([*keys[:-1], "else"], cells)
    name = _written(row.key)
    hint = f"the draw is written `{name}: {draw}`, the rows `{name}: {rows}`"
    checker.collector.add("E319", row.place, message, hint)
    raise Poisoned


def _mapping(keys: Sequence[str], cells: Sequence[str]) -> str:
    entries = [f"{key}: {cell}" for key, cell in zip(keys, cells, strict=True)]
    return f"{{{', '.join(entries)}}}"


def _written(part: s.Expr | tuple[s.TableRow, ...] | None) -> str:
    if part is None:
        return "else"
    assert not isinstance(part, tuple)
    return part.place.written


def _probabilities(checker: BaseChecker, rows: Sequence[s.TableRow], scope: Scope) -> list[Fraction | float]:
    """Weights of several rows if they are constants that sum to 1, as probabilities of a draw do; else none."""
    weights: list[Any] = []
    total: Any = 0
    for row in rows:
        if isinstance(row.body, tuple) or not _is_number(row.body, scope):
            return []
        if isinstance(row.body, s.Number):
            weights.append(row.body.value)
        else:
            node = checker.numeric(row.body, scope)
            if not isinstance(node, Const) or not node.type.is_scalar:
                return []
            weights += node.flat
        total += weights[-1]
        if weights[-1] < 0 or total > 1 + TOLERANCE:  # most tables of numbers end here
            return []
    if len(weights) > 1 and total >= 1 - TOLERANCE:
        return weights
    return []


def _is_number(expr: s.Expr, scope: Scope) -> bool:
    for part in s.below(expr):
        if isinstance(part, s.Name):
            binding = scope.lookup(part.written)
            if not isinstance(binding, Value) or binding.domain is not None:
                return False
        elif not isinstance(part, s.Number | s.Unary | s.Binary):
            return False
    return True


def _may_be_drawn(
    key: s.Expr, weights: Sequence[Fraction | float], column: _Column, scope: Scope, want: Domain | None
) -> bool:
    if isinstance(key, s.Boolean):
        return any(0 < weight < 1 for weight in weights)
    if not may_be_label(key, scope):
        return True
    if isinstance(key, s.Quoted):
        label = key.value
    else:
        label = key.place.written
    if want is not None:
        return label in want.labels
    return column.domain is None or label not in column.domain.labels


def _leaves(
    checker: BaseChecker, rows: Sequence[s.TableRow], columns: Sequence[_Column], scope: Scope
) -> list[tuple[tuple[_Key, ...], s.Expr]]:
    """List cells with their keys, in written order; a cell that stops early spans the columns left."""
    if not columns:
        cell = next(s.cells(rows))
        checker.fail("E307", cell, "this table has more levels of rows than names in `by`")
    column = columns[0]
    rest = columns[1:]
    leaves: list[tuple[tuple[_Key, ...], s.Expr]] = []
    seen: set[_Key] = set()
    for row in rows:
        key = None
        if row.key is not None:
            key = _key(checker, row.key, column, scope)
        if row.key is not None and key in seen:
            checker.fail("E309", row.key, f"the row '{column.shown(key or 0)}' is given twice")
        seen.add(key)
        if isinstance(row.body, tuple):
            leaves += [((key, *deeper), cell) for deeper, cell in _leaves(checker, row.body, rest, scope)]
        else:
            leaves.append(((key, *(None for _ in rest)), row.body))
    return leaves


def _key(checker: BaseChecker, expr: s.Expr, column: _Column, scope: Scope) -> int:
    value = checker.value(expr, scope, column.domain)
    own = value.domain == column.domain
    node = value.node
    if not own:
        node = checker.number_of(value)
    if not isinstance(node, Const) or not node.type.is_scalar:
        checker.fail("E312", expr, "a row of a table must be a constant")
    is_label = value.domain is not None and value.domain.values is None
    foreign = not own and (column.domain is not None or is_label)
    if foreign or node.type.kind is Kind.REAL or not column.ends[0] <= int(node.value) <= column.ends[1]:
        hint = None
        if column.values is not None:
            shown = ", ".join(map(column.shown, column.values[:6]))
            hint = f"its values are {shown}" + ", ..." * (len(column.values) > 6)
        checker.fail("E313", expr, f"'{node.value}' is not a value of this column", hint)
    return int(node.value)


class _Table:
    """Rows of a table by the keys of its columns, and for every combination of column values the number of its cell.

    `grid` is None where the combinations are endless or many. A combination without a cell is reported (E410).
    """

    def __init__(self, checker: BaseChecker, columns: Sequence[_Column], keys: _Keys, expr: s.Table) -> None:
        self.builder = checker.builder
        self.columns = columns
        self.keys = keys
        # The order in which rows are tried: a named value goes before `else`, the leftmost column first.
        self.order = sorted(range(len(keys)), key=lambda n: tuple(k is None for k in keys[n]))
        self.grid: list[int] | None = None
        size = 1
        most = limits().cells
        for column in columns:
            size *= most + 1 if column.values is None else len(column.values)
        if size <= most:
            self.grid = self._cells(checker, expr)
        elif not _covers(keys, columns):
            message = "this table needs a last row `else:`, since its columns have infinitely many values"
            checker.fail("E410", expr, message)

    def _cells(self, checker: BaseChecker, expr: s.Table) -> list[int]:
        rows = {}
        for n in reversed(self.order):
            rows[self.keys[n]] = n
        masks: dict[tuple[bool, ...], None] = {}  # a set in order
        for n in self.order:
            masks[tuple(k is None for k in self.keys[n])] = None
        grid = []
        for values in itertools.product(*(c.values or () for c in self.columns)):
            cell = _matching(rows, masks, values)
            if cell is None:
                missing = []
                for c, v in zip(self.columns, values, strict=True):
                    name = "the column"
                    if isinstance(c.expr, s.Name):
                        name = c.expr.written
                    missing.append(f"{name} = {c.shown(v)}")
                message = f"this table has no row for {', '.join(missing)}"
                checker.collector.add("E410", self._gap(expr, values), message, "add the row, or `else:`")
                raise Poisoned
            grid.append(cell)
        return grid

    def _gap(self, expr: s.Table, values: tuple[int, ...]) -> s.Place:
        """Place of the innermost rows that lack one for some values: their key, or the key of the whole table."""
        place = expr.place
        rows = expr.rows
        start = 0
        for level, value in enumerate(values):
            entered = None
            for row in rows:
                key = self.keys[start][level]
                if isinstance(row.body, tuple) and (key == value or (key is None and entered is None)):
                    entered = row, start
                start += sum(1 for _ in s.cells([row]))
            if entered is None:
                break
            row, start = entered
            assert isinstance(row.body, tuple)
            rows = row.body
            if row.key is None:
                place = row.place
            else:
                place = row.key.place
        return place

    def look_up(self, cells: Sequence[Node]) -> Node:
        """Look up the cell of the present row: in a constant array where possible, else by a chain of selects."""
        b = self.builder
        if self.grid is not None:
            if all(c is cells[0] for c in cells):
                return cells[0]
            if are_constant(cells):
                kind = max(c.type.kind for c in cells)
                rows = b.structure("vector", [b.cast(cells[n], kind) for n in self.grid])
                row: Node = b.scalar(0)
                for column in self.columns:
                    assert column.values is not None
                    digit = b.apply("sub", b.cast(column.node, Kind.INT), b.scalar(column.values.start))
                    row = b.apply("add", b.apply("mul", row, b.scalar(len(column.values))), digit)
                return b.structure("index", [rows, row])
        result = cells[self.order[-1]]
        for number in reversed(self.order[:-1]):
            condition: Node = b.scalar(True)
            for column, value in zip(self.columns, self.keys[number], strict=True):
                if value is not None:
                    here = b.apply("eq", b.cast(column.node, Kind.INT), b.scalar(value))
                    condition = b.apply("and", condition, here)
            result = b.apply("where", condition, cells[number], result)
        return result


def _covers(keys: _Keys, columns: Sequence[_Column]) -> bool:
    if not columns or not keys:
        return bool(keys)
    values = columns[0].values
    named: set[_Key] = set()
    for k in keys:
        if k[0] is not None and (values is None or k[0] in values):
            named.add(k[0])
    if values is None or len(named) < len(values):
        named.add(None)  # stands for the values without a row of their own
    for value in named:
        rest = []
        for k in keys:
            if k[0] is None or k[0] == value:
                rest.append(k[1:])
        if not _covers(rest, columns[1:]):
            return False
    return True


def _matching(
    rows: Mapping[tuple[_Key, ...], int], masks: Iterable[tuple[bool, ...]], values: tuple[int, ...]
) -> int | None:
    for mask in masks:
        key: list[_Key] = list(values)
        for column, spans in enumerate(mask):
            if spans:
                key[column] = None
        if tuple(key) in rows:
            return rows[tuple(key)]
    return None
