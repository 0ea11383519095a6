"""Policies of causal maximum entropy, to 60 digits."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

from tests.proofs.brute import Gains, Rule, Solved, Unsettled
from tests.proofs.process import Key, Shares

DIGITS = 60
NEAR = Fraction(1, 10**40)
LARGEST, LONGEST = 1000, 12


def rule(solved: Solved, beta: int) -> Rule:
    """soft(beta). Unsettled: where 60 digits may not do, or take too long."""
    process = solved.process
    if process.horizon is None or process.horizon > LONGEST or is_large(solved):
        raise Unsettled
    key = ("soft", beta)
    if key not in solved._known:

        def share(state: Key, t: int, gains: Gains) -> Shares:
            return dict(enumerate(weighed(gains, beta)[0]))

        solved._known[key] = Rule(f"soft({beta})", share, lambda gains: weighed(gains, beta)[1])
    found: Rule = solved._known[key]
    return found


def is_large(solved: Solved) -> bool:
    process = solved.process
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
    with localcontext() as context:
        context.prec = DIGITS
        weights = [decimal(beta * (Fraction(g) - Fraction(top))).exp() for g in gains]
        total = sum(weights, Decimal(0))
        value = Fraction(top) + Fraction(total.ln() / beta)
        return [Fraction(w / total) for w in weights], value


def decimal(x: Fraction) -> Decimal:
    return Decimal(x.numerator) / Decimal(x.denominator)
