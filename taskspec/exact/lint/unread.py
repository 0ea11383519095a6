"""Components of the state that make no difference."""

from __future__ import annotations

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.lang.ir import Node, Role, draws, reads, walk
from taskspec.task.task import Task


def unread(case: Linted, collector: Collector) -> None:
    """W519: a component on which neither rewards nor ends depend, which is not shown, or is drawn all the same."""
    task = case.task
    matters = _followed(task, (task.reward, task.terminal))
    shown = _followed(task, () if task.observation.is_state else task.observation.nodes)
    for c, first, following in zip(task.state, task.initial, task.next, strict=True):
        if c.name in matters | shown or c.low == c.high:
            continue
        if not task.observation.is_state:
            message = f"neither rewards nor ends depend on '{c.name}', and it is not observed"
            collector.add("W519", case.key("state", c.name), message)
        elif draws((first, following)):
            collector.add(
                "W519", case.key("state", c.name), f"'{c.name}' is drawn, but neither rewards nor endings depend on it"
            )


def forgotten(case: Linted, collector: Collector) -> None:
    """W519: what the expert remembers, and nothing that it does depends on."""
    task = case.task
    if task.memory is None:
        return
    nexts = {c.name: node for c, node in zip(task.memory.components, task.memory.next, strict=True) if c.type.size}
    found = {name for _, name in reads(task.expert)} if isinstance(task.expert, tuple) else set()
    for _ in nexts:
        found |= {name for known in found & nexts.keys() for role, name in reads([nexts[known]]) if role is Role.STATE}
    for name in (n for n in nexts if n not in found):
        collector.add("W519", case.key("memory", name), f"no action of the expert depends on '{name}'")


def _followed(task: Task, roots: tuple[Node, ...]) -> set[str]:
    """Components that some nodes depend on, at this step or later; a node may hold the next value of a component."""
    nexts = {c.name: node for c, node in zip(task.state, task.next, strict=True)}
    inside = {id(node) for node in walk(roots)}
    found: set[str] = set()
    fresh = {name for role, name in reads(roots) if role is Role.STATE}
    fresh |= {name for name, node in nexts.items() if id(node) in inside}
    while fresh:
        found |= fresh
        fresh = {name for role, name in reads([nexts[n] for n in fresh]) if role is Role.STATE} - found
    return found
