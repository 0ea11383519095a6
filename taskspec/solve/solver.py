"""What is asked of a model, and the arithmetic that answers: rational where that is affordable, else bounded floats."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any, Protocol

from taskspec.base.arrays import Array
from taskspec.base.extras import is_installed
from taskspec.base.limits import tell
from taskspec.model.model import Model
from taskspec.solve.backward import Rule, backward, first_values
from taskspec.solve.bounded import QUIET, Bounded
from taskspec.solve.enclosure import Enclosure, Inexact, Reader
from taskspec.solve.rational import Rational

LONG = 100_000_000
"""Entries times steps from which compiled sweeps pay: NumPy takes four seconds for as many, and compiling may take six."""


class ValueArithmetic(Protocol):
    """Arithmetic on values (S,), action values (A, S) and policies (A, S): `Rational` or `Bounded`."""

    model: Model
    horizon: int

    def zero(self) -> Any: ...
    def backup(self, t: int, value: Any) -> Any: ...
    def reached(self, t: int, value: Any, states: Array) -> Any: ...
    def marked(self, value: Any, states: Array) -> Any: ...
    def top(self, q: Any) -> Any: ...
    def bottom(self, q: Any) -> Any: ...
    def is_open(self, policy: Any) -> bool: ...
    def follow(self, policy: Any, q: Any, side: int = 1) -> Any: ...
    def followed(self, policy: Any, t: int, value: Any, side: int = 1) -> Any: ...
    def at_start(self, value: Any) -> Enclosure: ...
    def preference(self, policy: Any, wanted: Array) -> Array: ...


class Solver(Protocol):
    """Answers about one model. All are enclosures of the truth."""

    @property
    def numbers(self) -> Any: ...
    def best(self) -> Enclosure: ...
    def worst(self) -> Enclosure: ...
    def value(self, rule: Rule) -> Enclosure: ...
    def probability(self, rule: Rule, states: Array) -> Enclosure: ...
    def policies(self, rule: Rule) -> Iterator[tuple[int, Any]]: ...


class Finite:
    """Answers for models with a horizon, by backward induction."""

    def __init__(self, numbers: ValueArithmetic) -> None:
        self._numbers = numbers

    @property
    def numbers(self) -> Any:
        return self._numbers

    def best(self) -> Enclosure:
        return self._best

    @cached_property
    def _best(self) -> Enclosure:
        return self._numbers.at_start(extreme(self._numbers, True))

    def worst(self) -> Enclosure:
        return self._numbers.at_start(extreme(self._numbers, False))

    @QUIET
    def value(self, rule: Rule) -> Enclosure:
        """Return the expected return of a policy."""
        if rule.is_best:
            return self.best()
        n = self._numbers
        return self._evaluated(rule, n.zero(), lambda t, policy, V, side: n.followed(policy, t, V, side))

    @QUIET
    def probability(self, rule: Rule, states: Array) -> Enclosure:
        """Return how likely an episode is ever in one of the states (S,), its last one included."""
        n = self._numbers

        def backup(t: int, policy: Any, V: Any, side: int) -> Any:
            return n.marked(n.follow(policy, n.reached(t, V, states), side), states)

        return self._evaluated(rule, n.marked(n.zero(), states), backup)

    def _evaluated(self, rule: Rule, end: Any, backup: Callable[[int, Any, Any, int], Any]) -> Enclosure:
        """Return what a policy comes to; in the best and the worst case where rounding leaves open which actions are best."""
        found = []
        for side in (1, -1):
            V = end
            is_open = False
            for t, policy in self.policies(rule):
                V = backup(t, policy, V, side)
                is_open = is_open or self._numbers.is_open(policy)
            found.append(self._numbers.at_start(V))
            if not is_open:
                break
        return found[0].hull(found[-1])

    def policies(self, rule: Rule) -> Iterator[tuple[int, Any]]:
        """Yield a rule's policy at each time, the last one first; one is held at a time."""
        numbers = self._numbers
        what = f"of {numbers.horizon:,}"
        if rule.is_planned:
            for t, q, _ in rule.plan(numbers):
                tell(f"following a policy, step {t + 1:,} {what}")
                yield t, rule.policy(numbers, t, q)
            return
        policy = None
        for t in range(numbers.horizon - 1, -1, -1):
            tell(f"following a policy, step {t + 1:,} {what}")
            if policy is None or rule.is_timed:
                policy = rule.policy(numbers, t, None)
            yield t, policy


@QUIET
def extreme(numbers: ValueArithmetic, largest: bool) -> Any:
    """Return the best (or worst) values (S,) at the first time."""
    if isinstance(numbers, Bounded) and _is_long(numbers) and is_installed("numba"):
        from taskspec.solve.kernels_numba import extreme_values

        return extreme_values(numbers, largest)

    def choose(t: int, q: Any) -> Any:
        tell(f"planning, step {t + 1:,} of {numbers.horizon:,}")
        return numbers.top(q) if largest else numbers.bottom(q)

    return first_values(backward(numbers.backup, choose, numbers.zero(), numbers.horizon))


def _is_long(numbers: Bounded) -> bool:
    """Return whether compiled sweeps pay for their compilation."""
    return numbers.model.entries * numbers.horizon >= LONG


class Solvers:
    """The solvers of one model, made when they are needed: one for each reading of floats, and one in floats."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._known: dict[bool | None, Solver] = {}
        self.ambiguous = False
        """Whether some answer depended on the reading."""

    def of(self, rule: Rule | None = None, as_written: bool = False) -> Solver:
        """Return the most exact solver for questions about a rule (None: about all policies)."""
        if rule is not None and not rule.is_rational:
            return self._bounded()
        if as_written not in self._known:
            self._known[as_written] = self._made(as_written)
        found = self._known[as_written]
        return found if rule is None or not rule.is_drawn or _has(found, rule) else self._bounded()

    def _made(self, as_written: bool) -> Solver:
        if self.model.horizon is None:
            return self._bounded()
        if as_written and not self.ambiguous and False in self._known:
            return self._known[False]
        reader = Reader(as_written)
        try:
            found: Solver = Finite(Rational(self.model, reader))
        except Inexact:
            return self._bounded()
        self.ambiguous |= reader.ambiguous
        return found

    def _bounded(self) -> Solver:
        if None not in self._known:
            self._known[None] = _in_floats(self.model)
        return self._known[None]


def _has(solver: Solver, rule: Rule) -> bool:
    """Return whether a solver's arithmetic has the policies of a rule."""
    if not isinstance(solver.numbers, Rational):
        return True
    try:
        deque(solver.policies(rule), maxlen=0)
    except Inexact:
        return False
    return True


def _in_floats(model: Model) -> Solver:
    if model.horizon is not None:
        return Finite(Bounded(model))
    from taskspec.solve.infinite_horizon import InfiniteHorizon

    return InfiniteHorizon(model)


def why_endless(solver: Solver) -> str:
    """Return why a value has no finite bounds, in words."""
    numbers = solver.numbers
    if isinstance(numbers, Bounded) and math.isinf(numbers.slack.beyond):
        return (
            "the reward grows without a bound with a draw that has infinitely many outcomes; "
            "`min(draw, 100)` in its place would bound it"
        )
    return "it has no finite value that floats could hold"
