"""The sections of a spec as core nodes: first and next states, reward, end, observation, expert, claims."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

from taskspec.base.diagnostics import suggest
from taskspec.base.limits import count, how_to_raise, limits
from taskspec.base.named import all_names, entries_by_name
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.scope import Lazy, Poisoned, Scope, Value
from taskspec.language.expressions.types import REAL, Role, Type
from taskspec.language.source import Path
from taskspec.language.task import declarations
from taskspec.language.task import parts as parameters
from taskspec.language.task.context import EXPRESSIONS, Context, poison
from taskspec.language.task.names import Names
from taskspec.language.task.parts import FINITE_SPACES, Claim, Component, Observation, Soft, counts_of
from taskspec.language.task.reach import Observed, kept, reach, saturated, too_wide, widest

Expert = tuple[Node, ...] | Literal["optimal"] | Soft | None


def parse_sections(context: Context) -> None:
    """Read the expressions of every section, reporting all syntax errors; without components nothing more can be read."""
    for section in EXPRESSIONS:
        exprs = context.exprs[section]
        for name, value in (context.data.get(section) or {}).items():
            is_measure = section == "measures" and isinstance(value, dict) and "value" in value
            if is_measure or (section == "observation" and is_bounded(value)):
                exprs[name] = context.forms.expr((section, name, "value"))
            elif (section, name) != ("observation", "space"):
                exprs[name] = context.forms.expr((section, name))
    for section in ("reward", "terminal", "absorbing_reward", "legal"):
        if section in context.data:
            context.exprs[section] = context.forms.expr((section,))
    if not context.state or not context.action:
        context.collector.raise_if_errors()


# -- states ---------------------------------------------------------------------------------------------------


def initial_values(context: Context, names: Names) -> list[Node]:
    """Read the first state, in order; later lines see earlier ones."""
    scope = names.initial_scope()
    _check_names(context, "initial", all_names(context.state))
    components = entries_by_name(context.state)
    values: dict[str, Node] = {}
    for name, expr in context.exprs["initial"].items():
        c = components.get(name)
        if c is None:
            continue
        node = context.assign(expr, scope, c)
        if node is None:
            names.define(scope, name, Lazy(poison))
            continue
        context.raw_initial[name] = node
        values[name] = kept(context.builder, c, node)
        names.define(scope, name, Value(values[name], c.domain, late=True))
    for c in context.state:
        if c.name in context.exprs["initial"]:
            continue
        if c.low == c.high:  # there is nothing to choose
            values[c.name] = context.raw_initial[c.name] = context.builder.constant(c.low, c.type)
            continue
        # Reported at `initial`, unless a variant declares the component beside the spec's `initial`.
        declared: Path = ("state", c.name)
        is_added = context.merged.origin(declared) != context.merged.origin(("initial",))
        path: Path = declared if is_added else ("initial",)
        context.report_key("E217", path, f"'{c.name}' has no value in `initial`", f"add `{c.name}: ...`")
    return [values[c.name] for c in context.state if c.name in values]


def _check_names(context: Context, section: str, known: list[str]) -> None:
    for name in context.exprs[section]:
        if name in known:
            continue
        if section == "dynamics" and name + "'" in known:
            message = f"the next value of '{name}' is written with a prime"
            context.report_key("E215", (section, name), message, f"{name}': ...")
        else:
            bare = name.removesuffix("'")
            context.report_key("E216", (section, name), f"there is no state component '{bare}'", suggest(name, known))


def next_values(context: Context, names: Names) -> list[Node]:
    """Read the next state, in order; a component that is not named keeps its value."""
    _check_names(context, "dynamics", [c.name + "'" for c in context.state])
    place = context.place("dynamics")
    values = []
    for c in context.state:
        try:
            values.append(names.next_value(c.name, s.Name(c.name, True, place)).node)
        except Poisoned:
            continue
    return values


def saturate(context: Context, names: Names, initial: list[Node], following: list[Node]) -> list[Node]:
    """Bound ints of next states so that they fit; all later reads of next values read the bounded ones."""
    if not len(initial) == len(following) == len(context.state):
        return following
    nexts = saturated(context.builder, context.state, initial, following, context.horizon)
    for c, old, new in zip(context.state, following, nexts, strict=True):
        if new is not old:
            names.next[c.name] = Value(new, c.domain, late=True)
    return nexts


def check_widths(context: Context, **sections: Sequence[Node]) -> None:
    """Report (E318) the lines of sections in which an int may not fit in 64 bits."""
    for section, nodes in sections.items():
        exprs = context.exprs.get(section)
        lines = [exprs]
        if isinstance(exprs, dict):
            lines = list(exprs.values())
        for number, node in enumerate(nodes):
            most = widest([node])
            if not most:
                continue
            line = None
            if len(lines) == len(nodes):
                line = lines[number]
            too_wide(context.collector, line.place if line else context.place(section), most)
            break


# -- single values --------------------------------------------------------------------------------------------


def end_condition(context: Context, names: Names) -> Node | None:
    """Read the condition that ends an episode, which `reward` may have named before; never, without one."""
    if "terminal" not in context.data:
        return context.builder.scalar(False)
    try:
        return names.end(s.Name("terminal", False, context.place("terminal"))).node
    except Poisoned:
        return None


def single_number(context: Context, section: str, type_: Type, scope: Scope, default: Any = None) -> Node | None:
    """Read a section that is one number: the reward, the absorbing reward."""
    if section not in context.data:
        return context.builder.const(default, type_)
    return _number(context, context.exprs[section], f"the {section}", type_, scope)


def measures(context: Context, names: Names) -> dict[str, Node]:
    """Read the measures by name, without broken ones (reported)."""
    values: dict[str, Node] = {}
    for name, expr in context.exprs["measures"].items():
        node = _number(context, expr, f"the measure '{name}'", REAL, names.scope("measures"))
        if node is not None:
            values[name] = node
    return values


def _number(context: Context, expr: s.Expr | None, what: str, kind: Type, scope: Scope) -> Node | None:
    if expr is None:
        return None
    try:
        node = context.checker.numeric(expr, scope)
        if node.type.is_scalar:
            return context.builder.cast(node, kind.kind)
        parts = []
        for part in s.alternatives(expr):
            parts.append((part, context.checker.numeric(part, scope).type))
    except Poisoned:
        return None
    for part, type_ in [p for p in parts if not p[1].is_scalar] or [(expr, node.type)]:
        message = f"{what} is a single number, but this has shape {list(type_.shape)}"
        hint = "`all(...)`, `any(...)` and `sum(...)` make one value of many"
        context.collector.add("E307", part.place, message, hint)
    return None


# -- observation ----------------------------------------------------------------------------------------------


def is_bounded(entry: Any) -> bool:
    """Test whether an observation is written `{value: expression, low: ..., high: ...}`."""
    return isinstance(entry, dict) and "value" in entry and entry.keys() <= {"value", "low", "high"}


def observed(context: Context, names: Names, initial: list[Node], following: list[Node]) -> Observation:
    """Read the observation: the declared expressions, or else the state."""
    space = (context.data.get("observation") or {}).get("space", "auto")
    whole = len(initial) == len(following) == len(context.state)
    reached = {}
    if whole:
        reached = reach(context.state, initial, following, context.horizon)
    makes = Observed(context.builder, context.state, reached)
    declared = context.exprs["observation"]
    if not declared:
        present = [context.read(c, Role.STATE) for c in context.state]
        components = tuple(makes.expression(c.name, value) for c, value in zip(context.state, present, strict=True))
        if whole:
            _check_space(context, components, space)
        return Observation(components, tuple(value.node for value in present), space, is_state=True)
    scope = names.scope("observation")
    values = {name: context.checker.check(expr, scope) for name, expr in declared.items()}
    seen = {name: value for name, value in values.items() if value is not None}
    is_sound = len(seen) == len(declared)
    size = sum(v.node.type.size for v in seen.values())
    place = context.merged.key_span(("observation",))
    if not declarations.fits(context, size, place, "`observation:`", least=int(is_sound)):
        return Observation((), ())
    shown = []
    for name, value in seen.items():
        low = _edge(context, name, "low", value.node.type)
        high = _edge(context, name, "high", value.node.type)
        c = makes.expression(name, value, low, high)
        shown.append(c)
        if low is not None or high is not None:
            try:
                declarations.check_order(context, c.low, c.high, ("observation", name))
            except Poisoned:
                is_sound = False
    if is_sound:
        _check_space(context, shown, space)
    return Observation(tuple(shown), tuple(v.node for v in seen.values()), space)


def _check_space(context: Context, components: Sequence[Component], space: str) -> None:
    path: Path = ("observation", "space")
    endless = next((c.name for c in components if not c.is_finite), None)
    if space in FINITE_SPACES and endless is not None:
        message = f"`{space}` needs ints with bounds, choices or conditions, which '{endless}' is not"
        context.report("E214", path, message, "declare bounds: `{value: ..., low: ..., high: ...}`")
    elif space == "discrete" and not (len(components) == 1 and components[0].type.is_scalar):
        context.report("E214", path, "`discrete` is one number, but more are observed")
    elif space == "one_hot" and (needed := sum(counts_of(components))) > limits().one_hot:
        message = f"`one_hot` would have {count(needed)} elements; the limit is {limits().one_hot:,}"
        context.report("E214", path, message, how_to_raise("one_hot", needed))


def _edge(context: Context, name: str, key: str, type_: Type) -> tuple[float, ...] | None:
    entry = context.data["observation"][name]
    if not is_bounded(entry) or entry.get(key) is None:
        return None
    try:
        scope = context.constant_scope("bounds are fixed")
        return declarations.bound(context, key, ("observation", name), type_, scope)
    except Poisoned:
        return None


# -- expert ---------------------------------------------------------------------------------------------------


def expert_action(context: Context, names: Names) -> Expert:
    """Read the action of the expert: `optimal`, `soft(beta)`, an expression for each component, or a single one."""
    value = context.data.get("expert")
    if value is None:
        return None
    scope = names.scope("expert")
    components = context.action
    expr = None
    names_components = isinstance(value, dict) and (len(components) != 1 or components[0].name in value)
    if not names_components:
        expr = context.exprs["expert"] = context.forms.expr(("expert",))
        if isinstance(expr, s.Weights):
            outcomes = [outcome for outcome, _ in expr.pairs]
            names_components = all(isinstance(o, s.Name) and o.id not in scope.bindings for o in outcomes)
    if names_components:
        exprs = {name: context.forms.expr(("expert", name)) for name in value}
        context.exprs["expert"] = exprs
        return by_component(context, ("expert",), exprs, scope, is_whole=True)
    match expr:
        case s.Name(id="optimal"):
            return "optimal"
        case s.Call(function="soft", args=(beta,)):
            try:
                return Soft(float(context.checker.constant(beta, scope, "the inverse temperature").value))
            except Poisoned:
                return None
    if expr is not None and len(components) != 1:
        every = ", ".join(f"{c.name}: ..." for c in components)
        context.collector.add("E216", expr.place, f"an expert gives every action component: {{{every}}}")
        return None
    node = context.assign(expr, scope, components[0])
    if node is None:
        return None
    return (node,)


def by_component(
    context: Context, path: Path, exprs: Mapping[str, s.Expr | None], scope: Scope, is_whole: bool
) -> tuple[Node, ...] | None:
    """Read a value for each action component, None for a broken one (reported); `is_whole` where all must be given."""
    known = all_names(context.action)
    for name in exprs:
        if name not in known:
            context.report_key("E216", (*path, name), f"there is no action component '{name}'", suggest(name, known))
    nodes = []
    for c in context.action:
        node = context.assign(exprs.get(c.name), scope, c)
        if c.name not in exprs and is_whole:
            context.report_key("E216", path, f"the expert gives no '{c.name}'")
        elif c.name not in exprs:
            node = context.read(c, Role.ACTION).node
        if node is not None:
            nodes.append(node)
    if len(nodes) == len(known):
        return tuple(nodes)
    return None


# -- abstraction and claims -----------------------------------------------------------------------------------


def abstraction_map(context: Context, names: Names) -> list[Node]:
    """Read the values that the components of the finite stand-in have in a state."""
    if not context.data.get("abstraction"):
        return []
    scope = names.scope("abstraction")
    fixed = context.constant_scope("domains are fixed")
    path: Path = ("abstraction", "map")
    written = context.data["abstraction"]["map"]
    components = context.data["abstraction"]["state"]
    exprs = {name: context.forms.expr((*path, name)) for name in written}
    context.exprs["abstraction"] = exprs
    nodes = []
    for name, expr in exprs.items():
        if name not in components:
            message = f"the abstraction has no component '{name}'"
            context.report_key("E216", (*path, name), message, suggest(name, components))
            continue
        c = declarations.component(context, ("abstraction", "state", name), fixed)
        if c is not None:
            node = context.assign(expr, scope, c)
            nodes += [] if node is None else [node]
    for name in components:
        if name not in written:
            context.report_key("E216", path, f"the map does not say what '{name}' is", f"add `{name}: ...`")
    return nodes


def claims(context: Context) -> Iterator[Claim]:
    """Parse the claims; they are evaluated on the exact model."""
    written = context.data.get("claims") or []
    entries: list[dict[str, Any]] = []
    for entry in written:
        if isinstance(entry, str):
            entries.append({"claim": entry})
        else:
            entries.append(entry)
    number = sum(parameters.size(entry.get("for")) or 1 for entry in entries)
    too_many = number > limits().claims
    if too_many:
        message = f"{number:,} claims, with all their parameter values, are too many; the limit is {limits().claims:,}"
        context.report_key("E314", ("claims",), message, how_to_raise("claims", number))
    for i, entry in enumerate(entries):
        path: Path = ("claims", i) if isinstance(written[i], str) else ("claims", i, "claim")
        text = str(entry["claim"])
        expr = context.forms.parsed(context.forms.text(path, text), path)
        episodes = entry.get("episodes") or 0
        if episodes > limits().episodes:
            message = f"{count(episodes)} episodes are too many; the limit is {limits().episodes:,}"
            context.report("E314", ("claims", i, "episodes"), message, how_to_raise("episodes", episodes))
        if expr is not None:
            rest = {}
            for key, value in entry.items():
                if key not in ("claim", "for"):
                    rest[key] = value
            cases = () if too_many else tuple(parameters.cases(entry.get("for")))
            yield Claim(expr, text, cases, rest)
