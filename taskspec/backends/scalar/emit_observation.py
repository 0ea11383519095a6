"""How a generated step writes its observation: a fresh row, an int, or whatever form the layout has."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from taskspec.backends.emit.lane import LaneEmitter
from taskspec.backends.emit.lanevalues import UNROLLED, LaneValue
from taskspec.backends.lowering.phase import Phase, is_filled
from taskspec.lang.ir import Node
from taskspec.lang.types import Kind
from taskspec.task.spaces import SpaceLayout

_LARGEST = 3.4e38
"""Below the largest float32."""


def observe(lane: LaneEmitter, layout: SpaceLayout, phase: Phase, values: Sequence[LaneValue]) -> tuple[str, list[str]]:
    """The source of the observation, and the statements that fill it in."""
    nodes = phase.observation
    match layout.form:
        case "discrete":
            return _integer(lane, nodes[0]), []
        case "box" if phase.row_size:
            return _row(lane, nodes, layout)
        case "box":
            return _array(lane, nodes[0], lane.scalar(nodes[0])), []
        case "multi_discrete":
            atoms = [_shifted(a, start) for a, start in zip(_all_atoms(lane, nodes), layout.starts, strict=True)]
            return f"np.array(({', '.join(atoms)},), np.int64)", []
        case "one_hot":
            return _one_hot(lane, nodes, layout)
        case "dict":
            return _dictionary(lane, nodes, layout), []


def _integer(lane: LaneEmitter, node: Node) -> str:
    """A finite scalar as `Discrete` has it: a condition is 0 or 1."""
    atom = lane.scalar(node)
    return f"(1 if {atom} else 0)" if node.type.kind is Kind.BOOL else atom


def _all_atoms(lane: LaneEmitter, nodes: Sequence[Node]) -> list[str]:
    return [atom for node in nodes for atom in lane.atoms(node)]


def _shifted(atom: str, start: int) -> str:
    return atom if start == 0 else f"{atom} - {start}" if start > 0 else f"{atom} + {-start}"


def _row(lane: LaneEmitter, nodes: Sequence[Node], layout: SpaceLayout) -> tuple[str, list[str]]:
    """Runs of elements written into the fresh row `o`; what the block filled in is left alone."""
    statements: list[str] = []
    run: list[Node] = []
    offset = start = 0
    sizes = [c.type.size for c in layout.components]
    for node, size in zip([*nodes, None], [*sizes, 0], strict=True):
        if node is None or is_filled(node):
            statements += _write(lane, start, run)
            run = []
        else:
            start = start if run else offset
            run.append(node)
        offset += size
    return "o", statements


def _write(lane: LaneEmitter, start: int, run: Sequence[Node]) -> list[str]:
    if not run:
        return []
    size = sum(n.type.size for n in run)
    if size == 1 and not _may_overflow(lane, run[0]):
        return [f"o[{start}] = {lane.scalar(run[0])}"]
    items = [f"*{lane.packed(n)}" if n.type.size > UNROLLED else ", ".join(lane.atoms(n)) for n in run]
    writer = lane.constant(Struct(f"{size}f").pack_into)  # native floats: what overflows becomes inf
    return [f"{writer}(o, {4 * start}, {', '.join(items)})"]


def _one_hot(lane: LaneEmitter, nodes: Sequence[Node], layout: SpaceLayout) -> tuple[str, list[str]]:
    name = lane.name()
    statements = [f"{name} = np.zeros({layout.size}, np.float32)"]
    offset = 0
    bounds = [lane.certain(node) for node in nodes for _ in range(node.type.size)]
    places = zip(_all_atoms(lane, nodes), bounds, layout.starts, layout.counts, strict=True)
    for atom, (low, high), start, count in places:
        inside = "" if start <= low and high < start + count else f"if {start} <= {atom} < {start + count}: "
        statements.append(f"{inside}{name}[{offset} + {_shifted(atom, start)}] = 1.0")
        offset += count
    return name, statements


def _may_overflow(lane: LaneEmitter, node: Node) -> bool:
    """Whether a number may be finite, and infinite in float32, which NumPy warns of."""
    return max(map(abs, lane.certain(node))) > _LARGEST


def _array(lane: LaneEmitter, node: Node, source: str) -> str:
    """The source of an array of float32."""
    shape = node.type.shape
    if _may_overflow(lane, node):
        return f"singles({source}, {shape})"
    return f"np.array({source}, np.float32)" + (f".reshape({shape})" if len(shape) > 1 else "")


def _dictionary(lane: LaneEmitter, nodes: Sequence[Node], layout: SpaceLayout) -> str:
    items = []
    for node, c in zip(nodes, layout.components, strict=True):
        if c.is_finite and c.type.is_scalar:
            items.append(f"{c.name!r}: {_integer(lane, node)}")
        else:
            source = lane.scalar(node) if c.type.is_scalar else lane.packed(node)
            items.append(f"{c.name!r}: {_array(lane, node, source)}")
    return "{" + ", ".join(items) + "}"
