"""The generated module of a Numba program: one step, and the reset, of a block of lanes.

`advance` is the step of n lanes and `begin` the first state of some of them: loops over lanes in which everything is a
scalar. `step` and `reset` run them over the memory of an environment, block by block, so that what one loop leaves in the
cache the next one finds there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.backends.arraystep import never
from taskspec.backends.hoist import compared, word_names
from taskspec.backends.kernel import EVERYTHING, KernelLane
from taskspec.backends.lane import Value
from taskspec.backends.source import literal, without_unused
from taskspec.backends.spaces import Layout
from taskspec.backends.vector import Mode
from taskspec.draws.layout import Layout as WordLayout
from taskspec.draws.layout import words_of
from taskspec.lang.ir import Const, Draw, Node, Read, Role
from taskspec.lang.types import Kind, Type
from taskspec.spec.task import Component, Task

FLOAT_MAX = 3.4028234663852886e38
SCRATCH = 1 << 16
"""Bytes of random words of a block, about: what a first-level cache and a part of the second hold."""
BLOCK = 1024
SHOWN = 8
"""Draws of this many elements or more that are observed as they are go to the observations in one piece."""
_ARRAYS = {Kind.BOOL: "bools", Kind.INT: "i64s", Kind.REAL: "f64s"}


@dataclass
class Memory:
    """Where every array is: its number in the vector of addresses, in the order of `Engine.addresses`."""

    fields: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.fields = ["start", "stop", "every"]  # numbers: the range of lanes, and how many there are in all
        self.fields += ["k0", "k1", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
        self.fields += ["lanes", "words", "reals"]

    def at(self, name: str) -> str:
        if name not in self.fields:
            self.fields.append(name)
        return f"m[{self.fields.index(name)}]"


@dataclass(frozen=True)
class Row:
    """One element of all lanes: a row of an array in memory."""

    name: str
    array: str  # the array's name in `Memory`
    row: int
    kind: str  # the library's function that gives n numbers of it

    def source(self, memory: Memory, first: str = "first", every: str = "every") -> str:
        offset = first if self.row == 0 else f"{self.row} * {every} + {first}"
        return f"{self.kind}({memory.at(self.array)}, {offset}, n)"


@dataclass
class Program:
    """A task's kernel while it is being written."""

    task: Task
    observation: Layout
    action: Layout
    mode: Mode
    memory: Memory = field(default_factory=Memory)
    constants: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        b = self.task.builder
        roots = (*self.task.next, self.task.reward, self.task.terminal, *self.task.next_observation)
        self.step_words = WordLayout.of(roots)
        self.step = compared(b, roots)
        start = (*self.task.initial, *self.task.first_observation)
        self.reset_words = WordLayout.of(start)
        self.start = compared(b, start)
        most = max(self.step_words.count, self.reset_words.count, 1)
        self.block = max(64, min(BLOCK, SCRATCH // (8 * most) // 64 * 64))
        self.rows = most + 2
        self.states = self._component_rows("s", self.task.state)
        self.seen, self.final = _seen_rows("seen", self.observation), _seen_rows("final", self.observation)
        for i in range(len(self.task.state)):
            self.memory.at(f"s{i}")
        parts = len(self.observation.components) if self.observation.form == "dict" else 1
        for i in range(parts):
            self.memory.at(f"seen{i}")
            self.memory.at(f"final{i}")

    @staticmethod
    def _component_rows(prefix: str, components: Sequence[Component]) -> list[list[Row]]:
        return [
            [Row(f"{prefix}{i}_{k}", f"{prefix}{i}", k, _ARRAYS[c.type.kind]) for k in range(c.type.size)]
            for i, c in enumerate(components)
        ]

    @property
    def inline_reset(self) -> bool:
        """Whether lanes that end start again within the loop: where that is known and takes no draws."""
        return self.mode == "same_step" and not self.reset_words.count


def _seen_rows(prefix: str, layout: Layout) -> list[Row]:
    """The rows of the arrays that hold observations."""
    if layout.form == "dict":
        rows = []
        for i, c in enumerate(layout.components):
            kind = "i64s" if c.is_finite and c.type.is_scalar else "f32s"
            rows += [Row(f"{prefix}{i}_{k}", f"{prefix}{i}", k, kind) for k in range(c.type.size)]
        return rows
    kind = "i64s" if layout.form in ("discrete", "multi_discrete") else "f32s"
    return [Row(f"{prefix}0_{k}", f"{prefix}0", k, kind) for k in range(max(1, layout.size))]


@dataclass
class Loop:
    """The body of a loop over lanes: statements, the rows that they name, and what is shown in one piece."""

    program: Program
    lane: KernelLane
    values: list[Value]
    shown: dict[int, tuple[int, int]] = field(default_factory=dict)  # row of observations -> first word, size


# -- loops --------------------------------------------------------------------------------------------------------


def _loop(p: Program, roots: Sequence[Node], words: WordLayout, at: str, acting: bool) -> Loop:
    """Emit roots; lane `j` is read, and random numbers of place `at`."""
    names: dict[tuple[Role, str], Value] = {(Role.TIME, "t"): Value(["t"])}
    for c, rows in zip(p.task.state, p.states, strict=True):
        names[Role.STATE, c.name] = Value([f"x_{r.name}" for r in rows])
    for i, c in enumerate(p.task.action if acting else ()):
        names[Role.ACTION, c.name] = Value([f"a_{i}_{k}" for k in range(c.type.size)])
    numbers = {d.site: [f"w{words.first[d.site] + k}" for k in range(words_of(d))] for d in words.draws}
    for draw in words.draws:
        for name, number in zip(word_names(draw), numbers[draw.site], strict=True):
            names[Role.VARIABLE, name] = Value([f"i64({number})"])
    lane = KernelLane(names, numbers, p.task.builder.bounds, p.constants, unrolled=EVERYTHING)
    lane.reals = {d.site: [f"r{words.first[d.site] + k}" for k in range(words_of(d))] for d in words.draws}
    shown = _shown(p, roots, words)
    hidden = {len(roots) - len(p.observation.components) + i for i in shown}
    kept = [_NOTHING if i in hidden else root for i, root in enumerate(roots)]
    values = lane.emit(kept)
    return Loop(p, lane, values, dict(shown.values()))


_NOTHING: Node = Const(0, Type(Kind.INT))


def _shown(p: Program, roots: Sequence[Node], words: WordLayout) -> dict[int, tuple[int, tuple[int, int]]]:
    """Observed components that are long draws as they come: number of the component -> row, (first word, size)."""
    if p.observation.form != "box":
        return {}
    found, row = {}, 0
    components = p.observation.components
    for i, (c, node) in enumerate(zip(components, roots[len(roots) - len(components) :], strict=True)):
        if isinstance(node, Draw) and node.base in ("normal", "exponential") and c.type.size >= SHOWN:
            found[i] = (row, (words.first[node.site], c.type.size))
        row += c.type.size
    return found


def _observed(loop: Loop) -> dict[str, str]:
    """What is stored in each row of the observations, by name without its prefix."""
    p, layout = loop.program, loop.program.observation
    values = loop.values[len(loop.values) - len(layout.components) :]
    if layout.form == "one_hot":
        return _one_hot(loop, values)
    out, row = {}, 0
    for i, (c, value) in enumerate(zip(layout.components, values, strict=True)):
        if layout.form == "box" and row in loop.shown:
            row += c.type.size
            continue
        for k, atom in enumerate(value.atoms or ()):
            name = f"{i}_{k}" if layout.form == "dict" else f"0_{row + k}"
            low = int(c.low[k]) if layout.form == "multi_discrete" else 0
            real = p.seen[0].kind == "f32s" if layout.form != "dict" else not (c.is_finite and c.type.is_scalar)
            shifted = f"({atom} - {low})" if low else atom
            out[name] = loop.lane.assign(f"f32({shifted})" if real else f"i64({shifted})")
        row += c.type.size
    return out


def _one_hot(loop: Loop, values: Sequence[Value]) -> dict[str, str]:
    out, row = {}, 0
    for c, value in zip(loop.program.observation.components, values, strict=True):
        for atom, count, low in zip(value.atoms or (), c.counts, c.low, strict=True):
            held = loop.lane.assign(f"i64({atom})")
            for k in range(count):
                out[f"0_{row + k}"] = loop.lane.assign(f"f32({held} == {int(low) + k})")
            row += count
    return out


def _stores(p: Program, loop: Loop) -> dict[Row, str]:
    """The next value of every row of the state that changes."""
    stored: dict[Row, str] = {}
    for rows, value, c in zip(p.states, loop.values, p.task.state, strict=False):
        for row, atom in zip(rows, value.atoms or (), strict=True):
            if atom != f"x_{row.name}":
                stored[row] = loop.lane.assign(f"f64({atom})" if c.type.kind is Kind.REAL else atom)
    return stored


# -- the module ---------------------------------------------------------------------------------------------------


def generate(task: Task, observation: Layout, action: Layout, mode: Mode) -> tuple[str, Program]:
    """Source of the module, and what it says about its memory."""
    p = Program(task, observation, action, mode)
    check = _check(p)
    advance, advance_rows, shown = _advance(p)
    begin, begin_rows, begin_shown = _begin(p)
    step = _step(p, advance_rows, shown, begin_rows, begin_shown)
    reset = _reset(p, begin_rows, begin_shown)
    text = repr(f"{task.id}: a block of lanes at a time, for Numba. Generated; autoreset is {mode!r}.")
    tables = [f"{name} = np.array({array.tolist()}, np.{array.dtype})" for name, array in p.constants.items()]
    head = [text, "", "import numpy as np", "", _IMPORT, "", *tables, ""]
    return "\n".join([*head, *_blank([check, advance, begin, step, reset])]), p


_IMPORT = "from taskspec.backends.numba.library import *  # noqa: F403"


def _blank(functions: Sequence[Sequence[str]]) -> list[str]:
    return [line for function in functions for line in ("", *function, "")]


def _indent(lines: Sequence[str], by: int = 1) -> list[str]:
    return [f"{'    ' * by}{line}" if line else "" for line in lines]


def _action_rows(p: Program) -> list[tuple[str, str]]:
    """For every element of an action: its name, and where it stands in the lanes-first array of actions."""
    names = [f"a_{i}_{k}" for i, c in enumerate(p.task.action) for k in range(c.type.size)]
    width = len(names)
    return [(name, "j" if width == 1 else f"j * {width} + {k}") for k, name in enumerate(names)]


def _check(p: Program) -> list[str]:
    """The number of actions that are not in the action space."""
    lines = ["bad = 0", "for j in range(n):"]
    places = _action_rows(p)
    if p.action.form == "box":
        bounds = zip(p.action.low, p.action.high, strict=True)
        limits = [(literal(max(a, -FLOAT_MAX)), literal(min(b, FLOAT_MAX))) for a, b in bounds]
    else:
        low = [0] * len(places) if p.action.form == "multi_discrete" else list(p.action.starts)
        limits = [(str(a), str(a + c - 1)) for a, c in zip(low, p.action.counts, strict=True)]
    kinds = [c.type.kind for c in p.task.action for _ in range(c.type.size)]
    for (name, place), (a, b), kind in zip(places, limits, kinds, strict=True):
        lines.append(f"    {name} = actions[{place}]")
        good = f"({name} >= {a}) & ({name} <= {b})"
        if p.action.form == "box" and kind is not Kind.REAL:
            good += f" & ({name} == np.trunc({name}))"
        lines.append(f"    bad += i64(({good}) == False)")
    return ["@inner", "def check(n, actions):", *_indent([*lines, "return bad"])]


def _read_actions(p: Program) -> list[str]:
    lines, places = [], iter(_action_rows(p))
    for c in p.task.action:
        for k in range(c.type.size):
            name, place = next(places)
            start = int(c.low[k]) if p.action.form == "multi_discrete" else 0
            raw = f"actions[{place}] + {start}" if start else f"actions[{place}]"
            cast = {Kind.BOOL: "({} != 0)", Kind.INT: "i32({})", Kind.REAL: "f64({})"}[c.type.kind]
            lines.append(f"{name} = {cast.format(raw)}")
    return lines


def _loads(p: Program, words: WordLayout, body: str, at: str) -> tuple[list[str], list[Row]]:
    """Statements that read the rows which the body names, and these rows."""
    lines, rows = [], []
    import re

    used = set(re.findall(r"\b[A-Za-z_]\w*", body))
    for state, c in zip(p.states, p.task.state, strict=True):
        for k, row in enumerate(state):
            if f"x_{row.name}" in used:
                narrow = c.type.kind is Kind.INT and c.low[k] > -(2**31) and c.high[k] < 2**31
                lines.append(f"x_{row.name} = i32({row.name}[j])" if narrow else f"x_{row.name} = {row.name}[j]")
                rows.append(row)
    for k in range(words.count + 1):
        for prefix, array, kind in (("w", "words", "u32s"), ("r", "reals", "f32s")):
            if f"{prefix}{k}" in used:
                lines.append(f"{prefix}{k} = {prefix}_{k}[{at}]")
                rows.append(Row(f"{prefix}_{k}", array, k, kind))
    return lines, rows


def _advance(p: Program) -> tuple[list[str], list[Row], dict[int, tuple[int, int]]]:
    loop = _loop(p, p.step, p.step_words, "j", acting=True)
    n = len(p.task.state)
    state, seen = _stores(p, loop), _observed(loop)
    reward = loop.lane.assign(f"f64({(loop.values[n].atoms or ['0'])[0]})")
    terminal = (loop.values[n + 1].atoms or ["False"])[0]
    ending, end = _ending(p, terminal)
    results, stores, out_rows = _results(p, loop, state, seen, end)
    lines = without_unused(loop.lane.lines, [*state.values(), *seen.values(), reward, terminal])
    body = [*lines, f"reward[j] = {reward}", *ending, *results, *stores]
    loads, in_rows = _loads(p, p.step_words, "\n".join(body), "j")
    rows = list(dict.fromkeys([*in_rows, *out_rows]))
    arguments = ["n", "actions", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
    text = [
        "@apart",
        f"def advance({', '.join([*arguments, *(r.name for r in rows)])}):",
        *_indent(["count = 0", "for j in range(n):"]),
        *_indent(["t = i32(time[j])", *_read_actions(p), *loads, *body], 2),
        *_indent(["    count += i64(e)", "return count"]),
    ]
    return text, rows, loop.shown


def _ending(p: Program, terminal: str) -> tuple[list[str], str]:
    """Statements that count the step and work out the flags; `e` says whether the episode has ended."""
    late = "False" if p.task.horizon is None else f"(t + 1 >= {p.task.horizon})"
    lines = [f"late = {late}", f"e = late | {terminal}" if not never(p.task.terminal) else "e = late"]
    lines += ["steps[j] = u32(steps[j] + u32(1))", f"terminated[j] = {terminal}"]
    return [*lines, "truncated[j] = late", "ended[j] = e"], "e"


def _results(
    p: Program, loop: Loop, state: dict[Row, str], seen: dict[str, str], end: str
) -> tuple[list[str], list[str], list[Row]]:
    """Statements that store the next state and what is seen of it; or the first state, where the episode has ended."""
    rows = {r.name.removeprefix("seen"): r for r in p.seen}
    finals = {r.name.removeprefix("final"): r for r in p.final}
    used = [*state, *(rows[name] for name in seen)]
    if not p.inline_reset:
        stores = [f"{row.name}[j] = {value}" for row, value in state.items()]
        stores += [f"{rows[name].name}[j] = {value}" for name, value in seen.items()]
        return ["time[j] = i64(t + 1)"], stores, used
    start = _loop(p, p.start, p.reset_words, "j", acting=False)
    assert not start.lane.lines or p.start
    first_state, first_seen = _stores(p, start), _observed(start)
    constant = without_unused(start.lane.lines, [*first_state.values(), *first_seen.values()])
    renamed = [_renamed(line) for line in constant]
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
    """Names of a loop's values, apart from those of another."""
    import re

    return re.sub(r"\bv(\d+)\b", r"again\1", text)


def _begin(p: Program) -> tuple[list[str], list[Row], dict[int, tuple[int, int]]]:
    loop = _loop(p, p.start, p.reset_words, "i", acting=False)
    state, seen = _stores(p, loop), _observed(loop)
    rows = {r.name.removeprefix("seen"): r for r in p.seen}
    lines = without_unused(loop.lane.lines, [*state.values(), *seen.values()])
    body = [*lines, *(f"{row.name}[j] = {value}" for row, value in state.items())]
    body += [f"{rows[name].name}[j] = {value}" for name, value in seen.items()]
    body += ["time[j] = 0", "episodes[j] = u32(episodes[j] + u32(1))"]
    loads, in_rows = _loads(p, p.reset_words, "\n".join(body), "i")
    used = list(dict.fromkeys([*in_rows, *state, *(rows[name] for name in seen)]))
    text = [
        "@inner",
        f"def begin({', '.join(['m', 'lanes', 'time', 'episodes', *(r.name for r in used)])}):",
        *_indent(["for i in range(m):"]),
        *_indent(["j = u64(lanes[i])", *loads, *body], 2),
    ]
    return text, used, loop.shown


# -- running the loops over memory --------------------------------------------------------------------------------

_COUNTERS = {
    "k0": "u32s", "k1": "u32s", "steps": "u32s", "episodes": "u32s", "time": "i64s", "reward": "f64s",
    "terminated": "bools", "truncated": "bools", "ended": "bools",
}  # fmt: skip


def _views(p: Program, rows: Sequence[Row]) -> list[str]:
    """Statements that name the arrays of a block."""
    lines = [f"{name} = {kind}({p.memory.at(name)}, first, n)" for name, kind in _COUNTERS.items()]
    for row in rows:
        scratch = row.array in ("words", "reals")
        source = row.source(p.memory, "0", str(p.block)) if scratch else row.source(p.memory)
        lines.append(f"{row.name} = {source}")
    return list(dict.fromkeys(lines))


def _step(
    p: Program,
    rows: Sequence[Row],
    shown: dict[int, tuple[int, int]],
    begin: Sequence[Row],
    begin_shown: dict[int, tuple[int, int]],
) -> list[str]:
    arguments = ["n", "part", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
    width = len(_action_rows(p))
    part = "actions[first:first + n]" if width == 1 else f"actions[first * {width}:(first + n) * {width}]"
    body = _views(p, [*rows, *begin])
    body += [f"part = {part}", f"lanes = i64s({p.memory.at('lanes')}, 0, {p.block + 1})"]
    if p.mode == "next_step":
        body += ["late = gather(n, ended, lanes)"]
    body += _fill(p, p.step_words, "step_words(n", "k0, k1, steps", "n")
    body += [f"count = advance({', '.join([*arguments, *(r.name for r in rows)])})"]
    for row, (number, size) in shown.items():
        seen = p.memory.at("seen0")
        body.append(f"show(n, {p.memory.at('reals')}, {p.block}, {number}, {size}, {seen}, {row}, every, first)")
    body += _restart(p, begin, begin_shown)
    flat = "actions = actions.ravel()"
    bad = [f"if check(stop - start, actions[start * {width}:stop * {width}]) > 0:", "    return -1"]
    return [
        "@outer",
        "def step(m, actions):",
        *_indent([*_RANGE, flat, *bad, "total = 0", *_blocks(p, [*body, "total += count"])]),
        "    return total",
    ]


_RANGE = ["start, stop, every = i64(m[0]), i64(m[1]), i64(m[2])"]


def _blocks(p: Program, body: Sequence[str]) -> list[str]:
    """A loop over the blocks of the range."""
    return [f"for first in range(start, stop, {p.block}):", *_indent([f"n = min({p.block}, stop - first)", *body])]


def _restart(p: Program, begin: Sequence[Row], shown: dict[int, tuple[int, int]]) -> list[str]:
    """What follows the step of a block: lanes that have ended begin again."""
    if p.mode == "disabled" or p.inline_reset:
        return []
    if p.mode == "same_step":
        return [
            "if count > 0:",
            *_indent(["late = gather(n, ended, lanes)", *_keep(p), *_begin_again(p, begin, shown)]),
        ]
    undo = [
        "for i in range(late):",
        "    j = u64(lanes[i])",
        "    count -= i64(ended[j])",
        "    steps[j] = u32(steps[j] - u32(1))",
        "    reward[j] = 0.0",
        "    terminated[j] = truncated[j] = ended[j] = False",
    ]
    return ["if late > 0:", *_indent([*undo, *_begin_again(p, begin, shown)])]


def _keep(p: Program) -> list[str]:
    lines = []
    for array in dict.fromkeys(r.array for r in p.seen):
        rows = [r for r in p.seen if r.array == array]
        kind = "keep_reals" if rows[0].kind == "f32s" else "keep_ints"
        final = p.memory.at(array.replace("seen", "final"))
        lines.append(f"{kind}(late, lanes, {len(rows)}, every, first, n, {p.memory.at(array)}, {final})")
    return lines


def _begin_again(p: Program, rows: Sequence[Row], shown: dict[int, tuple[int, int]]) -> list[str]:
    lines = _fill(p, p.reset_words, "reset_words(late, lanes", "k0, k1, episodes", "late")
    lines.append(f"begin({', '.join(['late', 'lanes', 'time', 'episodes', *(r.name for r in rows)])})")
    for row, (number, size) in shown.items():
        seen, reals = p.memory.at("seen0"), p.memory.at("reals")
        lines.append(f"show_some(late, lanes, {reals}, {p.block}, {number}, {size}, {seen}, {row}, every, first, n)")
    return lines


def _fill(p: Program, words: WordLayout, call: str, keys: str, n: str) -> list[str]:
    """Statements that work out the words of a phase, and the normals and exponentials made of them."""
    if not words.count:
        return []
    w, r = p.memory.at("words"), p.memory.at("reals")
    lines = [f"{call}, {w}, {p.block}, {(words.count + 1) // 2}, {keys})"]
    for draw in words.draws:
        if draw.base in ("normal", "exponential"):
            place = f"{words.first[draw.site]}, {draw.type.size}"
            lines.append(f"{draw.base}s({n}, {w}, {r}, {p.block}, {place})")
    return lines


def _reset(p: Program, rows: Sequence[Row], shown: dict[int, tuple[int, int]]) -> list[str]:
    """Begin an episode in the lanes of a range whose flag `chosen` is set."""
    body = _views(p, rows)
    body += [
        f"lanes = i64s({p.memory.at('lanes')}, 0, {p.block + 1})",
        "late = gather(n, chosen[first:first + n], lanes)",
        "for i in range(late):",
        "    j = u64(lanes[i])",
        "    terminated[j] = truncated[j] = ended[j] = False",
        *_begin_again(p, rows, shown),
    ]
    return ["@outer", "def reset(m, chosen):", *_indent([*_RANGE, *_blocks(p, body)])]


def reads_state(root: Node) -> bool:
    return isinstance(root, Read) and root.role is Role.STATE
