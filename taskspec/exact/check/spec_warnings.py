"""Warnings about what a spec says: names, capabilities, sources, indices that lie outside, observations, and abstractions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Placed, Span, suggest
from taskspec.exact.model.extract import lasting
from taskspec.exact.model.model import Model
from taskspec.exact.model.space import plain, words
from taskspec.exact.model.transitions import picked
from taskspec.exact.scores.returns import Results
from taskspec.exact.soundness.indices import moved_indices
from taskspec.exact.soundness.soundness import in_words
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import TIME, Expression, Role
from taskspec.language.registry import CAPABILITIES
from taskspec.language.task import questions
from taskspec.language.task.merge import Merged, merge
from taskspec.language.task.parts import by_name
from taskspec.language.task.questions import components_followed, is_random, reads_time
from taskspec.language.task.task import Task

SAME = 1e-9  # numbers that differ by less, relative to their size, count as equal


@dataclass(frozen=True)
class Doubt:
    """Something to warn about, at its place; the check that found it has the code."""

    place: Placed | None
    message: str
    hint: str | None = None
    notes: Iterable[str] = ()


@dataclass(frozen=True)
class LintContext:
    """A task with its results."""

    task: Task
    results: Results

    @cached_property
    def model(self) -> Model | None:
        """The exact model of the task itself, not of a stand-in; None where there is none."""
        model = self.results.model
        if model is None or model.task is not self.task:
            return None
        return model

    @cached_property
    def lasting_model(self) -> Model:
        """The exact model with the states that longer episodes would enter; raises E712 as `known_model`."""
        return lasting(self.results.known_model)

    @cached_property
    def merged(self) -> Merged:
        return merge(self.task.source.document, self.task.source.variant)

    def key(self, *path: str) -> Span:
        return self.merged.key_span(path)

    @cached_property
    def paid(self) -> tuple[float, float] | None:
        """The least and the largest expected reward of any step of any episode; None if there is no such step."""
        model = self.results.known_model
        low = []
        high = []
        levels: Iterable[tuple[int, Array]] = [(0, model.acting)]
        if model.is_timed:
            levels = model.levels()
        for t, level in levels:
            if level.any():
                for paid in model.step(t).R.reshape(model.n_actions, -1):  # one action at a time, to save memory
                    low.append(paid[level].min())
                    high.append(paid[level].max())
        if not low:
            return None
        return float(np.min(low)), float(np.max(high))

    @property
    def is_constant(self) -> bool:
        """True if all steps have the same reward, and their number makes no difference."""
        paid = self.paid
        model = self.results.known_model
        if paid is None or not np.isfinite(paid).all() or paid[1] - paid[0] > SAME:
            return False
        return all(step.P_end is None for step in model.steps) or abs(paid[0]) <= SAME


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
    """Collect words, and every word of the entries of some sections that they name."""
    entries = {}
    for section in sections:
        for written, value in (task.written.get(section) or {}).items():
            entries[str(written).partition("(")[0].strip()] = value
    reached = set(words)
    used: set[str] = set()
    while fresh := (reached & entries.keys()) - used:
        used |= fresh
        for word in fresh:
            reached |= set(_words(entries[word]))
    return reached


def _words(value: Any) -> Iterator[str]:
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


def moved(context: LintContext) -> Iterator[Doubt]:
    """Yield an index that lies outside in a state in which episodes act, where its value matters."""
    task = context.task
    for m in moved_indices(task, context.model):
        where = [in_words(task.state, Role.STATE, m.reads), in_words(task.action, Role.ACTION, m.reads)]
        if TIME in m.reads:
            where.append(f"t = {words(int(m.reads[TIME][0]))}")
        state = ", ".join(filter(None, where))
        end = min(max(m.index, 0), m.length - 1)
        place = f"for {state}, " * bool(state)
        message = f"{place}this index is {m.index}; it is moved to {end}, the nearest of 0 ... {m.length - 1}"
        yield Doubt(m.place, message, "if this is intended, write `clip(i, 0, n - 1)`")


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


def _values(node: Expression, model: Model | None) -> Array | None:
    if questions.constant(node) is not None:
        return evaluate([node], {})[0]
    if model is None or is_random([node]) or reads_time([node]):
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
    paid = components_followed([task.process.reward], by_name(task.state, task.process.next))
    paid -= followed(task, set(_words(task.written.get("observation"))), tuple(NAMED)[1:])
    for c in task.state:
        values = known.get((Role.STATE, c.name))
        varies = values is None or not _is_constant(values)
        if c.name in paid and c.low != c.high and varies:
            message = f"rewards depend on '{c.name}', which the observation does not show"
            yield Doubt(context.key("observation"), message)


def unproved_abstraction(context: LintContext) -> Iterator[Doubt]:
    """Yield an abstraction that gives no exact results, as it is infinite or cannot be proved."""
    declared = context.results.abstraction
    if declared is None:
        return
    for c in declared.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            yield Doubt(context.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`")
            return
    check = context.results.abstraction_check
    if check is not None and check.why_not is not None:
        message = f"the abstraction is not proved, so it gives no exact results: {check.why_not}"
        yield Doubt(context.key("abstraction"), message)


def unknown_capability(context: LintContext) -> Iterator[Doubt]:
    """Yield a capability that is not in the closed list."""
    written = context.task.capability
    if written is None or written in CAPABILITIES:
        return
    hint = suggest(written, CAPABILITIES) or f"choose one of {', '.join(CAPABILITIES)}; other words go to `keywords`"
    yield Doubt(context.merged.span(("capability",)), f"'{written}' is not in the list of capabilities", hint)
