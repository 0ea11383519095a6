"""Tables as model checkers take them, with one first state and ends that are states; and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from taskspec.exact.solve.outcomes import Number, Outcome, Outcomes, merged
from taskspec.tools.exchange.tables import FrozenTask, cleared

FIRST = "draw"
"""The label of the state that draws the first state of an episode, where that is not always the same."""
END = "end"
"""The label of states in which an episode has ended."""
PHASE = "phase"
"""The variable of states: 0 before the first state is drawn, 1 in an episode, 2 after its end."""
_SUFFIX = {0: "_draw", 1: "", 2: "_end"}


def settled(task: FrozenTask) -> FrozenTask:
    """Return the same decision process without ends, discount and start distribution, in rationals.

    A step that ends leads to a copy of the next state, labelled `end`, which is never left. A discount gamma becomes a
    probability of 1 - gamma to end after a step. A start distribution becomes the first step, from a state labelled `draw`,
    which counts in the horizon. Expected returns are the same. States with one choice alone have one row.
    """
    gamma = Fraction(task.discount)
    starts = [s for s, probability in enumerate(task.start) if probability > 0]
    taken = [outcome for s, _, outcome in task.steps() if s in task.acting]
    places = [(starts[0], 0)] if len(starts) > 1 else []
    places += [(s, 1) for s in sorted(task.acting)]
    places += [(s, 2) for s in sorted({outcome.state for outcome in taken if outcome.ends or gamma < 1})]
    index = {place: i for i, place in enumerate(places)}
    rows: list[tuple[Outcomes, ...]] = []
    for s, phase in places:
        if phase == 0:
            drawn = zip(starts, _shares([task.start[first] for first in starts]), strict=True)
            rows.append((tuple(_free(p, index[first, 1]) for first, p in drawn),))
        elif phase == 1:
            rows.append(tuple(tuple(_outcomes(outcomes, gamma, index)) for outcomes in task.outcomes[s]))
        else:
            rows.append(((_free(Fraction(1), index[s, 2]),),))
    values = task.values or [{"s": s} for s in range(len(task.states))]
    seen = task.seen
    if seen is not None:  # nothing is observed before the first state
        seen = tuple(seen[s] if phase else () for s, phase in places)
    labels = {}
    for name, held in task.labels.items():
        labels[name] = frozenset(i for (s, phase), i in index.items() if s in held and phase > 0)
    labels[END] = frozenset(i for (_, phase), i in index.items() if phase == 2)
    if len(starts) > 1:
        labels[FIRST] = frozenset({0})
    horizon = task.horizon
    if task.last is not None:
        horizon = task.last + 1
    if horizon is not None and len(starts) > 1:
        horizon += 1
    first = index.get((starts[0], 0), index[starts[0], 1])
    return replace(
        task, states=tuple(f"{task.states[s]}{_SUFFIX[phase]}" for s, phase in places), outcomes=tuple(rows),
        values=tuple({**values[s], PHASE: phase} for s, phase in places), labels=labels, last=None, seen=seen,
        start=tuple(Fraction(i == first) for i in range(len(places))), horizon=horizon, discount=Fraction(1),
    )  # fmt: skip


def _free(probability: Fraction, place: int) -> Outcome:
    return Outcome(probability, place, Fraction(0), False)


def _outcomes(outcomes: Outcomes, gamma: Fraction, index: dict[tuple[int, int], int]) -> Iterator[Outcome]:
    """Yield what follows a step: the episode goes on with probability gamma, unless it ends."""
    shares = _shares([outcome.probability for outcome in outcomes]) if outcomes else []
    for outcome, share in zip(outcomes, shares, strict=True):
        going = Fraction(0) if outcome.ends else gamma
        for phase, part in ((1, going), (2, 1 - going)):
            if part:
                place = index[outcome.state, phase]
                yield Outcome(share * part, place, Fraction(outcome.reward), False)


def _shares(probabilities: Sequence[Number]) -> list[Fraction]:
    """Return probabilities as rationals that sum to 1: the largest one makes up for rounding errors."""
    exact = [Fraction(p) for p in probabilities]
    exact[exact.index(max(exact))] += 1 - sum(exact)
    return exact


def at_random(task: FrozenTask) -> FrozenTask:
    """Return a task whose only action chooses uniformly among the actions of another one."""
    rows = []
    for by_action in task.outcomes:
        share = Fraction(1, len(list(filter(None, by_action))))
        shared = [replace(o, probability=o.probability * share) for outcomes in by_action for o in outcomes]
        rows.append((merged(shared),))
    return replace(task, actions=("random",), outcomes=tuple(rows))


def legal_choices(by_action: Sequence[Outcomes]) -> Iterator[tuple[int, Outcomes]]:
    """Yield the outcomes of each action that is legal in a state, with the number of the action."""
    return ((a, outcomes) for a, outcomes in enumerate(by_action) if outcomes)


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
        if all(outcome.state == s and not outcome.reward for outcomes in by_action for outcome in outcomes):
            ends.add(s)
    rows = []
    for by_action in task.outcomes:
        rows.append(tuple(tuple(replace(o, ends=o.state in ends) for o in outcomes) for outcomes in by_action))
    labels = dict(task.labels)
    if labels.get(END, frozenset()) <= ends:
        labels.pop(END, None)
    plain = replace(task, outcomes=tuple(rows), labels=labels)
    first = _drawing(plain)
    if first is None:
        return cleared(plain)
    del labels[FIRST]
    chances = {outcome.state: outcome.probability for outcome in rows[first][0]}
    start = tuple(chances.get(s, Fraction(0)) for s in range(len(rows)))
    horizon = task.horizon
    if horizon is not None:
        horizon -= 1
    return cleared(replace(plain, start=start, horizon=horizon, labels=labels), known=1)


def _drawing(task: FrozenTask) -> int | None:
    """Return the state that draws the first state: where episodes start, without choices and rewards, and never return."""
    likely = [s for s, probability in enumerate(task.start) if probability]
    if task.horizon == 1 or len(likely) != 1 or task.labels.get(FIRST) != frozenset(likely):
        return None
    (first,) = likely
    is_free = not any(outcome.reward or outcome.ends for outcome in task.outcomes[first][0])
    is_left = all(outcome.state != first for _, _, outcome in task.steps())
    if is_free and is_left and len(set(task.outcomes[first])) == 1:
        return first
    return None
