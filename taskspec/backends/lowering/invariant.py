"""What stays the same for a whole episode: expressions over components that no step changes, computed once at reset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taskspec.lang.ir import Apply, Draw, Node, Read, Role, children, reads, rewrite, walk
from taskspec.lang.variates.choices import row_table
from taskspec.task.task import Task


@dataclass(frozen=True)
class Invariants:
    """The invariants of a task's steps.

    `nodes` read the state; `at_reset` are the same over the first state; `names` are the variables that hold them.
    `observation` says that the whole observation is one.
    """

    nodes: tuple[Node, ...]
    at_reset: tuple[Node, ...]
    names: tuple[str, ...]
    observation: bool

    @classmethod
    def of(cls, task: Task, rows: bool) -> Invariants:
        """`rows`: whether observations are float32 arrays, which can be kept and copied."""
        roots = (*task.next, task.reward, task.terminal)
        fixed = _fixed((*roots, *task.next_observation), frozen_components(task))
        # What is seen at the reset may be something else: `x'` may be the same in every step, and not be `x`.
        observed = (
            rows
            and all(fixed[id(n)] for n in task.next_observation)
            and _at_reset(task, task.next_observation) == task.first_observation
        )
        seen = () if observed else task.next_observation
        nodes = tuple(_maximal((*roots, *seen), fixed))
        return cls(nodes, _at_reset(task, nodes), tuple(f"k{i}" for i in range(len(nodes))), observed)

    def replaced(self, task: Task, roots: Sequence[Node]) -> tuple[Node, ...]:
        """Roots that read the variables instead of working the invariants out."""
        names = {id(n): name for n, name in zip(self.nodes, self.names, strict=True)}

        def leaf(node: Node) -> Node | None:
            name = names.get(id(node))
            return None if name is None else task.builder.read(Role.VARIABLE, name, node.type)

        return rewrite(roots, leaf, task.builder.remake)


def _at_reset(task: Task, nodes: Sequence[Node]) -> tuple[Node, ...]:
    """Nodes over the first state in place of the present one."""
    first = {c.name: n for c, n in zip(task.state, task.initial, strict=True)}

    def leaf(node: Node) -> Node | None:
        return first[node.name] if isinstance(node, Read) and node.role is Role.STATE else None

    return rewrite(nodes, leaf, task.builder.remake_late)


WIDE = 32
"""Vectors above this are handled as arrays: thousands of Python numbers waiting for their turn would miss the cache."""


def cold_components(task: Task, roots: Sequence[Node]) -> frozenset[str]:
    """Wide components that no step changes and none of the roots reads: not worth keeping, since a reset can be replayed."""
    read = reads(roots)
    frozen = frozen_components(task)
    return frozenset(c.name for c in task.state if c.name in frozen and c.type.size > WIDE and c.read not in read)


def changing(task: Task, roots: Sequence[Node]) -> list[Node]:
    """Roots of a step without those of components that stay as they are."""
    n, frozen = len(task.state), frozen_components(task)
    moving = [r for r, c in zip(roots[:n], task.state, strict=True) if c.name not in frozen]
    return [*moving, *roots[n:]]


def frozen_components(task: Task) -> frozenset[str]:
    """Names of the state components that no step changes."""
    pairs = zip(task.state, task.next, strict=True)
    return frozenset(c.name for c, n in pairs if isinstance(n, Read) and n.role is Role.STATE and n.name == c.name)


def _fixed(roots: Sequence[Node], frozen: frozenset[str]) -> dict[int, bool]:
    """For every node, whether it draws nothing and reads frozen components only."""
    fixed: dict[int, bool] = {}
    for node in walk(roots):
        match node:
            case Draw():
                own = False
            case Read(role=role, name=name):
                own = role is Role.STATE and name in frozen
            case _:
                own = True
        fixed[id(node)] = own and all(fixed[id(c)] for c in children(node))
    return fixed


def _maximal(roots: Sequence[Node], fixed: dict[int, bool]) -> list[Node]:
    """The largest fixed operations that the rest refers to; a bare read or constant is not worth a variable.

    Rows of a table that a draw looks up stay as they are: their probabilities are exact only while they are known as such.
    """
    found: dict[int, Node] = {}
    rows = {id(d.args[0]): d.args[0] for d in walk(roots) if isinstance(d, Draw) and d.args and row_table(d.args[0])}
    users = [*roots, *(c for n in walk(roots) if not fixed[id(n)] or id(n) in rows for c in children(n))]
    for node in users:
        if fixed[id(node)] and isinstance(node, Apply) and id(node) not in rows:
            found[id(node)] = node
    return list(found.values())
