"""Whether a rule means something: every name, function, argument and kind of value in it, before there are any results."""

from __future__ import annotations

from collections.abc import Mapping

from taskspec.diagnostics import Collector, suggest
from taskspec.exam.rules.vocabulary import FIXED, FUNCTIONS, NUMBERS, QUANTIFIERS, SIDES, RuleNames
from taskspec.lang import syntax as s

Bound = Mapping[str, str]
"""Variables of comprehensions, each with what it stands for: `task`, `learner`, or what cannot be told."""
UNKNOWN = "unknown"


class RuleChecker:
    """Walks a rule and collects all that is wrong with it."""

    def __init__(self, names: RuleNames, collector: Collector) -> None:
        self.names, self.collector = names, collector

    def condition(self, expr: s.Expr, bound: Bound) -> None:
        """A condition belongs here."""
        match expr:
            case s.Logical(operands=operands):
                for operand in operands:
                    self.condition(operand, bound)
            case s.Unary(op="not", operand=operand):
                self.condition(operand, bound)
            case s.Compare(first=first, rest=rest):
                self.compare(first, rest, bound)
            case s.Call(function="all" | "any" | "most"):
                self.quantifier(expr, bound)
            case s.Boolean():
                pass
            case _:
                self.fail("E306", expr, "a condition is needed here", "for example `score(task) > 0.9`")

    def compare(self, first: s.Expr, rest: tuple[tuple[str, s.Expr], ...], bound: Bound) -> None:
        self.number(first, bound)
        for op, other in rest:
            if op in ("in", "not in"):
                self.fail("E316", other, "`in` is allowed only after the `if` of a comprehension")
            else:
                self.number(other, bound)

    def number(self, expr: s.Expr, bound: Bound) -> None:
        """A number belongs here."""
        match expr:
            case s.Number():
                pass
            case s.Binary(op="+" | "-" | "*" | "/", left=left, right=right):
                self.number(left, bound)
                self.number(right, bound)
            case s.Unary(op="-" | "+", operand=operand):
                self.number(operand, bound)
            case s.Call(function="count"):
                self.quantifier(expr, bound)
            case s.Call(function=name) if name in FUNCTIONS:
                self.function(expr, bound)
            case s.Call(function=name) if name in NUMBERS or name in FIXED:
                self.about(expr, bound)
            case s.Call(function=name):
                known = (*NUMBERS, *FIXED, *FUNCTIONS, *QUANTIFIERS)
                hint = suggest(name, known) or f"there are {', '.join(known)}"
                self.collector.add("E303", expr.name_place, f"there is no function '{name}' in rules", hint)
            case s.Name(id=name):
                self.fail("E306", expr, f"a number is needed here, not '{name}'", f"for example `score({name})`")
            case _:
                self.fail("E306", expr, "a number is needed here", "for example `score(task)`")

    def function(self, expr: s.Call, bound: Bound) -> None:
        low, high, _ = FUNCTIONS[expr.function]
        if not low <= len(expr.args) <= high or expr.keywords:
            self.fail("E304", expr, f"{expr.function} takes {low if low == high else f'{low} or more'} numbers")
        for each in expr.args:
            self.number(each, bound)

    # -- what a number is about ----------------------------------------------------------------------

    def about(self, expr: s.Call, bound: Bound) -> None:
        """The arguments `(learner, task, side)`; there is a learner where there are several, and a side need not be given."""
        wanted = (["learner"] if self.names.learners and expr.function in NUMBERS else []) + ["task"]
        sides = expr.function in NUMBERS
        written = f"{expr.function}({', '.join(wanted)})"
        if expr.keywords or not len(wanted) <= len(expr.args) <= len(wanted) + sides:
            hint = f"behind them may stand {', '.join(SIDES)}" if sides else None
            self.fail("E304", expr, f"{expr.function} takes other arguments: {written}", hint)
            return
        for kind, each in zip(wanted, expr.args, strict=False):
            self.member(each, kind, bound)
        for each in expr.args[len(wanted) :]:
            self.name_of(each, tuple(SIDES), "side of a task")

    def member(self, expr: s.Expr, kind: str, bound: Bound) -> None:
        """A task or a learner, or a variable for one."""
        if isinstance(expr, s.Name) and expr.id in bound:
            if bound[expr.id] not in (kind, UNKNOWN):
                self.fail("E306", expr, f"'{expr.id}' is a {bound[expr.id]} here; a {kind} is needed")
            return
        known = (*self.names.tasks, *self.names.instances) if kind == "task" else self.names.learners
        self.name_of(expr, known, kind, tuple(bound))

    def name_of(self, expr: s.Expr, known: tuple[str, ...], kind: str, others: tuple[str, ...] = ()) -> None:
        if not isinstance(expr, s.Name) or expr.primed:
            self.fail("E306", expr, f"the name of a {kind} is needed here", f"one of {', '.join(known)}")
        elif expr.id not in known:
            hint = suggest(expr.id, (*known, *others)) or f"one of {', '.join(known)}"
            self.fail("E302", expr, f"there is no {kind} '{expr.id}' here", hint)

    # -- quantifiers ---------------------------------------------------------------------------------

    def quantifier(self, expr: s.Call, bound: Bound) -> None:
        if len(expr.args) != 1 or expr.keywords or not isinstance(expr.args[0], s.Comprehension):
            hint = f"`{expr.function}(score(t) > 0.9 for t in tasks)`"
            self.fail("E304", expr, f"{expr.function} takes a condition for each of some tasks", hint)
            return
        inner = dict(bound)
        for clause in expr.args[0].clauses:
            kind = self.domain(clause.domain)
            if len(clause.targets) != 1:
                self.fail("E316", clause.domain, "one variable goes through a group")
            inner |= dict.fromkeys(clause.targets, kind)
            for condition in clause.conditions:
                self.filter(condition, inner)
        self.condition(expr.args[0].element, inner)

    def domain(self, expr: s.Expr) -> str:
        """What a group, or a list of names, is of."""
        match expr:
            case s.Name(id=name):
                members = self.names.group(name)
                if members is None:
                    self.name_of(expr, self.names.known_groups, "group")
                return UNKNOWN if members is None else self.kind_of(members)
            case s.SetOf(items=items) | s.Vector(items=items):
                names = tuple(i.id for i in items if isinstance(i, s.Name))
                kind = self.kind_of(names)
                for item in items:
                    self.member(item, kind, {})
                return kind
            case _:
                self.fail("E306", expr, "a group is needed here", f"one of {', '.join(self.names.known_groups)}")
                return "task"

    def kind_of(self, members: tuple[str, ...]) -> str:
        return "learner" if any(m in self.names.learners for m in members) else "task"

    def filter(self, expr: s.Expr, bound: Bound) -> None:
        """What stands behind `if`: which members are meant, told by their names."""
        match expr:
            case s.Logical(operands=operands):
                for operand in operands:
                    self.filter(operand, bound)
            case s.Compare(first=s.Name(id=name), rest=(("in" | "not in", others),)) if name in bound:
                self.domain(others)
            case s.Compare(first=s.Name(id=name), rest=(("==" | "!=", other),)) if name in bound:
                self.member(other, bound[name], bound)
            case _:
                hint = "for example `if t != Sort`, or `if t not in {Sort, Parabola}`"
                self.fail("E316", expr, "a group is narrowed by names only", hint)

    def fail(self, code: str, expr: s.Expr, message: str, hint: str | None = None) -> None:
        self.collector.add(code, expr.place, message, hint)
