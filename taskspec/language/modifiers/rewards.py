"""Modifiers of rewards: scaled, shifted, noisy, shaped by a potential, paid later."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import chain, pairwise, product
from typing import TypeAlias

from taskspec.base.diagnostics import Collector, Diagnostic, Origin, Span, SpecError
from taskspec.base.named import all_names
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.ir import Apply, Const, Node, children, plain, reads, walk
from taskspec.language.expressions.operators import OPERATORS, Elements, entry_of
from taskspec.language.expressions.parse import parse
from taskspec.language.expressions.scope import Unavailable
from taskspec.language.expressions.types import INT, REAL, Kind, Refused, Role, Type
from taskspec.language.modifiers import core
from taskspec.language.modifiers.entry import STD, Arguments, ModifierArgument, ModifierEntry, always, as_well
from taskspec.language.task.parts import Component, by_read
from taskspec.language.task.task import Task

SCOPE = "absorbing"
"""The section whose expressions see states, and no actions."""


def potential(b: Builder, task: Task, written: str) -> Node:
    """Read a potential: an expression of the task language over a state.

    Raises:
        SpecError: with all that is wrong with it, at its place in the expression.
    """
    collector = Collector()
    origin = Origin("potential", written)
    expr = parse(s.SourceText(written, lambda start, end: Span(origin, 1, start + 1, 1, end + 1)))
    names = ["t", *all_names(task.action)]
    hidden = {}
    for name in names:
        hidden[name] = Unavailable("E302", f"'{name}' cannot be used in a potential")
    scope = task.source.surface.scopes[SCOPE].child(dict(hidden))
    scope.draws = "a potential is a function of the state"
    try:
        node = Checker(b, collector).numeric(expr, scope)
    except Refused as refused:
        raise SpecError([Diagnostic(refused.code, expr.place.span, refused.message, refused.hint)]) from None
    finally:
        collector.raise_if_errors()
    if not node.type.is_scalar:
        raise SpecError(
            [Diagnostic("E307", expr.place.span, f"a potential is one number, not {list(node.type.shape)}")]
        )
    if any(role.value == "time" for role, _ in reads([node])):
        raise SpecError(
            [Diagnostic("E302", expr.place.span, "a potential depends on the state alone, not on the time")]
        )
    return b.cast(node, Kind.REAL)


# Rewards that are paid later: after some steps, or when the episode ends.
#
# Outstanding rewards are part of the state. Where the rewards of a task are known to be few, it is kept in whole numbers, so that
# a finite task stays finite.

MOST_SUMS = 1_000_000
"""Limit on distinct sums of rewards."""


MOST_VALUES = 256
"""Limit on the values of an expression that are listed."""
TRIED = 4096
"""Combinations of arguments that are worked out for one operation."""
Values: TypeAlias = frozenset[Const] | None
"""Possible values of the elements of a node; None for unknown or too many ones."""


@dataclass(frozen=True)
class FewRewards:
    """The rewards of a task, 0 among them, in order; `number` says which one a step pays."""

    values: tuple[float, ...]
    number: Node


def few_rewards(b: Builder, task: Task) -> FewRewards | None:
    """Rewards of a task if they are known to be few, else None."""
    known: dict[int, Values] = {}
    for node in walk([task.process.reward]):
        possible = _values(b, node, [known[id(c)] for c in children(node)])
        if possible is not None and len(possible) <= MOST_VALUES:
            known[id(node)] = possible
        else:
            known[id(node)] = None
    constants = known[id(task.process.reward)]
    if constants is None:
        return None
    values = sorted({0.0, *(float(plain(v.value)) + 0.0 for v in constants)})
    if not all(map(math.isfinite, values)):
        return None
    number: Node = b.scalar(0)
    for low, high in pairwise(values):
        half = float((Fraction(low) + Fraction(high)) / 2)  # half way, where rounding makes no difference
        above = b.apply("lt", b.scalar(half if half < high else low), task.process.reward)
        number = b.apply("add", number, b.cast(above, Kind.INT))
    return FewRewards(tuple(values), b.within(number, 0, len(values) - 1))


def _values(b: Builder, node: Node, args: list[Values]) -> Values:
    kind = node.type.kind
    values: list[Node] | None = None
    match node:
        case Const():
            values = [b.const(v, Type(kind)) for v in set(node.flat)]
        case Apply(op=op) if entry_of(op).elements is Elements.MOVED:
            moved = [a for i, a in enumerate(args) if i not in entry_of(op).indices]
            every = [a for a in moved if a is not None]
            if len(every) == len(moved):
                values = [b.cast(value, kind) for value in chain.from_iterable(every)]
        case Apply(op=op) if op in OPERATORS and OPERATORS[op].elementwise:
            every = [a for a in args if a is not None]
            if len(every) == len(args) and math.prod(map(len, every)) <= TRIED:
                values = [b.apply(op, *each) for each in product(*every)]
    if values is not None:
        return frozenset(v for v in values if isinstance(v, Const))
    if kind is Kind.BOOL:
        return frozenset((b.const(False, Type(kind)), b.const(True, Type(kind))))
    low, high = b.bounds(node)
    if kind is Kind.REAL or not high - low < MOST_VALUES:
        return None
    return frozenset(b.const(v, INT) for v in range(int(low), int(high) + 1))


# -- after some steps ---------------------------------------------------------------------------------------------


def _delayed(b: Builder, task: Task, given: Arguments) -> Task:
    few = few_rewards(b, task)
    steps = given["steps"]
    (name,) = core.fresh(["outstanding"], core.names_in(task))
    if few is None:
        c = Component(name, Type(Kind.REAL, (steps,)), (-math.inf,) * steps, (math.inf,) * steps, doc=_QUEUE)
        queue = b.read(Role.STATE, name, c.type)
        amounts = queue
        entry = task.process.reward
        nothing = b.const([0.0] * steps, c.type)
    else:
        most = len(few.values) - 1
        c = Component(name, Type(Kind.INT, (steps,)), (0,) * steps, (most,) * steps, doc=f"{_QUEUE}, by their numbers")
        queue = b.read(Role.STATE, name, c.type, 0, most)
        table = b.const(few.values, Type(Kind.REAL, (most + 1,)))
        amounts = b.structure("index", [table, queue])
        entry = few.number
        nothing = b.const([few.values.index(0.0)] * steps, c.type)
    moved_up = b.structure("vector", [entry])
    if steps > 1:
        moved_up = b.structure("concat", [b.structure("slice", [queue], (1, steps - 1, 1)), moved_up])
    added = core.AddedState(c, nothing, moved_up)
    everything = b.apply("add", b.apply("sum", amounts), task.process.reward)
    paid = b.apply("where", core.last(b, task), everything, b.structure("element", [amounts], (0,)))
    return core.with_state(core.paying(b, task, paid), [added])


_QUEUE = "rewards not paid yet, the oldest first"


# -- at the end ---------------------------------------------------------------------------------------------------


def _at_end(b: Builder, task: Task, given: Arguments) -> Task:
    few = few_rewards(b, task)
    (name,) = core.fresh(["earned"], core.names_in(task))
    counted = None
    if few is not None:
        counted = _in_units(b, task, few, name)
    if counted is None:
        c = Component(name, REAL, (-math.inf,), (math.inf,), doc="the sum of the rewards so far")
        total = b.apply("add", b.read(Role.STATE, name, REAL), task.process.reward)
        added = core.AddedState(c, b.scalar(0.0), total)
        paid = total
    else:
        added, paid = counted
    return core.with_state(core.paying(b, task, b.apply("where", core.last(b, task), paid, b.scalar(0.0))), [added])


def _in_units(b: Builder, task: Task, few: FewRewards, name: str) -> tuple[core.AddedState, Node] | None:
    """Express a sum as a multiple of the rewards' greatest common divisor; None where that may be too many."""
    exact = [Fraction(repr(v)) for v in few.values]
    unit = reduce(_common, exact) or Fraction(1)
    if task.horizon is None:
        return None
    times = [int(v / unit) for v in exact]
    low = task.horizon * min(times)
    high = task.horizon * max(times)
    if high - low >= MOST_SUMS:
        return None
    c = Component(name, INT, (low,), (high,), doc=f"the sum of the rewards so far, in units of {float(unit):g}")
    total = b.apply("add", b.read(Role.STATE, name, INT, low, high), core.looked_up(b, times, few.number))
    following = b.within(total, low, high)
    return core.AddedState(c, b.scalar(0), following), b.apply("mul", b.const(unit, REAL), following)


