"""Equations and sets of one task, and expressions that draw in the form in which people write them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any

from taskspec.lang import syntax as s
from taskspec.printers import tree as m
from taskspec.printers.elements import rank
from taskspec.printers.expressions import ExpressionWriter, condition, mathematics
from taskspec.printers.idioms import interval
from taskspec.printers.names import Notation, expression, of_task, symbol
from taskspec.printers.pieces import prime
from taskspec.printers.rewrites import Drawn, is_draw, shows_probabilities, substitute, take_apart
from taskspec.task.names import signature
from taskspec.task.schema.models import Spec
from taskspec.task.schema.typed import ComponentEntry, ParameterEntry
from taskspec.task.task import Task

LETTERS = ("xi", "zeta", "chi", "eta")
"""Letters for what is drawn inside an expression, the usual one first."""


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
        return self.plain.with_symbols({name: m.Accent("hat", self.plain.symbol(name)) for name in self.hatted})

    @property
    def spec(self) -> Spec:
        return self.task.spec

    def parsed(self, name: str) -> Any:
        return self.task.surface.sections.get(name)

    # -- values ---------------------------------------------------------------------------------------------------

    def put(self, expr: s.Expr) -> s.Expr:
        return substitute(expr, self.values) if self.values else expr

    def math(self, expr: s.Expr, of: str | None = None, notation: Notation | None = None) -> m.Math:
        return mathematics(self.put(expr), notation or self.notation, of)

    def truth(self, expr: s.Expr, notation: Notation | None = None) -> m.Math:
        return condition(self.put(expr), notation or self.notation)

    def declared(self, value: Any) -> m.Math:
        """Return a bound or a length as declared."""
        return self.math(expression(value))

    def symbol(self, name: str, primed: bool = False) -> m.Math:
        return prime(self.notation.symbol(name), primed)

    def equation(self, left: m.Math, expr: s.Expr, of: str | None = None) -> m.Math:
        """Return `left = expr`, or `left ~ expr` for a distribution; draws inside the expression get names."""
        if is_draw(expr):
            sign = "=" if shows_probabilities(expr) else "∼"
            return m.Row((left, m.Sym(sign), self.math(expr, of)))
        apart = take_apart(expr, self.drawn)
        notation = self._drawing(apart)
        parts: list[m.Math] = [left, m.Sym("="), self.math(apart.expr, of, notation)]
        for name, draw in apart.draws:
            parts += [m.Sym(","), m.Gap("wide"), mathematics(name, notation), m.Sym("∼"), self.math(draw)]
        return m.Row(tuple(parts))

    def _drawing(self, apart: Drawn) -> Notation:
        """Return the notation of an expression in which names stand for draws."""
        axes = {}
        for name, draw in apart.draws:
            whole, indices = (name.value, name.indices) if isinstance(name, s.Subscript) else (name, ())
            assert isinstance(whole, s.Name)
            axes[whole.id] = rank(ExpressionWriter(self.notation), draw) + len(indices)
        return replace(self.notation, axes={**self.notation.axes, **axes})

    @cached_property
    def drawn(self) -> str:
        """The letter for what is drawn inside an expression: one that neither is a name of the task nor looks like one."""
        looks = set(self.notation.symbols.values())
        free = (x for x in LETTERS if x not in self.notation.symbols and symbol(x) not in looks)
        return next(free, LETTERS[0])

    # -- sets -----------------------------------------------------------------------------------------------------

    def domain(self, name: str, entry: ComponentEntry | ParameterEntry) -> m.Math:
        """Return the set of values of a component or parameter."""
        bounds = {key: end for key in ("low", "high") if (end := getattr(entry, key)) is not None}
        several = [end for end in bounds.values() if isinstance(end, list)]
        if several:  # a bound for each element
            each = ({key: self._of_element(end, i) for key, end in bounds.items()} for i in range(len(several[0])))
            return self._product([self._scalar(name, entry.model_copy(update=ends)) for ends in each])
        ends = {key: self._of_element(end, "i") for key, end in bounds.items()}
        if ends != bounds:
            return m.Row((m.Big("∏", m.Ident("i")), self._scalar(name, entry.model_copy(update=ends))))
        inner = self._scalar(name, entry)
        shape = getattr(entry, "shape", None)
        lengths = shape if isinstance(shape, list) else [] if shape is None else [shape]
        if not lengths or lengths == [1]:
            return inner
        return m.Script(inner, sup=m.joined((self.declared(n) for n in lengths), "×"))

    def _of_element(self, end: Any, index: int | str) -> Any:
        """Return a bound of one element: that of a list, or of a vector among the constants."""
        if isinstance(end, list):
            return end[int(index)]
        return f"({end})[{index}]" if self._is_vector(expression(end)) else end

    def _is_vector(self, expr: s.Expr) -> bool:
        match expr:
            case s.Name(id=name):
                return name in self.task.fixed and bool(self.task.fixed[name].type.shape)
            case s.Unary(operand=inner):
                return self._is_vector(inner)
            case s.Binary(left=left, right=right):
                return self._is_vector(left) or self._is_vector(right)
            case _:
                return False

    def _scalar(self, name: str, entry: ComponentEntry | ParameterEntry) -> m.Math:
        low, high = (None if end is None else self.declared(end) for end in (entry.low, entry.high))
        match entry.type:
            case "bool":
                return interval(m.Num("0"), m.Num("1"))
            case "choice":
                labels = self.notation.labels.get(name) or {str(v): m.Words(str(v)) for v in entry.values or ()}
                return m.braces(m.joined(labels.values()))
            case "int":
                return _integers(low, high)
            case _:
                return _reals(low, high)

    def space(self, components: Mapping[str, ComponentEntry]) -> m.Math:
        """Return the product of the components' sets, equal neighbours as a power."""
        return self._product([self.domain(name, entry) for name, entry in components.items()])

    def _product(self, sets: Sequence[m.Math]) -> m.Math:
        return m.joined((_power(same, len(list(group))) for same, group in groupby(sets)), "×")

    def whole(self, components: Iterable[str], primed: bool = False) -> m.Math:
        """Return the state or the action as one thing: its component, or the tuple of its components."""
        names = [self.symbol(name, primed) for name in components]
        return names[0] if len(names) == 1 else m.brackets(m.joined(names))

    # -- what is read ---------------------------------------------------------------------------------------------

    def reads(self, expr: s.Expr) -> set[str]:
        """Return names that an expression depends on, through definitions and noise, as written (with primes)."""
        defined = {signature(w)[0]: (e, signature(w)[1] or ()) for w, e in (self.parsed("definitions") or {}).items()}
        defined |= {name: (e, ()) for name, e in (self.parsed("noise") or {}).items()}
        if isinstance(end := self.parsed("terminal"), s.Expr):
            defined["terminal"] = (end, ())
        found: set[str] = set()
        expanded: set[str] = set()
        waiting: list[tuple[Any, tuple[str, ...]]] = [(expr, ())]
        while waiting:
            body, bound = waiting.pop()
            for node in s.names(body):
                name = node.function if isinstance(node, s.Call) else node.written
                if name in defined and name not in expanded:
                    expanded.add(name)
                    waiting.append(defined[name])
                if name not in bound:
                    found.add(name)
        return found

    def arguments(self, expr: s.Expr) -> tuple[m.Math, ...]:
        """Return the arguments of a value: state, action, next state, time, in this order."""
        used = self.reads(expr)
        state = list(self.spec.state)
        action = list(self.spec.action)
        names = [(n, False) for n in (*state, *action) if n in used]
        names += [(n, True) for n in state if n + "'" in used]
        names += [("t", False)] if "t" in used else []
        return tuple(self.symbol(name, primed) for name, primed in names)


