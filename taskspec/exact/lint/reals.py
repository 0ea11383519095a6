"""Reals that could be ints."""

from __future__ import annotations

import math

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.exact.lint.names import mentioned
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, walk
from taskspec.lang.operators import OPERATORS
from taskspec.lang.operators.structure import STRUCTURES
from taskspec.lang.types import Kind
from taskspec.task.task import Component, Task


def whole(case: Linted, collector: Collector) -> None:
    """W513: a real component of the state that is whole in every state of every episode."""
    for c in _whole_components(case.task):
        message = f"'{c.name}' is declared real, but only takes whole values"
        collector.add("W513", case.key("state", c.name), message, "declare it `type: int`")


def _whole_components(task: Task) -> list[Component]:
    """The largest set of real components that start whole and stay whole while all of them are."""
    reals = {p.name for p in task.parameters if p.kind == "real"}
    nodes = {c.name: pair for c, *pair in zip(task.state, task.initial, task.next, strict=True)}
    found = {
        c.name: c for c in task.state if c.type.kind is Kind.REAL and c.type.size and not _words(task, c.name) & reals
    }
    while broken := [name for name in found if not all(_is_whole(node, found.keys()) for node in nodes[name])]:
        for name in broken:
            del found[name]
    return [c for name, c in found.items() if not _is_fixed(name, *nodes[name])]


def _is_fixed(name: str, first: Node, following: Node) -> bool:
    """Whether a component starts as a constant and stays as it is."""
    return isinstance(first, Const) and isinstance(following, Read) and (following.name == name)


def _words(task: Task, name: str) -> set[str]:
    """What the lines of a component mention; a real parameter there is whole by chance at the most."""
    return mentioned(task, "initial", name) | mentioned(task, "dynamics", name + "'")


def _is_whole(root: Node, assumed: object) -> bool:
    """Whether a value is whole if the components in `assumed` are."""
    whole: dict[int, bool] = {}
    for node in walk([root]):
        whole[id(node)] = node.type.kind is not Kind.REAL or _keeps(node, whole, assumed)
    return whole[id(root)]


def _keeps(node: Node, whole: dict[int, bool], assumed: object) -> bool:
    match node:
        case Const():
            return all(math.isfinite(v) and v == int(v) for v in node.flat)
        case Read(role=role, name=name):
            return role is Role.STATE and name in assumed  # type: ignore[operator]
        case Apply(op=op, args=args):
            return (op in STRUCTURES or OPERATORS[op].whole) and all(whole[id(a)] for a in args)
        case Draw():
            return False