def _common(a: Fraction, b: Fraction) -> Fraction:
    return Fraction(math.gcd(a.numerator * b.denominator, b.numerator * a.denominator), a.denominator * b.denominator)


def undiscounted(task: Task, given: Arguments) -> bool:
    return task.discount == 1


_STEPS = ModifierArgument("steps", "int", "how many steps later", low=1, high=10_000, sample=lambda task: 2)
LATER_TABLE = (
    ModifierEntry(
        "delay", (_STEPS,), "Rewards are paid some steps later; those still outstanding when the episode ends are paid then.",
        _delayed,
        lambda task, given: f"each reward is paid {_times(given['steps'])} later; what is outstanding when the episode ends is "
        "paid then",
        time_limit="read", keeps="every policy's return", observed=always, when=undiscounted, condition="the discount is 1",
    ),
    ModifierEntry(
        "reward_at_end", (), "All rewards are 0 until the end of the episode, where their sum is paid.",
        _at_end, lambda task, given: "nothing is paid before the episode ends, and then the sum of all its rewards",
        time_limit="read", keeps="every policy's return", observed=always, when=undiscounted, condition="the discount is 1",
    ),
)  # fmt: skip


def _times(steps: int) -> str:
    if steps == 1:
        return "one step"
    return f"${steps}$ steps"


