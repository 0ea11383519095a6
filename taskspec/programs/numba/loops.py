"""Loops over lanes as source: `check` the actions, `advance` lanes by a step, and `begin` episodes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Const, Draw, Node
from taskspec.language.expressions.types import INT_MAX, TIME, Kind, Role, Type
from taskspec.language.expressions.variates import VARIATES, WordLayout, words_of
from taskspec.language.task.parts import Component
from taskspec.language.task.task import Task
from taskspec.programs import indent, literal
from taskspec.programs.lane_form import LaneValue
from taskspec.programs.lowering import compared, word_names
from taskspec.programs.numba.kernel import EVERYTHING, KernelLane
from taskspec.programs.numba.memory import GAP, Field, Memory, row_names
from taskspec.programs.numpy.step import never
from taskspec.programs.vector_program import Mode

SCRATCH = 1 << 16
"""Bytes of random words of a block, about: what a first-level cache and a part of the second hold."""
BLOCK = 1024
SHOWN = 8
"""Draws of this many elements or more that are observed as they are go to the observations in one piece."""
_NAMES = re.compile(r"[A-Za-z_]\w*")
_NOTHING: Node = Const(0, Type(Kind.INT))
_COUNTERS = {
    "k0": np.uint32, "k1": np.uint32, "steps": np.uint32, "episodes": np.uint32, "time": np.int64, "reward": np.float64,
    "terminated": np.bool_, "truncated": np.bool_, "ended": np.bool_, "chosen": np.bool_,
}  # fmt: skip


class Program:
    """A task, its memory, and the names of rows: numbers with one for each lane, which are arguments of loops."""

    def __init__(self, task: Task, mode: Mode) -> None:
        self.task = task
        self.mode = mode
        self.observation = task.observation_layout
        self.action = task.action_layout
        self.constants: dict[str, Any] = {}
        b = task.new_builder()
        self.step_words = task.step_words
        self.step_roots = compared(b, task.step_roots)
        self.reset_words = task.reset_words
        self.reset_roots = compared(b, task.reset_roots)
        most = max(self.step_words.count, self.reset_words.count, 1)
        self.block = max(64, min(BLOCK, SCRATCH // (4 * most) // 64 * 64))
        self.width = self.block + GAP
        self.states = [row_names(f"s{i}", c.type.shape) for i, c in enumerate(task.state)]
        self.measures = [f"measure{i}" for i in range(len(task.process.measures))]
        self.seen = []
        self.final: dict[str, str] = {}  # row of the observations -> row of the last observation of an episode
        for i, part in enumerate(self.observation.parts):
            rows = row_names(f"seen{i}", part.shape)
            self.seen.append(rows)
            self.final |= zip(rows, row_names(f"final{i}", part.shape), strict=True)
        self.memory = Memory(self._fields(), (most + 2) * self.width)
        self.rows = self.memory.rows() | {"lanes": "u32s(memory, scratch)"}
        for k in range(most):
            self.rows[f"w_{k}"] = f"u32s(memory, scratch + {(k + 1) * self.width})"
            self.rows[f"r_{k}"] = f"f32s(memory, scratch + {(k + 1) * self.width})"

    def _fields(self) -> dict[str, Field]:
        fields = {name: Field(dtype) for name, dtype in _COUNTERS.items()}
        for i, c in enumerate(self.task.state):
            fields[f"s{i}"] = Field(DTYPES[c.type.kind], c.type.shape)
        for name in self.measures:
            fields[name] = Field(np.float64)
        for i, part in enumerate(self.observation.parts):
            dtype: Any = np.int64 if part.is_whole else np.float32
            fields[f"seen{i}"] = Field(dtype, part.shape)
            fields[f"final{i}"] = Field(dtype, part.shape)
        return fields

    @property
    def inline_reset(self) -> bool:
        """Lanes that end start again within the loop: where that is known and takes no draws."""
        return self.mode == "same_step" and not self.reset_words.count

    def rows_in(self, lines: Iterable[str]) -> list[str]:
        """Rows that some statements name."""
        names = set(_NAMES.findall("\n".join(lines)))
        return [row for row in self.rows if row in names]


@dataclass(frozen=True)
class ShownDraw:
    """A long draw that is observed as it is: the first row of observations, the number of the first word, and its size."""

    row: str
    word: int
    size: int


@dataclass(frozen=True)
class LoopFunction:
    """The source of a function; its last arguments, which are rows; and what its caller is to show."""

    lines: list[str]
    rows: Sequence[str] = ()
    shown: Sequence[ShownDraw] = ()


# -- statements for one lane ----------------------------------------------------------------------------------------


class Statements:
    """Statements for one lane: what is stored in rows of the state and of the observations."""

    def __init__(self, p: Program, roots: Sequence[Node], words: WordLayout) -> None:
        """Lane `j` is read, its time `t`, its actions `a_...`, and its random numbers `w...` and `r...`."""
        self.p = p
        self.shown = _shown(p, roots, words)
        hidden = len(roots) - len(p.observation.components)
        kept = []
        for i, root in enumerate(roots):
            if i - hidden in self.shown:
                kept.append(_NOTHING)
            else:
                kept.append(root)
        self.lane = _lane(p, words)
        self.values = self.lane.emit(kept)

    def scalar(self, place: int, cast: str) -> str:
        return self.lane.assign(f"{cast}({(self.values[place].atoms or ['0'])[0]})")

    def state(self) -> dict[str, str]:
        """Next value of every row of the state that changes."""
        stored = {}
        for rows, value, c in zip(self.p.states, self.values, self.p.task.state, strict=False):
            for row, atom in zip(rows, value.atoms or (), strict=True):
                if atom == f"x_{row}":
                    continue
                if c.type.kind is Kind.REAL:
                    atom = self.lane.assign(f"f64({atom})")
                stored[row] = self.lane.assign(atom)
        return stored

    def observed(self) -> dict[str, str]:
        """Value to store in each row of the observations."""
        layout = self.p.observation
        values = self.values[len(self.values) - len(layout.components) :]
        stored = {}
        for segment in layout.segments:
            if segment.component in self.shown:
                continue
            cast = "f32"
            if layout.parts[segment.part].is_whole:
                cast = "i64"
            atoms = values[segment.component].atoms or []
            if segment.values is not None:
                held = self.lane.assign(f"i32({atoms[segment.element]})")
                atoms = [f"({held} == {value})" for value in segment.values]
            elif segment.starts:
                atoms = [f"({a} - {start})" if start else a for a, start in zip(atoms, segment.starts, strict=True)]
            for k, atom in enumerate(atoms, segment.first):
                stored[self.p.seen[segment.part][k]] = self.lane.assign(f"{cast}({atom})")
        return stored


def _lane(p: Program, words: WordLayout) -> KernelLane:
    names: dict[tuple[Role, str], LaneValue] = {TIME: LaneValue(["t"])}
    for c, rows in zip(p.task.state, p.states, strict=True):
        names[Role.STATE, c.name] = LaneValue([f"x_{row}" for row in rows])
    for i, c in enumerate(p.task.action):
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
    return lane


def _shown(p: Program, roots: Sequence[Node], words: WordLayout) -> dict[int, ShownDraw]:
    shown: dict[int, ShownDraw] = {}
    if len(p.observation.parts) > 1 or p.observation.parts[0].is_whole:
        return shown
    for segment in p.observation.segments:
        node = roots[len(roots) - len(p.observation.components) + segment.component]
        if not isinstance(node, Draw) or VARIATES[node.base].loop is None:
            continue
        if segment.size >= SHOWN and not segment.starts and segment.values is None:
            shown[segment.component] = ShownDraw(p.seen[0][segment.first], words.first[node.site], segment.size)
    return shown


# -- functions ------------------------------------------------------------------------------------------------------


def action_places(p: Program) -> list[tuple[str, str]]:
    """For every element of an action: its name, and where it stands in the lanes-first array of actions."""
    names = []
    for i, c in enumerate(p.task.action):
        for k in range(c.type.size):
            names.append(f"a_{i}_{k}")
    if len(names) == 1:
        return [(names[0], "j")]
    return [(name, f"j * {len(names)} + {k}") for k, name in enumerate(names)]


def check(p: Program) -> LoopFunction:
    """Count the actions that are not in the action space."""
    lines = []
    for (name, place), (low, high) in zip(action_places(p), p.action.ends, strict=True):
        lines.append(f"{name} = actions[{place}]")
        lines.append(f"bad += i64((({name} >= {literal(low)}) & ({name} <= {literal(high)})) == False)")
    body = ["bad = 0", "for j in range(n):", *indent(lines), "return bad"]
    return LoopFunction(["@inner", "def check(n, actions):", *indent(body)])


def _read_actions(p: Program) -> list[str]:
    lines = []
    places = iter(action_places(p))
    for c, segment in zip(p.task.action, p.action.segments, strict=True):
        rounded = c.type.kind is not Kind.REAL and not p.action.parts[segment.part].is_whole
        for start in segment.starts or (0,) * segment.size:
            name, place = next(places)
            raw = f"actions[{place}]"
            if start:
                raw = f"{raw} + {start}"
            if rounded:
                raw = f"np.rint({raw})"
            cast = {Kind.BOOL: "({} != 0)", Kind.INT: "i32({})", Kind.REAL: "f64({})"}[c.type.kind]
            lines.append(f"{name} = {cast.format(raw)}")
    return lines


def _loads(p: Program, words: WordLayout, body: Sequence[str], at: str) -> list[str]:
    lines = []
    used = set(_NAMES.findall("\n".join(body)))
    for rows, c in zip(p.states, p.task.state, strict=True):
        for k, row in enumerate(rows):
            if f"x_{row}" in used:
                lines.append(f"x_{row} = {_read_state(c, k).format(f'{row}[j]')}")
    for k in range(words.count + 1):
        for letter in "wr":
            if f"{letter}{k}" in used:
                lines.append(f"{letter}{k} = {letter}_{k}[{at}]")
    return lines


def _read_state(c: Component, k: int) -> str:
    if c.type.kind is Kind.BOOL:
        return "({} != 0)"
    if c.type.kind is Kind.INT and c.low[k] > -(2**31) and c.high[k] < 2**31:
        return "i32({})"
    return "{}"


def advance(p: Program) -> LoopFunction:
    """Take a step in n lanes; the function returns how many episodes ended in it."""
    step = Statements(p, p.step_roots, p.step_words)
    n = len(p.task.state)
    state = step.state()
    seen = step.observed()
    reward = step.scalar(n, "f64")
    terminal = (step.values[n + 1].atoms or ["False"])[0]
    measures = {}
    for i, row in enumerate(p.measures):
        measures[row] = step.scalar(n + 2 + i, "f64")
    again, stores = _results(p, step, state, seen)
    lines = step.lane.finish(results=[*state.values(), *seen.values(), reward, terminal, *measures.values()])
    time = "i32(time[j])"
    late = f"(t + 1 >= {p.task.horizon})"
    if p.task.horizon is None:
        time = f"i32(min(time[j], {INT_MAX}))"
        late = "False"
    either = f"late | {terminal}"
    if never(p.task.process.terminal):
        either = "late"
    body = [*lines, f"reward[j] = {reward}", *_stored(measures), f"late = {late}", f"e = {either}"]
    body += ["steps[j] = u32(steps[j] + u32(1))", f"terminated[j] = {terminal}", "truncated[j] = late", "ended[j] = e"]
    body += [*again, *stores, "count += i64(e)"]
    body = [f"t = {time}", *_read_actions(p), *_loads(p, p.step_words, body, "j"), *body]
    rows = p.rows_in(body)
    text = [
        "@apart",
        f"def advance({', '.join(['n', 'actions', *rows])}):",
        *indent(["count = 0", "for j in range(n):", *indent(body), "return count"]),
    ]
    return LoopFunction(text, rows, list(step.shown.values()))


def _stored(values: dict[str, str]) -> list[str]:
    return [f"{row}[j] = {value}" for row, value in values.items()]


def _results(p: Program, step: Statements, state: dict[str, str], seen: dict[str, str]) -> tuple[list[str], list[str]]:
    """Store the next state and its observation; or the first state, where the episode has ended."""
    if not p.inline_reset:
        return ["time[j] = i64(t + 1)"], [*_stored(state), *_stored(seen)]
    start = Statements(p, p.reset_roots, p.reset_words)
    first_state = start.state()
    first_seen = start.observed()
    constant = start.lane.finish(results=[*first_state.values(), *first_seen.values()])
    again = [_renamed(line) for line in constant]
    again += ["time[j] = i64(select(e, 0, t + 1))", "episodes[j] = u32(episodes[j] + u32(e))"]
    stores = []
    for row, first in first_state.items():
        stores.append(f"{row}[j] = select(e, {_renamed(first)}, {state.get(row, f'x_{row}')})")
    for row, value in seen.items():
        stores.append(f"{p.final[row]}[j] = {value}")
        stores.append(f"{row}[j] = select(e, {_renamed(first_seen[row])}, {value})")
    return again, stores


def _renamed(text: str) -> str:
    return re.sub(r"\bv(\d+)\b", r"again\1", text)


def begin(p: Program) -> LoopFunction:
    """Begin episodes in m lanes, whose numbers are `lanes`."""
    start = Statements(p, p.reset_roots, p.reset_words)
    state = start.state()
    seen = start.observed()
    lines = start.lane.finish(results=[*state.values(), *seen.values()])
    body = [*lines, *_stored(state), *_stored(seen), "time[j] = 0", "episodes[j] = u32(episodes[j] + u32(1))"]
    body = ["j = u64(lanes[i])", *_loads(p, p.reset_words, body, "i"), *body]
    rows = p.rows_in(body)
    text = ["@apart", f"def begin({', '.join(['m', *rows])}):", *indent(["for i in range(m):", *indent(body)])]
    return LoopFunction(text, rows, list(start.shown.values()))
