"""A phase of the scalar program (reset or step): which values depend on draws alone, and come in blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence

from taskspec.backends.lowering.hoist import WIDE, everywhere, maximal_draws, word_names
from taskspec.base.records import dataclass
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, rewrite, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.types import Kind, Type
from taskspec.lang.variates import WordLayout
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task


@dataclass(frozen=True)
class Phase:
    """The roots of a phase, with what depends on draws alone replaced by reads of `hoisted` values.

    An item of the stream (`taskspec.backends.scalar.stream`) is the new observation row (if any), then the words of the draws
    that stay, then the hoisted values.
    """

    roots: tuple[Node, ...]
    observation: tuple[Node, ...]
    hoisted: tuple[Node, ...]
    hoisted_names: tuple[str, ...]
    words: dict[int, tuple[str, ...]]  # of the draws that stay in the lane form, by site
    layout: WordLayout
    row_shape: tuple[int, ...]  # of a fresh float32 observation, () where observations are no arrays
    row_parts: tuple[tuple[int, Node], ...]  # offset and node of what is filled in for a whole block

    @classmethod
    def of(
        cls,
        task: Task,
        roots: Sequence[Node],
        observation: Sequence[Node],
        layout: SpaceLayout,
        words: WordLayout,
    ) -> Phase:
        """Split a phase of a task."""
        everything = (*roots, *observation)
        free = everywhere(everything, _block_can_compute)
        rows = layout.form == "box" and bool(layout.shape) and bool(observation)
        parts, inner = _row_parts(observation, free) if rows else ((), list(observation))
        hoisted = maximal_draws((*roots, *(n for n in inner if n is not None)), free)
        names = {id(n): f"h{i}" for i, n in enumerate(hoisted)}

        def leaf(node: Node) -> Node | None:
            return task.builder.read(Role.VARIABLE, names[id(node)], node.type) if id(node) in names else None

        lane = [*roots, *(n for n in inner if n is not None)]
        rewritten = iter(rewrite(lane, leaf, task.builder.remake))
        new_roots = tuple(next(rewritten) for _ in roots)
        new_observation = tuple(_FILLED if n is None else next(rewritten) for n in inner)
        staying = [n for n in walk([*new_roots, *new_observation]) if isinstance(n, Draw)]
        named = {d.site: word_names(d) for d in staying}
        return cls(
            new_roots,
            new_observation,
            tuple(hoisted),
            tuple(names.values()),
            named,
            words,
            layout.shape if rows else (),
            parts,
        )

    @property
    def row_size(self) -> int:
        """Elements of a fresh observation, 0 where observations are no arrays."""
        return math.prod(self.row_shape) if self.row_shape else 0

    @property
    def wide(self) -> list[str]:
        """The hoisted values that come as arrays."""
        return [name for name, n in zip(self.hoisted_names, self.hoisted, strict=True) if n.type.size > WIDE]

    @property
    def names(self) -> list[str]:
        """The names that an item of the stream is unpacked into."""
        row = ["o"] if self.row_size else []
        return [*row, *(w for ws in self.words.values() for w in ws), *self.hoisted_names]


_FILLED: Node = Const(0, Type(Kind.INT))
"""Stands for an observation component that the block has filled in already."""


def is_filled(node: Node) -> bool:
    return node is _FILLED


def _block_can_compute(node: Node) -> bool:
    """Return whether NumPy computes the same number in a block: no read, and no operator whose last digit differs in the C
    library.
    """
    if isinstance(node, Read):
        return False
    return not isinstance(node, Apply) or node.op not in OPERATORS or OPERATORS[node.op].precise


def _row_parts(
    observation: Sequence[Node], free: dict[int, bool]
) -> tuple[tuple[tuple[int, Node], ...], list[Node | None]]:
    """Observation components that a block fills in, with their offsets; None in place of each."""
    parts: list[tuple[int, Node]] = []
    inner: list[Node | None] = []
    offset = 0
    for node in observation:
        if free[id(node)]:
            parts.append((offset, node))
        inner.append(None if free[id(node)] else node)
        offset += node.type.size
    return tuple(parts), inner
