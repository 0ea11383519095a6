"""The model checker Storm, in rationals: the returns of a file, beside those of the exact model."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from taskspec.base.extras import need
from taskspec.base.files import write_bytes
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.model.probabilities import Inexact, Reader
from taskspec.exact.solve.backward import Uniform
from taskspec.exact.solve.enclosure import Enclosure, digits
from taskspec.exact.solve.outcomes import Number
from taskspec.exact.solve.rational import Rational
from taskspec.exact.solve.solve import Finite, Solver, Solvers
from taskspec.tools.exchange import umb
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.settled import END, at_random, property_of, settled

MOST_WORK = 20_000_000
"""Outcomes times steps of an episode up to which values are compared as rationals."""
SHORT = 10**6
MOST_STATES = 150
"""States up to which a task without a horizon is solved in rationals."""


def is_installed() -> bool:
    """Return whether there is a `stormpy` that reads rationals."""
    try:
        return int(version("stormpy").partition(".")[0]) >= 2
    except PackageNotFoundError:
        return False


def solved(task: FrozenTask, *properties: str) -> list[Fraction]:
    """Return the values that Storm finds for properties at the first state of a UMB file.

    Args:
        task: a settled task, which is written to the file.
        properties: such as `R{"reward"}max=? [F "end"]`.

    Raises:
        SpecError: E705 without stormpy, E712 for values that are not finite.
    """
    stormpy = need("stormpy", "storm", "a comparison with Storm")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "task.umb"
        write_bytes(path, umb.write(task))
        model = stormpy.build_model_from_umb(str(path))
    paid = model.reward_models["reward"]
    if not (paid.has_state_rewards or paid.has_state_action_rewards or paid.has_transition_rewards):
        return [Fraction(0)] * len(properties)  # Storm refuses to add up rewards where there are none
    first = model.initial_states[0]
    values = []
    for each in properties:
        parsed = stormpy.parse_properties(each)[0]
        result = stormpy.model_checking(model, parsed)
        values.append(_fraction(str(result.get_value(first))))
    return values


def _fraction(text: str) -> Fraction:
    """Return a rational of any length. SpecError: E712 for an infinity."""
    if "inf" in text:
        refuse("Storm finds no finite return: some policy never ends", "give the task a horizon, or a discount below 1")
    limit = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(0)
    try:
        return Fraction(text)
    finally:
        sys.set_int_max_str_digits(limit)


@dataclass(frozen=True)
class ComparedReturn:
    """A return of a task by its exact model and by Storm."""

    which: str
    ours: Enclosure
    storm: Fraction

    @property
    def agrees(self) -> bool:
        """Return whether Storm's value is ours, or lies within our bounds."""
        return self.ours.low <= self.storm <= self.ours.high

    def record(self) -> dict[str, str]:
        """Write the comparison as JSON data."""
        return {"return": self.which, "taskspec": str(self.ours), "storm": str(self.storm), "verdict": self.verdict}

    @property
    def verdict(self) -> str:
        """Words for the result."""
        if not self.agrees:
            return "different"
        if self.ours.is_exact:
            return "equal rationals"
        return "within the bounds of rounding"

    @property
    def shown(self) -> str:
        """Storm's value, in full where it is short."""
        if self.storm.denominator < SHORT:
            return str(self.storm)
        return digits(self.storm)


def compared(model: Model, frozen: FrozenTask) -> Iterator[ComparedReturn]:
    """Yield the optimal, worst and random return of a task, solved by Storm from a UMB file.

    Raises:
        SpecError: E705 without stormpy, E712 for a task whose returns are not known.
    """
    ready = settled(replace(frozen, seen=None))  # returns of policies that see the state
    best, worst = solved(ready, property_of(ready, "max"), property_of(ready, "min"))
    random = at_random(ready)
    (middle,) = solved(random, property_of(random, "max"))
    theirs = {"optimal": best, "random": middle, "worst": worst}
    for which, ours in _ours(model, frozen).items():
        yield ComparedReturn(which, ours, theirs[which])


