"""Policies of maximum entropy, causal and not, to 60 digits."""

from __future__ import annotations

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from fractions import Fraction
from functools import cache

from tests.verification.proofs.brute import Gains, Rule, Solved, Unsettled, Value
from tests.verification.proofs.process import Key, Outcome, Process, Shares

DIGITS = 60
NEAR = Fraction(1, 10**40)
LARGEST = 2**54
LONGEST = 12
"""Rewards up to this, and horizons."""
SMALLEST = -400
"""The exponent of the smallest share; fractions of others are too long."""
EXACT = Context(prec=DIGITS, Emax=MAX_EMAX, Emin=MIN_EMIN)


def soft(solved: Solved, beta: int) -> Rule:
    """soft(beta). Unsettled: where 60 digits may not do, or take too long."""
    refuse_large(solved.process)

    def share(state: Key, t: int, gains: Gains) -> Shares:
        return dict(enumerate(weighed(gains, beta)[0]))

    def worth(gains: Gains) -> Value:
        return weighed(gains, beta)[1]

    return solved.kept(Rule(f"soft({beta})", share, worth))


def maxent(solved: Solved, beta: int) -> Rule:
    """maxent(beta): actions by the weight of all trajectories that begin with them, probability times exp(beta return)."""
    process = solved.process
    refuse_large(process)

    @cache
    def weights(state: Key, t: int) -> list[Decimal]:
        return [sum((weight(o, t) for o in process.row(state, a, t)), Decimal(0)) for a in range(process.actions)]

    def weight(o: Outcome, t: int) -> Decimal:
        assert process.horizon is not None
        over = o.terminated or t + 1 == process.horizon
        later = Decimal(1) if over else sum(weights(o.state, t + 1), Decimal(0))
        return decimal(o.probability) * decimal(beta * process.discount**t * o.reward).exp() * later

    def share(state: Key, t: int, gains: Gains) -> Shares:
        with localcontext(EXACT):
            found = weights(state, t)
            return dict(enumerate(fractions([w / sum(found) for w in found])))

    return solved.kept(Rule(f"maxent({beta})", share))


def refuse_large(process: Process) -> None:
    if process.horizon is None or process.horizon > LONGEST or is_large(process):
        raise Unsettled


def is_large(process: Process) -> bool:
    return any(
        abs(o.reward) > LARGEST
        for t, layer in enumerate(process.layers()) for k in layer for a in range(process.actions)
        for o in process.row(k, a, t)
    )  # fmt: skip


def weighed(gains: Gains, beta: int) -> tuple[list[Fraction], Fraction]:
    """Shares in proportion to exp(beta gain), and log sum exp(beta gain) / beta."""
    top = max(gains)
    if any(0 < abs(x - y) < NEAR for x in gains for y in gains):
        raise Unsettled  # a tie or not
    with localcontext(EXACT):
        weights = [decimal(beta * (Fraction(g) - Fraction(top))).exp() for g in gains]
        total = sum(weights, Decimal(0))
        value = Fraction(top) + Fraction(total.ln() / beta)
        return fractions([w / total for w in weights]), value


def fractions(shares: list[Decimal]) -> list[Fraction]:
    if min(share.adjusted() for share in shares) < SMALLEST:
        raise Unsettled
    return [Fraction(share) for share in shares]


def decimal(x: Fraction) -> Decimal:
    return Decimal(x.numerator) / Decimal(x.denominator)
