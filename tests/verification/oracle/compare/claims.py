"""Random claims, true and false, beside what brute force finds."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

from taskspec.exact import verdicts
from tests.verification.oracle.compare.cases import Case, Difference
from tests.verification.oracle.generator import conditions
from tests.verification.oracle.generator.terms import Context, Term
from tests.verification.oracle.reference import solve
from tests.verification.oracle.reference.forms import form
from tests.verification.oracle.reference.model import Key, Model
from tests.verification.oracle.reference.moment import Moment


@dataclass(frozen=True)
class Claim:
    text: str
    holds: bool
    tolerance: float | None = None

    @property
    def entry(self) -> Any:
        """As the spec lists it."""
        return self.text if self.tolerance is None else {"claim": self.text, "tolerance": self.tolerance}


def claims(case: Case, model: Model, rng: random.Random) -> list[Claim]:
    """A few claims about returns, states and events."""
    made: list[Claim] = []
    if case.reference.horizon is not None:
        for name, value in solve.returns(model).items():
            made.append(about_number(name, value, rng))
    made.append(about_number("states", Fraction(len(model.states)), rng))
    made.append(about_number("actions", Fraction(len(model.actions)), rng))
    for _ in range(2):
        made.append(about_event(case, model, rng))
    rng.shuffle(made)
    return made[:4]


DELTAS = (Fraction(1, 7), Fraction(1), Fraction(1, 1000), Fraction(1, 10**6))


def about_number(name: str, value: Fraction, rng: random.Random) -> Claim:
    """A comparison with a number: the right one, or one that is a little off.

    To be equal to 0, a number that is not worked out in fractions needs a tolerance: it has no size that would give one.
    """
    if rng.random() < 0.5:
        return Claim(f"{name} == {written(value)}", True, None if value else 1e-9)
    delta = rng.choice(DELTAS) * max(1, abs(value).__ceil__()) * rng.choice((1, -1))
    op = rng.choice(("==", "!=", "<", ">", "<=", ">="))
    holds = {"==": False, "!=": True, "<": delta > 0, "<=": delta > 0, ">": delta < 0, ">=": delta < 0}[op]
    return Claim(f"{name} {op} {written(value + delta)}", holds)


def written(x: Fraction) -> str:
    sign = "-" if x < 0 else ""
    number = str(abs(x.numerator)) if x.denominator == 1 else f"({abs(x.numerator)} / {x.denominator})"
    return sign + number


def about_event(case: Case, model: Model, rng: random.Random) -> Claim:
    condition = state_condition(case, rng)

    def at(key: Key) -> bool:
        return holds(case, model, key, condition)

    if rng.random() < 0.5 or case.reference.horizon is None:
        reached = any(at(key) for key in model.states)
        truth = rng.random() < 0.5
        return Claim(f"reachable({condition})" if truth else f"not reachable({condition})", reached == truth)
    return about_number(f"probability({condition})", chance_of(model, at), rng)


def state_condition(case: Case, rng: random.Random) -> str:
    names = [t for c in case.reference.state if c.size for t in terms(c)]
    return conditions.condition(Context(rng, names), 2).text


def terms(c: Any) -> list[Term]:
    """How a condition may read a component."""
    reads = frozenset({"state"})
    if c.choice is None:
        return [Term(c.name, c.kind, c.shape, size=9, reads=reads)]
    return [Term(c.name, "label", size=2 if c.choice.meaning else 1, reads=reads, labels=c.choice.labels)]


def holds(case: Case, model: Model, key: Key, condition: str) -> bool:
    moment = Moment(case.reference, model.states[key], None, 0, None)
    return bool(form(condition, moment.scope("claim", primes=False)).item)


def chance_of(model: Model, at: Callable[[Key], bool]) -> Fraction:
    """How likely an episode of uniformly random actions is ever in such a state."""
    horizon = model.task.horizon
    assert horizon is not None

    @cache
    def ever(key: Key, t: int, over: bool) -> Fraction:
        if at(key):
            return Fraction(1)
        if over or t == horizon:
            return Fraction(0)
        legal = model.legal(key)
        outcomes = [o for a in legal for o in model.row(key, a, t)]
        total = sum((o.probability * ever(o.state, t + 1, o.terminated) for o in outcomes), Fraction(0))
        return total / len(legal)

    return sum((p * ever(key, 0, False) for key, p in model.start().items()), Fraction(0))


def compare(case: Case, model: Model) -> int:
    """Add claims to the spec, and see that true ones are proved, and false ones refuted; how many there were.

    The claims of a spec that was kept are true ones.
    """
    own = [Claim(text, True) for text in case.spec.get("claims", ())]
    made = own or claims(case, model, case.rng("claims"))
    claimed = Case(case.spec | {"claims": [c.entry for c in made]}, case.variant, case.seed, case.given)
    task = claimed.task
    for claim, verdict in zip(made, verdicts(task), strict=True):
        if verdict.status not in (("proved",) if claim.holds else ("false",)):
            wrong = "false claim" if not claim.holds else "true claim"
            raise Difference(f"{wrong} {verdict.status}", f"{claim.text}: {verdict.detail}")
    return len(made)
