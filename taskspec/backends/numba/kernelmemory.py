"""What a Numba program keeps in memory, and where: a vector of addresses, rows of elements, blocks of lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from taskspec.backends.lowering.hoist import compared
from taskspec.backends.vector import Mode
from taskspec.lang.types import Kind
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Component, Task

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


@dataclass
class Memory:
    """Where every array is: its number in the vector of addresses, in the order of `Engine.addresses`."""

    fields: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        # Numbers: the range of lanes, how far apart rows are, what is to be done.
        self.fields = ["start", "stop", "every", "what"]
        self.fields += ["k0", "k1", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
        self.fields += ["chosen", "lanes", "words", "reals"]

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
        offset = first if self.row == 0 else f"i64({self.row}) * {every} + {first}"
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
        b = self.task.builder
        self.step_words = self.task.step_words
        self.step = compared(b, self.task.step_roots)
        self.reset_words = self.task.reset_words
        self.start = compared(b, self.task.reset_roots)
        most = max(self.step_words.count, self.reset_words.count, 1)
        self.block = max(64, min(BLOCK, SCRATCH // (8 * most) // 64 * 64))
        self.rows, self.width = most + 2, self.block + GAP
        self.states = self._component_rows("s", self.task.state)
        self.seen, self.final = _seen_rows("seen", self.observation), _seen_rows("final", self.observation)
        for i in range(len(self.task.state)):
            self.memory.at(f"s{i}")
        for i in range(len(self.observation.parts)):
            self.memory.at(f"seen{i}")
            self.memory.at(f"final{i}")

    @staticmethod
    def _component_rows(prefix: str, components: Sequence[Component]) -> list[list[MemoryRow]]:
        return [
            [MemoryRow(f"{prefix}{i}_{k}", f"{prefix}{i}", k, _ARRAYS[c.type.kind]) for k in range(c.type.size)]
            for i, c in enumerate(components)
        ]

    @property
    def inline_reset(self) -> bool:
        """Whether lanes that end start again within the loop: where that is known and takes no draws."""
        return self.mode == "same_step" and not self.reset_words.count


def _seen_rows(prefix: str, layout: SpaceLayout) -> list[MemoryRow]:
    """The rows of the arrays that hold observations."""
    return [
        MemoryRow(f"{prefix}{i}_{k}", f"{prefix}{i}", k, "i64s" if part.is_whole else "f32s")
        for i, part in enumerate(layout.parts)
        for k in range(math.prod(part.shape))
    ]
