"""What is true of every task, as a list: one rule a line, checked of every task that any test builds.

Whatever is downstream of a `Task` relies on these rules and checks none of them again. A rule that does not hold is a
mistake of the compiler, never of a spec.
"""

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from operator import le
from typing import Any, TypeVar

from taskspec.language.expressions import interval
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, draws, reads, walk
from taskspec.language.expressions.operators import OPERATORS, STRUCTURES
from taskspec.language.expressions.types import BOOL, INT_MAX, REAL, Kind, Role, Type
from taskspec.language.expressions.variates import VARIATES
from taskspec.language.modifiers.core import remembers_what_is_told
from taskspec.language.task.parts import Component, Symmetry
from taskspec.language.task.task import Task

SomeNode = TypeVar("SomeNode", bound=Node)
NodeRule = tuple[str, Callable[[Node], bool]]
TaskRule = tuple[str, Callable[[Task], bool]]

_PRESENT = {Role.STATE, Role.TIME}
_STEP = {*_PRESENT, Role.ACTION}
_NUMBERS: dict[Kind, set[type]] = {Kind.BOOL: {bool}, Kind.INT: {int}, Kind.REAL: {float, Fraction}}

OF_NODES: tuple[NodeRule, ...] = (
    ("a constant has one scalar for each element", lambda n: not isinstance(n, Const) or _sized(n)),
    ("the scalars of a constant are of its kind", lambda n: not isinstance(n, Const) or _of_kind(n)),
    ("an operator is in one of the two tables", lambda n: not isinstance(n, Apply) or (n.op in OPERATORS) ^ (n.op in STRUCTURES)),
    ("the type of an operation follows its rule", lambda n: not isinstance(n, Apply) or _ruled(n)),
    ("an operation without arguments does not exist", lambda n: not isinstance(n, Apply) or len(n.args) > 0),
    ("static values are ints", lambda n: not isinstance(n, Apply) or set(map(type, n.static)) <= {int}),
    ("a draw is of a base variate, and of its kind", lambda n: not isinstance(n, Draw) or VARIATES[n.base].kind is n.type.kind),
    ("variables of comprehensions and functions are expanded", lambda n: getattr(n, "role", None) is not Role.VARIABLE),
)  # fmt: skip

OF_TASKS: tuple[TaskRule, ...] = (
    ("there is a state and an action", lambda t: bool(t.state and t.action)),
    ("no two components have one name", lambda t: _distinct(_names((*t.state, *t.action, *kept(t))))),
    ("no two observed components have one name", lambda t: _distinct(_names(t.observation.components))),
    ("bounds have one number for each element, low first", lambda t: all(map(_bounded, components(t)))),
    ("each state component has a first value of its type", lambda t: _typed(t.process.initial, t.state)),
    ("each state component has a next value of its type", lambda t: _typed(t.process.next, t.state)),
    ("each observed component has a value of its type", lambda t: _typed(t.observation.nodes, t.observation.components)),
    ("each action component has an expert's value of its type", lambda t: _typed(experts(t), t.action if experts(t) else ())),
    ("the rewards are single reals", lambda t: t.process.reward.type == t.process.absorbing_reward.type == REAL),
    ("the end is a single condition", lambda t: t.process.terminal.type == BOOL),
    ("first values read nothing", lambda t: not _roles(t.process.initial)),
    ("a step reads state, action and time", lambda t: _roles((*t.process.next, t.process.reward, t.process.terminal)) <= _STEP),
    ("an observation reads state and time", lambda t: _roles(t.observation.nodes) <= _PRESENT),
    ("an expert reads state and time", lambda t: _roles(experts(t)) <= _PRESENT),
    ("a figure reads what a step reads", lambda t: _roles(drawn(t)) <= _STEP),
    ("the absorbing reward reads state and time", lambda t: _roles([t.process.absorbing_reward]) <= _PRESENT),
    ("the absorbing reward draws nothing", lambda t: not draws([t.process.absorbing_reward])),
    ("each component of a memory has values of its type", lambda t: _typed(memory(t), kept(t) * 2)),
    ("a memory reads what is seen, and later itself, action and time", lambda t: remembers_what_is_told(t)),
    ("a memory draws nothing", lambda t: not draws(memory(t))),
    ("a symmetry maps what is seen, or the action, and draws nothing", lambda t: all(map(_mapped, t.annotations.symmetries))),
    ("what is read is a component", lambda t: _read(t) <= {*_names((*t.state, *t.action, *kept(t))), "t"}),
    ("a site of a draw is one node", lambda t: _distinct(map(_site, _nodes(t, Draw)))),
    ("equal operations are one node", lambda t: _distinct(map(_key, _nodes(t, Apply)))),
    ("an index is certain to lie in its vector", lambda t: _certain(_indices(t))),
    ("a draw of an index has one value to draw from at least", lambda t: _certain(_counts(t))),
    ("a state int is certain to keep to its range", lambda t: _certain(_kept(t))),
    ("a horizon has a step at least", lambda t: t.horizon is None or t.horizon >= 1),
    ("the discount is between 0 and 1", lambda t: 0 <= t.discount <= 1),
)  # fmt: skip


