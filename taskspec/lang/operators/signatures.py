"""Type rules of operators, promotion of their arguments, and where results are linear in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from taskspec.lang.types import Kind, Type, join

TypeRule = Callable[[tuple[Type, ...]], Type | str]
"""Result type from argument types, or a sentence that says what is wrong."""
Promote = Callable[[Sequence[Kind], Kind], Sequence[Kind]]
"""The kinds that an operator works on, from those of its arguments and of its result; nothing is ever demoted."""


def broadcast(types: tuple[Type, ...]) -> tuple[int, ...] | None:
    """Return the common shape of elementwise arguments: all equal, scalars stretching; None when they disagree."""
    shapes = {t.shape for t in types if t.shape != ()}
    if len(shapes) > 1:
        return None
    return shapes.pop() if shapes else ()


def elementwise(kind: Callable[[tuple[Type, ...]], Kind | str]) -> TypeRule:
    def rule(types: tuple[Type, ...]) -> Type | str:
        shape = broadcast(types)
        if shape is None:
            shapes = " and ".join(str(list(t.shape)) for t in types if t.shape)
            return f"the shapes {shapes} do not match element by element"
        result = kind(types)
        return result if isinstance(result, str) else Type(result, shape)

    return rule


def _a(t: Type) -> str:
    return f"an {t}" if str(t)[0] in "aeiou" else f"a {t}"


def _arithmetic(types: tuple[Type, ...]) -> Kind:
    return join(Kind.INT, *(t.kind for t in types))


def _logical(types: tuple[Type, ...]) -> Kind | str:
    wrong = [t for t in types if t.kind is not Kind.BOOL]
    return f"a condition is needed, not {_a(wrong[0])}" if wrong else Kind.BOOL


def _truth(types: tuple[Type, ...]) -> Kind | str:
    return Kind.INT if types[0].kind is Kind.BOOL else f"a condition is needed, not {_a(types[0])}"


def _choose(types: tuple[Type, ...]) -> Kind | str:
    condition, *branches = types
    if condition.kind is not Kind.BOOL:
        return f"a condition is needed, not {_a(condition)}"
    return join(*(t.kind for t in branches))


arithmetic = elementwise(_arithmetic)
real = elementwise(lambda types: Kind.REAL)
to_integer = elementwise(lambda types: Kind.INT)
truth = elementwise(_truth)
compare = elementwise(lambda types: Kind.BOOL)
logical = elementwise(_logical)
choose = elementwise(_choose)


def reduction(kind: Callable[[Kind], Kind | str], empty: bool = True) -> TypeRule:
    """Reduce all elements to one; `empty` says whether there is a value for no elements."""

    def rule(types: tuple[Type, ...]) -> Type | str:
        (t,) = types
        if t.is_scalar:
            return f"a vector is needed, not {_a(t)}"
        if not empty and t.size == 0:
            return "a vector of shape [0] has no smallest and no largest element"
        result = kind(t.kind)
        return result if isinstance(result, str) else Type(result)

    return rule


def vector(kind: Callable[[Kind], Kind]) -> TypeRule:
    """Map a vector to another of the same length."""

    def rule(types: tuple[Type, ...]) -> Type | str:
        (t,) = types
        if len(t.shape) != 1:
            return f"a vector is needed, not {_a(t)}" if t.is_scalar else "a vector is needed, not a matrix"
        return Type(kind(t.kind), t.shape)

    return rule


def conditions(result: Kind) -> Callable[[Kind], Kind | str]:
    """Take a vector of conditions."""
    return lambda kind: result if kind is Kind.BOOL else f"a vector of conditions is needed, not of {kind}s"


def number(kind: Kind) -> Kind:
    """Return a condition counts as 0 or 1."""
    return join(Kind.INT, kind)


# -- promotion --------------------------------------------------------------------------------------------------------


def to_result(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return [result] * len(kinds)


def as_they_are(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return kinds


def to_common(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return [join(*kinds)] * len(kinds)


def to_numbers(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return [join(Kind.INT, *kinds)] * len(kinds)


def but_the_first(kinds: Sequence[Kind], result: Kind) -> Sequence[Kind]:
    return [kinds[0], *([result] * (len(kinds) - 1))]


# Where a value is linear in what its arguments are linear in.


def every(below: Sequence[bool]) -> bool:
    """Return sums, and what only chooses elements."""
    return True


def one(below: Sequence[bool]) -> bool:
    """Products: of two dependent factors a square may come."""
    return sum(below) == 1


def unless_second(below: Sequence[bool]) -> bool:
    return not below[1]


def unless_first(below: Sequence[bool]) -> bool:
    return not below[0]
