"""The sections of a spec as core nodes: first and next states, reward, end, observation, expert, claims."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal

from taskspec.base.diagnostics import suggest
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.lang import syntax as s
from taskspec.lang.ir import Node, Role
from taskspec.lang.parse import parse_into
from taskspec.lang.scope import Lazy, Poisoned, Scope, Value
from taskspec.lang.types import Kind, Type
from taskspec.source import Path
from taskspec.task import declare, parameters
from taskspec.task.context import Context, poison
from taskspec.task.names import Names
from taskspec.task.observe import Observed
from taskspec.task.reach import kept, reach, saturated, too_wide, widest
from taskspec.task.task import FINITE_SPACES, Claim, Component, Observation, Soft

Expert = tuple[Node, ...] | Literal["optimal"] | Soft | None


def parse_sections(context: Context) -> None:
    """Read the expressions of every section, reporting all syntax errors."""
    for section in ("definitions", "noise", "initial", "dynamics", "observation"):
        entries = context.data.get(section) or {}
        names = [n for n in entries if not (section == "observation" and n == "space")]
        context.exprs[section] = {name: _entry(context, section, name, entries[name]) for name in names}
    for section in ("reward", "terminal", "absorbing_reward"):
        if section in context.data:
            context.exprs[section] = context.forms.expr((section,))


def _entry(context: Context, section: str, name: str, value: Any) -> s.Expr | None:
    inner = section == "observation" and is_bounded(value)
    return context.forms.expr((section, name, "value") if inner else (section, name))


# -- states ---------------------------------------------------------------------------------------------------


def initial_values(context: Context, names: Names) -> list[Node]:
    """Return nodes of the first state, in order; later lines see earlier ones."""
    scope = names.initial_scope()
    _check_names(context, "initial", [c.name for c in context.state])
    components = {c.name: c for c in context.state}
    found: dict[str, Node] = {}
    for name, expr in context.exprs["initial"].items():
        c = components.get(name)
        node = None if expr is None or c is None else context.assign(expr, scope, c)
        if node is not None and c is not None:
            context.raw_initial[name] = node
            found[name] = kept(context.builder, c, node)
            names.define(scope, name, Value(found[name], c.domain, late=True))
        elif c is not None:
            names.define(scope, name, Lazy(poison))
    for c in context.state:
        if c.name not in context.exprs["initial"] and c.low == c.high:  # there is nothing to choose
            flat = c.low if c.type.kind is Kind.REAL else tuple(map(int, c.low))
            found[c.name] = context.raw_initial[c.name] = context.builder.const(
                flat if c.type.shape else flat[0], c.type
            )
        elif c.name not in context.exprs["initial"]:
            _without_start(context, c.name)
    return [found[c.name] for c in context.state if c.name in found]


def _without_start(context: Context, name: str) -> None:
    """Report a component without a line in `initial`: there, unless a variant declares it beside the spec's `initial`."""
    merged = context.merged
    section = ("initial",)
    is_added = merged.origin(("state", name)) != merged.origin(section)
    place = merged.key_span(("state", name) if is_added else section)
    context.collector.add("E217", place, f"'{name}' has no value in `initial`", f"add `{name}: ...`")


def _check_names(context: Context, section: str, known: list[str]) -> None:
    for name in context.exprs[section]:
        span = context.merged.key_span((section, name))
        if name in known:
            continue
        if section == "dynamics" and name + "'" in known:
            message = f"the next value of '{name}' is written with a prime"
            context.collector.add("E215", span, message, f"{name}': ...")
        else:
            bare = name.removesuffix("'")
            context.collector.add("E216", span, f"there is no state component '{bare}'", suggest(name, known))


def next_values(context: Context, names: Names) -> list[Node]:
    """Return nodes of the next state, in order; a component that is not named keeps its value."""
    _check_names(context, "dynamics", [c.name + "'" for c in context.state])
    place = context.place("dynamics")
    found = []
    for c in context.state:
        try:
            found.append(names.next_value(c.name, s.Name(c.name, True, place)).node)
        except Poisoned:
            continue
    return found


