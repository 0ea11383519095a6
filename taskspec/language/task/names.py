"""The names visible in each section, what they mean there, and names that are taken.

Definitions are expanded in the scope of the section that uses them, so that a primed name in a definition means the
next value where there is one, and is refused where there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from taskspec.base.diagnostics import Collector, Span
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.calls import NO_DRAWS, is_function
from taskspec.language.expressions.check import CONSTANTS
from taskspec.language.expressions.ir import Draw, Node, reads
from taskspec.language.expressions.scope import Binding, FunctionDef, Lazy, Poisoned, Scope, Unavailable, Value, named
from taskspec.language.expressions.types import Kind, Role, Type
from taskspec.language.source import Path
from taskspec.language.task.context import Context, poison
from taskspec.language.task.merge import Merged
from taskspec.language.task.parts import article
from taskspec.language.task.reach import kept

PRIMED = ("dynamics", "reward", "measures", "terminal")
"""Sections that may name next values."""
_PAYING = ("reward", "measures")
"""Sections that may name the end of the episode."""

_WITHOUT_ACTION = {
    "observation": "the agent observes before it acts",
    **dict.fromkeys(("expert", "absorbing", "abstraction"), "the action is not known yet"),
    "figure": "a figure shows states",
}
_NO_DRAWS = {
    "absorbing": "an absorbing reward is a fixed number",
    "claims": "a claim is a statement about exact results",
    "legal": "an action is legal in a state, or not",
    **dict.fromkeys(("first memory", "memory"), "a memory holds what was seen and done"),
    "abstraction": "an abstraction is a function of the state",
    "figure": "a figure shows states",
    **dict.fromkeys(("seen", "done"), "a symmetry gives one value for each"),
}
"""Sections in which nothing may be drawn, and why; `seen` and `done` are the maps of a symmetry."""
_OUTSIDE_STEPS = ("initial", "observation")
"""Sections in which a noise may stand that depends on no step."""


class Names:
    """Makes the scopes of one build, and works out noise and next values on first use."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._noise: dict[str, tuple[Value, tuple[Draw, ...]]] = {}
        self.seen: Mapping[str, Value] = {}
        """The observation of an expert with memory."""
        self.next: dict[str, Value] = {}
        """Next values, worked out on first use."""
        self._end: Value | Poisoned | None = None
        self.raw_next: dict[str, Node] = {}
        """Next values as the dynamics have them, in and out of range."""

    def scope(self, section: str) -> Scope:
        """Names visible in a section; made once."""
        known = self.context.named_scopes.get(section)
        if known is not None:
            return known
        bindings: dict[str, Binding] = dict(self.context.constants)
        self._bind_components(bindings, section)
        self._bind_time(bindings, section)
        return self._finished(section, bindings)

    def memory_scope(self, section: str, seen: Mapping[str, Value]) -> Scope:
        """Names visible in `first memory` or `memory`: the observation, the memory itself, and the action before."""
        visible: dict[str, Binding] = dict(seen)
        hint = None
        if section == "memory":
            for name, value in seen.items():
                hint = f"`{name}'` is seen after it; memory keeps what was"
                visible[name] = Unavailable("E302", f"'{name}' was seen before the step", hint)
                visible[name + "'"] = value
            hint = "an observation after a step is written with a prime"
            for c in self.context.action:
                visible[c.name] = self.context.bound(c, Role.ACTION)
            for c in self.context.memory:
                visible[c.name] = self.context.bound(c, Role.STATE)
            self._bind_time(visible, section)
        return self._restricted(section, visible, "a memory is computed from observations, and '{}' is not", hint)

    def map_scope(self, section: str, visible: Mapping[str, Binding]) -> Scope:
        """Names visible in a map of a symmetry: the mapped components, and what is fixed."""
        return self._restricted(section, visible, "a symmetry maps observations and actions; '{}' is not part of this")

    def _restricted(self, section: str, visible: Mapping[str, Binding], message: str, hint: str | None = None) -> Scope:
        context = self.context
        bindings: dict[str, Binding] = dict(context.constants)
        for c in (*context.state, *context.action):
            bindings[c.name] = Unavailable("E302", message.format(c.name), hint)
        bindings |= visible
        for name in context.exprs["observation"]:
            if section != "done" and name not in visible:  # it is broken (and reported)
                bindings[name] = bindings[name + "'"] = Lazy(poison)
        return self._finished(section, bindings)

    def initial_scope(self) -> Scope:
        """Names visible in `initial`; components join as their lines are read (`define`)."""
        context = self.context
        bindings: dict[str, Binding] = dict(context.constants)
        for c in context.state:
            hint = "a line of `initial` may use the lines before it"
            bindings[c.name] = Unavailable("E317", f"'{c.name}' has no value yet", hint)
        for c in context.action:
            bindings[c.name] = Unavailable("E302", f"the action '{c.name}' cannot be used in `initial`")
        return self._finished("initial", bindings)

    def define(self, scope: Scope, name: str, binding: Binding) -> None:
        """Add a name to a scope; definitions that were given up without it may now be worked out."""
        scope.bindings[name] = binding
        self._bind_definitions(scope.bindings, scope)

    def _finished(self, section: str, bindings: dict[str, Binding]) -> Scope:
        self._bind_noise(bindings, section)
        if section in _PAYING and "terminal" in self.context.data:
            bindings["terminal"] = Lazy(self.end)
        elif section in _PAYING:
            bindings["terminal"] = Unavailable("E302", "no step ends an episode here: there is no section `terminal`")
        elif section != "initial":
            bindings["terminal"] = Unavailable("E302", "'terminal' can only be used in `reward` and `measures`")
        scope = Scope(bindings, self.context.domains, draws=_NO_DRAWS.get(section))
        self._bind_definitions(bindings, scope)
        self.context.scopes.append(scope)
        self.context.named_scopes[section] = scope
        return scope

    def _bind_components(self, bindings: dict[str, Binding], section: str) -> None:
        context = self.context
        for c in context.state:
            bindings[c.name] = context.bound(c, Role.STATE)
            if section in PRIMED:
                bindings[c.name + "'"] = Lazy(lambda at, n=c.name: self.next_value(n, at), c.domain)  # type: ignore[misc]
        for c in context.action:
            bindings[c.name] = context.bound(c, Role.ACTION)
            if section in _WITHOUT_ACTION:
                where = "the expert"
                if section != "expert":
                    where = f"`{section}`"
                message = f"the action '{c.name}' cannot be used in {where}"
                bindings[c.name] = Unavailable("E302", message, _WITHOUT_ACTION[section])
        for c in context.memory:
            message = f"'{c.name}' is the expert's memory, which only `expert` and `memory` can use"
            bindings[c.name] = Unavailable("E302", message)
            if section == "expert":
                bindings[c.name] = context.bound(c, Role.STATE)
        known = Scope(bindings, context.domains)
        for name in context.exprs["observation"] if section == "expert" else ():
            if not known.is_label(name):
                bindings.setdefault(name, self._observed(name))

    def _observed(self, name: str) -> Binding:
        if not self.context.memory:
            message = f"'{name}' is an observation, and an expert without `memory` reads the state"
            hint = "declare what it remembers; it then also reads what is observed"
            return Unavailable("E302", message, hint)
        return self.seen.get(name) or Lazy(poison)

    def _bind_time(self, bindings: dict[str, Binding], section: str) -> None:
        b = self.context.builder
        horizon = self.context.horizon
        if horizon is None:
            bindings["t"] = Value(b.read(Role.TIME, "t", Type(Kind.INT), 0))
            bindings.setdefault("T", Unavailable("E302", "there is no horizon 'T': it is `none`"))
        else:
            last = horizon - (section not in ("observation", "claims"))
            bindings["t"] = Value(b.read(Role.TIME, "t", Type(Kind.INT), 0, last))
            bindings["T"] = Value(b.scalar(horizon))
        if section == "legal":
            hint = "a component of the state can count the steps"
            bindings["t"] = Unavailable("E302", "the time 't' cannot be used in `legal`", hint)

    # -- the end --------------------------------------------------------------------------------------------------

    def end(self, at: s.Expr) -> Value:
        """Condition on which a step ends the episode, worked out on first use.

        Raises:
            Poisoned: when the condition is broken; its mistakes are reported once.
        """
        if self._end is None:
            expr = self.context.exprs.get("terminal")
            self._end = Poisoned()
            if expr is not None:
                self._end = Value(self.context.checker.condition(expr, self.scope("terminal")), late=True)
        if isinstance(self._end, Poisoned):
            raise Poisoned
        return self._end

    # -- noise ----------------------------------------------------------------------------------------------------

    def _bind_noise(self, bindings: dict[str, Binding], section: str) -> None:
        for name in self.context.data.get("noise") or {}:
            if section in _OUTSIDE_STEPS:
                bindings[name] = Lazy(lambda at, n=name: self._noise_of_reset(n, at, section))  # type: ignore[misc]
            elif section in _NO_DRAWS or section == "expert":
                bindings[name] = Unavailable("E302", f"the noise '{name}' is drawn in steps, not here")
            else:
                bindings[name] = Lazy(lambda at, n=name: self._drawn(n))  # type: ignore[misc]

    def _drawn(self, name: str) -> Value:
        builder = self.context.builder
        if name not in self._noise:
            expr = self.context.exprs["noise"].get(name)
            if expr is None:
                raise Poisoned
            with self.context.guard(name, expr), builder.written() as draws:
                value = self.context.shaped(name, self.context.checker.value(expr, self.scope("noise")))
            self._noise[name] = replace(value, late=True), tuple(draws.values())
        value, made = self._noise[name]
        builder.name_draws(made)
        return value

    def _noise_of_reset(self, name: str, at: s.Name, section: str) -> Value:
        """Noise that a reset draws, too: it depends on no step."""
        value = self._drawn(name)
        if any(role is not Role.PARAMETER for role, _ in reads([value.node])):
            message = f"the noise '{name}' depends on the state or the action before the step"
            hint = "only noise that depends on neither can be observed; keep it in a state component"
            if section == "initial":
                message = f"{message}; an episode begins before any step"
                hint = "give this draw a noise of its own"
            self.context.checker.fail("E302", at, message, hint)
        return value

    # -- definitions ----------------------------------------------------------------------------------------------

    def _bind_definitions(self, bindings: dict[str, Binding], scope: Scope) -> None:
        context = self.context
        for written, expr in context.exprs["definitions"].items():
            name, arguments = signature(written)
            if expr is None:
                bindings[name] = context.lazy(name, poison)
            elif arguments is None:
                bindings[name] = context.lazy(name, lambda n=name, e=expr: self._without_draws(n, e, scope))  # type: ignore[misc]
            else:
                enter = lambda at, n=name: context.guard(n, at)  # noqa: E731
                bindings[name] = FunctionDef(name, arguments, expr, scope, enter)

    def _without_draws(self, name: str, expr: s.Expr, scope: Scope) -> Value:
        inner = scope.child({})
        inner.draws = NO_DRAWS
        return self.context.shaped(name, named(self.context.checker.value(expr, inner), expr, scope))

    # -- next values ----------------------------------------------------------------------------------------------

    def next_value(self, name: str, at: s.Name) -> Value:
        """Next value of a component, worked out on first use; without a line of `dynamics` it stays the same."""
        if name not in self.next:
            self.next[name] = self._changed(name, at)
        return self.next[name]

    def _changed(self, name: str, at: s.Name) -> Value:
        context = self.context
        written = name + "'"
        component = next(c for c in context.state if c.name == name)
        if written not in context.exprs["dynamics"]:
            if name in context.broken:
                raise Poisoned
            value = context.read(component, Role.STATE)
            self.raw_next[name] = value.node
            return Value(value.node, value.domain)
        expr = context.exprs["dynamics"][written]
        with context.guard(written, at):
            node = context.assign(expr, self.scope("dynamics"), component)
        if node is None:
            raise Poisoned
        self.raw_next[name] = node
        return Value(kept(context.builder, component, node), component.domain, late=True)


