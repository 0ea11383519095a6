"""The generated module of a Numba program: loops over lanes, and the kernel that runs them over memory."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.base.named import all_names
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Const, Draw, Node
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.types import INT_MAX, TIME, Kind, Role, Type
from taskspec.language.expressions.variates import VARIATES, words_of
from taskspec.language.expressions.variates import WordLayout as WordLayout
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent, literal
from taskspec.programs.lane_form import LaneValue
from taskspec.programs.lowering import compared, word_names
from taskspec.programs.numba.kernel import EVERYTHING, KernelLane
from taskspec.programs.numpy.step import never
from taskspec.programs.vector_program import Mode

SCRATCH = 1 << 16
"""Bytes of random words of a block, about: what a first-level cache and a part of the second hold."""
BLOCK = 1024
CHECKED_STEP, STEP, CHECK, RESET = range(4)
"""What `kernel` is to do: check the actions and step; step, without the interpreter's lock; check the actions; reset."""
GAP = 16
"""Numbers between the rows of an array, see `Buffers.of`."""
WHAT = 3
"""The number of the field that says so."""
BAD = -1
"""What `kernel` gives where an action is not in the action space; nothing has changed then."""
_ARRAYS = {Kind.BOOL: "flags", Kind.INT: "i64s", Kind.REAL: "f64s"}


_FIELDS = (
    "start", "stop", "every", "what",  # the range of lanes, how far apart rows are, what is to be done
    "k0", "k1", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended", "chosen", "lanes", "words", "reals",
)  # fmt: skip


@dataclass
class Memory:
    """The place of every array: its number in the vector of addresses."""

    fields: list[str] = field(default_factory=lambda: list(_FIELDS))

    def at(self, name: str) -> str:
        if name not in self.fields:
            self.fields.append(name)
        return f"m[{self.fields.index(name)}]"


@dataclass(frozen=True)
class MemoryRow:
    """One element of all lanes: a row of an array in memory."""

    name: str
    array: str  # the array's name in `Memory`
    row: int
    kind: str  # the library's function that gives n numbers of it

    def source(self, memory: Memory, first: str = "first", every: str = "every") -> str:
        # Numba compiles a function once more for every literal that it is given, and not for what i64() returns.
        offset = f"i64({self.row}) * {every} + {first}"
        if self.row == 0:
            offset = first
        return f"{self.kind}({memory.at(self.array)}, {offset})"


