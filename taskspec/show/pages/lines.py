"""Lines of the sections that say what a task is: spaces, observations, dynamics, rewards, start, expert."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import groupby
from typing import Any

from taskspec.base.display import lettered, number
from taskspec.language.expressions import syntax as s
from taskspec.language.task.names import signature
from taskspec.language.task.parts import Component, Soft
from taskspec.language.task.questions import argument_axes
from taskspec.language.task.schema.typed import ComponentEntry
from taskspec.show.pages.equations import Writing, unchanged
from taskspec.show.pages.prose import CodeSpan, Formula, Inlines, Text, followed, inlines, listing, separated
from taskspec.show.printers import tree as m
from taskspec.show.printers.cases import arrows, has_arrows
from taskspec.show.printers.expressions import ExpressionWriter
from taskspec.show.printers.names import expression
from taskspec.show.printers.rewrites import draws, is_draw
from taskspec.show.printers.text import text

_SPACES = {
    "dict": "as a dictionary of its components", "one_hot": "as one-hot vectors",
    "multi_discrete": "as a vector of integers", "box": "as one vector of reals", "discrete": "as one integer",
}  # fmt: skip
_MANY = 40
_OF_STEPS = ("dynamics", "reward", "measures", "terminal", "observation")  # sections whose draws are made in every step


Maker = Callable[[Writing], Iterator[Inlines]]  # makes the lines of a section


def formula(*items: m.Math) -> Formula:
    return Formula(m.row(*items))


def parameters(w: Writing) -> Iterator[Inlines]:
    """Yield `L = 10`, its description and its range, for each parameter."""
    for p in w.task.parameters:
        content: Inlines = (formula(m.equal(w.symbol(p.name), setting(w.values.get(p.name, p.value)))),)
        if w.symbol(p.name) not in (m.Ident(p.name), m.upright(p.name)):
            content += (Text(" ("), CodeSpan(p.name), Text(")"))
        yield (*followed(content, ", ", p.doc), *_range(w, p.name))


def cases(w: Writing, given: Iterable[Mapping[str, Any]]) -> Inlines:
    lines = []
    for case in given:
        equal: list[Inlines] = []
        for name, value in case.items():
            equal.append((formula(m.equal(w.symbol(name), setting(value))),))
        lines.append(separated(equal))
    return separated(lines, "; ")


def setting(value: Any) -> m.Math:
    if isinstance(value, bool):
        return m.upright(str(value).lower())
    if isinstance(value, int | float):
        digits = str(abs(value))
        if isinstance(value, float):
            digits = number(abs(value), 10)
        return m.signed(value < 0, m.Num(digits))
    return m.Words(str(value))


def _range(w: Writing, name: str) -> Inlines:
    entry = w.spec.parameters.entries[name]
    low = entry.low
    high = entry.high
    if entry.values:
        return (Text(" ("), Formula(w.domain(name, entry)), Text(")"))
    if low is not None and high is not None:
        return (Text(" ("), Formula(w.declared(low)), Text(" to "), Formula(w.declared(high)), Text(")"))
    if low is not None:
        return (Text(" (at least "), Formula(w.declared(low)), Text(")"))
    if high is not None:
        return (Text(" (at most "), Formula(w.declared(high)), Text(")"))
    return ()


def grids(w: Writing) -> Iterator[tuple[str, str]]:
    for name, value in w.spec.constants.items():
        if isinstance(value, Mapping) and "grid" in value:
            text = value["grid"]
            if not isinstance(text, str):
                text = "\n".join(text)
            legend = ", ".join(f"{lettered(k)} = {v}" for k, v in (value.get("legend") or {}).items())
            yield f"{name} ({legend})", text


def state(w: Writing) -> Iterator[Inlines]:
    yield from _space(w, "S", w.spec.state, w.task.state)


def actions(w: Writing) -> Iterator[Inlines]:
    yield from _space(w, "A", w.spec.action, w.task.action)
    expr = w.parsed("legal")
    if expr is None:
        return
    actions = m.Ident("A", "calligraphic")
    (action,) = w.spec.action
    used = w.reads(expr)
    arguments = [w.symbol(name) for name in w.spec.state if name in used]
    left: tuple[m.Math, ...] = ()
    if arguments:
        left = (actions, m.brackets(m.joined(arguments)), m.Sym("="))
    legal = m.braces(m.such_that(m.Row((w.symbol(action), m.Sym("∈"), actions)), w.truth(expr)))
    yield (Text("legal actions: "), formula(*left, legal))


def _space(
    w: Writing, letter: str, declared: Mapping[str, ComponentEntry], components: tuple[Component, ...]
) -> Iterator[Inlines]:
    """Yield the set of states or of actions, then its components; a single one without a description is named at once."""
    said = list(_components(w, declared, components))
    equation: list[m.Math] = [m.Ident(letter, "calligraphic"), m.Sym("="), w.space(declared)]
    if not said:
        equation[:0] = [w.symbol(components[0].name), m.Sym("∈")]
    whole: Inlines = (formula(*equation),)
    if any(c.domain is not None for c in components):
        whole += (Text(", numbered from 0"),)
    yield whole
    yield from said


def _components(
    w: Writing, declared: Mapping[str, ComponentEntry], components: tuple[Component, ...]
) -> Iterator[Inlines]:
    for c in components:
        name = [w.symbol(c.name)]
        if len(components) > 1:
            name += [m.Sym("∈"), w.domain(c.name, declared[c.name])]
        said = list(filter(None, (inlines(c.doc), _labels(w, c))))
        if said:
            yield (formula(*name), Text(": "), *separated(said, "; "))
        elif len(components) > 1:
            yield (formula(*name),)


def _labels(w: Writing, c: Component) -> Inlines:
    if c.domain is None or len(c.domain.labels) > _MANY or not (c.domain.symbols or c.domain.values):
        return ()
    items: list[Inlines] = []
    for i, label in enumerate(c.domain.labels):
        mark = w.notation.labels[c.name][label]
        tree = mark
        if c.domain.values and not isinstance(mark, m.Num):
            tree = m.Row((mark, m.Sym("↦"), _value(w, c.domain.values[i])))
        if isinstance(mark, m.Words | m.Num):
            items.append((Formula(tree),))
        else:
            items.append((Formula(tree), Text(f" {label.replace('_', ' ')}")))
    if max(map(len, items)) == 1 and not c.domain.values:
        return ()
    return listing(items)


def _value(w: Writing, value: Any) -> m.Math:
    if isinstance(value, tuple):
        return m.brackets(m.joined(_value(w, v) for v in value))
    if not isinstance(value, bool | int | float):
        value = float(value)
    return w.declared(value)


def observations(w: Writing) -> Iterator[Inlines]:
    observation = w.task.observation
    extra: Inlines = ()
    if observation.space in _SPACES:
        extra = (Text(f", {_SPACES[observation.space]}"),)
    if observation.is_state:
        yield (Text("the state "), formula(w.whole(w.spec.state)), *extra)
        return
    exprs: Mapping[str, s.Expr] = w.parsed("observation")
    yield (formula(w.whole(exprs)), *extra)
    of_state: list[Inlines] = []
    times: list[Inlines] = []
    defined: list[Inlines] = []
    others: list[Inlines] = []
    for name, expr in exprs.items():
        if not (isinstance(expr, s.Name) and expr.id == name and not expr.primed):
            others.append(_observed(w, name, expr))
        elif name in w.spec.state:
            of_state.append((formula(w.symbol(name)),))
        elif name == "t":
            times.append((formula(w.symbol(name)),))
        else:
            defined.append((formula(w.symbol(name)),))
    for names, one, several in (
        (of_state, " is that of the state", " are those of the state"),
        (times, " is the time", ""),
        (defined, " is defined below", " are defined below"),
    ):
        if len(names) > 1:
            yield (*listing(names), Text(several))
        elif names:
            yield (*names[0], Text(one))
    yield from others


def _observed(w: Writing, name: str, expr: s.Expr) -> Inlines:
    equation = Formula(w.equation(w.symbol(name), expr))
    if name in w.spec.state:  # on the right it is the component of the state
        return Text("observed "), equation
    return (equation,)


def horizon(w: Writing) -> Iterator[Inlines]:
    value = w.spec.horizon
    content: Inlines = (Text("none"),)
    if value not in (None, "none"):
        content = (Formula(w.declared(value)),)
    if w.spec.discount != 1:
        content += (Text(", discount "), formula(m.equal(m.Ident("γ"), w.declared(w.spec.discount))))
    yield content


def termination(w: Writing) -> Iterator[Inlines]:
    expr = w.parsed("terminal")
    if expr is None:
        return
    if isinstance(expr, s.Boolean):
        yield (Text(("never", "after every step")[expr.value]),)
    else:
        yield (Text("when "), Formula(w.truth(expr)))
    reward = w.parsed("absorbing_reward")
    if reward is not None:
        yield (Text("where terminal states absorb, each further step pays "), Formula(w.math(reward)))


def definitions(w: Writing) -> Iterator[Inlines]:
    for name, value in w.spec.constants.items():
        if isinstance(value, Mapping) and "grid" in value:
            continue
        written = expression(value)
        line: Inlines = (Formula(w.equation(w.symbol(name), written)),)
        if draws(written):
            line += (Text(", drawn once per instance"),)
        yield line
    for written, expr in (w.parsed("definitions") or {}).items():
        name, arguments = signature(written)
        left = w.symbol(name)
        if arguments is not None:
            left = m.Row((left, m.brackets(m.joined(map(w.notation.symbol, arguments)))))
        axes = argument_axes(w.task, name, arguments or ())
        yield (Formula(w.equation(left, expr, arguments=axes)),)
    for name, expr in (w.parsed("noise") or {}).items():
        yield (Formula(w.equation(w.symbol(name), expr)), Text(f", drawn {_when_drawn(w, name)}"))


def _when_drawn(w: Writing, noise: str) -> str:
    """Return when the draws of a noise are made: at the start, in every step, or both."""
    if not _is_read(w, noise, ("initial",)):
        return "again in every step"
    if _is_read(w, noise, _OF_STEPS):
        return "at the start, and again in every step"
    return "at the start of an episode"


def _is_read(w: Writing, name: str, sections: Iterable[str]) -> bool:
    for section in map(w.parsed, sections):
        exprs = [section]
        if isinstance(section, Mapping):
            exprs = list(section.values())
        for expr in exprs:
            if expr is not None and name in w.reads(expr):
                return True
    return False


def dynamics(w: Writing) -> Iterator[Inlines]:
    exprs: Mapping[str, s.Expr] = w.parsed("dynamics") or {}
    fixed = list(unchanged(w.task, exprs))
    for component in w.task.state:
        expr = exprs.get(component.name + "'")
        if component.name not in fixed and expr is not None:
            yield from _transition(w, component.name, expr)
    if fixed:
        verb = " keeps its value" if len(fixed) == 1 else " keep their values"
        yield (*listing([(formula(w.symbol(n)),) for n in fixed]), Text(verb))


def _transition(w: Writing, name: str, expr: s.Expr) -> Iterator[Inlines]:
    actions = list(w.spec.action)
    expr = w.put(expr)
    if len(w.task.state) == 1 and isinstance(expr, s.Table) and has_arrows(expr, name, actions):
        writer = ExpressionWriter(w.notation, name)
        for line in arrows(writer, expr, name, w.whole(actions), actions[0]):
            yield (Formula(line),)
    else:
        yield (Formula(w.equation(w.symbol(name, primed=True), expr, name)),)


def rewards(w: Writing) -> Iterator[Inlines]:
    """Yield the reward, then each measure with its description."""
    yield (_of_step(w, m.Ident("R"), w.parsed("reward")),)
    for name, expr in (w.parsed("measures") or {}).items():
        entry = w.spec.measures[name]
        doc = entry.get("doc") if isinstance(entry, Mapping) else None
        yield followed((Text("measure "), _of_step(w, w.symbol(name), expr)), ", ", doc)


def _of_step(w: Writing, left: m.Math, expr: s.Expr) -> Formula:
    arguments = w.arguments(expr)
    if arguments:
        left = m.Row((left, m.brackets(m.joined(arguments))))
    return Formula(w.equation(left, expr))


def initial(w: Writing) -> Iterator[Inlines]:
    """Yield a line for each component; neighbours that are drawn alike share one."""

    def how(item: tuple[str, s.Expr]) -> str:
        name, expr = item
        if is_draw(expr):
            return text(expr)
        return name

    for _, group in groupby((w.parsed("initial") or {}).items(), key=how):
        drawn = dict(group)
        name, expr = next(iter(drawn.items()))
        line: Inlines = (Formula(w.equation(m.joined(map(w.symbol, drawn)), expr, name)),)
        if len(drawn) > 1:
            line += (Text(", independently"),)
        yield line


def roles(w: Writing) -> Iterator[Inlines]:
    if w.spec.roles is not None:
        yield (Text(f"the expert acts in {w.spec.roles.expert}, and the learner in {w.spec.roles.learner}"),)


def expert(w: Writing) -> Iterator[Inlines]:
    if w.task.annotations.memory is not None:
        for c in w.task.annotations.memory.declared:
            yield _remembered(w, c)
    written = w.parsed("expert")
    match w.task.annotations.expert:
        case None:
            return
        case "optimal":
            yield (Text("an optimal policy of the exact model"),)
        case Soft():
            value: m.Math = m.Num(f"{w.task.annotations.expert.beta:g}")
            if isinstance(written, s.Call):
                value = w.math(written.args[0])
            yield (Text("Boltzmann-rational, "), formula(m.equal(m.Ident("β"), value)))
        case _:
            actions = written
            if not isinstance(written, Mapping):
                actions = {next(iter(w.spec.action)): written}
            for name, expr in actions.items():
                yield (Formula(w.equation(w.symbol(name), expr, name)),)


def _remembered(w: Writing, c: Component) -> Inlines:
    memory = w.parsed("memory")
    symbol = w.symbol(c.name)
    later = w.symbol(c.name, primed=True)
    declared = formula(symbol, m.Sym("∈"), w.domain(c.name, w.spec.memory[c.name]))
    return (
        *followed((Text("remembers "), declared), ", ", c.doc),
        Text(": at first "), Formula(w.equation(symbol, memory[c.name], c.name)),
        Text("; after a step "), Formula(w.equation(later, memory[f"{c.name}'"], c.name)),
    )  # fmt: skip