def saturate(context: Context, names: Names, initial: list[Node], following: list[Node]) -> list[Node]:
    """Return next states with ints that fit (`spec.widths`); what reads a next value later reads that."""
    if not len(initial) == len(following) == len(context.state):
        return following
    found = saturated(context.builder, context.state, initial, following, context.horizon)
    for c, old, new in zip(context.state, following, found, strict=True):
        if new is not old:
            names.set_next(c.name, Value(new, c.domain, late=True))
    return found


def check_widths(context: Context, **sections: Sequence[Node]) -> None:
    """Report (E318) the lines of sections in which an int may not fit in 64 bits."""
    for section, nodes in sections.items():
        _check_widths(context, section, nodes)


def _check_widths(context: Context, section: str, nodes: Sequence[Node]) -> None:
    exprs = context.exprs.get(section)
    lines = list(exprs.values()) if isinstance(exprs, dict) else [exprs]
    wide = [most for most in map(widest, ([n] for n in nodes)) if most]
    if wide:
        narrow = [e for e, n in zip(lines, nodes, strict=False) if e is not None and widest([n])]
        place = narrow[0].place if narrow and len(lines) == len(nodes) else context.place(section)
        too_wide(context.collector, place, wide[0])


# -- single values --------------------------------------------------------------------------------------------


def end_condition(context: Context, names: Names) -> Node | None:
    """Return the condition that ends an episode, which `reward` may have named before; never, where there is none."""
    if "terminal" not in context.data:
        return context.builder.scalar(False)
    try:
        return names.end(s.Name("terminal", False, context.place("terminal"))).node
    except Poisoned:
        return None


def single_number(context: Context, section: str, type_: Type, scope: Scope, default: Any = None) -> Node | None:
    """Return a section that is one number: the reward, the absorbing reward."""
    if section not in context.data:
        return context.builder.const(default, type_)
    expr = context.exprs[section]
    try:
        if expr is None:
            return None
        return _number(context, expr, scope, section, type_)
    except Poisoned:
        return None


def _number(context: Context, expr: s.Expr, scope: Scope, section: str, type_: Type) -> Node:
    node = context.checker.numeric(expr, scope)
    if not node.type.is_scalar:
        parts = [(part, context.checker.numeric(part, scope).type) for part in s.alternatives(expr)]
        for part, type_ in [p for p in parts if not p[1].is_scalar] or [(expr, node.type)]:
            message = f"the {section} is a single number, but this has shape {list(type_.shape)}"
            hint = "`all(...)`, `any(...)` and `sum(...)` make one value of many"
            context.collector.add("E307", part.place, message, hint)
        raise Poisoned
    return context.builder.cast(node, type_.kind)


# -- observation ----------------------------------------------------------------------------------------------


def observed(context: Context, names: Names, initial: list[Node], following: list[Node]) -> Observation:
    space = (context.data.get("observation") or {}).get("space", "auto")
    whole = len(initial) == len(following) == len(context.state)
    reached = reach(context.state, initial, following, context.horizon) if whole else {}
    observed = Observed(context.builder, context.state, reached)
    declared = context.exprs["observation"]
    if not declared:
        nodes = tuple(context.read(c, Role.STATE).node for c in context.state)
        components = tuple(map(observed.state, context.state))
        if whole:
            _check_space(context, components, space)
        return Observation(components, nodes, space, is_state=True)
    scope = names.scope("observation")
    values = {name: None if expr is None else context.checker.check(expr, scope) for name, expr in declared.items()}
    found = {name: value for name, value in values.items() if value is not None}
    size = sum(v.node.type.size for v in found.values())
    place = context.merged.key_span(("observation",))
    if not declare.fits(context, size, place, "`observation:`", least=int(len(found) == len(declared))):
        return Observation((), ())
    edges = {name: [_edge(context, name, key, v.node.type) for key in ("low", "high")] for name, v in found.items()}
    components = tuple(observed.expression(name, v, *edges[name]) for name, v in found.items())
    ordered = [_check_order(context, c) for c in components if edges[c.name] != [None, None]]
    if len(found) == len(declared) and all(ordered):
        _check_space(context, components, space)
    return Observation(components, tuple(v.node for v in found.values()), space)


