"""The page of the functions and distributions of the task language, from the tables that the compiler runs on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from docs.tools.markdown import code, entries, table
from taskspec.base.diagnostics import Collector, Origin, Span
from taskspec.language.expressions import dists
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.ir import Const
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.parse import parse
from taskspec.language.expressions.scope import Scope
from taskspec.language.expressions.syntax import SourceText
from taskspec.show.printers import tex
from taskspec.show.printers import tree as m
from taskspec.show.printers.markup import latex
from taskspec.show.printers.pieces import fill

HEAD = """# Functions of expressions

The functions and distributions that [expressions](language.md#operators) of a spec may use. Functions act on each element of a
vector, unless they are about whole vectors. [`fold` and `scan`](language.md#vectors-elements-sets) apply functions of the spec.
"""
IN_SHORT = "On the site, this page also has examples, the mathematics that is printed, and values of edge cases.\n"
EDGES = """## Edge cases

Every operator has a value for every input, the same on every backend:
"""
GROUPS = {
    "Numbers": "abs sign sqrt exp log floor ceil round clip",
    "Angles": "sin cos tan tanh asinh atan2",
    "Choices, counts and extremes": "where any all count min max argmin argmax",
    "Sums and products": "sum prod cumsum dot norm1 norm2",
    "Order and shape": "len sort argsort reverse swap put concat reshape onehot",
}
DRAWS = {
    "Draws from finite sets": "Categorical UniformInt Bernoulli Binomial Geometric Poisson Permutation Subset",
    "Draws of real numbers": "Uniform Normal TruncatedNormal Exponential Gamma Beta Dirichlet",
}
DISTRIBUTIONS = {d.name: d for d in (dists.CATEGORICAL, *dists.DISTS.values())}
AWKWARD = (
    "1 / 0", "0 / 0", "7 // 0", "7 % 0", "-7 // 2", "-7 % 2", "7 % -2", "2**-2", "0**0", "(-8.0)**0.5", "sqrt(-1)", "log(0)",
    "exp(1000)", "min(0/0, 1)", "max((0/0, 2))", "argmin((0/0, 0/0))", "sort((2, 0/0, 1))", "argsort((1, 0, 1, 0))",
    "round(2.5)", "floor(1 / 0)", "floor(0 / 0)", "sign(0 / 0)", "0 / 0 == 0 / 0", "True + True", "clip(5, 3, 0)",
    "put((1, 2, 3), 9, 0)", "put((1, 2, 3), -1, 0)", "onehot(5, 3)",
)  # fmt: skip
ROUNDED = 4
"""Digits after the point with which a value is taken to be rounded."""


def overview() -> str:
    """Return the page of the repository: each function and distribution in one sentence."""
    parts = [HEAD, IN_SHORT]
    for title, names in _grouped(GROUPS, FUNCTIONS):
        parts += [
            f"## {title}\n",
            entries((code(FUNCTIONS[name].signature), FUNCTIONS[name].doc) for name in names),
            "",
        ]
    for title, names in _grouped(DRAWS, DISTRIBUTIONS):
        rows = [(code(_signature(DISTRIBUTIONS[name])), DISTRIBUTIONS[name].doc) for name in names]
        parts += [f"## {title}\n", entries(rows), ""]
    return "\n".join(parts)


def functions() -> str:
    """Return the page of the site: each function and distribution with its mathematics, and an example."""
    parts = [HEAD]
    for title, names in _grouped(GROUPS, FUNCTIONS):
        rows = [(code(FUNCTIONS[n].signature), FUNCTIONS[n].doc, _example(n), _printed_function(n)) for n in names]
        parts += [f"## {title}\n", table(("function", "value", "example", "printed"), rows), ""]
    for title, names in _grouped(DRAWS, DISTRIBUTIONS):
        drawn = [(code(_signature(DISTRIBUTIONS[n])), DISTRIBUTIONS[n].doc, _printed_draw(n)) for n in names]
        parts += [f"## {title}\n", table(("distribution", "draw", "printed"), drawn), ""]
    edges = [(code(each), code(_value(each))) for each in AWKWARD]
    return "\n".join([*parts, EDGES, table(("expression", "value"), edges), ""])


def _grouped(groups: dict[str, str], known: Iterable[str]) -> list[tuple[str, Sequence[str]]]:
    """Return titles and names of groups.

    Raises:
        ValueError: where a known name is in none of them.
    """
    grouped: list[tuple[str, Sequence[str]]] = [(title, names.split()) for title, names in groups.items()]
    missing = set(known) - {name for _, names in grouped for name in names}
    if missing:
        raise ValueError(f"no group has {', '.join(sorted(missing))}")
    return grouped


def _argument(name: str) -> m.Math:
    """Return a name in mathematics: a letter, or a word."""
    if len(name) == 1:
        return tex.read(name)
    return m.Words(name.removeprefix("*"))


def _printed_function(name: str) -> str:
    function = FUNCTIONS[name]
    names = [_argument(argument) for argument in function.arguments]
    holes: list[tuple[str, m.Math]] = [(str(i), tree) for i, tree in enumerate(names)]
    return f"${latex(fill(function.latex, [*holes, ('*', m.joined(names))]))}$"


def _printed_draw(name: str) -> str:
    dist = DISTRIBUTIONS[name]
    return f"${latex(fill(dist.latex, [(a.name, _argument(a.name)) for a in dist.arguments]))}$"


def _signature(dist: dists.Dist) -> str:
    arguments = [a.name if a.default is None else f"{a.name}={a.default}" for a in dist.arguments]
    return f"{dist.name}({', '.join([*arguments, *(['shape=()'] if dist.shaped else [])])})"


def _example(name: str) -> str:
    """Return an example of a function, unless its value has to be rounded."""
    expression = f"{name}({', '.join(map(_literal, FUNCTIONS[name].samples[0]))})"
    value = _value(expression)
    if len(value.partition(".")[2]) > ROUNDED:
        return ""
    return f"{code(expression)} is {code(value)}"


def _literal(item: Any) -> str:
    if isinstance(item, tuple):
        return f"({', '.join(map(_literal, item))}{',' * (len(item) == 1)})"
    return str(item)


def _value(expression: str) -> str:
    """The value of a constant expression, written as the language writes values."""
    origin = Origin("<manual>", expression)
    text = SourceText(expression, lambda start, end: Span(origin, 1, start + 1, 1, end + 1))
    collector = Collector()
    found = Checker(Builder(), collector).check(parse(text), Scope({}))
    collector.raise_if_errors()
    assert found is not None and isinstance(found.node, Const)
    return _written(found.node.flat, found.node.type.shape)


def _written(flat: tuple[Any, ...], shape: tuple[int, ...]) -> str:
    if not shape:
        return _number(flat[0])
    step = len(flat) // shape[0]
    rows = (flat[i * step : (i + 1) * step] for i in range(shape[0]))
    return f"({', '.join(_written(row, shape[1:]) for row in rows)})"


def _number(item: Any) -> str:
    if isinstance(item, Fraction):
        return str(item) if item.denominator <= 100 else f"{float(item):.6g}"
    return f"{item:.6g}" if isinstance(item, float) else str(item)