def signature(written: str) -> tuple[str, tuple[str, ...] | None]:
    """Split a definition into name and arguments: `p(x, y)` is ("p", ("x", "y")), `p` is ("p", None)."""
    name, bracket, rest = written.partition("(")
    if not bracket:
        return name.strip(), None
    return name.strip(), tuple(a.strip() for a in rest.rstrip().rstrip(")").split(",") if a.strip())


# One set of names: what a spec declares twice, or what the language has already given a meaning.

_SECTIONS = {
    "parameters": "parameter",
    "constants": "constant",
    "definitions": "definition",
    "noise": "noise",
    "state": "state component",
    "action": "action component",
    "memory": "component of the memory",
}
_RESERVED = {
    "t": "the number of steps taken",
    "T": "the horizon",
    "terminal": "the end of the episode",
    **dict.fromkeys(CONSTANTS, "a constant"),
}


def check_names(merged: Merged, collector: Collector) -> None:
    """Report (E309) every declared name that is taken: by a declaration above it, or by the language."""
    known: dict[str, tuple[str, Span]] = {}
    for path, name, what in declared(merged):
        place = merged.key_span(path)
        if name in known:
            before, there = known[name]
            if there.origin == place.origin:
                where = f"line {there.line}"
            else:
                where = str(there)
            message = f"'{name}' is {article(before)} already, in {where}"
            collector.add("E309", place, message, "every name has one meaning in a spec")
        elif name in _RESERVED:
            collector.add("E309", place, f"'{name}' means {_RESERVED[name]} in every expression; choose another name")
        elif is_function(name):
            collector.add("E309", place, f"'{name}' is a function of the language; choose another name")
        known.setdefault(name, (what, place))


def declared(merged: Merged) -> Iterator[tuple[Path, str, str]]:
    """Path, name and kind of everything that a spec declares, in the order of the sections."""
    for section, what in _SECTIONS.items():
        for written in merged.data.get(section) or {}:
            if (section, written) != ("parameters", "require"):
                yield (section, written), signature(written)[0], what
    for name, entry in (merged.data.get("parameters") or {}).items():
        if name != "require" and entry.get("alias"):
            yield ("parameters", name, "alias"), entry["alias"], "alias of a parameter"