def _check_space(context: Context, components: tuple[Component, ...], space: str) -> None:
    """Refuse a space that cannot hold what is observed."""
    endless = next((c.name for c in components if not c.is_finite), None)
    message = hint = None
    if space in FINITE_SPACES and endless is not None:
        message = f"`{space}` needs ints with bounds, choices or conditions, which '{endless}' is not"
    elif space == "discrete" and not (len(components) == 1 and components[0].type.is_scalar):
        message = "`discrete` is one number, but more are observed"
    elif space == "one_hot" and (needed := sum(n for c in components for n in c.counts)) > limits().one_hot:
        message = f"`one_hot` would have {count(needed)} elements; the limit is {limits().one_hot:,}"
        hint = how_to_raise("one_hot", needed)
    if message is not None:
        hint = "declare bounds: `{value: ..., low: ..., high: ...}`" if endless else hint
        context.collector.add("E214", context.merged.span(("observation", "space")), message, hint)


def _check_order(context: Context, c: Component) -> bool:
    """Return whether values lie between the bounds of what is observed; reported where there are none."""
    try:
        declare.check_order(context, c.low, c.high, ("observation", c.name))
    except Poisoned:
        return False
    return True


def _edge(context: Context, name: str, key: str, type_: Type) -> tuple[float, ...] | None:
    """Return a declared bound of an observed expression, if there is one."""
    entry = context.data["observation"][name]
    if not is_bounded(entry) or entry.get(key) is None:
        return None
    scope = context.constant_scope("bounds are fixed")
    try:
        return declare.bound(context, entry, key, ("observation", name), type_, scope)
    except Poisoned:
        return None


# -- expert ---------------------------------------------------------------------------------------------------


def expert_action(context: Context, names: Names) -> Expert:
    value = context.data.get("expert")
    if value is None:
        return None
    components = context.action
    if isinstance(value, dict) and not (len(components) == 1 and components[0].name not in value):
        return _expert_components(context, names, value)
    return _expert_expression(context, names)


def _expert_expression(context: Context, names: Names) -> Expert:
    """`optimal`, `soft(beta)`, or the action itself where it has one component."""
    scope = names.scope("expert")
    expr = context.exprs["expert"] = context.forms.expr(("expert",))
    match expr:
        case None:
            return None
        case s.Name(id="optimal"):
            return "optimal"
        case s.Call(function="soft", args=(beta,)):
            return _soft(context, beta, scope)
    if len(context.action) != 1:
        every = ", ".join(f"{c.name}: ..." for c in context.action)
        context.collector.add("E216", expr.place, f"an expert gives every action component: {{{every}}}")
        return None
    node = context.assign(expr, scope, context.action[0])
    return None if node is None else (node,)


def _soft(context: Context, beta: s.Expr, scope: Scope) -> Soft | None:
    try:
        return Soft(float(context.checker.constant(beta, scope, "the inverse temperature").value))
    except Poisoned:
        return None


def _expert_components(context: Context, names: Names, value: dict[str, Any]) -> Expert:
    scope = names.scope("expert")
    exprs = context.exprs["expert"] = {name: context.forms.expr(("expert", name)) for name in value}
    known = [c.name for c in context.action]
    for name in (n for n in value if n not in known):
        span = context.merged.key_span(("expert", name))
        context.collector.add("E216", span, f"there is no action component '{name}'", suggest(name, known))
    nodes = []
    for c in context.action:
        if c.name not in value:
            span = context.merged.key_span(("expert",))
            context.collector.add("E216", span, f"the expert gives no '{c.name}'")
        expr = exprs.get(c.name)
        node = None if expr is None else context.assign(expr, scope, c)
        nodes += [] if node is None else [node]
    return tuple(nodes) if len(nodes) == len(context.action) else None


