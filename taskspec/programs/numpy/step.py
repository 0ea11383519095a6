"""The generated module of a NumPy program: one step of n lanes over arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.expressions.batch import UNSORTED, Runtime, network
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, plain, walk
from taskspec.language.expressions.types import TIME, Kind, Role
from taskspec.language.expressions.variates import many
from taskspec.language.task.parts import by_read
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent, names_of, tuple_of
from taskspec.programs.array_form import ArrayForm, Scratch, Sink
from taskspec.programs.lowering import Hoisted


@lru_cache(maxsize=16)
def _lanes(n: int) -> Array:
    return np.arange(n)


class NumpyRuntime(Runtime):
    """Elements of vectors that differ from lane to lane are found by their place in memory."""

    def __init__(self) -> None:
        super().__init__(np, np.int64, np.float64)

    def index(self, x: Array, i: Array) -> Array:
        """Pick rows of x (n, ..., N) at the indices i (..., N) of each lane."""
        lanes = x.shape[-1]
        if x.ndim != 2 or lanes == 1 or not x.flags.c_contiguous:
            return super().index(x, i)
        return x.reshape(-1).take(i * lanes + _lanes(lanes), mode="clip")

    def sort(self, x: Array) -> Array:
        if not 1 < x.shape[0] <= UNSORTED:
            return super().sort(x)
        rows = list(x)
        exact = x.dtype.kind in "iub"
        least = np.minimum if exact else np.fmin
        for i, j in network(len(rows)):
            rows[i], rows[j] = least(rows[i], rows[j]), np.maximum(rows[i], rows[j])
        ordered = np.empty_like(x)
        for place, row in zip(ordered, rows, strict=True):
            if exact:
                np.copyto(place, row)
            else:
                np.add(row, 0.0, place)  # -0.0 becomes 0.0
        return ordered

    def count(self, x: Array) -> Array:
        if len(x) > 127:
            return super().count(x)
        total: Array = np.add.reduce(self.rows(x).view(np.int8), 0, np.int8)
        return total.astype(np.int64)

    def swap(self, x: Array, i: Array, j: Array) -> Array:
        if x.ndim != 2:
            return super().swap(x, i, j)
        lanes = max(x.shape[-1], i.shape[-1], j.shape[-1])
        exchanged = np.empty((len(x), lanes), x.dtype)
        exchanged[...] = x
        flat = exchanged.reshape(-1)
        first = i * lanes + _lanes(lanes)
        second = j * lanes + _lanes(lanes)
        flat[first], flat[second] = flat.take(second), flat.take(first)
        return exchanged


RUNTIME = NumpyRuntime()


# -- the generated module -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Again:
    """The values with which every episode begins, (*shape, 1): of the state, and of the raw arrays of observations."""

    state: tuple[Array, ...]
    seen: tuple[Array, ...]


def generate(
    task: Task, roots: Sequence[Node], hoisted: Hoisted, observation: SpaceLayout, again: Again | None
) -> tuple[str, dict[str, Any]]:
    """Source of the module, and the constants it refers to, as nodes; with `again`, lanes that end are reset."""
    states = names_of("s", task.state)
    actions = names_of("a", task.action)
    outputs = [f"o{i}" for i in range(len(observation.segments))]
    form = _form(task, states, actions, hoisted)
    form.sinks = _sinks(task, observation, roots, states, outputs)
    statements, values = form.emit(roots)
    n = len(task.state)
    measures = [f"measure{i}" for i in range(len(task.process.measures))]
    first = n + 2 + len(measures)  # of the observation
    shown = again is not None and _shows_state(task, observation, roots, again)
    measured = []
    for name, value in zip(measures, values[n + 2 :], strict=False):
        measured += _copy(name, value)
    ending = ["add(t, ONE, t)"]
    if task.horizon is not None:
        ending.append("greater_equal(t, HORIZON, truncated)")
    if not never(roots[n + 1]):
        ending.append("logical_or(terminated, truncated, ended)")
    lines = [  # results may show the state, so they are copied before it moves on
        *statements,
        *([] if shown else _observation(form, observation, outputs, values[first:])),
        *_copy("reward", values[n]),
        *measured,
        *([] if never(roots[n + 1]) else _copy("terminated", values[n + 1])),
        *_state(form, task, states, roots[:n], values[:n]),
        *ending,
        "count = int(count_nonzero(ended))",
        *(_begin(states, again, shown) if again is not None else []),
        *([f"copyto(seen0, {states[0]})"] if shown else []),
        "return count",
    ]
    arguments = ["n", *states, "t", *outputs, "reward", "terminated", "truncated", "ended", *measures]
    for name in ("seen", "final"):
        for i in range(len(observation.parts)):
            arguments.append(f"{name}{i}")
    taken = [*actions, *hoisted.names, *hoisted.word_numbers]
    assert form.scratch is not None
    quiet = []
    if _may_warn(roots, observation):
        quiet = ['@np.errstate(all="ignore")']
    body = [*form.scratch.declarations, "", *quiet, f"def step({', '.join(taken)}):"]
    body += [*indent(lines), "", "return step"]
    head = repr(f"{task.id}: n environments, array code. Generated; the spec is {task.source.document.origin.name}.")
    return "\n".join([head, "", "", f"def lanes({', '.join(arguments)}):", *indent(body), ""]), form.constants


def _may_warn(roots: Sequence[Node], observation: SpaceLayout) -> bool:
    """Test whether NumPy might warn of an overflow or of nan: not where everything is whole numbers and look-ups."""
    reals = []
    for n in walk(roots):
        if isinstance(n, Apply) and n.type.kind is Kind.REAL:
            reals.append(n)
    small = all(abs(v) < 2**31 for c in observation.components for v in (*c.low, *c.high))
    return not small or any(n.op not in ("index", "to_real", "where", "element") for n in reals)


def _form(task: Task, states: Sequence[str], actions: Sequence[str], hoisted: Hoisted) -> ArrayForm:
    names = {TIME: "t"}
    names |= by_read(Role.STATE, task.state, states)
    names |= by_read(Role.ACTION, task.action, actions)
    for v in (*hoisted.names, *hoisted.word_numbers):
        names[(Role.VARIABLE, v)] = v
    form = ArrayForm(names, lambda draw, args: drawn(draw, args), scratch=Scratch())

    def drawn(draw: Draw, args: Sequence[str]) -> str:
        """Draw from a distribution that depends on the state; the step is given its words one by one."""
        words = f"np.stack({tuple_of(hoisted.words[draw.site])}).astype(np.uint32)"
        return f"{form.constant(many(draw))}({tuple_of(args)}, {words})"

    return form


# -- what a step leaves behind ------------------------------------------------------------------------------------


def _sinks(
    task: Task, layout: SpaceLayout, roots: Sequence[Node], states: Sequence[str], outputs: Sequence[str]
) -> dict[int, Sink]:
    n = len(task.state)
    sinks: dict[int, Sink] = {}
    for c, name, root in zip(task.state, states, roots, strict=False):
        own_reads = set()
        for r in walk(roots):
            if isinstance(r, Read) and (r.role, r.name) == (Role.STATE, c.name):
                own_reads.add(id(r))
        held = frozenset(own_reads)
        sinks.setdefault(id(root), Sink(name, held))
    if roots[n].type.kind is Kind.REAL:
        sinks.setdefault(id(roots[n]), Sink("reward"))
    seen = roots[len(roots) - len(layout.components)]
    if layout.form == "discrete" and not layout.components[0].low[0] and seen.type.kind is Kind.INT:
        sinks.setdefault(id(seen), Sink(outputs[0]))
    return sinks


def _copy(target: str, value: str) -> list[str]:
    if value == target:
        return []
    return [f"copyto({target}, {value})"]


def _observation(form: ArrayForm, layout: SpaceLayout, outputs: Sequence[str], values: Sequence[str]) -> list[str]:
    lines: list[str] = []
    for segment, out in zip(layout.segments, outputs, strict=True):
        value = values[segment.component]
        type_ = layout.components[segment.component].type
        if not type_.size:
            continue  # a vector of reals without elements may be among ints
        if segment.values is not None:
            element = value
            if not type_.is_scalar:
                element = f"rt.rows({value})[{segment.element}]"
            lines.append(f"equal({element}, {form.constant(np.array(segment.values)[:, None])}, {out})")
        elif segment.starts:
            shape = (*type_.shape, 1)
            lines.append(f"subtract({value}, {form.constant(np.array(segment.starts).reshape(shape))}, {out})")
        else:
            lines += _copy(out, value)
    return lines


def _state(
    form: ArrayForm, task: Task, states: Sequence[str], roots: Sequence[Node], values: Sequence[str]
) -> list[str]:
    """Write the next state over the present one; values that share memory with another component are copied first."""
    shown = set()
    for n in walk(roots):
        if isinstance(n, Read) and n.role is Role.STATE:
            shown.add(id(n))
    copies = []
    lines = []
    for c, name, root, value in zip(task.state, states, roots, values, strict=True):
        if isinstance(root, Read) and root.role is Role.STATE and root.name == c.name:
            continue
        source = value
        if form.owner(root) in shown:
            source = f"n_{name}"
            copies.append(f"{source} = {value}.copy()")
        lines += _copy(name, source)
    return [*copies, *lines]


def never(terminal: Node) -> bool:
    """Test whether no step terminates; `ended` and `truncated` are one array then."""
    return isinstance(terminal, Const) and not plain(terminal.value)


def _shows_state(task: Task, layout: SpaceLayout, roots: Sequence[Node], again: Again) -> bool:
    """Test whether the observation is the first state component as it is, so that it can be copied after all else."""
    n = len(task.state)
    if not n or layout.form != "discrete" or layout.components[0].low[0] or roots[0] is not roots[-1]:
        return False
    return task.state[0].type.kind is Kind.INT and bool((again.state[0] == again.seen[0]).all())


def _begin(states: Sequence[str], again: Again, shown: bool) -> list[str]:
    """Write `_Block._finish` for episodes that all begin alike: most of its time would go to calls."""
    if shown:
        lines = [f"copyto(final0, {states[0]})", *_put(states, again.state)]
    else:
        seen = [f"seen{i}" for i in range(len(again.seen))]
        lines = [f"copyto(final{i}, {name})" for i, name in enumerate(seen)]
        lines += _put([*states, *seen], [*again.state, *again.seen])
    return ["if count:", *indent([*lines, "putmask(t, ended, ZERO)"])]


def _put(names: Sequence[str], values: Sequence[Array]) -> list[str]:
    """Write the first values, (*shape, 1), where episodes have ended; `putmask` is the quicker one."""
    lines = []
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        if value.ndim == 1:
            lines.append(f"putmask({name}, ended, FIRST[{k}])")
        else:
            lines.append(f"copyto({name}, FIRST[{k}], where=ended)")
    return lines