@dataclass
class Program:
    """A task's kernel while it is being written."""

    task: Task
    observation: SpaceLayout
    action: SpaceLayout
    mode: Mode
    actions: str  # "i", "f" or "d": int64, float32 or float64
    memory: Memory = field(default_factory=Memory)
    constants: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        b = self.task.new_builder()
        self.step_words = self.task.step_words
        self.step = compared(b, self.task.step_roots)
        self.reset_words = self.task.reset_words
        self.start = compared(b, self.task.reset_roots)
        most = max(self.step_words.count, self.reset_words.count, 1)
        self.block = max(64, min(BLOCK, SCRATCH // (8 * most) // 64 * 64))
        self.rows = most + 2
        self.width = self.block + GAP
        self.states = []
        for i, c in enumerate(self.task.state):
            kind = _ARRAYS[c.type.kind]
            self.memory.at(f"s{i}")
            self.states.append([MemoryRow(f"s{i}_{k}", f"s{i}", k, kind) for k in range(c.type.size)])
        self.measures = [
            MemoryRow(f"measure{i}", f"measure{i}", 0, "f64s") for i in range(len(self.task.process.measures))
        ]
        for row in self.measures:
            self.memory.at(row.array)
        self.seen: dict[str, MemoryRow] = {}  # by number of the part and of the row
        self.final: dict[str, MemoryRow] = {}
        for i, part in enumerate(self.observation.parts):
            kind = "i64s" if part.is_whole else "f32s"
            for name, rows in (("seen", self.seen), ("final", self.final)):
                self.memory.at(f"{name}{i}")
                for k in range(math.prod(part.shape)):
                    rows[f"{i}_{k}"] = MemoryRow(f"{name}{i}_{k}", f"{name}{i}", k, kind)

    @property
    def inline_reset(self) -> bool:
        """Lanes that end start again within the loop: where that is known and takes no draws."""
        return self.mode == "same_step" and not self.reset_words.count


# -- loops over lanes as source: `check`, `advance` (the step of n lanes), `begin` (first states) -----------------

SHOWN = 8
"""Draws of this many elements or more that are observed as they are go to the observations in one piece."""
Shown = dict[int, tuple[int, int]]
"""What is shown in one piece: row of the observations -> number of the first word, and how many."""


@dataclass
class Loop:
    """The body of a loop over lanes: statements, the rows that they name, and what is shown in one piece."""

    program: Program
    lane: KernelLane
    values: list[LaneValue]
    shown: Shown = field(default_factory=dict)  # row of observations -> first word, size


def _loop(p: Program, roots: Sequence[Node], words: WordLayout, at: str, acting: bool) -> Loop:
    """Emit roots; lane `j` is read, and random numbers of place `at`."""
    names: dict[tuple[Role, str], LaneValue] = {TIME: LaneValue(["t"])}
    for c, rows in zip(p.task.state, p.states, strict=True):
        names[Role.STATE, c.name] = LaneValue([f"x_{r.name}" for r in rows])
    for i, c in enumerate(p.task.action if acting else ()):
        names[Role.ACTION, c.name] = LaneValue([f"a_{i}_{k}" for k in range(c.type.size)])
    numbers = {}
    reals: dict[int, Sequence[str]] = {}
    for draw in words.draws:
        first = words.first[draw.site]
        places = range(first, first + words_of(draw))
        numbers[draw.site] = [f"w{place}" for place in places]
        reals[draw.site] = [f"r{place}" for place in places]
        for name, number in zip(word_names(draw), numbers[draw.site], strict=True):
            names[Role.VARIABLE, name] = LaneValue([f"i64({number})"])
    lane = KernelLane(names, numbers, Builder().certain, constants=p.constants, unrolled=EVERYTHING)
    lane.reals = reals
    shown = _shown(p, roots, words)
    hidden = {len(roots) - len(p.observation.components) + i for i in shown}
    kept = [_NOTHING if i in hidden else root for i, root in enumerate(roots)]
    values = lane.emit(kept)
    return Loop(p, lane, values, dict(shown.values()))


_NOTHING: Node = Const(0, Type(Kind.INT))


def _shown(p: Program, roots: Sequence[Node], words: WordLayout) -> dict[int, tuple[int, tuple[int, int]]]:
    """Observed components that are long draws as they come: number of the component -> row, (first word, size)."""
    found = {}
    components = p.observation.components
    for segment in p.observation.segments if len(p.observation.parts) == 1 else ():
        node = roots[len(roots) - len(components) + segment.component]
        plain = not segment.starts and segment.values is None and not p.observation.parts[0].is_whole
        if plain and isinstance(node, Draw) and VARIATES[node.base].loop and segment.size >= SHOWN:
            found[segment.component] = (segment.first, (words.first[node.site], segment.size))
    return found


def _observed(loop: Loop) -> dict[str, str]:
    layout = loop.program.observation
    values = loop.values[len(loop.values) - len(layout.components) :]
    out: dict[str, str] = {}
    for segment in layout.segments:
        if segment.first in loop.shown:
            continue
        cast = "i64" if layout.parts[segment.part].is_whole else "f32"
        atoms = values[segment.component].atoms or []
        if segment.values is not None:
            held = loop.lane.assign(f"i32({atoms[segment.element]})")
            atoms = [f"({held} == {value})" for value in segment.values]
        elif segment.starts:
            atoms = [f"({a} - {start})" if start else a for a, start in zip(atoms, segment.starts, strict=True)]
        for row, atom in enumerate(atoms, segment.first):
            out[f"{segment.part}_{row}"] = loop.lane.assign(f"{cast}({atom})")
    return out


def _stores(p: Program, loop: Loop) -> dict[MemoryRow, str]:
    stored: dict[MemoryRow, str] = {}
    for rows, value, c in zip(p.states, loop.values, p.task.state, strict=False):
        for row, atom in zip(rows, value.atoms or (), strict=True):
            if atom != f"x_{row.name}":
                stored[row] = loop.lane.assign(f"f64({atom})" if c.type.kind is Kind.REAL else atom)
    return stored


# -- functions of a kernel ----------------------------------------------------------------------------------------


def action_rows(p: Program) -> list[tuple[str, str]]:
    """For every element of an action: its name, and where it stands in the lanes-first array of actions."""
    names = [f"a_{i}_{k}" for i, c in enumerate(p.task.action) for k in range(c.type.size)]
    width = len(names)
    return [(name, "j" if width == 1 else f"j * {width} + {k}") for k, name in enumerate(names)]


def check(p: Program) -> list[str]:
    """Return the number of actions that are not in the action space."""
    lines = ["bad = 0", "for j in range(n):"]
    places = action_rows(p)
    for (name, place), (a, b) in zip(places, p.action.ends, strict=True):
        lines.append(f"    {name} = actions[{place}]")
        good = f"({name} >= {literal(a)}) & ({name} <= {literal(b)})"
        lines.append(f"    bad += i64(({good}) == False)")
    return ["@inner", "def check(n, actions):", *indent([*lines, "return bad"])]


def _read_actions(p: Program) -> list[str]:
    lines = []
    places = iter(action_rows(p))
    for c, segment in zip(p.task.action, p.action.segments, strict=True):
        rounded = c.type.kind is not Kind.REAL and not p.action.parts[segment.part].is_whole
        for start in segment.starts or (0,) * segment.size:
            name, place = next(places)
            raw = f"actions[{place}]"
            if start:
                raw = f"actions[{place}] + {start}"
            if rounded:
                raw = f"np.rint({raw})"
            cast = {Kind.BOOL: "({} != 0)", Kind.INT: "i32({})", Kind.REAL: "f64({})"}[c.type.kind]
            lines.append(f"{name} = {cast.format(raw)}")
    return lines


def _loads(p: Program, words: WordLayout, body: str, at: str) -> tuple[list[str], list[MemoryRow]]:
    lines = []
    rows = []
    used = set(re.findall(r"\b[A-Za-z_]\w*", body))
    for state, c in zip(p.states, p.task.state, strict=True):
        for k, row in enumerate(state):
            if f"x_{row.name}" in used:
                narrow = c.type.kind is Kind.INT and c.low[k] > -(2**31) and c.high[k] < 2**31
                source = f"{row.name}[j]"
                if narrow:
                    source = f"i32({source})"
                elif c.type.kind is Kind.BOOL:
                    source = f"({source} != 0)"
                lines.append(f"x_{row.name} = {source}")
                rows.append(row)
    for k in range(words.count + 1):
        for prefix, array, kind in (("w", "words", "u32s"), ("r", "reals", "f32s")):
            if f"{prefix}{k}" in used:
                lines.append(f"{prefix}{k} = {prefix}_{k}[{at}]")
                rows.append(MemoryRow(f"{prefix}_{k}", array, k, kind))
    return lines, rows


def advance(p: Program) -> tuple[list[str], list[MemoryRow], Shown]:
    loop = _loop(p, p.step, p.step_words, "j", acting=True)
    n = len(p.task.state)
    state = _stores(p, loop)
    seen = _observed(loop)
    reward = loop.lane.assign(f"f64({(loop.values[n].atoms or ['0'])[0]})")
    terminal = (loop.values[n + 1].atoms or ["False"])[0]
    measures = [
        loop.lane.assign(f"f64({(value.atoms or ['0'])[0]})") for value in loop.values[n + 2 : n + 2 + len(p.measures)]
    ]
    results, stores, out_rows = _results(p, loop, state, seen)
    lines = loop.lane.finish(results=[*state.values(), *seen.values(), reward, terminal, *measures])
    late = "False" if p.task.horizon is None else f"(t + 1 >= {p.task.horizon})"
    either = "late" if never(p.task.process.terminal) else f"late | {terminal}"
    ending = [f"late = {late}", f"e = {either}", "steps[j] = u32(steps[j] + u32(1))"]
    ending += [f"terminated[j] = {terminal}", "truncated[j] = late", "ended[j] = e"]
    paid = [f"{row.name}[j] = {value}" for row, value in zip(p.measures, measures, strict=True)]
    body = [*lines, f"reward[j] = {reward}", *paid, *ending, *results, *stores]
    loads, in_rows = _loads(p, p.step_words, "\n".join(body), "j")
    rows = list(dict.fromkeys([*in_rows, *out_rows, *p.measures]))
    time = "i32(time[j])"
    if p.task.horizon is None:
        time = f"i32(min(time[j], {INT_MAX}))"
    arguments = ["n", "actions", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
    text = [
        "@apart",
        f"def advance({', '.join([*arguments, *all_names(rows)])}):",
        *indent(["count = 0", "for j in range(n):"]),
        *indent([f"t = {time}", *_read_actions(p), *loads, *body], 2),
        *indent(["    count += i64(e)", "return count"]),
    ]
    return text, rows, loop.shown


def _results(
    p: Program, loop: Loop, state: dict[MemoryRow, str], seen: dict[str, str]
) -> tuple[list[str], list[str], list[MemoryRow]]:
    """Return statements that store the next state and what is seen of it; or the first state, where the episode has ended."""
    rows = p.seen
    finals = p.final
    used = [*state, *(rows[name] for name in seen)]
    if not p.inline_reset:
        stores = [f"{row.name}[j] = {value}" for row, value in state.items()]
        stores += [f"{rows[name].name}[j] = {value}" for name, value in seen.items()]
        return ["time[j] = i64(t + 1)"], stores, used
    start = _loop(p, p.start, p.reset_words, "j", acting=False)
    first_state = _stores(p, start)
    first_seen = _observed(start)
    constant = start.lane.finish(results=[*first_state.values(), *first_seen.values()])
    renamed = list(map(_renamed, constant))
    again = ["time[j] = i64(select(e, 0, t + 1))", "episodes[j] = u32(episodes[j] + u32(e))"]
    stores = [f"{row.name}[j] = select(e, {_renamed(first_state[row])}, {value})" for row, value in state.items()]
    for row in first_state:
        if row not in state:
            stores.append(f"{row.name}[j] = select(e, {_renamed(first_state[row])}, x_{row.name})")
            used.append(row)
    for name, value in seen.items():
        stores.append(f"{finals[name].name}[j] = {value}")
        stores.append(f"{rows[name].name}[j] = select(e, {_renamed(first_seen[name])}, {value})")
        used.append(finals[name])
    return [*renamed, *again], stores, used


def _renamed(text: str) -> str:
    return re.sub(r"\bv(\d+)\b", r"again\1", text)


def begin(p: Program) -> tuple[list[str], list[MemoryRow], Shown]:
    loop = _loop(p, p.start, p.reset_words, "i", acting=False)
    state = _stores(p, loop)
    seen = _observed(loop)
    rows = p.seen
    lines = loop.lane.finish(results=[*state.values(), *seen.values()])
    body = [*lines, *(f"{row.name}[j] = {value}" for row, value in state.items())]
    body += [f"{rows[name].name}[j] = {value}" for name, value in seen.items()]
    body += ["time[j] = 0", "episodes[j] = u32(episodes[j] + u32(1))"]
    loads, in_rows = _loads(p, p.reset_words, "\n".join(body), "i")
    used = list(dict.fromkeys([*in_rows, *state, *(rows[name] for name in seen)]))
    text = [
        "@inner",
        f"def begin({', '.join(['m', 'lanes', 'time', 'episodes', *all_names(used)])}):",
        *indent(["for i in range(m):"]),
        *indent(["j = u64(lanes[i])", *loads, *body], 2),
    ]
    return text, used, loop.shown


def generate(
    task: Task, observation: SpaceLayout, action: SpaceLayout, mode: Mode, actions: str
) -> tuple[str, Program]:
    """Source of the module, and what it says about its memory; `actions` is the type code of the array of actions."""
    p = Program(task, observation, action, mode, actions)
    checking = check(p)
    advancing, advance_rows, shown = advance(p)
    beginning, begin_rows, begin_shown = begin(p)
    running = _kernel(p, advance_rows, shown, begin_rows, begin_shown)
    text = repr(f"{task.id}: a block of lanes at a time, for Numba. Generated; autoreset is {mode!r}.")
    tables = [f"{name} = np.array({array.tolist()}, np.{array.dtype})" for name, array in p.constants.items()]
    head = [text, "", "import numpy as np", "", _IMPORT, "", *tables, ""]
    for function in (checking, advancing, beginning, running):
        head += ["", *function, ""]
    return "\n".join(head), p


_MATH = sorted({name for operator in OPERATORS.values() for name in operator.kernel.names})
_IMPORT = f"""from taskspec.programs.numba.runtime import *  # noqa: F403
from taskspec.programs.numba.kernel_draws import *  # noqa: F403
from math import {", ".join(_MATH)}"""


# -- running the loops over memory --------------------------------------------------------------------------------

_COUNTERS = {
    "k0": "u32s", "k1": "u32s", "steps": "u32s", "episodes": "u32s", "time": "i64s", "reward": "f64s",
    "terminated": "flags", "truncated": "flags", "ended": "flags",
}  # fmt: skip


def _views(p: Program, rows: Sequence[MemoryRow]) -> list[str]:
    lines = [f"{name} = {kind}({p.memory.at(name)}, first)" for name, kind in _COUNTERS.items()]
    for row in rows:
        scratch = row.array in ("words", "reals")
        places = ("i64(0)", str(p.width)) if scratch else ()
        lines.append(f"{row.name} = {row.source(p.memory, *places)}")
    return list(dict.fromkeys(lines))


def _kernel(
    p: Program, rows: Sequence[MemoryRow], shown: Shown, begin: Sequence[MemoryRow], begin_shown: Shown
) -> list[str]:
    """Check the actions of a range of lanes, step them, or begin episodes in those chosen, as `what` says."""
    body = _views(p, [*rows, *begin])
    body += [f"lanes = i64s({p.memory.at('lanes')}, i64(0))", "late = 0"]
    body += [f"if what == {RESET}:", *indent(_choose(p)), "else:", *indent(_step(p, rows, shown))]
    body += ["if late > 0:", *indent(_begin_again(p, begin, begin_shown))]
    lines = [
        "m, data = u64s(numbers_of(memory), i64(0)), numbers_of(actions)",
        f"start, stop, every, what = i64(m[0]), i64(m[1]), i64(m[2]), i64(m[{WHAT}])",
        f"if what == {CHECK} or what == {CHECKED_STEP}:",
        f"    bad = check(stop - start, {_actions(p, 'start')})",
        f"    if bad > 0 or what == {CHECK}:",
        f"        return boxed(i64({BAD} if bad > 0 else 0))",
        "total, thread = 0, u64(0)",
        f"if what == {STEP}:",
        "    thread = release()",
        f"for first in range(start, stop, {p.block}):",
        *indent([f"n = min({p.block}, stop - first)", *body]),
        f"if what == {STEP}:",
        "    acquire(thread)",
        "return boxed(total)",
    ]
    return ["def kernel(memory, actions):", *indent(lines)]


def _actions(p: Program, lane: str) -> str:
    kind = {"i": "i64s", "f": "f32s", "d": "f64s"}[p.actions]
    return f"{kind}(data, {lane} * {len(action_rows(p))})"


def _choose(p: Program) -> list[str]:
    return [
        f"chosen = flags({p.memory.at('chosen')}, first)",
        "late = gather(n, chosen, lanes)",
        "for i in range(late):",
        "    j = u64(lanes[i])",
        "    terminated[j] = truncated[j] = ended[j] = False",
    ]


def _step(p: Program, rows: Sequence[MemoryRow], shown: Shown) -> list[str]:
    """Return the step of a block; `late` becomes the number of lanes that begin again, and `lanes` has theirs."""
    body = _LATE if p.mode == "next_step" else []
    body = [*body, f"part = {_actions(p, 'first')}"]
    body += _fill(p, p.step_words, "step_words(n", "k0, k1, steps", "n")
    arguments = ["n", "part", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
    body += [f"count = advance({', '.join([*arguments, *all_names(rows)])})"]
    for row, (number, size) in shown.items():
        place = f"i64({p.width}), i64({number}), i64({size}), {p.memory.at('seen0')}, i64({row})"
        body.append(f"show(n, {p.memory.at('reals')}, {place}, every, first)")
    if p.mode == "same_step" and not p.inline_reset:
        body += ["if count > 0:", *indent(["late = gather(n, ended, lanes)", *_keep(p)])]
    if p.mode == "next_step":
        body += _UNDO
    return [*body, "total += count"]


_LATE = ["late = gather(n, ended, lanes)", "for i in range(late):", "    time[u64(lanes[i])] = 0"]
"""What the step makes of lanes that begin again is dropped; but it may look things up by the time."""
_UNDO = [
    "for i in range(late):",
    "    j = u64(lanes[i])",
    "    count -= i64(ended[j])",
    "    steps[j] = u32(steps[j] - u32(1))",
    "    reward[j] = 0.0",
    "    terminated[j] = truncated[j] = ended[j] = False",
]
"""Lanes that begin again in this step take none."""


def _keep(p: Program) -> list[str]:
    lines = []
    for array in dict.fromkeys(r.array for r in p.seen.values()):
        rows = [r for r in p.seen.values() if r.array == array]
        kind = "keep_reals" if rows[0].kind == "f32s" else "keep_ints"
        final = p.memory.at(array.replace("seen", "final"))
        lines.append(f"{kind}(late, lanes, i64({len(rows)}), every, first, n, {p.memory.at(array)}, {final})")
    return lines


def _begin_again(p: Program, rows: Sequence[MemoryRow], shown: Shown) -> list[str]:
    lines = _fill(p, p.reset_words, "reset_words(late, lanes", "k0, k1, episodes", "late")
    lines.append(f"begin({', '.join(['late', 'lanes', 'time', 'episodes', *all_names(rows)])})")
    for row, (number, size) in shown.items():
        place = f"i64({p.width}), i64({number}), i64({size}), {p.memory.at('seen0')}, i64({row})"
        lines.append(f"show_some(late, lanes, {p.memory.at('reals')}, {place}, every, first, n)")
    return lines


def _fill(p: Program, words: WordLayout, call: str, keys: str, n: str) -> list[str]:
    if not words.count:
        return []
    w = p.memory.at("words")
    r = p.memory.at("reals")
    lines = [f"{call}, {w}, i64({p.width}), i64({(words.count + 1) // 2}), {keys})"]
    for draw in words.draws:
        loop = VARIATES[draw.base].loop
        if loop is not None:
            place = f"i64({words.first[draw.site]}), i64({draw.type.size})"
            lines.append(f"{loop}({n}, {w}, {r}, i64({p.width}), {place})")
    return lines