def _ours(model: Model, frozen: FrozenTask) -> dict[str, Enclosure]:
    if model.horizon is None and frozen.is_rational:
        ready = settled(frozen)
        with suppress(Inexact):
            return {
                "optimal": Enclosure.exactly(stationary_return(ready, max)),
                "random": Enclosure.exactly(stationary_return(ready, None)),
                "worst": Enclosure.exactly(stationary_return(ready, min)),
            }
    solver: Solver
    try:
        solver = Finite(Rational(model, Reader(as_written=True), MOST_WORK))
    except Inexact:
        solver = Solvers(model).in_floats
    return {"optimal": solver.best(), "random": solver.value(Uniform()), "worst": solver.worst()}


# -- policy iteration in rationals, for tasks without a horizon ---------------------------------------------------------

Shares = list[dict[int, Fraction]]
"""For each state, the probability of each action."""


def stationary_return(ready: FrozenTask, pick: Callable[..., int] | None) -> Fraction:
    """Return an expected return of a settled task without a horizon, by policy iteration (Howard, 1960) without rounding.

    Args:
        ready: the task, in rationals.
        pick: max or min, for the best or worst policy; None for random actions.

    Raises:
        Inexact: for tasks that are too large, or in which some state cannot reach an end.
    """
    if len(ready.states) > MOST_STATES:
        raise Inexact
    policy = _ending_policy(ready)
    if pick is None:
        ready = at_random(ready)
        policy = [{0: Fraction(1)}] * len(ready.outcomes)
    while True:
        V = _policy_values(ready, policy)
        better = _better_actions(ready, V, pick) if pick is not None else {}
        if not better:
            return V[ready.starts[0]]
        for s, a in better.items():
            policy[s] = {a: Fraction(1)}


def _ending_policy(ready: FrozenTask) -> Shares:
    policy: Shares = [{} for _ in ready.states]
    ending = set(ready.labels[END])
    before = -1
    while len(ending) > before:
        before = len(ending)
        for s, a, outcome in ready.steps():
            if s not in ending and outcome.state in ending:
                policy[s] = {a: Fraction(1)}
                ending.add(s)
    if before < len(ready.states):
        raise Inexact
    return policy


def _better_actions(ready: FrozenTask, V: list[Fraction], pick: Callable[..., int]) -> dict[int, int]:
    better = {}
    for s, by_action in enumerate(ready.outcomes):
        Q: dict[int, Number] = {}
        for a, outcomes in enumerate(by_action):
            for o in outcomes:
                Q[a] = Q.get(a, Fraction(0)) + o.probability * (o.reward + V[o.state])
        best = pick(Q, key=Q.__getitem__)
        if s not in ready.labels[END] and Q[best] != V[s]:
            better[s] = best
    return better


def _policy_values(ready: FrozenTask, policy: Shares) -> list[Fraction]:
    """Return V of a policy by Gaussian elimination of V = R + P V, the states one after the other."""
    rows: list[dict[int, Fraction]] = []
    constants = []
    ended = ready.labels[END]
    for s, shares in enumerate(policy):
        row: dict[int, Fraction] = {}
        constant = Fraction(0)
        for a, share in shares.items():
            for o in ready.outcomes[s][a]:
                constant += share * Fraction(o.probability) * Fraction(o.reward)
                if s not in ended and o.state not in ended:
                    row[o.state] = row.get(o.state, Fraction(0)) + share * Fraction(o.probability)
        rows.append(row)
        constants.append(constant)
    for s, row in enumerate(rows):  # V[s] without V[s] itself, and then without V[s] in other rows
        left = 1 - row.pop(s, Fraction(0))
        if not left:
            raise Inexact
        rows[s] = {j: p / left for j, p in row.items()}
        constants[s] /= left
        for k, other in enumerate(rows):
            if k == s or s not in other:
                continue
            share = other.pop(s)
            constants[k] += share * constants[s]
            for j, p in rows[s].items():
                other[j] = other.get(j, Fraction(0)) + share * p
    return constants