# Modifiers of rewards: scaled, shifted, noisy, shaped.


def _changed(b: Builder, task: Task, op: str, given: float) -> Task:
    number = b.scalar(float(given))
    reward = b.apply(op, number, task.process.reward)
    absorbing = b.apply(op, number, task.process.absorbing_reward)
    return core.paying(b, task.with_process(absorbing_reward=absorbing), reward)


def _noise(b: Builder, task: Task, given: Arguments) -> Task:
    with b.written(apart=True) as drawn:
        reward = core.noisy(b, task.process.reward, given["std"])
    return core.drawing(core.paying(b, task, reward), drawn)


def _shaped(b: Builder, task: Task, given: Arguments) -> Task:
    here = potential(b, task, given["of"])
    (after,) = b.substitute([here], by_read(Role.STATE, task.state, task.process.next))
    there = b.apply("where", core.last(b, task), b.scalar(0.0), after)
    gained = b.apply("sub", b.apply("mul", b.scalar(float(task.discount)), there), here)
    return core.paying(b, task, b.apply("add", task.process.reward, gained))


def _some_state(task: Task) -> str:
    c: Component = task.state[0]
    if not c.type.is_scalar:
        return f"sum({c.name})"
    if c.domain is not None:
        return f"{c.name} == {c.domain.labels[-1]}"
    if c.type.kind is Kind.BOOL:
        return f"1 if {c.name} else 0"
    return c.name


def lasts(task: Task) -> bool:
    return isinstance(task.process.terminal, Const) and not task.process.terminal.value and task.horizon is not None


TABLE = (
    *LATER_TABLE,
    ModifierEntry(
        "reward_scale", (ModifierArgument("factor", "real", "what rewards are multiplied by", sample=lambda task: 2),),
        "Rewards are multiplied by a number.",
        lambda b, task, given: _changed(b, task, "mul", given["factor"]),
        lambda task, given: f"every reward is multiplied by ${given['factor']:g}$",
        keeps="best policies", when=lambda task, given: given["factor"] > 0, condition="the factor is above 0",
        abstraction=as_well,
    ),
    ModifierEntry(
        "reward_shift", (ModifierArgument("by", "real", "what is added", sample=lambda task: -0.5),),
        "A number is added to the reward of every step.",
        lambda b, task, given: _changed(b, task, "add", given["by"]),
        lambda task, given: f"${given['by']:g}$ is added to the reward of every step",
        keeps="best policies", when=lambda task, given: lasts(task), condition="all episodes are equally long",
        abstraction=as_well,
    ),
    ModifierEntry(
        "reward_noise", (STD,), "Normal noise is added to every reward.",
        _noise,
        lambda task, given: rf"noise from $\mathcal{{N}}(0, {given['std']:g}^2)$ is added to every reward",
        keeps="every policy's return", observed=always, abstraction=as_well,
    ),
    ModifierEntry(
        "potential", (
            ModifierArgument("of", "expression", "the potential of a state, in the task language", sample=_some_state),
        ),
        "The increase of a potential is added to each reward (Ng, Harada and Russell, 1999); the end has potential 0.",
        _shaped,
        lambda task, given: rf"$\gamma\, \Phi(s') - \Phi(s)$ is added to the reward, where $\Phi$ is `{given['of']}`, and 0 when "
        "the episode has ended",
        time_limit="read", keeps="best policies",
    ),
)  # fmt: skip
