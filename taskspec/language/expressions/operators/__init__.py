"""The operator table: one entry per operator of the typed core, the single source of everything known about it.

An entry has its type rule, an obvious Python reference (what the operator *means*, used by the interpreter and for folding),
its bounds, how it is written and printed, its form in generated scalar, array and kernel code, and sample inputs on which all
forms are tested against the reference. A new operator is one entry in one of the files of this folder.

Every operator is total. The awkward points are decided here once, for every backend:
reals follow IEEE 754 (1/0 is inf, 0/0 and sqrt(-1) are nan); an int divided by 0 with `//` or `%` gives 0;
`min`, `max`, `argmin`, `argmax` pass over nan and give the first of equals, 0.0 and -0.0 included; `sort` puts nan last
and takes the sign from zeros, so that their order does not matter; `argsort` is stable; sums begin with the first element;
reals become ints by saturating at +-(2**31 - 1), nan becomes 0. An index is moved into range before it is used
(`Builder.position`).
"""

from __future__ import annotations

from taskspec.base.named import entries_by_name
from taskspec.language.expressions.operators import elementwise, vectors
from taskspec.language.expressions.operators.entry import Elements as Elements
from taskspec.language.expressions.operators.entry import Function as Function
from taskspec.language.expressions.operators.entry import Infix as Infix
from taskspec.language.expressions.operators.entry import Operator as Operator
from taskspec.language.expressions.operators.entry import OperatorEntry as OperatorEntry
from taskspec.language.expressions.operators.vectors import STRUCTURES as STRUCTURES
from taskspec.language.expressions.operators.vectors import Structure as Structure

TABLE: tuple[Operator, ...] = (*elementwise.TABLE, *vectors.TABLE)
OPERATORS: dict[str, Operator] = entries_by_name(TABLE)
"""Operators whose result type follows from the types of their arguments alone, by name."""
FUNCTIONS: dict[str, Function] = entries_by_name(
    (*(o.function for o in TABLE if o.function is not None), *elementwise.FUNCTIONS, *vectors.FUNCTIONS)
)
"""The functions that authors write: each names one operator or composes several."""
INFIX: dict[str, Infix] = {i.symbol: i for i in (*(o.infix for o in TABLE if o.infix is not None), *vectors.INFIX)}
"""The operators that authors write between or before operands."""


def entry_of(op: str) -> OperatorEntry:
    if op in OPERATORS:
        return OPERATORS[op]
    return STRUCTURES[op]
