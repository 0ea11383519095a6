"""A task's exact model as tables, in the rationals that its spec writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.transitions import FLOATS, Steps
from taskspec.exact.policies.adapters import ProbabilisticPolicy
from taskspec.exact.policies.policy import states_of
from taskspec.exact.rules.conditions import condition_over_states
from taskspec.exact.rules.evaluator import InvalidClaim
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.enclosure import Inexact, Reader
from taskspec.exact.solve.rational import ExactProbabilities
from taskspec.language.expressions import syntax
from taskspec.language.expressions.batch import evaluate
from taskspec.language.expressions.types import BOOL
from taskspec.language.expressions.variates.entry import ProbabilityArithmetic
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from taskspec.tools.exchange.tables import FrozenOutcome, FrozenTask, Number, Outcomes, merged, plain_names, separated

MOST_STATES = 1000
"""The largest number of states of a task that is frozen."""
TIME = "t"
"""The component that is added to states where the time matters."""
Place = tuple[int, int]
"""A time, 0 where it does not matter, and the index of a state."""
Chances = Callable[[int], dict[tuple[int, int], Outcomes]]
"""From the time to the outcomes by state and action, of all states in which episodes act."""


def freeze(task: Task) -> FrozenTask:
    """Return a task as tables, with its exact returns as claims; all actions are legal there.

    Raises:
        SpecError: E712 for a task that has no exact model, is too large, or whose observations are drawn.
    """
    task = with_all_actions(task)
    model = extract(task, reachable=True)
    frozen = tables(model, MOST_STATES)
    seen = _observations(model)
    if seen is not None:
        if model.is_timed and frozen.last is None:
            refuse(f"{task.id} depends on the time, which its observations leave out", "add the time to the state")
        frozen = replace(frozen, seen=tuple(seen[s] for s in np.flatnonzero(model.entered).tolist()))
    results = Results(task, 1)
    claims = {}
    for name in ("optimal", "random", "worst"):
        value = getattr(results, name)
        if value is not None:
            claims[f"{name}_return"] = value.value
    text = {
        "title": f"{task.title or task.name}, frozen",
        "summary": f"{task.instance_id} as tables, without draws of constants.",
        "description": task.spec.description or "",
        "capability": task.capability or task.name,
    }
    return separated(replace(frozen, text=text, claims=claims))


def tables(model: Model, most: int) -> FrozenTask:
    """Return a model as tables of the states that some episode visits.

    States in which none acts stay as they are and pay nothing. Where the time matters, it becomes part of the state.

    Args:
        model: an exact model.
        most: the largest number of states.

    Raises:
        SpecError: E712 for a model that is too large.
    """
    last = _last_step(model)
    is_timed = model.is_timed and last is None
    start, discount, chances = _numbers(model)
    rows = _explored(model, chances, is_timed, most)
    places = sorted(rows)
    index = {place: i for i, place in enumerate(places)}
    outcomes = []
    for (t, s), by_action in sorted(rows.items()):
        later = t + is_timed
        moved = [tuple(replace(o, state=index[later, o.state]) for o in found) for found in by_action]
        stays = ((FrozenOutcome(1, index[t, s], 0, False),),) * len(moved)
        outcomes.append(tuple(moved) if any(moved) else stays)
    values = tuple(_values(model, places, is_timed))
    return FrozenTask(
        name=f"Frozen{model.task.name}", states=_names([model.state(s) for _, s in places], values, "s"),
        actions=_names([model.action(a) for a in range(model.n_actions)], (), "a"),
        start=tuple(start[s] if t == 0 else 0 for t, s in places), outcomes=tuple(outcomes), horizon=model.horizon,
        discount=discount, last=last, values=values,
        labels={name: frozenset(index[p] for p in places if holds[p[1]]) for name, holds in _conditions(model)},
    )  # fmt: skip


def _last_step(model: Model) -> int | None:
    """Return the step at which every episode ends, of a model in which nothing else depends on the time."""
    if not model.is_timed:
        return None
    first = model.step(0)
    for t, step in enumerate(model.steps):
        if step.same(first):
            continue
        ends_first = first.P_end is not None and first.P_end.sum() > 0
        if not ends_first and step.P.sum() == 0 and np.array_equal(step.R, first.R):
            return t
        return None
    return None


def _numbers(model: Model) -> tuple[list[Number], Number, Chances]:
    """Return the start distribution, the discount and the outcomes: in rationals, or in floats where a draw has none."""
    reader = Reader(as_written=True)
    steps = Steps(model.task)
    for numbers, read in ((ExactProbabilities(reader), reader), (FLOATS, float)):
        try:
            return _read(model, steps, numbers, read)
        except Inexact:
            continue
    raise AssertionError("floats are always known")


def _read(
    model: Model, steps: Steps, numbers: ProbabilityArithmetic, read: Callable[[float], Number]
) -> tuple[list[Number], Number, Chances]:
    n = model.n_states
    start: list[Number] = [0] * n
    codes, weights = steps.starts(numbers)
    for s, weight in zip(np.searchsorted(model.codes, codes).tolist(), weights.tolist(), strict=True):
        start[s] = weight

    @cache
    def chances(t: int) -> dict[tuple[int, int], Outcomes]:
        table = steps.table(model.codes, t, numbers)
        found: dict[tuple[int, int], list[FrozenOutcome]] = {}
        for row, column, weight, reward, ends, inside in zip(*(each.tolist() for each in table), strict=True):
            if inside and weight and model.acting[row % n]:
                outcome = FrozenOutcome(weight, column, read(float(reward)), bool(ends))
                found.setdefault((row % n, row // n), []).append(outcome)
        return {key: merged(outcomes) for key, outcomes in found.items()}

    chances(0)
    return start, read(model.discount), chances


def _explored(model: Model, chances: Chances, is_timed: bool, most: int) -> dict[Place, list[Outcomes]]:
    """Return the outcomes of each action in all places that episodes visit; none where no episode acts."""
    found: dict[Place, list[Outcomes]] = {}
    waiting = [(0, s) for s in np.flatnonzero(model.start > 0).tolist()]
    while waiting:
        t, s = waiting.pop()
        if (t, s) in found:
            continue
        by_action: list[Outcomes] = [()] * model.n_actions
        if not is_timed or t < (model.horizon or 0):
            by_action = [chances(t).get((s, a), ()) for a in range(model.n_actions)]
            if model.legal is not None:
                by_action = [found if model.legal[a, s] else () for a, found in enumerate(by_action)]
        for outcomes in by_action:
            waiting += [(t + is_timed, outcome.state) for outcome in outcomes]
        found[t, s] = by_action
        if len(found) > most:
            refuse(f"{model.task.id} has more than {most:,} states; tables have {most:,} at most")
    return found


def _values(model: Model, places: Sequence[Place], is_timed: bool) -> Iterator[dict[str, int]]:
    """Yield the values of all components in each place, element by element."""
    columns: dict[str, Array] = {}
    for (_, name), value in model.reads().items():
        if name == TIME:
            continue
        flat = np.broadcast_to(value, (*value.shape[:-1], model.n_states))
        for at in np.ndindex(flat.shape[:-1]):
            columns["_".join([name, *map(str, at)])] = flat[at]
    for t, s in places:
        row = {name: int(column[s]) for name, column in columns.items()}
        yield row | {TIME: t} if is_timed else row


def _names(parts: Sequence[dict[str, object]], values: Sequence[dict[str, int]], letter: str) -> tuple[str, ...]:
    """Return names of states or actions: labels, or components with their values such as `x1_y0`."""
    names = []
    for i, each in enumerate(parts):
        words = [str(value) for value in each.values()]
        if len(words) == 1 and not (values and TIME in values[i]):
            names.append(f"{letter}{words[0]}" if words[0].isdigit() else words[0])
        elif values:
            names.append("_".join(f"{name}{value}" for name, value in values[i].items()))
        else:
            names.append("_".join(f"{name}{value}" for name, value in each.items()))
    return plain_names(names, letter)


def _conditions(model: Model) -> Iterator[tuple[str, Array]]:
    """Yield the states (S,) that the figure highlights, and those that claims are about, with their names."""
    task = model.task
    if task.annotations.figure is not None:
        for name, node in task.annotations.figure.highlight.items():
            if node.type == BOOL:
                (holds,) = evaluate([node], model.reads())
                yield name, np.broadcast_to(holds, (model.n_states,))
    for number, claim in enumerate(task.annotations.claims, 1):
        for call in syntax.names(claim.expr):
            if isinstance(call, syntax.Call) and call.function in ("reachable", "probability") and call.args:
                try:
                    yield f"claim_{number}", condition_over_states(call.args[0], model)
                except InvalidClaim:
                    continue


def _observations(model: Model) -> list[tuple[float, ...]] | None:
    if model.task.observation.is_state:
        return None
    reader = ProbabilisticPolicy(model.task, np.asarray, 0)
    if reader.is_noisy or reader.sees_time:
        refuse(f"observations of {model.task.id} are not functions of the state")
    rows = reader.observe(states_of(model), 0, np.random.default_rng(0))
    parts = list(rows.values()) if isinstance(rows, dict) else [rows]
    flat = np.hstack([np.asarray(part, np.float64).reshape(model.n_states, -1) for part in parts])
    return [tuple(row) for row in flat.tolist()]
