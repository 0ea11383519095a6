"""An entry of the table of operators: its fields, binding strength, sample inputs, and the nodes that it may ask for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, Protocol

from taskspec.language.expressions.ir import Apply, Const, Node
from taskspec.language.expressions.operators.rules import Promote, TypeRule, everything, never, stays_finite, to_result
from taskspec.language.expressions.types import Args, Interval, Kind, Shape, Type


class NodeMaker(Protocol):
    """Makes nodes, with the methods of `builder.Builder`."""

    def const(self, value: Any, type: Type) -> Const: ...

    def scalar(self, value: Any) -> Const: ...

    def apply(self, name: str, *args: Node) -> Node: ...

    def structure(self, name: str, args: Sequence[Node], static: tuple[int, ...] = ()) -> Node: ...

    def cast(self, node: Node, kind: Kind) -> Node: ...

    def stretch(self, node: Node, shape: Shape) -> Node: ...

    def position(self, index: Node, length: int) -> Node: ...

    def check_size(self, shape: Shape) -> None: ...


# How tightly notation binds, which decides where brackets stand.


class Level(IntEnum):
    """Levels of binding of notation, from the loosest to notation that needs no brackets anywhere."""

    SCOPE = 0
    OR = 1
    AND = 2
    NOT = 3
    RELATION = 4
    EXTREME = 5  # the sides of relations
    REMAINDER = 6  # below sums: readers take a remainder of all that stands left of it
    SUM = 7
    BIG = 8
    PRODUCT = 9
    FACTOR = 10
    POWER = 11
    ATOM = 12


@dataclass(frozen=True, slots=True)
class Brackets:
    """The level at which an operator binds, and its operands at least; the last entry holds for all further operands.

    `lead` says that the first operand may begin with a sign.
    """

    own: int
    operands: tuple[int, ...]
    lead: bool = False

    def operand(self, i: int) -> int:
        return self.operands[min(i, len(self.operands) - 1)]


ENCLOSED = Brackets(Level.ATOM, (Level.SCOPE,))
"""Whatever stands between delimiters of its own, as the arguments of most functions do."""


# An entry of the operator table.

Build = Callable[[NodeMaker, list[Node]], Node]
Linear = Callable[[Sequence[bool]], bool]
"""Whether a value is linear in something, from which arguments are; those are linear, and the others do not depend on it."""
Axes = Callable[[Sequence[int]], int]
"""How many axes a value has, from how many the arguments have."""


def widest(axes: Sequence[int]) -> int:
    """Axes of an elementwise function, whose scalars stretch."""
    return max(axes, default=0)


def no_axes(axes: Sequence[int]) -> int:
    return 0


def of_first(axes: Sequence[int]) -> int:
    return axes[0]


@dataclass(frozen=True, slots=True)
class Function:
    """A function of the language.

    `arguments` are names for the reference and for messages; the last may be `*rest`. `latex` is a template over
    `{0}`, `{1}`, ...; `{*}` is all arguments with commas, and `brackets` says which operands need them. `static`
    arguments must be constants; `indices` are arguments that say where in the first one, and elements of those that are
    `moved` stay as they are, so that labels stay labels. `build` makes the core nodes, with
    `applies` makes nodes of one operator. `whole` says that it takes vectors as a whole and not element by element.
    """

    name: str
    arguments: tuple[str, ...]
    latex: str
    doc: str
    samples: tuple[tuple[Any, ...], ...]
    build: Build
    static: tuple[int, ...] = ()
    indices: tuple[int, ...] = ()
    moved: range = range(0)
    brackets: Brackets = ENCLOSED
    axes: Axes = widest
    whole: bool = False

    @property
    def signature(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"

    def accepts(self, count: int) -> bool:
        if self.arguments[-1].startswith("*"):
            return count >= len(self.arguments) - 1  # `*rest` may be empty
        return count == len(self.arguments)


def applies(name: str) -> Build:
    return lambda b, args: b.apply(name, *args)


@dataclass(frozen=True, slots=True)
class Infix:
    """An infix or prefix operator as it is written.

    Its precedence in text (higher binds tighter), its mathematics over `{0}`, `{1}`, and the brackets of that.
    """

    symbol: str
    op: str
    precedence: int
    latex: str
    doc: str
    brackets: Brackets | None = None  # relations share the brackets of `compare`


@dataclass(frozen=True, slots=True)
class Scalar:
    """The form in scalar Python: a template over `{0}`, `{1}`, ..., per element of an elementwise operator.

    `real` is used instead where an argument is real, `divides` where the second argument is never 0, `whole` where no argument
    is real. A reduction of a few elements is written out as a `chain`: what stands between them, and the value of none.
    `names` are the functions that the templates call, in addition to Python's own.
    """

    template: str
    real: str | None = None
    divides: str | None = None
    whole: str | None = None
    chain: tuple[str, str] | None = None
    names: Mapping[str, Callable[..., Any]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Array:
    """The form over arrays, batch axis last: a template with `xp` for the namespace, and `rt` for `arrays.Runtime`.

    `real` is used instead where an argument is real, `nonzero` where one of those is a constant other than 0, so that no 0.0
    meets a -0.0.
    """

    template: str
    real: str | None = None
    nonzero: str | None = None


@dataclass(frozen=True, slots=True)
class Kernel:
    """The form in compiled kernels, without branches. `real` and `whole` as in `Scalar`.

    `names` are functions of Python's `math` that the templates call; others are in `taskspec.programs.numba.runtime`.
    """

    template: str | None = None
    real: str | None = None
    whole: str | None = None
    names: tuple[str, ...] = ()


class Elements(Enum):
    """Relations of the elements of an operator's value to the elements of its arguments, except `indices`."""

    COMPUTED = "new values"
    MOVED = "elements of the arguments, at places that their values do not decide"
    CHOSEN = "elements of the arguments, chosen by how these compare"
    RANKED = "a function of how the elements compare, in which 0.0 is -0.0"


