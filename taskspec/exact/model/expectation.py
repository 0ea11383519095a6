"""The expected reward where the reward itself is noisy: real draws that enter it linearly are replaced by their means."""

from __future__ import annotations

from collections.abc import Collection

from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Draw, Node, children, draws, rewrite, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.operators.structure import STRUCTURES
from taskspec.lang.variates import VARIATES

SMALL = 1e-100
"""A product of such sizes may be too small for a float."""


def is_faint(reward: Node, mean: Node) -> bool:
    """Whether so small numbers went into the expectation of a reward that it may be 0 in floats, and is not."""
    constants = (node for node in walk([reward, mean]) if isinstance(node, Const))
    return reward is not mean and any(0 < abs(v) < SMALL for node in constants for v in node.flat)


def expected(reward: Node, builder: Builder, shared: Collection[Draw] = ()) -> Node:
    """The reward with every draw that is not finite and enters linearly replaced by its mean.

    Draws in `shared` also decide something else (the next state) and are left alone; so is a draw
    that enters in any other way, and then the task has no exact model.
    """
    kept = {d.site for d in shared}
    means = {
        d.site: mean
        for d in draws([reward])
        if d.site not in kept and (mean := _mean(d, builder)) is not None and _is_linear(reward, d)
    }

    def leaf(node: Node) -> Node | None:
        return means.get(node.site) if isinstance(node, Draw) else None

    return rewrite([reward], leaf, builder.remake)[0] if means else reward


def _mean(draw: Draw, builder: Builder) -> Node | None:
    found = VARIATES[draw.base].mean
    return (
        None if found is None else builder.stretch(builder.cast(found(builder, draw), draw.type.kind), draw.type.shape)
    )


def _is_linear(root: Node, draw: Draw) -> bool:
    """Whether the root is linear in the draw, whatever else it depends on."""
    depends: dict[int, bool] = {}
    for node in walk([root]):
        below = [depends[id(c)] for c in children(node)]
        if node is draw:
            depends[id(node)] = True
        elif not any(below):
            depends[id(node)] = False
        elif not (isinstance(node, Apply) and _keeps_linear(node.op, below)):
            return False
        else:
            depends[id(node)] = True
    return True


def _keeps_linear(op: str, below: list[bool]) -> bool:
    return (OPERATORS[op] if op in OPERATORS else STRUCTURES[op]).linear(below)
