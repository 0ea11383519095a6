"""Equations and sets of one task, and expressions that draw in the form in which people write them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any

from taskspec.language.expressions import syntax as s
from taskspec.language.task.names import signature
from taskspec.language.task.questions import written_in
from taskspec.language.task.schema.models import Spec
from taskspec.language.task.schema.typed import ComponentEntry, ParameterEntry
from taskspec.language.task.task import Task
from taskspec.show.printers import rewrites
from taskspec.show.printers import tree as m
from taskspec.show.printers.expressions import ExpressionWriter, condition, mathematics
from taskspec.show.printers.idioms import interval
from taskspec.show.printers.names import Notation, expression, of_task, symbol
from taskspec.show.printers.pieces import indexed, prime

LETTERS = ("xi", "zeta", "chi", "eta")  # letters for what is drawn inside an expression, the usual one first


@dataclass(frozen=True)
class Writing:
    """Writes the parts of a task; `values` are put in the place of parameters, and names in `hatted` get a hat."""

    task: Task
    values: Mapping[str, Any]
    hatted: frozenset[str] = frozenset()

    @cached_property
    def plain(self) -> Notation:
        return of_task(self.task)

    @cached_property
    def notation(self) -> Notation:
        hats = {name: m.Accent("hat", self.plain.symbol(name)) for name in self.hatted}
        return self.plain.with_symbols(hats)

    @property
    def spec(self) -> Spec:
        return self.task.spec

    def parsed(self, section: str) -> Any:
        return written_in(self.task, section)

    def put(self, expr: s.Expr) -> s.Expr:
        if self.values:
            return rewrites.substitute(expr, self.values)
        return expr

    def math(self, expr: s.Expr, of: str | None = None) -> m.Math:
        return mathematics(self.put(expr), self.notation, of)

    def truth(self, expr: s.Expr, notation: Notation | None = None) -> m.Math:
        return condition(self.put(expr), notation or self.notation)

    def declared(self, value: Any) -> m.Math:
        return self.math(expression(value))

    def symbol(self, name: str, primed: bool = False) -> m.Math:
        return prime(self.notation.symbol(name), primed)

    def equation(
        self, left: m.Math, expr: s.Expr, of: str | None = None, arguments: Mapping[str, int] | None = None
    ) -> m.Math:
        """Return `left = expr`, or `left ~ expr` for a distribution; draws inside the expression get names.

        Where conditions decide about elements, or one value is that of all, the left side has an index. `arguments` are
        those of a function, with their axes.
        """
        if rewrites.shows_probabilities(expr):
            return m.equal(left, self.math(expr, of))
        if rewrites.is_draw(expr):
            return m.Row((left, m.Sym("∼"), self.math(expr, of)))
        apart = rewrites.take_apart(expr, self.drawn)
        writer = ExpressionWriter(self.notation)
        axes = {**self.notation.axes, **(arguments or {})}
        for name, draw in apart.draws:
            if isinstance(name, s.Subscript) and isinstance(name.value, s.Name):
                axes[name.value.id] = rewrites.rank(writer, draw) + len(name.indices)
            elif isinstance(name, s.Name):
                axes[name.id] = rewrites.rank(writer, draw)
        notation = replace(self.notation, axes=axes)
        whole = ExpressionWriter(notation, of)
        value = self.put(apart.expr)
        elements = None
        if rewrites.has_conditions(whole, value):
            elements = rewrites.pointwise(whole, value)
        if elements is None:
            index = rewrites.broadcast(whole, value)
            right = whole.number(value).tree
        else:
            inner, index, element = elements
            right = inner.number(element).tree
        if index is not None:
            left = indexed(left, index)
        parts = [left, m.Sym("="), right]
        for name, draw in apart.draws:
            parts += [m.Sym(","), m.Gap("wide"), mathematics(name, notation), m.Sym("∼"), self.math(draw)]
        return m.Row(tuple(parts))

    @cached_property
    def drawn(self) -> str:
        """The letter for what is drawn inside an expression: one that neither is a name of the task nor looks like one."""
        looks = set(self.notation.symbols.values())
        for letter in LETTERS:
            if letter not in self.notation.symbols and symbol(letter) not in looks:
                return letter
        return LETTERS[0]

    def domain(self, name: str, entry: ComponentEntry | ParameterEntry) -> m.Math:
        """Return the set of values of a component or parameter."""
        bounds = {}
        count = 0  # of elements with bounds of their own
        for key in ("low", "high"):
            end = getattr(entry, key)
            if end is not None:
                bounds[key] = end
            if isinstance(end, list):
                count = len(end)
        if count:
            sets = []
            for i in range(count):
                sets.append(self._scalar(name, entry, self._of_element(bounds, i)))
            return _product(sets)
        ends = self._of_element(bounds, "i")
        if ends != bounds:
            return m.Row((m.Big("∏", m.Ident("i")), self._scalar(name, entry, ends)))
        inner = self._scalar(name, entry, bounds)
        shape = getattr(entry, "shape", None)
        if shape in (None, [], 1, [1]):
            return inner
        lengths = shape if isinstance(shape, list) else [shape]
        return m.Script(inner, sup=m.joined(map(self.declared, lengths), "×"))

    def _of_element(self, bounds: Mapping[str, Any], index: int | str) -> dict[str, Any]:
        """Return the bounds of one element: those of a list, or of a vector among the constants."""
        inner = dict(bounds)
        for key, end in bounds.items():
            if isinstance(end, list):
                inner[key] = end[int(index)]
            elif self._is_vector(expression(end)):
                inner[key] = f"({end})[{index}]"
        return inner

    def _is_vector(self, expr: s.Expr) -> bool:
        if isinstance(expr, s.Name):
            return expr.id in self.task.source.constants and bool(self.task.source.constants[expr.id].type.shape)
        return isinstance(expr, s.Unary | s.Binary) and any(map(self._is_vector, m.children(expr)))

    def _scalar(self, name: str, entry: ComponentEntry | ParameterEntry, ends: Mapping[str, Any]) -> m.Math:
        match entry.type:
            case "bool":
                return interval(m.Num("0"), m.Num("1"))
            case "choice":
                labels = self.notation.labels.get(name) or {v: m.Words(str(v)) for v in entry.values or ()}
                return m.braces(m.joined(labels.values()))
            case "int":
                return self._integers(ends)
        if not ends:
            return m.Ident("R", "blackboard")
        left = "("
        right = ")"
        high: m.Math = m.Ident("∞")
        low: m.Math = m.Row((m.Sym("−"), high))
        if "low" in ends:
            left = "["
            low = self.declared(ends["low"])
        if "high" in ends:
            right = "]"
            high = self.declared(ends["high"])
        return m.Fence(left, m.joined((low, high)), right)

    def _integers(self, ends: Mapping[str, Any]) -> m.Math:
        if len(ends) == 2:
            return interval(self.declared(ends["low"]), self.declared(ends["high"]))
        integers = m.Ident("Z", "blackboard")
        for key, sign in (("low", "≥"), ("high", "≤")):
            if key in ends:
                return m.Script(integers, m.Row((m.Sym(sign), self.declared(ends[key]))))
        return integers

    def space(self, components: Mapping[str, ComponentEntry]) -> m.Math:
        """Return the product of the components' sets, equal neighbours as a power."""
        return _product([self.domain(name, entry) for name, entry in components.items()])

    def whole(self, components: Iterable[str], primed: bool = False) -> m.Math:
        """Return the state or the action as one thing: its component, or the tuple of its components."""
        return m.tupled([self.symbol(name, primed) for name in components])

    def reads(self, expr: s.Expr) -> set[str]:
        """Return names that an expression depends on, through definitions and noise, as written (with primes)."""
        defined: dict[str, tuple[Any, tuple[str, ...]]] = {}
        for written, body in (self.parsed("definitions") or {}).items():
            name, arguments = signature(written)
            defined[name] = (body, arguments or ())
        defined |= {name: (e, ()) for name, e in (self.parsed("noise") or {}).items()}
        if self.parsed("terminal") is not None:
            defined["terminal"] = (self.parsed("terminal"), ())
        names: set[str] = set()
        waiting: list[tuple[Any, tuple[str, ...]]] = [(expr, ())]
        while waiting:
            body, bound = waiting.pop()
            for node in s.names(body):
                if isinstance(node, s.Call):
                    name = node.function
                else:
                    name = node.written
                if name in defined:
                    waiting.append(defined.pop(name))
                if name not in bound:
                    names.add(name)
        return names

    def arguments(self, expr: s.Expr) -> tuple[m.Math, ...]:
        """Return the arguments of a value: state, action, next state, time, in this order."""
        used = self.reads(expr)
        names = (*self.spec.state, *self.spec.action, *(f"{name}'" for name in self.spec.state), "t")
        symbols = []
        for name in filter(used.__contains__, names):
            symbols.append(self.symbol(name.removesuffix("'"), primed=name.endswith("'")))
        return tuple(symbols)


def _product(sets: Sequence[m.Math]) -> m.Math:
    factors = []
    for factor, group in groupby(sets):
        count = len(list(group))
        if count > 1:
            if isinstance(factor, m.Script):
                factor = m.brackets(factor)
            factor = m.Script(factor, sup=m.Num(str(count)))
        factors.append(factor)
    return m.joined(factors, "×")


def unchanged(task: Task, dynamics: Mapping[str, s.Expr]) -> Iterator[str]:
    """Yield state components that keep their value."""
    for component in task.state:
        expr = dynamics.get(component.name + "'")
        if expr is None or (isinstance(expr, s.Name) and expr.written == component.name):
            yield component.name