FromCount = Callable[[NodeMaker, Node, int], Node]
"""The value of a reduction of `size` conditions, from how many of them hold."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorEntry:
    """Everything known about an operator.

    `bounds` gives bounds of the value from bounds of the arguments, and `finite` whether the value is a finite number;
    both must hold for the run time's own arithmetic. `linear` tells the exact model which draws may be replaced by their mean,
    `from_count` which conditions may be replaced by their count. `elements` and `indices` (the arguments that only say which
    elements are meant) serve proofs about permutations and rank orders. On the `samples` every form is tested.
    """

    name: str
    samples: tuple[Any, ...]
    bounds: Callable[[Args, Apply], Interval] = everything
    finite: Callable[[Args, Interval], bool] = stays_finite
    linear: Linear = never
    from_count: FromCount | None = None
    elements: Elements = Elements.COMPUTED
    indices: tuple[int, ...] = ()
    commutative: bool = False
    """Whether operands, or `indices`, may change places; not two reals among which one is `CHOSEN`, which may be 0.0 and -0.0."""
    wraps: bool = False
    """Whether it may give an int that no argument is, and so leave the ints of a backend."""
    rounds: bool = False
    """Whether it makes an int of a real."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Operator(OperatorEntry):
    """One operator whose result type follows from the types of its arguments.

    A kernel takes the template of scalar code where it has none of its own; kernels write reductions out themselves
    (`backends.kernel`).
    """

    rule: TypeRule
    promote: Promote = to_result
    reference: Callable[..., Any]
    scalar: Scalar
    array: Array
    kernel: Kernel = Kernel()
    elementwise: bool = True
    rational: bool = False
    """Whether it is worked out in fractions where all arguments are exact constants."""
    precise: bool = True
    """Whether all of NumPy, the C library and Numba give the same digits."""
    function: Function | None = None
    infix: Infix | None = None


# Inputs on which every form of an operator is compared with its reference.

PAIRS = ((1, 2), (-7, 2), (7, -2), (0, 5), (-3, -3), (1.5, -0.25), (0.0, 3.0), (-2.5, 0.75), (2, 0.5))
ZEROS = ((1, 0), (0, 0), (-4, 0), (1.0, 0.0), (0.0, 0.0), (-1.0, 0.0))
NANS = ((math.nan, 1.0), (1.0, math.nan), (math.nan, math.nan), (math.inf, 1.0), (-math.inf, math.nan))
REALS = (
    (0.0,), (0.5,), (-1.25,), (3.7,), (-100.0,), (math.inf,), (-math.inf,), (math.nan,), (1e9,), (2.5,), (-0.5,),
)  # fmt: skip
LOGIC = ((True, True), (True, False), (False, True), (False, False))
VECTORS = (((3, 1, 2),), ((1, 1, 0, 1),), ((5,),), ((2.5, -1.0, 2.5, 0.0),), ((-1.0, math.inf, -math.inf),))
NAN_VECTORS = (((math.nan, 1.0, 3.0),), ((1.0, math.nan, 3.0, 3.0),), ((math.nan, math.nan),))
MASKS = (((True, False, True),), ((False,),), ((True, True),))
INTS = (3, -1, 2)
MIXED = (0.5, -2.0, 1.5)
"""Vectors as arguments of functions."""
ROWS = ((1, 2), (3, -1))
"""A matrix as one."""
