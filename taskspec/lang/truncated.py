"""A standard normal between two bounds, as arithmetic over a uniform: the inverse of its distribution function.

The distribution function is Numerical Recipes' rational Chebyshev fit of erfc (relative error below 1.2e-7, in the tails as
well), its inverse Acklam's rational approximation (1.2e-9). Bounds with more mass above 0 than below are mirrored,
so that the digits of small probabilities are not lost beside 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from taskspec.lang.ir import Node
from taskspec.lang.operators.nodes import NodeMaker

ERFC = (
    -1.26551223, 1.00002368, 0.37409196, 0.09678418, -0.18628806, 0.27886807, -1.13520398, 1.48851587, -0.82215223,
    0.17087277,
)  # fmt: skip
A = (
    -39.69683028665376,
    220.9460984245205,
    -275.9285104469687,
    138.3577518672690,
    -30.66479806614716,
    2.506628277459239,
)
B = (-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572, 1.0)
C = (
    -0.007784894002430293,
    -0.3223964580411365,
    -2.400758277161838,
    -2.549732539343734,
    4.374664141464968,
    2.938163982698783,
)
D = (0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416, 1.0)
TAIL = 0.02425


def truncated(b: NodeMaker, u: Node, low: Node, high: Node) -> Node:
    """A standard normal between `low` and `high`, from a uniform number."""
    mirrored = b.apply("lt", b.scalar(0.0), b.apply("add", low, high))
    left = b.apply("where", mirrored, b.apply("neg", high), low)
    right = b.apply("where", mirrored, b.apply("neg", low), high)
    bottom, top = _distribution(b, left), _distribution(b, right)
    p = b.apply("add", bottom, b.apply("mul", u, b.apply("sub", top, bottom)))
    found = b.apply("where", b.apply("lt", b.scalar(0.0), p), _quantile(b, p), right)  # no float holds what is rarer
    return b.apply("where", mirrored, b.apply("neg", found), found)


def _distribution(b: NodeMaker, x: Node) -> Node:
    """The probability of a standard normal up to x."""
    z = b.apply("mul", b.apply("abs", x), b.scalar(math.sqrt(0.5)))
    t = b.apply("div", b.scalar(1.0), b.apply("add", b.scalar(1.0), b.apply("mul", b.scalar(0.5), z)))
    inner = b.apply("sub", _polynomial(b, t, ERFC[::-1]), b.apply("mul", z, z))
    tail = b.apply("mul", b.apply("mul", b.scalar(0.5), t), b.apply("exp", inner))
    return b.apply("where", b.apply("lt", x, b.scalar(0.0)), tail, b.apply("sub", b.scalar(1.0), tail))


def _quantile(b: NodeMaker, p: Node) -> Node:
    """The x up to which a standard normal has the probability p."""
    q = b.apply("sub", p, b.scalar(0.5))
    r = b.apply("mul", q, q)
    middle = b.apply("div", b.apply("mul", _polynomial(b, r, A), q), _polynomial(b, r, B))
    rest = b.apply("where", b.apply("lt", p, b.scalar(0.5)), p, b.apply("sub", b.scalar(1.0), p))
    s = b.apply("sqrt", b.apply("mul", b.scalar(-2.0), b.apply("log", rest)))
    tail = b.apply("div", _polynomial(b, s, C), _polynomial(b, s, D))
    tail = b.apply("where", b.apply("lt", p, b.scalar(0.5)), tail, b.apply("neg", tail))
    return b.apply("where", b.apply("lt", rest, b.scalar(TAIL)), tail, middle)


def _polynomial(b: NodeMaker, x: Node, coefficients: Sequence[float]) -> Node:
    """The first coefficient belongs to the highest power."""
    value: Node = b.scalar(coefficients[0])
    for c in coefficients[1:]:
        value = b.apply("add", b.apply("mul", value, x), b.scalar(c))
    return value
