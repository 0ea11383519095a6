"""The exact model and the returns of a finite task beside lists of outcomes and brute force, in fractions."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.exact import extract, scores
from tests.verification.oracle.compare.cases import Case, Difference
from tests.verification.oracle.reference import solve
from tests.verification.oracle.reference.chance import Endless
from tests.verification.oracle.reference.components import Component
from tests.verification.oracle.reference.model import Key, Model
from tests.verification.oracle.reference.task import Task
from tests.verification.oracle.reference.values import DOUBTS, as_float

Row = dict[tuple[Key, bool], float]
"""Probabilities by the state that follows, and by whether the episode ends there."""
BUDGET = 4000
"""The most outcomes that are listed, over all states, actions and times."""
NEAR = 1e-13
TINY = 1e-15
"""By how much of its size a number of the model may be off; and how much more a probability that is computed."""
PAIRS = 2000
"""The most pairs of states and actions that are listed, over all times."""
SLOW = 4.0
"""Seconds of the processor after which the list is given up: each outcome evaluates the whole spec once."""


def reference_model(case: Case) -> Model | None:
    """The model by lists of outcomes, with all rows that an episode of the task may need; None: too large, or in doubt."""
    task = case.reference
    before = DOUBTS.count
    begun = time.process_time()
    if not all(c.finite for c in (*task.state, *task.action)) or not is_countable(task):
        return None
    try:
        model = Model(task, limit=600, budget=BUDGET)
        pairs = 0
        for t, layer in enumerate(layers(model)):
            pairs += len(layer) * len(model.actions)
            if pairs > PAIRS:
                return None
            for key in layer:
                for a in range(len(model.actions)):
                    if any(not math.isfinite(o.reward) for o in model.row(key, a, t)):
                        return None
                    if time.process_time() - begun > SLOW:
                        return None
    except Endless:
        return None
    return model if DOUBTS.count == before else None


def is_countable(task: Task) -> bool:
    """Whether the declared states are few enough for a model of arrays."""
    return math.prod(high - low + 1 for c in task.state for low, high in map(c.ends, range(c.size))) <= 10**6


def layers(model: Model) -> Iterator[list[Key]]:
    """Acting states by time; without a horizon, all of them at once, as if at the first step."""
    if model.task.horizon is not None:
        yield from model.layers()
        return
    here = list(model.start())
    seen = set(here)
    while here:
        yield here
        going = [o for key in here for a in range(len(model.actions)) for o in model.row(key, a, 0)]
        here = list(dict.fromkeys(o.state for o in going if not o.terminated and o.state not in seen))
        seen.update(here)


def rows(case: Case, model: Model) -> int:
    """Compare states, start and rows; the number of rows compared."""
    found = extract(case.task)
    keys = {int(i): key_of(case.reference.state, found.state(i)) for i in np.flatnonzero(found.entered)}
    numbers = {key: i for i, key in keys.items()}
    entered = set(keys.values())
    if entered != set(model.states):
        only = sorted(map(str, entered ^ set(model.states)))
        raise Difference("model states", f"{len(entered)} for {len(model.states)}; {only[:3]}")
    start = {keys[i]: p for i, p in enumerate(found.start.tolist()) if p}
    compare({k: float(p) for k, p in model.start().items()}, start, "model start", "the start")
    actions = {key_of(case.reference.action, found.action(i)): i for i in range(found.n_actions)}
    count = 0
    for t, layer in enumerate(layers(model)):
        step = found.step(t if case.reference.horizon is not None else 0)
        for key in layer:
            for a, action in enumerate(model.actions):
                number = actions[tuple(x for v in action.values() for x in v.data)]
                row = number * found.n_states + numbers[key]
                one_row(model, step, keys, row, (key, a, t))
                count += 1
    return count


def one_row(model: Model, step: Any, keys: dict[int, Key], row: int, at: tuple[Key, int, int]) -> None:
    outcomes = model.row(*at)
    expected: Row = {}
    for o in outcomes:
        expected[o.state, o.terminated] = expected.get((o.state, o.terminated), 0.0) + float(o.probability)
    found: Row = {}
    for matrix, ends in ((step.P, False), (step.P_end, True)):
        if matrix is not None:
            part = slice(matrix.indptr[row], matrix.indptr[row + 1])
            for column, p in zip(matrix.indices[part], matrix.data[part], strict=True):
                after = keys.get(int(column), ("not entered",))
                found[after, ends] = found.get((after, ends), 0.0) + float(p)
    where = f"state {at[0]}, action {at[1]}, time {at[2]}"
    compare(expected, {k: p for k, p in found.items() if p}, "model row", where)
    reward = sum((o.probability * exact(o.reward) for o in outcomes), Fraction(0))
    size = sum((o.probability * abs(exact(o.reward)) for o in outcomes), Fraction(0))
    if abs(reward - exact(float(step.R[row]))) > NEAR * size:
        raise Difference("model reward", f"{where}: {step.R[row]}, expected {float(reward)}")


def exact(x: Any) -> Fraction:
    return Fraction(as_float(x)) if isinstance(x, float) else Fraction(x)


def compare(expected: dict[Any, float], found: dict[Any, float], what: str, where: str) -> None:
    if expected.keys() != found.keys() or any(
        not math.isclose(expected[k], found[k], rel_tol=NEAR, abs_tol=TINY) for k in expected
    ):
        raise Difference(what, f"{where}: {found}, expected {expected}")


def key_of(components: list[Component], values: dict[str, Any]) -> Key:
    """A state as the compiler shows it, as the second interpreter names it."""
    found: list[Any] = []
    for c in components:
        items = np.ravel(np.asarray(values[c.name], dtype=object)).tolist()
        found += [c.choice.labels.index(x) for x in items] if c.choice is not None else items
    return tuple(found)


def returns(case: Case, model: Model) -> int:
    """Compare the returns of all policies that the brute force knows; how many there were."""
    expected = solve.returns(model)
    found = scores(case.task)
    named = {
        "optimal_return": found.optimal,
        "random_return": found.random,
        "worst_return": found.worst,
        "expert_return": found.expert,
    }
    for name, value in expected.items():
        theirs = named[name]
        if theirs is None or not theirs.exact:
            raise Difference("return not exact", f"{name}: {theirs}")
        if not math.isclose(theirs.value, float(value), rel_tol=1e-9, abs_tol=1e-9):
            raise Difference("return", f"{name} is {theirs.value}, expected {float(value)} = {value}")
    return len(expected)


def refused(error: SpecError) -> bool:
    """Whether the compiler says that there is no exact model."""
    return all(d.code == "E712" for d in error.diagnostics)