# -- abstraction and claims -----------------------------------------------------------------------------------


def abstraction_map(context: Context, names: Names) -> list[Node]:
    """Return the values that the components of the finite stand-in have in a state."""
    if not context.data.get("abstraction"):
        return []
    scope = names.scope("abstraction")
    written = context.data["abstraction"]["map"]
    context.exprs["abstraction"] = {n: context.forms.expr(("abstraction", "map", n)) for n in written}
    components = context.data["abstraction"]["state"]
    mapped = [_mapped(context, name, expr, components, scope) for name, expr in context.exprs["abstraction"].items()]
    for name in (n for n in components if n not in written):
        span = context.merged.key_span(("abstraction", "map"))
        context.collector.add("E216", span, f"the map does not say what '{name}' is", f"add `{name}: ...`")
    return [node for node in mapped if node is not None]


def _mapped(context: Context, name: str, expr: s.Expr | None, components: dict[str, Any], scope: Scope) -> Node | None:
    """Return an expression of the map as a value of the component that it is for; None when it is broken (and reported)."""
    if name not in components:
        span = context.merged.key_span(("abstraction", "map", name))
        context.collector.add("E216", span, f"the abstraction has no component '{name}'", suggest(name, components))
        return None
    fixed = context.constant_scope("domains are fixed")
    c = declare.component(context, ("abstraction", "state", name), fixed)
    return None if expr is None or c is None else context.assign(expr, scope, c)


def _check_episodes(context: Context, path: Path, entry: Any) -> None:
    """Report (E314) a claim that asks for more episodes than are simulated."""
    wanted = entry.get("episodes") if isinstance(entry, dict) else None
    most = limits().episodes
    if wanted is not None and wanted > most:
        message = f"{count(wanted)} episodes are too many; the limit is {most:,}"
        context.collector.add(
            "E314", context.merged.span((*path, "episodes")), message, how_to_raise("episodes", wanted)
        )


def _too_many(context: Context, claims: list[Any]) -> bool:
    """Report (E314) more claims than are checked."""
    number = sum(parameters.size(entry.get("for")) or 1 if isinstance(entry, dict) else 1 for entry in claims)
    most = limits().claims
    if number > most:
        message = f"{number:,} claims, counted for all their parameter values, are too many; the limit is {most:,}"
        context.collector.add("E314", context.merged.key_span(("claims",)), message, how_to_raise("claims", number))
    return number > most


def claims(context: Context) -> Iterable[Claim]:
    """Yield the claims as surface syntax; they are evaluated on the exact model."""
    too_many = _too_many(context, context.data.get("claims") or [])
    for i, entry in enumerate(context.data.get("claims") or ()):
        path: Path = ("claims", i) if isinstance(entry, str) else ("claims", i, "claim")
        text = entry if isinstance(entry, str) else entry["claim"]
        expr = parse_into(context.forms.text(path, str(text)), context.collector)
        _check_episodes(context, path[:2], entry)
        if expr is not None:
            rest = {} if isinstance(entry, str) else {k: v for k, v in entry.items() if k not in ("claim", "for")}
            cases = () if isinstance(entry, str) or too_many else tuple(parameters.cases(entry.get("for")))
            yield Claim(expr, str(text), cases, rest)


def is_bounded(entry: Any) -> bool:
    """Return whether an observation is written `{value: expression, low: ..., high: ...}`."""
    return isinstance(entry, dict) and "value" in entry and entry.keys() <= {"value", "low", "high"}
