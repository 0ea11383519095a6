"""Proofs by interval arithmetic: that a value is a number, and that it stays within its range."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, walk
from taskspec.lang.types import Kind

if TYPE_CHECKING:
    from taskspec.exact.phases import Check

_SAFE_OPERATORS = """
add sub mul neg abs sign min2 max2 sin cos tanh atan2 floor ceil round to_int to_real eq ne lt le not and or where
sum prod any all count min max argmin argmax sort argsort cumsum vector concat slice element reshape fill position
index put swap exp
"""
_SAFE = frozenset(_SAFE_OPERATORS.split())
"""Operators that give a finite number for finite numbers, as long as the result is bounded."""


def proved(check: Check, builder: Builder) -> bool:
    """Whether bounds alone show that a check holds everywhere."""
    low, high = builder.bounds(check.node)
    if not (low >= max(check.low) and high <= min(check.high)):
        return False
    return check.node.type.kind is not Kind.REAL or finite(check.node, builder)


def finite(root: Node, builder: Builder) -> bool:
    """Whether every element is a finite number, whatever is read and drawn, as far as bounds can tell."""
    return all(_finite(node, builder) for node in walk([root]))


def _finite(node: Node, builder: Builder) -> bool:
    match node:
        case Const():
            return all(math.isfinite(v) for v in node.flat)
        case Read():
            return True  # a state is made of numbers; whether they are bounded is another question
        case Draw(base=base):
            return base != "gamma"
        case Apply(type=t) if t.kind is not Kind.REAL:
            return True
        case Apply(op="div" | "mod" | "floordiv", args=(_, divisor)):
            low, high = builder.bounds(divisor)
            return (low > 0 or high < 0) and _bounded(node, builder)
        case Apply(op="sqrt", args=(inner,)):
            return builder.bounds(inner)[0] >= 0
        case Apply(op="log", args=(inner,)):
            return builder.bounds(inner)[0] > 0
        case Apply(op="exp", args=(inner,)):
            return builder.bounds(inner)[1] < 700
        case Apply(op=op):
            return op in _SAFE and (_bounded(node, builder) or op in _CLOSED)


_CHOOSING = "neg abs min2 max2 where min max sort vector concat slice element reshape fill index put swap to_real"
_CLOSED = frozenset(_CHOOSING.split())
"""Operators that only choose among finite numbers, bounded or not."""


def _bounded(node: Node, builder: Builder) -> bool:
    return all(math.isfinite(v) for v in builder.bounds(node))
