"""Spec + parameters -> Task: every section checked in one pass, all mistakes reported together."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

from taskspec.diagnostics import Collector, suggest
from taskspec.lang import syntax as s
from taskspec.lang.builder import Builder
from taskspec.lang.check import Checker, Poisoned
from taskspec.lang.ir import Const, Node, Role, reads
from taskspec.lang.parse import parse_into
from taskspec.lang.scope import Binding, FunctionDef, Lazy, Scope, Unavailable, Value
from taskspec.lang.types import BOOL, REAL, Domain, Kind, Refused, Type
from taskspec.source import Document, Path, read_text
from taskspec.spec.declare import INSTANCE_SEED, Declarations
from taskspec.spec.forms import Forms
from taskspec.spec.merge import Merged, abstracted, merge
from taskspec.spec.observe import Observed
from taskspec.spec.reach import reach
from taskspec.spec.schema import check_shape
from taskspec.spec.task import Claim, Component, Observation, Parameter, Soft, Surface, Task

SEMANTIC = (
    "constants", "definitions", "noise", "state", "action", "observation", "horizon", "terminal", "discount", "initial",
    "dynamics", "reward", "absorbing_reward", "expert", "abstraction",
)  # fmt: skip
"""Sections that decide what a task does; the content hash covers these and the parameter values."""


def build(
    document: Document, variant: str | None = None, parameters: Mapping[str, Any] | None = None, suite: str = ""
) -> Task:
    """The task that a document describes, for given parameter values.

    Raises:
        SpecError: with every mistake found.
    """
    collector = Collector()
    collector.extend(check_shape(document))
    collector.raise_if_errors()
    return _Build(merge(document, variant), collector).task(dict(parameters or {}), suite)


def rebuild(
    text: str, name: str, variant: str | None, values: dict[str, Any], suite: str, ending: str, observe_time: bool
) -> Task:
    """A task from the text it was built from; how tasks are unpickled."""
    task = build(read_text(text, name), variant, values, suite)
    task = task.absorbing() if ending == "absorb" else task
    return task.observing_time() if observe_time else task


def build_abstract(task: Task) -> Task | None:
    """The finite stand-in that a task's spec declares under `abstraction`, for the same parameters; None without one.

    Raises:
        SpecError: with every mistake found in it.
    """
    merged = abstracted(merge(task.document, task.variant))
    if merged is None:
        return None
    found = _Build(merged, Collector()).task(task.values, task.suite)
    return found.absorbing() if task.ending == "absorb" else found


class _Build:
    """One build; the attributes fill in the order of `task`."""

    def __init__(self, merged: Merged, collector: Collector) -> None:
        self.merged, self.data, self.collector = merged, merged.data, collector
        self.builder = Builder()
        self.checker = Checker(self.builder, collector)
        self.forms = Forms(merged, collector)
        self.declare = Declarations(merged, self.builder, self.checker, self.forms)
        self.parameters: list[Parameter] = []
        self.constants: dict[str, Binding] = {}
        self.state: tuple[Component, ...] = ()
        self.action: tuple[Component, ...] = ()
        self.domains: list[Domain] = []
        self.horizon: int | None = None
        self.exprs: dict[str, Any] = {}
        self.next: dict[str, Value] = {}
        self.noise: dict[str, Value] = {}
        self.busy: list[str] = []
        self.scopes: list[Scope] = []
        self.named_scopes: dict[str, Scope] = {}

    # -- the pipeline ---------------------------------------------------------------------------------------------

    def task(self, given: dict[str, Any], suite: str) -> Task:
        self._check_complete()
        self._bind_parameters(given)
        self._bind_constants()
        self.state = self._components("state")
        self.action = self._components("action")
        self.domains = [c.domain for c in (*self.state, *self.action) if c.domain is not None]
        self.horizon = self._horizon()
        self._parse()
        initial = self._initial()
        following = self._dynamics()
        reward = self._single("reward", REAL, self._scope("reward"))
        terminal = self._single("terminal", BOOL, self._scope("terminal"), default=False)
        observation = self._observation(initial, following)
        absorbing = self._single("absorbing_reward", REAL, self._scope("absorbing"), default=0)
        expert = self._expert()
        self._check_unused()
        self._abstraction()
        claims = self._claims()
        self._scope("claims")
        self.collector.raise_if_errors()
        assert reward is not None and terminal is not None and absorbing is not None
        return Task(
            name=self.merged.name, suite=suite, version=int(self.data.get("version", 0)), variant=self.merged.variant,
            parameters=tuple(self.parameters), state=self.state, action=self.action, observation=observation,
            horizon=self.horizon, discount=self._discount(), initial=tuple(initial), next=tuple(following),
            reward=reward, terminal=terminal, expert=expert, claims=tuple(claims), absorbing_reward=absorbing,
            builder=self.builder, surface=Surface(self.exprs, self.data, self.named_scopes), document=self.merged.document,
            content_hash=self._hash(),
        )  # fmt: skip

    def _check_complete(self) -> None:
        for section in self.merged.missing:
            others = self.merged.document.data.get("variants") if self.merged.variant is None else None
            hint = f"only its variants are tasks: {', '.join(others)}" if others else None
            self.collector.add("E210", self.merged.span(("name",)), f"{self.merged.name} has no `{section}:` section", hint)
        self.collector.raise_if_errors()

    def _bind_parameters(self, given: dict[str, Any]) -> None:
        entries = self.data.get("parameters") or {}
        names = [name for name in entries if name != "require"]
        for name in given:
            if name not in names:
                known = f"its parameters are {', '.join(names)}" if names else "it has no parameters"
                self.collector.add("E702", None, f"{self.merged.name} has no parameter '{name}'", suggest(name, names) or known)
        scope = Scope(self.constants, draws="parameters are fixed numbers")
        for name in names:
            found = self.declare.parameter(name, given, scope)
            if found is not None:
                self.parameters.append(found[0])
                self.constants[name] = found[1]
        self.collector.raise_if_errors()
        for i, _ in enumerate(entries.get("require") or ()):
            self._require(("parameters", "require", i), scope, bool(given))
        self.collector.raise_if_errors()

    def _require(self, path: Path, scope: Scope, given: bool) -> None:
        expr = self.forms.expr((*path, "condition"))
        value = None if expr is None else self.checker.check(expr, scope)
        if expr is None or value is None:
            return
        if not isinstance(value.node, Const) or value.node.type != BOOL:
            self.collector.add("E306", expr.place, "a requirement is a condition on parameters")
        elif not value.node.value:
            message = self.forms.value((*path, "message"))
            values = ", ".join(f"{p.name}={p.value!r}" for p in self.parameters)
            self.collector.add("E704", expr.place, f"{message} ({values})")

    def _bind_constants(self) -> None:
        seed = next((p.value for p in self.parameters if p.name == INSTANCE_SEED), None)
        scope = Scope(self.constants)
        scope.used.add(INSTANCE_SEED)
        for name in self.data.get("constants") or {}:
            self.constants[name] = self._lazy(name, lambda n=name: self.declare.constant(n, scope, seed))
        for name in self.data.get("constants") or {}:
            self._resolve(self.constants[name])
        self.scopes.append(scope)

    def _components(self, section: str) -> tuple[Component, ...]:
        scope = self.constants_scope = Scope(self.constants, draws="domains are fixed")
        self.scopes.append(scope)
        found = [self.declare.component(section, name, scope) for name in self.data[section]]
        self.collector.raise_if_errors()  # without its components no section can be checked
        return tuple(c for c in found if c is not None)

    def _horizon(self) -> int | None:
        value = self.data["horizon"]
        if value is None or value == "none":
            return None
        expr = self.forms.expr(("horizon",))
        if expr is None:
            return None
        scope = Scope(self.constants, draws="the horizon is fixed")
        self.scopes.append(scope)
        try:
            steps = self.checker.integer(expr, scope, "the horizon")
        except Poisoned:
            return None
        if not 1 <= steps <= 2**31 - 2:
            self.collector.add("E407", expr.place, f"a horizon of {steps} steps is not possible; at least 1")
        return steps

    def _discount(self) -> float:
        if "discount" not in self.data:
            return 1.0
        expr = self.forms.expr(("discount",))
        node = None if expr is None else self.checker.check(expr, Scope(self.constants, draws="the discount is fixed"))
        if expr is None or node is None:
            self.collector.raise_if_errors()
        assert expr is not None and node is not None
        value = float(node.node.value) if isinstance(node.node, Const) and node.node.type.is_scalar else -1.0
        if not 0 <= value <= 1:
            self.collector.add("E703", expr.place, "the discount is a constant between 0 and 1")
            self.collector.raise_if_errors()
        return value

    # -- scopes ---------------------------------------------------------------------------------------------------

    def _parse(self) -> None:
        """Read the expressions of every section, reporting all syntax errors."""
        for section in ("definitions", "noise", "initial", "dynamics", "observation"):
            entries = self.data.get(section) or {}
            names = [n for n in entries if not (section == "observation" and n == "space")]
            self.exprs[section] = {name: self._entry(section, name, entries[name]) for name in names}
        for section in ("reward", "terminal", "absorbing_reward"):
            if section in self.data:
                self.exprs[section] = self.forms.expr((section,))

    def _entry(self, section: str, name: str, value: Any) -> s.Expr | None:
        inner = section == "observation" and is_bounded(value)
        return self.forms.expr((section, name, "value") if inner else (section, name))

    def _scope(self, section: str) -> Scope:
        """The names visible in a section. Definitions are expanded in the scope of the section that uses them."""
        bindings: dict[str, Binding] = dict(self.constants)
        where = {"expert": "the expert"}.get(section, f"`{section}`")
        for c in self.state:
            bindings[c.name] = self._value(c, Role.STATE)
        for c in self.action:
            bindings[c.name] = self._value(c, Role.ACTION)
            if section in ("observation", "expert", "absorbing", "abstraction"):
                why = "the agent observes before it acts" if section == "observation" else "the action is not known yet"
                bindings[c.name] = Unavailable("E302", f"the action '{c.name}' cannot be used in {where}", why)
        if section in ("dynamics", "reward", "terminal"):
            for c in self.state:
                bindings[c.name + "'"] = Lazy(lambda name, n=c.name: self._next_value(n, name))
        self._bind_time(bindings, section)
        self._bind_noise(bindings, section)
        scope = Scope(bindings, self.domains, draws=_NO_DRAWS.get(section))
        self._bind_definitions(bindings, scope)
        self.scopes.append(scope)
        self.named_scopes[section] = scope
        return scope

    def _value(self, c: Component, role: Role) -> Value:
        return Value(self.builder.read(role, c.name, c.type, min(c.low), max(c.high)), c.domain)

    def _bind_time(self, bindings: dict[str, Binding], section: str) -> None:
        last = float("inf") if self.horizon is None else self.horizon - (section not in ("observation", "claims"))
        bindings["t"] = Value(self.builder.read(Role.TIME, "t", Type(Kind.INT), 0, last))
        if self.horizon is not None:
            bindings["T"] = Value(self.builder.scalar(self.horizon))
        else:
            bindings["T"] = Unavailable("E302", "there is no horizon 'T': it is `none`")

    def _bind_noise(self, bindings: dict[str, Binding], section: str) -> None:
        for name in self.data.get("noise") or {}:
            if section == "observation":
                bindings[name] = Lazy(lambda at, n=name: self._observed_noise(n, at))
            elif section in ("expert", "absorbing", "initial", "claims", "abstraction"):
                bindings[name] = Unavailable("E302", f"the noise '{name}' is drawn in steps, not here")
            else:
                bindings[name] = Lazy(lambda at, n=name: self._noise(n))

    def _noise(self, name: str) -> Value:
        """A noise entry: drawn once per step, the same draw wherever it is named."""
        if name not in self.noise:
            expr = self.exprs["noise"][name]
            if expr is None:
                raise Poisoned
            with_ = self._guard(name, expr)
            try:
                self.noise[name] = self.checker.value(expr, self._noise_scope())
            finally:
                with_()
        return self.noise[name]

    def _noise_scope(self) -> Scope:
        if not hasattr(self, "_noise_names"):
            self._noise_names = self._scope("noise")
        return self._noise_names

    def _observed_noise(self, name: str, at: s.Name) -> Value:
        value = self._noise(name)
        if reads([value.node]):
            self.checker.fail("E302", at, f"the noise '{name}' depends on the state or the action before the step",
                              "only noise that depends on neither can be observed; keep it in a state component")  # fmt: skip
        return value

    def _bind_definitions(self, bindings: dict[str, Binding], scope: Scope) -> None:
        for written, expr in self.exprs.get("definitions", {}).items():
            name, arguments = signature(written)
            if expr is None:
                bindings[name] = self._lazy(name, self._poison)
            elif arguments is None:
                bindings[name] = self._lazy(name, lambda e=expr: self._without_draws(e, scope))
            else:
                bindings[name] = FunctionDef(name, arguments, expr, scope, lambda at, n=name: self._guard(n, at))

    def _poison(self) -> Value:
        raise Poisoned

    def _without_draws(self, expr: s.Expr, scope: Scope) -> Value:
        inner = scope.child({})
        inner.draws = "definitions are named expressions, drawn nowhere; name a draw under `noise`"
        return self.checker.value(expr, inner)

    def _lazy(self, name: str, make: Callable[[], Value]) -> Lazy:
        """A binding worked out once, on first use; a circle is reported."""
        known: list[Value | None] = []

        def resolve(at: s.Name) -> Value:
            if not known:
                leave = self._guard(name, at)
                try:
                    known.append(make())
                except Poisoned:
                    known.append(None)
                finally:
                    leave()
            if known[0] is None:
                raise Poisoned
            return known[0]

        return Lazy(resolve)

    def _resolve(self, binding: Binding) -> None:
        """Work a lazy binding out for its mistakes."""
        place = s.Place(s.Text("", lambda a, b: self.merged.span(("name",))), 0, 0)
        try:
            if isinstance(binding, Lazy):
                binding.resolve(s.Name("", False, place))
        except Poisoned:
            pass
        except Refused as refused:
            self.collector.add(refused.code, place, refused.message, refused.hint)

    def _guard(self, name: str, at: s.Expr) -> Callable[[], None]:
        """Enter the expansion of a name; entering it twice is a circle. Returns what leaves it."""
        if name in self.busy:
            circle = " -> ".join([*self.busy[self.busy.index(name) :], name])
            self.checker.fail("E310", at, f"'{name}' needs its own value: {circle}")
        self.busy.append(name)
        return lambda: self.busy.remove(name)

    # -- sections -------------------------------------------------------------------------------------------------

    def _assign(self, expr: s.Expr, scope: Scope, component: Component) -> Node | None:
        """An expression as a value of a component; None when it is broken (and reported)."""
        value = self.checker.check(expr, scope, component.domain)
        if value is None:
            return None
        try:
            return self._fit(value, expr, component)
        except Poisoned:
            return None
        except Refused as refused:
            self.collector.add(refused.code, expr.place, refused.message, refused.hint)
            return None

    def _fit(self, value: Value, expr: s.Expr, c: Component) -> Node:
        if c.domain is not None and value.domain != c.domain:
            labels = ", ".join(c.domain.labels[:6])
            self.checker.fail("E306", expr, f"'{c.name}' is a choice between {labels}; this is {_what(value)}")
        node = value.node if c.domain is not None else self.checker.number_of(value, expr)
        if node.type.kind > c.type.kind:
            hint = {Kind.INT: "`floor(x)` and `round(x)` give ints", Kind.BOOL: "compare it, e.g. `x > 0`"}[c.type.kind]
            self.checker.fail("E306", expr, f"'{c.name}' is {_named(c.type.kind)}, but this is {_named(node.type.kind)}", hint)
        node = self.builder.stretch(self.builder.cast(node, c.type.kind), c.type.shape)
        if node.type.shape != c.type.shape:
            self.checker.fail("E307", expr, f"'{c.name}' has shape {list(c.type.shape)}, but this has {list(node.type.shape)}")
        return node

    def _initial(self) -> list[Node]:
        """Nodes of the first state, in order; later lines see earlier ones."""
        bindings: dict[str, Binding] = dict(self.constants)
        for c in self.state:
            bindings[c.name] = Unavailable("E317", f"'{c.name}' has no value yet", "a line of `initial` may use the lines before it")
        for c in self.action:
            bindings[c.name] = Unavailable("E302", f"the action '{c.name}' cannot be used in `initial`")
        scope = Scope(bindings, self.domains)
        self.scopes.append(scope)
        self.named_scopes["initial"] = scope
        self._bind_definitions(bindings, scope)
        found: dict[str, Node] = {}
        self._check_names("initial", [c.name for c in self.state])
        components = {c.name: c for c in self.state}
        for name, expr in self.exprs["initial"].items():
            c = components.get(name)
            node = None if expr is None or c is None else self._assign(expr, scope, c)
            if node is not None and c is not None:
                found[name] = node
                bindings[name] = Value(node, c.domain)
            elif c is not None:
                bindings[name] = Lazy(lambda at: self._poison())
            self._bind_definitions(bindings, scope)  # they may now see this component
        for c in self.state:
            if c.name not in self.exprs["initial"]:
                self.collector.add("E217", self.merged.key_span(("state", c.name)), f"'{c.name}' has no value in `initial`")
        return [found[c.name] for c in self.state if c.name in found]

    def _check_names(self, section: str, known: list[str]) -> None:
        for name in self.exprs[section]:
            if name in known:
                continue
            span = self.merged.key_span((section, name))
            if section == "dynamics" and name + "'" in known:
                self.collector.add("E215", span, f"the next value of '{name}' is written with a prime", f"{name}': ...")
            else:
                self.collector.add("E216", span, f"there is no state component '{name.rstrip(chr(39))}'", suggest(name, known))

    def _dynamics(self) -> list[Node]:
        """Nodes of the next state, in order; a component that is not named keeps its value."""
        self._check_names("dynamics", [c.name + "'" for c in self.state])
        self.dynamics_scope = self._scope("dynamics")
        place = s.Place(s.Text("", lambda a, b: self.merged.span(("dynamics",))), 0, 0)
        found = []
        for c in self.state:
            try:
                found.append(self._next_value(c.name, s.Name(c.name, True, place)).node)
            except Poisoned:
                continue
        return found

    def _next_value(self, name: str, at: s.Name) -> Value:
        """The next value of a component, worked out on first use."""
        if name in self.next:
            return self.next[name]
        component = next(c for c in self.state if c.name == name)
        written = name + "'"
        if written not in self.exprs["dynamics"]:
            self.next[name] = self._value(component, Role.STATE)
            return self.next[name]
        expr = self.exprs["dynamics"][written]
        leave = self._guard(written, at)
        try:
            node = None if expr is None else self._assign(expr, self.dynamics_scope, component)
        finally:
            leave()
        if node is None:
            raise Poisoned
        self.next[name] = Value(node, component.domain)
        return self.next[name]

    def _single(self, section: str, type_: Type, scope: Scope, default: Any = None) -> Node | None:
        """A section that is one value: the reward, the terminal condition."""
        if section not in self.data:
            return self.builder.const(default, type_)
        expr = self.exprs[section]
        value = None if expr is None else self.checker.check(expr, scope)
        if expr is None or value is None:
            return None
        try:
            node = self.checker.condition(expr, scope) if type_ == BOOL else self.checker.number_of(value, expr)
        except Poisoned:
            return None
        if not node.type.is_scalar:
            self.collector.add("E307", expr.place, f"the {section} is a single number, but this has shape {list(node.type.shape)}",
                               "`all(...)`, `any(...)` and `sum(...)` make one value of many")  # fmt: skip
            return None
        return self.builder.cast(node, type_.kind)

    def _observation(self, initial: list[Node], following: list[Node]) -> Observation:
        space = (self.data.get("observation") or {}).get("space", "auto")
        whole = len(initial) == len(following) == len(self.state)
        reached = reach(self.state, initial, following, self.horizon) if whole else {}
        observed = Observed(self.builder, self.state, reached)
        declared = self.exprs["observation"]
        if not declared:
            nodes = tuple(self._value(c, Role.STATE).node for c in self.state)
            return Observation(tuple(map(observed.state, self.state)), nodes, space, is_state=True)
        scope = self._scope("observation")
        components, nodes_ = [], []
        for name, expr in declared.items():
            value = None if expr is None else self.checker.check(expr, scope)
            if value is not None:
                low, high = (self._observed_edge(name, key, value.node.type) for key in ("low", "high"))
                components.append(observed.expression(name, value, low, high))
                nodes_.append(value.node)
        return Observation(tuple(components), tuple(nodes_), space)

    def _observed_edge(self, name: str, key: str, type_: Type) -> tuple[float, ...] | None:
        """A declared bound of an observed expression, if there is one."""
        entry = self.data["observation"][name]
        if not is_bounded(entry) or entry.get(key) is None:
            return None
        try:
            return self.declare.edge(entry, key, ("observation", name), type_, self.constants_scope)
        except Poisoned:
            return None

    def _expert(self) -> tuple[Node, ...] | Literal["optimal"] | Soft | None:
        value = self.data.get("expert")
        if value is None:
            return None
        scope = self._scope("expert")
        if not isinstance(value, dict) or (len(self.action) == 1 and self.action[0].name not in value):
            expr = self.forms.expr(("expert",))
            self.exprs["expert"] = expr
            if expr is None:
                return None
            named = self._named_expert(expr, scope)
            if named is not None or len(self.action) != 1:
                if named is None:
                    names = ", ".join(f"{c.name}: ..." for c in self.action)
                    self.collector.add("E216", expr.place, f"an expert gives every action component: {{{names}}}")
                return named
            node = self._assign(expr, scope, self.action[0])
            return None if node is None else (node,)
        return self._expert_components(value, scope)

    def _named_expert(self, expr: s.Expr, scope: Scope) -> Literal["optimal"] | Soft | None:
        match expr:
            case s.Name(id="optimal"):
                return "optimal"
            case s.Call(function="soft", args=(beta,)):
                try:
                    node = self.checker.constant(beta, scope, "the inverse temperature")
                except Poisoned:
                    return Soft(1.0)
                return Soft(float(node.value))
            case _:
                return None

    def _expert_components(self, value: dict[str, Any], scope: Scope) -> tuple[Node, ...] | None:
        exprs = {name: self.forms.expr(("expert", name)) for name in value}
        self.exprs["expert"] = exprs
        known = [c.name for c in self.action]
        for name in value:
            if name not in known:
                span = self.merged.key_span(("expert", name))
                self.collector.add("E216", span, f"there is no action component '{name}'", suggest(name, known))
        nodes = []
        for c in self.action:
            expr = exprs.get(c.name)
            if c.name not in value:
                self.collector.add("E216", self.merged.key_span(("expert",)), f"the expert gives no '{c.name}'")
            node = None if expr is None else self._assign(expr, scope, c)
            if node is not None:
                nodes.append(node)
        return tuple(nodes) if len(nodes) == len(self.action) else None

    def _check_unused(self) -> None:
        """Definitions and noise that nothing uses are checked all the same."""
        scope = self._scope("reward")
        for name in self.data.get("noise") or {}:
            self._resolve(scope.bindings[name])
        for written in self.exprs["definitions"]:
            name, arguments = signature(written)
            if arguments is None and not any(name in x.used for x in self.scopes):
                self._resolve(scope.bindings[name])

    def _abstraction(self) -> None:
        """Read the functions that map a state to its finite stand-in."""
        if self.data.get("abstraction"):
            scope = self._scope("abstraction")
            path = ("abstraction", "map")
            self.exprs["abstraction"] = {n: self.forms.expr((*path, n)) for n in self.forms.value(path)}
            for expr in self.exprs["abstraction"].values():
                if expr is not None:
                    self.checker.check(expr, scope)

    def _claims(self) -> Iterable[Claim]:
        claims = []
        for i, entry in enumerate(self.data.get("claims") or ()):
            path: Path = ("claims", i) if isinstance(entry, str) else ("claims", i, "claim")
            text = entry if isinstance(entry, str) else entry["claim"]
            expr = parse_into(self.forms.text(path, str(text)), self.collector)
            if expr is not None:
                rest = {} if isinstance(entry, str) else {k: v for k, v in entry.items() if k not in ("claim", "for")}
                cases = () if isinstance(entry, str) else tuple(entry.get("for") or ())
                claims.append(Claim(expr, str(text), cases, rest))
        return claims

    def _hash(self) -> str:
        """SHA-256 of what decides the task's behaviour: its semantic sections and its parameter values."""
        content = {section: self.data[section] for section in SEMANTIC if section in self.data}
        content["format"] = self.data.get("taskspec", 1)
        content["values"] = {p.name: p.value for p in self.parameters}
        return hashlib.sha256(json.dumps(content, default=str).encode()).hexdigest()


_NO_DRAWS = {
    "absorbing": "an absorbing reward is a fixed number",
    "claims": "a claim is a statement about exact results",
    "abstraction": "an abstraction is a function of the state",
}
"""Sections in which nothing may be drawn, and why."""


def is_bounded(entry: Any) -> bool:
    """Whether an observation is written `{value: expression, low: ..., high: ...}`."""
    return isinstance(entry, dict) and "value" in entry and entry.keys() <= {"value", "low", "high"}


def signature(written: str) -> tuple[str, tuple[str, ...] | None]:
    """Name and arguments of a definition: `p(x, y)` is ("p", ("x", "y")), `p` is ("p", None)."""
    name, bracket, rest = written.partition("(")
    if not bracket:
        return name.strip(), None
    return name.strip(), tuple(a.strip() for a in rest.rstrip().rstrip(")").split(",") if a.strip())


def _named(kind: Kind) -> str:
    return {Kind.BOOL: "a bool", Kind.INT: "an int", Kind.REAL: "a real"}[kind]


def _what(value: Value) -> str:
    return "a choice between other labels" if value.domain is not None else _named(value.node.type.kind)
