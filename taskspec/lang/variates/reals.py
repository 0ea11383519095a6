"""Base variates that are reals: float32 numbers from one rounded operation after the other."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from taskspec import draws
from taskspec.lang.ir import Draw, Node
from taskspec.lang.operators.entry import NodeMaker
from taskspec.lang.types import INF, REAL, Kind
from taskspec.lang.variates.entry import Flat, KernelWriter, Variate, Words, groups, rows, stretched

NORMAL_REACH = 6.67
"""No standard normal that is drawn lies further out: its radius comes from 31 bits."""


def _normal(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.size
    return draws.normal(words[: draws.normal_words(n)], n)


def _dirichlet(draw: Draw, args: list[Flat], words: Words) -> Flat:
    return draws.dirichlet(words[: draws.dirichlet_words(draw.type.size)], [float(a) for a in args[0]])


def _gamma(draw: Draw, args: list[Flat], words: Words) -> Flat:
    n = draw.type.size
    return draws.gamma(words[: draws.gamma_words(n)], [float(a) for a in stretched(args[0], n)])


def _mean_share(b: NodeMaker, draw: Draw) -> Node:
    (alpha,) = draw.args
    return b.apply("div", alpha, b.apply("sum", alpha))


def _shares(k: KernelWriter, draw: Draw, words: Sequence[str]) -> list[str]:
    values = []
    for group, alpha in zip(groups(draw, words), k.argument(draw), strict=True):
        value = k.name()
        shrink = k.name()
        k.lines.append(f"{value}, {shrink} = gamma_parts({group}, {alpha})")
        values.append((value, shrink))
    largest = _largest(k, [value for value, _ in values])
    logs = [k.assign(f"log_share({value}, {largest}, {shrink})") for value, shrink in values]
    most = _largest(k, logs)
    parts = [k.assign(f"exp32({x} - {most})") for x in logs]
    total = parts[0]
    for part in parts[1:]:
        total = k.assign(f"({total} + {part})")
    return [f"share({part}, {total})" for part in parts]


def _largest(k: KernelWriter, atoms: Sequence[str]) -> str:
    found = atoms[0]
    for atom in atoms[1:]:
        found = k.assign(f"select({atom} > {found}, {atom}, {found})")
    return found


TABLE = (
    Variate(  # a multiple of 2**-24 in [0, 1)
        name="uniform", kind=Kind.REAL, bounds=lambda draw, args: (0, 1),
        mean=lambda b, draw: b.const(Fraction(1, 2), REAL),
        one=lambda draw, args, words: tuple(map(draws.uniform, words[: draw.type.size])),
        many=lambda x, draw, args, words: x.uniforms(words),
        kernel=lambda k, draw, words: [f"uniform({w})" for w in words],
    ),
    Variate(  # standard, by Box and Muller's method; words in pairs
        name="normal", kind=Kind.REAL, bounds=lambda draw, args: (-NORMAL_REACH, NORMAL_REACH), cut=True,
        mean=lambda b, draw: b.scalar(0.0),
        words=lambda draw: draws.normal_words(draw.type.size), one=_normal,
        many=lambda x, draw, args, words: x.normals(words, draw.type.size), loop="normals",
    ),
    Variate(  # standard
        name="exponential", kind=Kind.REAL, bounds=lambda draw, args: (0, INF), mean=lambda b, draw: b.scalar(1.0),
        one=lambda draw, args, words: tuple(map(draws.exponential, words[: draw.type.size])),
        many=lambda x, draw, args, words: x.exponentials(words), loop="exponentials",
    ),
    Variate(  # shares with given concentrations, by Marsaglia and Tsang's method
        name="dirichlet", kind=Kind.REAL, bounds=lambda draw, args: (0, 1), mean=_mean_share,
        words=lambda draw: draws.dirichlet_words(draw.type.size), one=_dirichlet,
        many=lambda x, draw, args, words: x.dirichlets(words, rows(x, draw, args[0])), kernel=_shares,
    ),
    Variate(  # of a given shape and scale 1, by the same method
        name="gamma", kind=Kind.REAL, bounds=lambda draw, args: (0, INF), mean=lambda b, draw: draw.args[0],
        words=lambda draw: draws.gamma_words(draw.type.size), one=_gamma,
        many=lambda x, draw, args, words: x.gammas(words, rows(x, draw, args[0])),
        kernel=lambda k, draw, words: [
            f"gamma({group}, {alpha})" for group, alpha in zip(groups(draw, words), k.argument(draw), strict=True)
        ],
    ),
)  # fmt: skip
