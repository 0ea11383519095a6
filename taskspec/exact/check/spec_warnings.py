"""Warnings about what a spec says: names, indices that lie outside, observations, and abstractions without use."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Collector, Diagnostic
from taskspec.exact.check.warning_context import Doubt, LintContext, followed_states
from taskspec.exact.model.model import Model
from taskspec.exact.model.points import Samples, columns
from taskspec.exact.model.space import Reads, plain, words
from taskspec.exact.model.transitions import picked
from taskspec.exact.rollout.rollout import visited
from taskspec.exact.soundness.phases import Check, CheckPhase, Examination, Violation
from taskspec.exact.soundness.soundness import in_words
from taskspec.language import printers
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Const, Node, children, draws, reads, walk
from taskspec.language.expressions.scope import ClampedIndex
from taskspec.language.expressions.syntax import Name
from taskspec.language.expressions.types import TIME, Role
from taskspec.language.printers.names import of_task
from taskspec.language.registry import load
from taskspec.language.task.merge import merge
from taskspec.language.task.parts import by_name
from taskspec.language.task.task import Task, TaskLike

NAMED = {"parameters": "parameter", "constants": "constant", "definitions": "definition", "noise": "noise"}
"""Sections of names that other sections use, and what each name is."""
ROOTS = (
    "state", "action", "observation", "horizon", "terminal", "discount", "initial", "dynamics", "reward",
    "absorbing_reward", "measures", "memory", "expert", "abstraction", "symmetries",
)  # fmt: skip
PROSE = frozenset({"doc", "symbol", "symbols", "message"})
INSTANCE_SEED = "instance_seed"
_WORD = re.compile(r"[^\W\d]\w*")


def unused_names(context: LintContext) -> Iterator[Doubt]:
    """Yield parameters, constants, definitions and noise that nothing depends on."""
    data = context.task.written
    wanted = {INSTANCE_SEED, *_words((data.get("parameters") or {}).get("require"))}
    for section in ROOTS:
        wanted |= set(_words(data.get(section)))
    used = followed(context.task, wanted, tuple(NAMED))
    for section in NAMED:
        for name in data.get(section) or {}:
            if name != "require" and str(name).partition("(")[0].strip() not in used:
                yield Doubt(context.key(section, name), f"nothing uses the {NAMED[section]} '{name}'")


def followed(task: Task, words: set[str], sections: Sequence[str]) -> set[str]:
    """Return some words, and every word of the entries of some sections that they name."""
    entries = {}
    for section in sections:
        for written, value in (task.written.get(section) or {}).items():
            entries[str(written).partition("(")[0].strip()] = value
    found = set(words)
    used: set[str] = set()
    while fresh := (found & entries.keys()) - used:
        used |= fresh
        for word in fresh:
            found |= set(_words(entries[word]))
    return found


def _words(value: Any) -> Iterator[str]:
    """Yield every word in the expressions of a section, keys included, prose excluded."""
    match value:
        case str():
            yield from _WORD.findall(value)
        case dict():
            for key, inner in value.items():
                if key not in PROSE:
                    yield from _words(str(key))
                    yield from _words(inner)
        case list():
            for inner in value:
                yield from _words(inner)
        case _:
            return


POINTS = 100_000  # states, actions and times that are evaluated, at most


def moved(context: LintContext) -> Iterator[Doubt]:
    """Yield an index that lies outside in a state in which episodes act, where its value matters."""
    task = context.task
    left = {id(m.node): m for m in task.source.surface.moved}
    if not left:
        return
    expert = task.annotations.expert_nodes
    step = (*task.process.raw_next, task.process.reward, task.process.terminal, *task.process.measures.values())
    for phase, roots in (("observation", task.observation.nodes), ("expert", expert), ("step", step)):
        checks = {}
        for node, guard in _guards(roots, task.new_builder(roots)):
            if id(node) in left:
                m = left[id(node)]
                size = m.index.type.size
                check = Check(
                    "W510", m.index, (0,) * size, (m.length - 1,) * size, phase, guards=(guard,), what=str(id(node))
                )
                checks[check.what] = check
        if not checks:
            continue
        points = Samples(_acting_points(context, roots), {})
        for violation in Examination(CheckPhase(task, phase, tuple(checks.values()), points, False)).violations():
            yield _moved(left.pop(int(violation.check.what)), violation, task)


def _acting_points(context: LintContext, roots: Sequence[Node]) -> Reads:
    """Return the values read at points at which episodes act: all if there is an exact model, otherwise samples."""
    model = context.model
    if model is None:
        return visited(context.task)
    read = reads(roots)
    actions = 1
    if any(role is Role.ACTION for role, _ in read):
        actions = model.n_actions
    levels: Iterable[tuple[int, Array]] = [(0, model.acting)]
    if TIME in read or model.is_timed:
        levels = model.levels()
    parts = []
    left = POINTS
    for t, level in levels:
        codes = model.codes[level]
        every = np.arange(len(codes) * actions)[:left]
        left -= len(every)
        point = model.states.decode(codes[every % len(codes)], read) | model.actions.decode(every // len(codes), read)
        parts.append(point | {TIME: np.full(len(every), t)})
    return columns(parts)


def _moved(m: ClampedIndex, violation: Violation, task: Task) -> Doubt:
    read = reads([m.index])
    known = {key: value for key, value in violation.reads.items() if key in read}
    where = [in_words(task.state, Role.STATE, known), in_words(task.action, Role.ACTION, known)]
    where += [f"t = {words(int(v[0]))}" for (role, _), v in known.items() if role is Role.TIME]
    found = ", ".join(filter(None, where))
    values = violation.value.reshape(-1)
    index = int(values[(values < 0) | (values >= m.length)][0])
    end = 0 if index < 0 else m.length - 1
    place = f"for {found}, " * bool(found)
    message = f"{place}this index is {index}; it is moved to {end}, the nearest of 0 ... {m.length - 1}"
    return Doubt(m.place, message, "if this is intended, write `clip(i, 0, n - 1)`")


def _guards(roots: Sequence[Node], b: Builder) -> Iterator[tuple[Node, Node]]:
    """Yield every node with the condition under which its value matters: not in a branch that is not taken."""
    never = b.scalar(False)
    guards: dict[int, Node] = {id(root): b.scalar(True) for root in roots}
    for node in reversed(list(walk(roots))):
        here = guards[id(node)]
        yield node, here
        needed = [here] * len(children(node))
        if isinstance(node, Apply) and node.op in ("where", "and", "or") and node.type.is_scalar:
            holds = node.args[0]
            fails = b.apply("not", holds)
            needed[1] = b.apply("and", here, fails if node.op == "or" else holds)
            if node.op == "where":
                needed[2] = b.apply("and", here, fails)
        for child, guard in zip(children(node), needed, strict=True):
            guards[id(child)] = b.apply("or", guards.get(id(child), never), guard)


def constant(context: LintContext) -> Iterator[Doubt]:
    """Yield a part of the observation that is always the same."""
    seen = context.task.observation
    for c, node in zip(seen.components, seen.nodes, strict=True):
        if seen.is_state or not c.type.size:
            continue
        values = _values(node, context.model)
        if values is not None and _is_constant(values):
            value = words(plain(c, values[..., 0]))
            yield Doubt(context.key("observation", c.name), f"'{c.name}' is {value} in every observation")


def _values(node: Node, model: Model | None) -> Array | None:
    """Return the values (..., N) of a node in all states that episodes enter; None if some are not known."""
    bare = node
    while isinstance(bare, Apply) and bare.op in ("to_real", "to_int"):
        bare = bare.args[0]
    if isinstance(bare, Const):
        return evaluate([node], {})[0]
    if model is None or draws([node]) or TIME in reads([node]):
        return None
    return evaluate([node], picked(model.reads(0), model.entered))[0]


def _is_constant(values: Array) -> bool:
    return bool((values == values[..., :1]).all())


def hidden(context: LintContext) -> Iterator[Doubt]:
    """Yield a component of the state that rewards depend on, at once or later, and the observation says nothing about."""
    task = context.task
    model = context.model
    if task.observation.is_state:
        return
    known = {}
    if model is not None and model.acting.any():
        known = model.states.decode(model.codes[model.acting])
    paid = followed_states(by_name(task.state, task.process.next), (task.process.reward,))
    paid -= followed(task, set(_words(task.written.get("observation"))), tuple(NAMED)[1:])
    for c in task.state:
        values = known.get((Role.STATE, c.name))
        varies = values is None or not _is_constant(values)
        if c.name in paid and c.low != c.high and varies:
            message = f"rewards depend on '{c.name}', which the observation does not show"
            yield Doubt(context.key("observation"), message)


def unproved_abstraction(context: LintContext) -> Iterator[Doubt]:
    """Yield an abstraction that gives no exact results, as it is infinite or cannot be proved."""
    found = context.results.abstraction
    if found is None:
        return
    for c in found.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            yield Doubt(context.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`")
            return
    check = context.results.abstraction_check
    if check is not None and check.why_not is not None:
        message = f"the abstraction is not proved, so it gives no exact results: {check.why_not}"
        yield Doubt(context.key("abstraction"), message)


# -- names that look alike --------------------------------------------------------------------------------------------

ALIKE = str.maketrans(
    "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0455\u0456\u0458\u04bb\u051b\u051d\u0501"  # Cyrillic, small
    "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0423\u0425\u0405\u0406\u0408"  # and capital
    "\u03bf\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7\u0585",  # Greek; Armenian
    "aeopcyxsijhqwdABEKMHOPCTYXSIJoABEZHIKMNOPTYXo",
)
"""Letters of other alphabets, and the Latin letters that they look like."""


_SECTIONS = {
    "parameters": "parameter", "constants": "constant", "definitions": "definition", "noise": "noise", "state": "component",
    "action": "action",
}  # fmt: skip


def look_alikes(task: TaskLike) -> tuple[Diagnostic, ...]:
    """Return W524 for names with one symbol, and W527 for names that look like others in Latin letters."""
    task = load(task)
    merged = merge(task.source.document, task.source.variant)
    collector = Collector()
    for path, message in _same_symbols(task):
        hint = "give one of them another `symbol`, or labels other `symbols`"
        collector.add("W524", merged.key_span(path), message, hint)
    for path, message in _foreign_letters(task):
        collector.add("W527", merged.key_span(path), message, "write it in Latin letters, here and where it is used")
    return collector.diagnostics


def _same_symbols(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield two names with one symbol, or a name and a label; labels of different components may share theirs."""
    notation = of_task(task)
    names = [(path, name, f"the {_SECTIONS[path[0]]} '{name}'") for path, name in _names(task)]
    observed = task.source.surface.sections.get("observation")
    for name, expr in observed.items() if isinstance(observed, dict) else ():
        if name not in task.spec.state and not (
            isinstance(expr, Name) and expr.written == name
        ):  # it is something else
            names.append((("observation", name), name, f"the observation '{name}'"))
    seen = {"R": "the reward"}
    if task.discount != 1:
        seen["γ"] = "the discount"
    for path, name, what in names:
        symbol = printers.plain(notation.symbol(name))
        if symbol in seen:
            yield path, f"pages print `{symbol}` for {seen[symbol]} and for {what}"
        seen.setdefault(symbol, what)
    for section, components in (("state", task.state), ("action", task.action)):
        for c in components:
            for label, tree in notation.labels.get(c.name, {}).items():
                symbol = printers.plain(tree)
                if symbol in seen:
                    what = f"the label '{label}' of '{c.name}'"
                    yield (section, c.name), f"pages print `{symbol}` for {seen[symbol]} and for {what}"


def _foreign_letters(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield a name or label that looks like one in Latin letters."""
    names = list(_names(task))
    for section, components in (("state", task.state), ("action", task.action)):
        for c in components:
            if c.domain is not None:
                names += [((section, c.name), str(label)) for label in c.domain.labels]
    for path, name in names:
        latin = name.translate(ALIKE)
        if latin != name and latin.isascii():
            letter = next(a for a, b in zip(name, latin, strict=True) if a != b)
            yield path, f"'{name}' is not '{latin}': its '{letter}' is {unicodedata.name(letter)}, U+{ord(letter):04X}"


def _names(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield the place of every declared name, and the name without the parameters of a function."""
    spec = task.spec
    parts = (spec.parameters.entries, spec.constants, spec.definitions, spec.noise, spec.state, spec.action)
    for section, declared in zip(_SECTIONS, parts, strict=True):
        for written in declared:
            yield (section, written), written.partition("(")[0].strip()
