"""Comparisons, conditions, and choices between values."""

from __future__ import annotations

from typing import Any

from taskspec.lang.operators import bounding, signatures
from taskspec.lang.operators.entry import (
    INTS,
    LOGIC,
    NANS,
    PAIRS,
    Array,
    Brackets,
    Elements,
    Function,
    Infix,
    Kernel,
    Level,
    Operator,
    Scalar,
    applies,
)
from taskspec.lang.operators.signatures import (
    as_they_are,
    but_the_first,
    choose,
    compare,
    logical,
    to_common,
    to_numbers,
)


def where(condition: Any, a: Any, b: Any) -> Any:
    return a if condition else b


TABLE = (
    Operator(
        name="eq", rule=compare, promote=to_common, reference=lambda a, b: bool(a == b),
        samples=PAIRS + NANS + LOGIC, scalar=Scalar("({0} == {1})"), array=Array("({0} == {1})"),
        elements=Elements.RANKED, commutative=True,
        infix=Infix("==", "eq", 4, "{0} = {1}", "Equal; comparisons can be chained."),
    ),
    Operator(
        name="ne", rule=compare, promote=to_common, reference=lambda a, b: bool(a != b),
        samples=PAIRS + NANS + LOGIC, scalar=Scalar("({0} != {1})"), array=Array("({0} != {1})"),
        elements=Elements.RANKED, commutative=True,
        infix=Infix("!=", "ne", 4, r"{0} \neq {1}", "Different."),
    ),
    Operator(
        name="lt", rule=compare, promote=to_numbers, reference=lambda a, b: bool(a < b), samples=PAIRS + NANS,
        scalar=Scalar("({0} < {1})"), array=Array("({0} < {1})"),
        elements=Elements.RANKED, infix=Infix("<", "lt", 4, "{0} < {1}", "Less."),
    ),
    Operator(
        name="le", rule=compare, promote=to_numbers, reference=lambda a, b: bool(a <= b),
        samples=PAIRS + NANS, scalar=Scalar("({0} <= {1})"), array=Array("({0} <= {1})"),
        elements=Elements.RANKED, infix=Infix("<=", "le", 4, r"{0} \leq {1}", "Less or equal."),
    ),
    Operator(
        name="not", rule=logical, promote=as_they_are, reference=lambda a: not a,
        samples=((True,), (False,)), scalar=Scalar("(not {0})"), array=Array("xp.logical_not({0})"),
        kernel=Kernel("({0} == False)"),
        infix=Infix("not", "not", 3, r"\lnot {0}", "The condition does not hold.", Brackets(Level.NOT, (Level.ATOM,))),
    ),
    Operator(
        name="and", commutative=True, rule=logical, promote=as_they_are, reference=lambda a, b: bool(a and b),
        samples=LOGIC, scalar=Scalar("({0} and {1})"), array=Array("xp.logical_and({0}, {1})"), kernel=Kernel("({0} & {1})"),
        infix=Infix("and", "and", 2, r"{0} \land {1}", "Both conditions hold.", Brackets(Level.AND, (Level.NOT,))),
    ),
    Operator(
        name="or", commutative=True, rule=logical, promote=as_they_are, reference=lambda a, b: bool(a or b),
        samples=LOGIC, scalar=Scalar("({0} or {1})"), array=Array("xp.logical_or({0}, {1})"), kernel=Kernel("({0} | {1})"),
        # Two different connectives side by side are easier to read with brackets.
        infix=Infix("or", "or", 1, r"{0} \lor {1}", "Either condition holds.", Brackets(Level.OR, (Level.NOT,))),
    ),
    Operator(
        name="where", elements=Elements.MOVED, indices=(0,), rule=choose, promote=but_the_first, reference=where,
        samples=((True, 1, 2), (False, 1, 2), (True, 1.5, -2.0), (False, 1.5, -2.0)),
        scalar=Scalar("({1} if {0} else {2})"), array=Array("xp.where({0}, {1}, {2})"), kernel=Kernel("select({0}, {1}, {2})"),
        bounds=lambda args, node: bounding.union(args[1:], node), linear=signatures.unless_first, whole=True,
        function=Function(
            "where", ("condition", "x", "y"), r"\begin{cases}{1} & \text{if } {0}\\ {2} & \text{otherwise}\end{cases}",
            "x where the condition holds, else y; element by element.", ((True, 1, 2.5), ((True, False, True), INTS, 0)),
            applies("where"),
        ),
    ),
)  # fmt: skip
