"""Finite tasks as tables, in the rationals that a spec writes."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import compress

from taskspec.base.display import plural
from taskspec.exact.solve.outcomes import Number, Outcome, Outcomes

LONGEST_NAME = 40
"""Letters of the name of a state or action."""
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_TAKEN = frozenset({
    "s", "a", "t", "T", "pi", "inf", "true", "false", "null", "terminal", "by", "rows", "then", "else", "seen",
    *keyword.kwlist,
})  # fmt: skip
"""Words that mean something else in the spec of a table."""


Rows = tuple[tuple[Outcomes, ...], ...]
"""The outcomes of each state and each action."""


@dataclass(frozen=True)
class FrozenTask:
    """A finite task as tables; numbers are rationals, or floats where nothing better is known.

    Attributes:
        states, actions: their names.
        start: the probability of each state at the beginning.
        outcomes: of each state and each action; none where the action is not legal.
        last: the number of the step that ends the episode wherever it is taken; None where there is none.
        seen: the numbers that are observed in each state; None where the state itself is observed.
        values: the values of components in each state, by name; empty where states have names only.
        labels: sets of states, by name.
        text: `title`, `summary`, `description`, `capability`.
        claims: exact returns, by name.
        absorbing: what each step pays after an end in each state, where ends absorb; empty where nothing.
        measures: the same task with a measure in place of the reward, by the measure's name.
        width: the columns of a grid whose cells are the states, row by row; None where they are none.
        remarks: the parts of its source that the tables do not have, or have in another form.
    """

    name: str
    states: tuple[str, ...]
    actions: tuple[str, ...]
    start: tuple[Number, ...]
    outcomes: Rows
    horizon: int | None
    discount: Number = 1.0
    last: int | None = None
    seen: tuple[tuple[float, ...], ...] | None = None
    values: tuple[Mapping[str, int], ...] = ()
    labels: Mapping[str, frozenset[int]] = field(default_factory=dict)
    text: Mapping[str, str] = field(default_factory=dict)
    claims: Mapping[str, Number] = field(default_factory=dict)
    absorbing: tuple[Number, ...] = ()
    measures: Mapping[str, FrozenTask] = field(default_factory=dict)
    width: int | None = None
    remarks: tuple[str, ...] = ()

    def steps(self) -> Iterator[tuple[int, int, Outcome]]:
        """Yield every outcome with its state and action."""
        for s, by_action in enumerate(self.outcomes):
            for a, outcomes in enumerate(by_action):
                for outcome in outcomes:
                    yield s, a, outcome

    @cached_property
    def is_rational(self) -> bool:
        """True where all probabilities are rationals."""
        return not any(isinstance(outcome.probability, float) for _, _, outcome in self.steps())

    def taken_steps(self) -> Iterator[tuple[int, int, Outcome]]:
        """Yield the outcomes of the states in which an episode could act."""
        for s, a, outcome in self.steps():
            if s in self.acting:
                yield s, a, outcome

    @cached_property
    def starts(self) -> list[int]:
        """The possible first states."""
        return [s for s, probability in enumerate(self.start) if probability]

    @property
    def steps_in_episode(self) -> int | None:
        """The largest number of steps; None where there is no limit."""
        if self.last is None:
            return self.horizon
        return self.last + 1

    @cached_property
    def acting(self) -> frozenset[int]:
        """The states in which an episode could act if there were no horizon."""
        waiting = list(self.starts)
        reached = set(waiting)
        while waiting:
            for outcomes in self.outcomes[waiting.pop()]:
                for outcome in outcomes:
                    if not outcome.ends and outcome.state not in reached:
                        reached.add(outcome.state)
                        waiting.append(outcome.state)
        return frozenset(reached)

    def remarked(self, *remarks: str) -> FrozenTask:
        """Return the same task with further remarks."""
        return replace(self, remarks=(*self.remarks, *remarks))


def numbered(letter: str, count: int) -> tuple[str, ...]:
    """Return names that are numbers behind a letter: `s0`, `s1`."""
    return tuple(f"{letter}{i}" for i in range(count))


def components_name(values: Mapping[str, object]) -> str:
    """Return components with their values as a name: `x1_y0`."""
    return "_".join(f"{name}{value}" for name, value in values.items())


def separated(task: FrozenTask, everywhere: bool = False) -> FrozenTask:
    """Add a copy, for ends alone, of each state that a step enters both with and without an end.

    Args:
        everywhere: so that whether an episode ends depends on the next state alone; else only where one step does both.
    """
    ambiguous = _ambiguous(task, everywhere)
    if not ambiguous:
        return task
    copies = {s: len(task.states) + i for i, s in enumerate(ambiguous)}

    def moved(outcome: Outcome) -> Outcome:
        if not outcome.ends:
            return outcome
        return replace(outcome, state=copies.get(outcome.state, outcome.state))

    rows = []
    for by_action in task.outcomes:
        rows.append(tuple(tuple(map(moved, outcomes)) for outcomes in by_action))
    names = list(task.states)
    seen = list(task.seen or ())
    absorbing = list(task.absorbing)
    for s, copy in copies.items():
        rows.append(_stays(copy, len(task.actions)))
        names.append(f"{task.states[s]}_end")
        if task.seen is not None:
            seen.append(task.seen[s])
        if task.absorbing:
            absorbing.append(task.absorbing[s])
    start = task.start + (0.0,) * len(copies)
    return replace(
        task, states=plain_names(names, "s"), start=start, outcomes=tuple(rows), seen=tuple(seen) or None, values=(),
        labels={}, width=None, absorbing=tuple(absorbing),
    )  # fmt: skip


def _ambiguous(task: FrozenTask, everywhere: bool) -> list[int]:
    going = set()
    for _, _, outcome in task.taken_steps():
        if not outcome.ends:
            going.add(outcome.state)
    states: dict[int, None] = {}
    for by_action in task.outcomes:
        for outcomes in by_action:
            if not everywhere:
                going = set()
                for outcome in outcomes:
                    if not outcome.ends:
                        going.add(outcome.state)
            for outcome in outcomes:
                if outcome.ends and outcome.state in going:
                    states[outcome.state] = None
    return list(states)


def _stays(s: int, actions: int) -> tuple[Outcomes, ...]:
    return ((Outcome(1.0, s, 0.0, False),),) * actions


def visited(task: FrozenTask) -> FrozenTask:
    """Leave out states that no episode enters."""
    reached = set(task.acting)
    for _, _, outcome in task.taken_steps():
        reached.add(outcome.state)
    kept = sorted(reached)
    if len(kept) == len(task.states):
        return task
    is_kept = [s in reached for s in range(len(task.states))]
    index = {s: i for i, s in enumerate(kept)}
    rows = []
    for s in kept:
        by_action = task.outcomes[s]
        if s not in task.acting:
            by_action = _stays(s, len(task.actions))
        moved = []
        for outcomes in by_action:
            moved.append(tuple(replace(outcome, state=index[outcome.state]) for outcome in outcomes))
        rows.append(tuple(moved))
    seen = task.seen
    if seen is not None:
        seen = tuple(compress(seen, is_kept))
    labels = {}
    for name, held in task.labels.items():
        labels[name] = frozenset(index[s] for s in held.intersection(index))
    return replace(
        task, states=tuple(compress(task.states, is_kept)), start=tuple(compress(task.start, is_kept)), outcomes=tuple(rows),
        seen=seen, values=tuple(compress(task.values, is_kept)), width=None, labels=labels,
        absorbing=tuple(compress(task.absorbing, is_kept)),
    )  # fmt: skip


def cleared(task: FrozenTask, known: int = 0) -> FrozenTask:
    """Leave out states that no episode enters, and remark on their number.

    Args:
        known: number of these states that need no remark.
    """
    kept = visited(task)
    left_out = len(task.states) - len(kept.states) - known
    if left_out > 0:
        kept = kept.remarked(f"lost: {plural(left_out, 'state')} that no episode enters")
    return kept


def plain_names(names: Sequence[str], letter: str) -> tuple[str, ...]:
    """Turn names into distinct labels of a spec.

    Signs become `_`, a name that does not begin with a letter gets the given one, a name that means something else a `_`, and
    one that occurs before its number.
    """
    known: set[str] = set()
    plain = []
    for i, given in enumerate(names):
        name = re.sub(r"\W", "_", given, flags=re.ASCII)[:LONGEST_NAME]
        if not _NAME.fullmatch(name):
            name = f"{letter}{name or i}"
        if name in _TAKEN:
            name = f"{name}_"
        if name in known:
            name = f"{name}_{i}"
        while name in known:
            name = f"{name}_"
        known.add(name)
        plain.append(name)
    return tuple(plain)