def _integers(low: m.Math | None, high: m.Math | None) -> m.Math:
    integers = m.Ident("Z", "blackboard")
    match low, high:
        case None, None:
            return integers
        case None, top if top is not None:
            return m.Script(integers, m.Row((m.Sym("≤"), top)))
        case bottom, None if bottom is not None:
            return m.Script(integers, m.Row((m.Sym("≥"), bottom)))
        case bottom, top:
            assert bottom is not None and top is not None
            return interval(bottom, top)


def _reals(low: m.Math | None, high: m.Math | None) -> m.Math:
    if low is None and high is None:
        return m.Ident("R", "blackboard")
    infinity = m.Ident("∞")
    ends = m.joined((low or m.Row((m.Sym("−"), infinity)), high or infinity))
    return m.Fence("[" if low else "(", ends, "]" if high else ")")


def _power(base: m.Math, count: int) -> m.Math:
    if count == 1:
        return base
    if isinstance(base, m.Script):
        return m.Script(m.brackets(base), sup=m.Num(str(count)))
    return m.Script(base, sup=m.Num(str(count)))


def commas(items: Iterable[m.Math]) -> m.Math:
    return m.joined(items)


def unchanged(task: Task, dynamics: Mapping[str, s.Expr]) -> Iterator[str]:
    """Yield state components that keep their value."""
    for component in task.state:
        expr = dynamics.get(component.name + "'")
        if expr is None or (isinstance(expr, s.Name) and expr.written == component.name):
            yield component.name


def assign(names: Sequence[m.Math], value: m.Math) -> m.Math:
    return m.Row((*names, m.Sym("="), value))
