"""What an entry of the table of base variates says, and what it is given to say it with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.base.records import dataclass
from taskspec.lang.ir import Draw, Node
from taskspec.lang.operators.entry import NodeMaker
from taskspec.lang.types import EVERYTHING, Args, Interval, Kind

Flat = tuple[Any, ...]
Words = Sequence[int]
Bounds = Callable[[Node], Interval]
Comparison = Callable[[NodeMaker, Draw, Sequence[Node], int], list[Node] | None]


class Draws(Protocol):
    """Variates over arrays of words: `taskspec.draws` for NumPy, `taskspec.backends.jax.library` for JAX.

    Words are uint32 and lie along the first axis, the lanes along the last one. Each function is that of `taskspec.draws`.
    """

    xp: Any

    def uniforms(self, words: AnyArray, /) -> AnyArray: ...

    def exponentials(self, words: AnyArray, /) -> AnyArray: ...

    def normals(self, words: AnyArray, n: int, /) -> AnyArray: ...

    def dirichlets(self, words: AnyArray, alphas: AnyArray, /) -> AnyArray: ...

    def gammas(self, words: AnyArray, alphas: AnyArray, /) -> AnyArray: ...

    def bernoullis(self, words: AnyArray, p: AnyArray, /) -> AnyArray: ...

    def indices(self, words: AnyArray, n: AnyArray, /) -> AnyArray: ...

    def categoricals(self, words: AnyArray, thresholds: Any, /) -> AnyArray: ...

    def weighted_categoricals(self, words: AnyArray, weights: AnyArray, /) -> AnyArray: ...

    def poissons(self, words: AnyArray, rate: AnyArray, bound: float, /) -> AnyArray: ...

    def permutations(self, words: AnyArray, /) -> AnyArray: ...


class LaneWriter(Protocol):
    """What writes a draw into the scalar program (`taskspec.backends.lane_form`)."""

    def atoms(self, node: Node) -> list[str]:
        """Return one expression for each element."""

    def packed(self, node: Node) -> str:
        """Return the name of a flat sequence of the elements."""

    def scalar_of(self, node: Node) -> str:
        """Return the name of a number that is no direct argument."""

    def constant(self, value: Any) -> str:
        """Return the name of a value that is kept outside of the function."""

    def argument(self, draw: Draw) -> list[str]:
        """Return the first argument of a draw, an expression for each of its elements."""


class KernelWriter(Protocol):
    """What writes a draw into a compiled kernel (`taskspec.backends.numba.kernel`), without branches.

    Statements may use the functions of `taskspec.backends.numba.runtime` and `taskspec.backends.numba.kernel_draws`.
    """

    lines: list[str]

    def name(self) -> str:
        """Return a name that is not taken."""

    def assign(self, text: str) -> str:
        """Return a name for an expression."""

    def atoms(self, node: Node) -> list[str]:
        """Return the name of each element."""

    def argument(self, draw: Draw) -> list[str]:
        """Return the first argument of a draw, a name for each of its elements."""

    def array(self, array: np.ndarray[Any, Any]) -> str:
        """Return the name of a constant array."""

    def order(self, atoms: Sequence[str], real: bool) -> list[str]:
        """Return the places that sort some numbers."""


class ProbabilityArithmetic(Protocol):
    """The arithmetic in which probabilities are worked out: floats, or rationals."""

    def argument(self, draw: Draw, arg: AnyArray) -> AnyArray:
        """Return the first argument of a draw, rates and probabilities, (*shape, N)."""

    def otherwise(self, draw: Draw, p: AnyArray) -> AnyArray:
        """Return one minus the probabilities of conditions (*shape, N) that are the first argument of a draw, within 0 and 1."""

    def ratio(self, part: AnyArray, whole: AnyArray) -> AnyArray:
        """Ints divided by ints."""

    def times(self, a: AnyArray, b: AnyArray) -> AnyArray:
        """Return the product of two probabilities other than 0."""


@dataclass(frozen=True, slots=True)
class Enumeration:
    """The outcomes of a variate that exact analysis goes through.

    `count` bounds how many there are, given bounds of nodes. `table` gives their values (K, *shape) and probabilities
    (K, N or 1) from arguments (*shape, N or 1). A probability takes so many rounded `steps`, as a row is rounded, added up
    and divided for each element, and is made of so many `chances` that the arguments give. With a `tail` there are
    infinitely many, of irrational probabilities; those left out weigh less than 1e-20 for each element. `weighted` says
    whether the arguments are what outcomes weigh, and `by_row` whether a row of a constant table is taken as it is written.
    """

    count: Callable[[Draw, Bounds], float]
    table: Callable[[Draw, list[AnyArray], ProbabilityArithmetic], tuple[AnyArray, AnyArray]]
    steps: Callable[[Draw], int] = lambda draw: 6 * draw.type.size
    chances: Callable[[Draw], int] = lambda draw: draw.type.size
    tail: bool = False
    weighted: bool = True
    by_row: bool = False


def one_each(draw: Draw) -> int:
    """Return a word for every element."""
    return draw.type.size


@dataclass(frozen=True, slots=True, kw_only=True)
class Variate:
    """A base variate: what draws are made of, and all that anyone needs to know of it.

    `words` is how many random words a draw takes. `many` is its value over arrays, (size, N) of any width, from a library,
    its arguments (*shape, N or 1) and its words (count, N); `one` the same of a single draw on Python numbers, where that is
    not a batch of one. All backends give the same to the bit. `many` is None for what stands in exact models only, and is
    never drawn.

    What depends on draws alone is worked out in blocks by `many`. Where a distribution depends on the state, the scalar
    program has the form `lane`, or else calls `one`. Kernels have the expressions `kernel`, one for each element; or a `loop` of
    `taskspec.backends.numba.kernel_draws` makes float32 numbers of the words, each of its own, before the step. `compared` gives
    the elements as comparisons of words (ints, less a bias) with known thresholds, where it can.

    `mean` is what a draw is replaced by where a reward is linear in it; variates with `outcomes` are gone through.
    `sorts` says that it sorts its words, which is costly; `passes`, how many times `many` goes through them. `cut`: its bounds
    are where the way it is made ends, and nothing in mathematics.
    """

    name: str
    kind: Kind
    many: Callable[[Draws, Draw, Sequence[AnyArray], AnyArray], AnyArray] | None
    one: Callable[[Draw, list[Flat], Words], Flat] | None = None
    words: Callable[[Draw], int] = one_each
    bounds: Callable[[Draw, Args], Interval] = lambda draw, args: EVERYTHING
    outcomes: Enumeration | None = None
    mean: Callable[[NodeMaker, Draw], Node] | None = None
    lane: Callable[[LaneWriter, Draw, Sequence[str]], list[str]] | None = None
    kernel: Callable[[KernelWriter, Draw, Sequence[str]], list[str]] | None = None
    loop: str | None = None
    compared: Comparison = lambda b, draw, words, bias: None
    sorts: bool = False
    passes: Callable[[Draw], int] = lambda draw: 1
    cut: bool = False


def stretched(flat: Flat, size: int) -> Flat:
    """Return an argument with one number for each element of a draw."""
    return flat * size if len(flat) == 1 and size != 1 else flat


def rows(x: Draws, draw: Draw, arg: AnyArray) -> AnyArray:
    """Return an argument with one row for each element of a draw: (size, N or 1)."""
    flat = arg.reshape(-1, arg.shape[-1])
    return x.xp.broadcast_to(flat, (draw.type.size, flat.shape[1]))


def groups(draw: Draw, words: Sequence[str]) -> list[str]:
    """Return the words of each element, as the source of a tuple."""
    step = len(words) // draw.type.size
    return [f"({', '.join(words[k : k + step])},)" for k in range(0, len(words), step)]