def roots(task: Task) -> tuple[Node, ...]:
    """Return every expression that a task is made of."""
    step = (*task.process.next, task.process.reward, task.process.terminal, task.process.absorbing_reward)
    return (*task.process.initial, *step, *task.observation.nodes, *experts(task), *drawn(task))


def experts(task: Task) -> tuple[Node, ...]:
    """Return the expert's action where the spec writes it out, else nothing."""
    return task.annotations.expert_nodes


def kept(task: Task) -> tuple[Component, ...]:
    """Return the components of what the expert remembers."""
    return () if task.annotations.memory is None else task.annotations.memory.components


def memory(task: Task) -> tuple[Node, ...]:
    """Return first and then next values of what the expert remembers."""
    return () if task.annotations.memory is None else (*task.annotations.memory.initial, *task.annotations.memory.next)


def drawn(task: Task) -> tuple[Node, ...]:
    """Return what the figure shows."""
    return () if task.annotations.figure is None else task.annotations.figure.nodes


def components(task: Task) -> tuple[Component, ...]:
    """Return every component of a task, the observed ones too."""
    return (*task.state, *task.action, *task.observation.components)


def broken(task: Task) -> Iterator[str]:
    """Yield the rules that a task breaks, each with the node or the task that breaks it; nothing for a task as it should be."""
    nodes = [*roots(task), *memory(task)]
    for symmetry in task.annotations.symmetries:
        nodes += symmetry.nodes
    for node in walk(nodes):
        for rule, holds in OF_NODES:
            if not holds(node):
                yield f"{rule}: {node!r}"
    for rule, holds_of_task in OF_TASKS:
        if not holds_of_task(task):
            yield f"{rule}: {task!r}"


def checked(make: Callable[..., Task]) -> Callable[..., Task]:
    """Return a function that makes tasks, which raises AssertionError for one that breaks a rule."""

    def make_checked(*args: Any, **options: Any) -> Task:
        task = make(*args, **options)
        found = list(broken(task))
        if found:
            raise AssertionError("\n".join(found))
        return task

    return make_checked


def _sized(node: Const) -> bool:
    return len(node.flat) == node.type.size


def _of_kind(node: Const) -> bool:
    return set(map(type, node.flat)) <= _NUMBERS[node.type.kind]


def _ruled(node: Apply) -> bool:
    types = _types(node.args)
    if node.op in OPERATORS:
        return OPERATORS[node.op].rule(types) == node.type
    return not types or node.op not in STRUCTURES or STRUCTURES[node.op].rule(types, node.static) == node.type


def _types(those: Iterable[Node | Component]) -> tuple[Type, ...]:
    return tuple(each.type for each in those)


def _typed(nodes: Iterable[Node], components: Iterable[Component]) -> bool:
    return _types(nodes) == _types(components)


def _bounded(c: Component) -> bool:
    return len(c.low) == len(c.high) == c.type.size and all(map(le, c.low, c.high))


def _roles(nodes: Iterable[Node]) -> set[Role]:
    return {role for role, _ in reads(nodes)} - {Role.PARAMETER}


def _mapped(symmetry: Symmetry) -> bool:
    seen = {(Role.NEXT, c.name) for c in symmetry.seen}
    alone = reads(symmetry.observation) <= seen and _roles(symmetry.action) <= {Role.ACTION}
    typed = _typed(symmetry.observation, symmetry.components)
    return typed and alone and not draws(symmetry.nodes)


Range = tuple[Node, float, float]
"""A node, and the range that its value must keep to."""


def _certain(ranges: Iterable[Range]) -> bool:
    for node, low, high in ranges:
        least, most = interval.certain(node, {})
        if least < low or high < most:
            return False
    return True


def _nodes(task: Task, kind: type[SomeNode]) -> Iterator[SomeNode]:
    for node in walk(roots(task)):
        if isinstance(node, kind):
            yield node


def _indices(task: Task) -> Iterator[Range]:
    """Yield every index of a vector."""
    for node in _nodes(task, Apply):
        for i in _INDICES.get(node.op, ()):
            yield node.args[i], 0, node.args[0].type.shape[0] - 1


_INDICES = {"index": (1,), "put": (1,), "swap": (1, 2)}
"""Which arguments of an operator say where in the first one."""


def _counts(task: Task) -> Iterator[Range]:
    for node in _nodes(task, Draw):
        if node.base == "index":
            yield node.args[0], 1, INT_MAX


def _kept(task: Task) -> Iterator[Range]:
    for nodes in (task.process.initial, task.process.next):
        for component, node in zip(task.state, nodes, strict=True):
            if component.type.kind is Kind.INT:
                yield node, component.least, component.most


def _names(components: Iterable[Component]) -> list[str]:
    return [component.name for component in components]


def _read(task: Task) -> set[str]:
    return {name for role, name in reads(roots(task)) if role is not Role.PARAMETER}


def _site(node: Draw) -> int:
    return node.site


def _key(node: Apply) -> tuple[str, tuple[int, ...], Type, tuple[int, ...]]:
    return node.op, node.static, node.type, tuple(map(id, node.args))


def _distinct(keys: Iterable[object]) -> bool:
    seen = list(keys)
    return len(set(seen)) == len(seen)
