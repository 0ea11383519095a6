"""What expressions mean: from surface syntax, and from Python's own parse of the text that is printed.

Names of vectors and of sets are known by their letters (`trees`), so nothing is asked of the compiler.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from taskspec.language.expressions import syntax as s
from tests.verification.printed import algebra as al

VECTORS = {"v", "w", "p", "s", "h"}  # p and s have lengths that the notation knows
POINTWISE = {"abs", "floor", "sqrt", "sin", "min", "max", "clip"}  # functions that go element by element
VALUED = {"sort", "argsort", "cumsum", "reverse"}  # functions whose value is a vector
BINARY = {"+": al.add, "-": al.subtract, "*": al.multiply, "/": al.divide, "%": al.modulo, "**": al.power,
          "//": lambda a, b: al.floor(al.divide(a, b))}  # fmt: skip
SIGNS = {"==": "=", "!=": "≠", "<": "<", ">": ">", "<=": "≤", ">=": "≥"}
Names = Mapping[str, al.Value]


def compared(op: str, a: al.Value, b: Any) -> al.Value:
    if op in ("in", "not in"):
        return al.member(a, b) if op == "in" else al.negation(al.member(a, b))
    return al.RELATIONS[SIGNS[op]](a, b)


class Meaning:
    """The meaning of surface syntax; `lengths` are of the vectors whose lengths the notation knows."""

    def __init__(self, names: Names, lengths: Mapping[str, s.Expr], depth: int = 0) -> None:
        self.names = names
        self.lengths = lengths
        self.depth = depth

    def under(self, **bound: al.Value) -> Meaning:
        return Meaning({**self.names, **bound}, self.lengths, self.depth + 1)

    def of(self, expr: s.Expr) -> al.Value:
        match expr:
            case s.Number(text=text):
                return al.number(text)
            case s.Boolean(value=value):
                return int(value)
            case s.Quoted(value=value):
                return self.names[value]
            case s.Name():
                return self.names[expr.written]
            case s.Unary(op=op, operand=x):
                return {"-": lambda a: al.subtract(0, a), "+": lambda a: a, "not": al.negation}[op](self.of(x))
            case s.Binary(op=op, left=a, right=b):
                return BINARY[op](self.of(a), self.of(b))
            case s.Logical(op=op, operands=operands):
                return (al.conjunction if op == "and" else al.disjunction)(map(self.of, operands))
            case s.Compare(first=first, rest=rest):
                return self.chain(first, rest)
            case s.IfElse(condition=c, then=a, otherwise=b):
                return al.choice(self.of(c), self.of(a), self.of(b))
            case s.Piecewise(branches=branches, otherwise=otherwise):
                found = self.of(otherwise)
                for condition, then in reversed(branches):
                    found = al.choice(self.of(condition), self.of(then), found)
                return found
            case s.Table(by=by, rows=rows):
                return self.table(by, rows)
            case s.Weights(pairs=pairs):
                return al.mixed("weights", *((self.of(a), self.of(b)) for a, b in pairs))
            case s.Subscript(value=value, indices=indices):
                places = []
                for axis, index in enumerate(indices):
                    places.append(self.from_start(value, axis, index))
                return al.index(self.of(value), places)
            case s.Vector(items=items):
                return self.of(items[0]) if len(items) == 1 else al.mixed("vector", *map(self.of, items))
            case s.Call():
                return self.call(expr)
        raise AssertionError(expr)

    def chain(self, first: s.Expr, rest: tuple[tuple[str, s.Expr], ...]) -> al.Value:
        links = []
        left = first
        for op, right in rest:
            other = self.set(right) if op in ("in", "not in") else self.of(right)
            links.append(compared(op, self.of(left), other))
            left = right
        return al.conjunction(links)

    def table(self, by: tuple[s.Expr, ...], rows: tuple[s.TableRow, ...]) -> al.Value:
        """The cell of the row whose key is equal; every key of a test is a small number, so one is or none."""
        key = self.of(by[0])
        row = next((r for r in rows if r.key is not None and self.of(r.key) == key), None)
        row = row or next(r for r in rows if r.key is None)
        return self.table(by[1:], row.body) if isinstance(row.body, tuple) else self.of(row.body)

    def from_start(self, vector: s.Expr, axis: int, index: s.Expr | s.Slice) -> Any:
        """An index, counted from the start: `x[-1]` is element `len(x) - 1`."""
        match index:
            case s.Unary(op="-", operand=s.Number(value=back)) if back > 0:
                if axis == 0 and isinstance(vector, s.Name) and vector.id in self.lengths:
                    return al.subtract(self.of(self.lengths[vector.id]), back)
                row = self.of(vector)
                for _ in range(axis):
                    row = al.index(row, [0])
                return al.subtract(al.mixed("bars", row), back)
        return self.index(index)

    def index(self, expr: s.Expr | s.Slice) -> Any:
        if not isinstance(expr, s.Slice):
            return self.of(expr)
        start, stop, step = (None if x is None else self.of(x) for x in (expr.start, expr.stop, expr.step))
        if stop is not None and step is None:
            return al.integers(0 if start is None else start, al.subtract(stop, 1))
        return (start, stop) if step is None else (start, stop, step)

    # -- functions ------------------------------------------------------------------------------------------------

    def call(self, expr: s.Call) -> al.Value:
        name = expr.function
        args = expr.args
        if name in ("sum", "prod"):
            return self.total({"sum": "∑", "prod": "∏"}[name], args[0])
        if name in ("any", "all"):
            return self.quantified({"any": "some", "all": "every"}[name], args[0])
        if name in ("argmax", "argmin") or name == "count":
            word = {"argmax": "arg max", "argmin": "arg min"}.get(name, name)
            return al.mixed(word, self.element(args[0]))
        if name == "where":
            return al.choice(*map(self.of, args))
        return self.applied(name, [self.of(a) for a in args])

    def applied(self, name: str, given: list[al.Value]) -> al.Value:
        match name:
            case "abs" | "len":
                return al.mixed("bars", *given)
            case "floor":
                return al.floor(*given)
            case "norm1" | "norm2":
                return al.mixed("norm", *given, int(name[-1]))
            case "dot":
                return al.mixed("dot", *given)
            case "onehot":
                return al.mixed(name, given[0])
            case "concat":
                return al.mixed("vector", *given)
            case "swap":
                return al.mixed(name, *given[1:], given[0])
            case "Normal":
                return al.mixed("𝒩", given[0], al.power(given[1], 2))
            case "Exponential":
                return al.mixed("Exp", *given)
            case "Permutation":
                return al.mixed("Perm", *given)
            case "Uniform":
                return al.mixed("Unif", *given)
            case "UniformInt":
                return al.mixed("Unif", al.integers(*given))
        return al.mixed(name, *given)

    def element(self, expr: s.Expr) -> al.Value:
        """A vector at the next bound variable."""
        return self.under().at(expr, al.bound(self.depth))

    def at(self, expr: s.Expr, i: al.Value) -> al.Value:
        """A vector's element: arithmetic goes element by element, single numbers stay."""
        match expr:
            case _ if not is_vector(expr):
                return self.of(expr)
            case s.Unary(op=op, operand=x):
                return {"-": lambda a: al.subtract(0, a), "+": lambda a: a, "not": al.negation}[op](self.at(x, i))
            case s.Binary(op=op, left=a, right=b):
                return BINARY[op](self.at(a, i), self.at(b, i))
            case s.Compare(first=first, rest=rest):
                links = []
                left = first
                for op, right in rest:
                    links.append(compared(op, self.at(left, i), self.at(right, i)))
                    left = right
                return al.conjunction(links)
            case s.Logical(op=op, operands=parts):
                return (al.conjunction if op == "and" else al.disjunction)(self.at(x, i) for x in parts)
            case s.IfElse(condition=c, then=a, otherwise=b):
                return al.choice(*(self.at(x, i) for x in (c, a, b)))
            case s.Call(function="where", args=args):
                return al.choice(*(self.at(x, i) for x in args))
            case s.Call(function=name, args=args) if name in POINTWISE:
                return self.applied(name, [self.at(x, i) for x in args])
            case s.Subscript(value=value, indices=(s.Slice(start=None, stop=None),)):  # all of it
                return al.index(self.of(value), [i])
            case _:
                return al.index(self.of(expr), [i])

    def quantified(self, kind: str, arg: s.Expr) -> al.Value:
        if isinstance(arg, s.Vector):
            return (al.disjunction if kind == "some" else al.conjunction)(map(self.of, arg.items))
        match arg:
            case s.Compare(first=a, rest=(("==", b),)) if kind == "every" and is_vector(a) and is_vector(b):
                return self.of(arg)  # two vectors are equal
        return al.mixed(kind, self.element(arg))

    def total(self, sign: str, arg: s.Expr) -> al.Value:
        match arg:
            case s.Comprehension(element=body, clauses=(s.Clause((name,), s.Call("range", (n,)), ()),)):
                inner = self.under(**{name: al.bound(self.depth)})
                value = inner.total(sign, body) if isinstance(body, s.Comprehension) else inner.of(body)
                return al.mixed(sign, 0, al.subtract(self.of(n), 1), value)
            case s.Name(id=name) if name in self.lengths:
                return al.mixed(sign, 0, al.subtract(self.of(self.lengths[name]), 1), self.element(arg))
            case s.Subscript(value=s.Name(id=name) as whole, indices=(s.Slice(start=start, stop=stop, step=None),)) if (
                stop or name in self.lengths
            ):
                last = al.subtract(self.of(stop or self.lengths[name]), 1)
                return al.mixed(sign, 0 if start is None else self.of(start), last, self.element(whole))
        return al.mixed(sign, "all", self.element(arg))

    # -- sets -----------------------------------------------------------------------------------------------------

    def set(self, expr: s.Expr) -> tuple[Any, ...]:
        match expr:
            case s.SetOf(items=items):
                return ("set", *map(self.of, items))
            case s.Call(function="range", args=args):
                low = 0 if len(args) == 1 else self.of(args[0])
                return al.integers(low, al.subtract(self.of(args[-1]), 1))
            case s.Call(function="box", args=(low, high, n)):
                return ("power", al.integers(self.of(low), self.of(high)), self.of(n))
            case s.Comprehension(element=body, clauses=(s.Clause((name,), domain, conditions),)):
                inner = self.under(**{name: al.bound(self.depth)})
                where = self.set(domain)
                if isinstance(body, s.Name) and body.id == name and not conditions:
                    return where
                return ("builder", where, inner.of(body), *map(inner.of, conditions))
        raise AssertionError(expr)


def is_vector(expr: s.Expr) -> bool:
    match expr:
        case s.Name(id=name):
            return name in VECTORS
        case s.Call(function="where", args=args):
            return any(map(is_vector, args))
        case s.Call(function=name):
            return name in VALUED or (name in POINTWISE and not is_reduced(expr) and any(map(is_vector, expr.args)))
        case s.Subscript(indices=indices):
            return any(isinstance(i, s.Slice) for i in indices)
        case s.Binary(left=a, right=b):
            return is_vector(a) or is_vector(b)
        case s.Unary(operand=a):
            return is_vector(a)
        case s.Compare(first=a, rest=rest):
            return is_vector(a) or any(is_vector(b) for _, b in rest)
        case s.Logical(operands=parts):
            return any(map(is_vector, parts))
        case s.IfElse(condition=c, then=a, otherwise=b):
            return any(map(is_vector, (c, a, b)))
    return False


def is_reduced(call: s.Call) -> bool:
    """Whether a call gives the best element of its one vector."""
    return call.function in ("min", "max") and len(call.args) == 1
