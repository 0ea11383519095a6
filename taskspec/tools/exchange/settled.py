"""Tables as model checkers take them, with one first state and ends that are states; and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain

from taskspec.exact.solve.outcomes import Number, Outcome, Outcomes, merged
from taskspec.tools.exchange.frozen_task import FrozenTask, cleared

FIRST = "draw"
"""The label of the state that draws the first state of an episode, where that is not always the same."""
END = "end"
"""The label of states in which an episode has ended."""
PHASE = "phase"
"""The variable of states that has one of these values."""
DRAWING = 0
ACTING = 1
ENDED = 2
_SUFFIX = {DRAWING: "_draw", ACTING: "", ENDED: "_end"}
UNSEEN = ()
"""Observed before the first state is drawn."""
Place = tuple[int, int]
"""A state, and its phase."""


def settled(task: FrozenTask) -> FrozenTask:
    """Return the same decision process without ends, discount and start distribution, in rationals.

    A step that ends leads to a copy of the next state, labelled `end`, which is never left. A discount gamma becomes a
    probability of 1 - gamma to end after a step. A start distribution becomes the first step, from a state labelled `draw`,
    which counts in the horizon. Expected returns are the same. States with one choice alone have one row.
    """
    starts = task.starts
    places = _places(task)
    index = {place: i for i, place in enumerate(places)}
    states = []
    rows: list[tuple[Outcomes, ...]] = []
    values = []
    seen: list[tuple[float, ...]] = []
    labels: dict[str, set[int]] = {name: set() for name in task.labels}
    labels[END] = set()
    for i, (s, phase) in enumerate(places):
        states.append(f"{task.states[s]}{_SUFFIX[phase]}")
        own: Mapping[str, int] = {"s": s}
        if task.values:
            own = task.values[s]
        values.append({**own, PHASE: phase})
        if phase == DRAWING:
            rows.append((_drawn(task, index),))
            seen.append(UNSEEN)
            labels[FIRST] = {i}
            continue
        if phase == ACTING:
            rows.append(tuple(_moved(task, outcomes, index) for outcomes in task.outcomes[s]))
        else:
            rows.append(((Outcome(Fraction(1), i, Fraction(0), False),),))
            labels[END].add(i)
        if task.seen is not None:
            seen.append(task.seen[s])
        for name, held in task.labels.items():
            if s in held:
                labels[name].add(i)
    start = [Fraction(0)] * len(places)
    start[index.get((starts[0], DRAWING), index[starts[0], ACTING])] = Fraction(1)
    horizon = task.steps_in_episode
    if horizon is not None and len(starts) > 1:
        horizon += 1
    ready = replace(
        task, states=tuple(states), outcomes=tuple(rows), values=tuple(values), last=None, start=tuple(start),
        labels={name: frozenset(held) for name, held in labels.items()}, horizon=horizon, discount=Fraction(1),
    )  # fmt: skip
    if task.seen is None:
        return ready
    return replace(ready, seen=tuple(seen))


def _places(task: FrozenTask) -> list[Place]:
    """Return the states of the settled task: the one that draws, those in which episodes act, and those in which they end."""
    acting = sorted(task.acting)
    ended = set()
    for s in acting:
        for outcome in chain(*task.outcomes[s]):
            if outcome.ends or task.discount < 1:
                ended.add(outcome.state)
    places = []
    if len(task.starts) > 1:
        places.append((task.starts[0], DRAWING))
    places += [(s, ACTING) for s in acting]
    places += [(s, ENDED) for s in sorted(ended)]
    return places


def _drawn(task: FrozenTask, index: Mapping[Place, int]) -> Outcomes:
    outcomes = []
    for s, share in zip(task.starts, _shares([task.start[s] for s in task.starts]), strict=True):
        outcomes.append(Outcome(share, index[s, ACTING], Fraction(0), False))
    return tuple(outcomes)


def _moved(task: FrozenTask, outcomes: Outcomes, index: Mapping[Place, int]) -> Outcomes:
    """Return the outcomes of a step: unless it ends, the episode goes on with the discount as probability."""
    if not outcomes:
        return ()
    moved = []
    shares = _shares([outcome.probability for outcome in outcomes])
    for outcome, share in zip(outcomes, shares, strict=True):
        going = Fraction(task.discount) if not outcome.ends else Fraction(0)
        for phase, part in ((ACTING, going), (ENDED, 1 - going)):
            if part:
                moved.append(Outcome(share * part, index[outcome.state, phase], Fraction(outcome.reward), False))
    return tuple(moved)


def _shares(probabilities: Sequence[Number]) -> list[Fraction]:
    """Return probabilities as rationals that sum to 1: the largest one makes up for rounding errors."""
    exact = [Fraction(p) for p in probabilities]
    exact[exact.index(max(exact))] += 1 - sum(exact)
    return exact


def at_random(task: FrozenTask) -> FrozenTask:
    """Return a task whose only action chooses uniformly among the actions of another one."""
    rows = []
    for by_action in task.outcomes:
        legal = list(filter(None, by_action))
        share = Fraction(1, len(legal))
        drawn = []
        for outcome in chain(*legal):
            drawn.append(replace(outcome, probability=outcome.probability * share))
        rows.append((merged(drawn),))
    return replace(task, actions=("random",), outcomes=tuple(rows))


def property_of(task: FrozenTask, extreme: str) -> str:
    """Return the property whose value is the largest (`max`) or smallest (`min`) expected return of a settled task."""
    until = f"C<={task.horizon}" if task.horizon is not None else f'F "{END}"'
    return f'R{{"reward"}}{extreme}=? [{until}]'


def unsettled(task: FrozenTask) -> FrozenTask:
    """Return the task of a decision process: steps into states that pay nothing and are never left end an episode.

    The state labelled `draw` is replaced by a start distribution.
    """
    ends = set()
    for s, by_action in enumerate(task.outcomes):
        if all(outcome.state == s and not outcome.reward for outcome in chain(*by_action)):
            ends.add(s)
    rows = []
    for by_action in task.outcomes:
        row = []
        for outcomes in by_action:
            row.append(tuple(replace(outcome, ends=outcome.state in ends) for outcome in outcomes))
        rows.append(tuple(row))
    labels = dict(task.labels)
    if labels.get(END, frozenset()) <= ends:
        labels.pop(END, None)
    plain = replace(task, outcomes=tuple(rows), labels=labels)
    first = _drawing(plain)
    if first is None:
        return cleared(plain)
    del labels[FIRST]
    start: list[Number] = [Fraction(0)] * len(rows)
    for outcome in rows[first][0]:
        start[outcome.state] = outcome.probability
    horizon = task.horizon
    if horizon is not None:
        horizon -= 1
    return cleared(replace(plain, start=tuple(start), horizon=horizon, labels=labels), known=1)


def _drawing(task: FrozenTask) -> int | None:
    """Return the state that draws the first state: where episodes start, without choices and rewards, and never return."""
    if task.horizon == 1 or len(task.starts) != 1 or task.labels.get(FIRST) != frozenset(task.starts):
        return None
    (first,) = task.starts
    is_free = not any(outcome.reward or outcome.ends for outcome in task.outcomes[first][0])
    is_left = all(outcome.state != first for _, _, outcome in task.steps())
    if is_free and is_left and len(set(task.outcomes[first])) == 1:
        return first
    return None
