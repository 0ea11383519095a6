"""What a vector program takes out of its steps: values that depend on draws alone, and draws as comparisons of words.

Both rewrite core nodes into core nodes, so that every backend gains: what draws give becomes a read of a named
value with bounds that are certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taskspec.draws import NEVER, threshold_table, thresholds
from taskspec.draws.layout import WordLayout, row_table, words_of
from taskspec.draws.sample import bernoulli_threshold
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, children, rewrite, walk
from taskspec.lang.types import INT, Kind, Type

COMPARED = 16
"""Constant categorical draws of up to this many outcomes become a sum of comparisons."""


@dataclass(frozen=True)
class Hoisted:
    """Roots of a phase whose draws are reads of variables.

    `values` are nodes that need draws and nothing else, read as the variables `names`. `words` gives, for every draw
    that is left (it depends on the state), the variable that holds each of its words; `layout` numbers the words.
    """

    roots: tuple[Node, ...]
    values: tuple[Node, ...]
    names: tuple[str, ...]
    words: dict[int, tuple[str, ...]]
    layout: WordLayout

    @property
    def word_numbers(self) -> dict[str, int]:
        """The number within the phase of every word that is read by name."""
        first = self.layout.first
        return {name: first[site] + k for site, names in self.words.items() for k, name in enumerate(names)}


def hoist(b: Builder, roots: Sequence[Node], layout: WordLayout, bias: int = 0) -> Hoisted:
    """Take out of the roots whatever depends on draws alone, and write the other draws as comparisons if possible."""
    free = _free(roots)
    values = _maximal(roots, free)
    names = {id(n): f"h{i}" for i, n in enumerate(values)}

    def leaf(node: Node) -> Node | None:
        if id(node) not in names:
            return None
        low, high = b.certain(node)
        return b.read(Role.VARIABLE, names[id(node)], node.type, low, high)

    rest = rewrite(roots, leaf, b.remake)
    left = {d.site: word_names(d) for d in walk(rest) if isinstance(d, Draw)}
    lowered = compared(b, rest, bias)
    return Hoisted(lowered, tuple(values), tuple(names.values()), left, layout)


def compared(b: Builder, roots: Sequence[Node], bias: int = 0) -> tuple[Node, ...]:
    """The roots with finite draws of known probabilities as comparisons of words with thresholds.

    A word is read as the int variable of `word_names`, less `bias` (2**31 where ints have 32 bits).
    """

    def leaf(node: Node) -> Node | None:
        return _comparison(b, node, bias) if isinstance(node, Draw) else None

    return rewrite(roots, leaf, b.remake)


def word_names(draw: Draw) -> tuple[str, ...]:
    return tuple(f"w{draw.site}_{k}" for k in range(words_of(draw)))


def _free(roots: Sequence[Node]) -> dict[int, bool]:
    """For every node, whether it reads nothing."""
    free: dict[int, bool] = {}
    for node in walk(roots):
        free[id(node)] = not isinstance(node, Read) and all(free[id(c)] for c in children(node))
    return free


def _maximal(roots: Sequence[Node], free: dict[int, bool]) -> list[Node]:
    """The largest free nodes that hold a draw."""
    random: dict[int, bool] = {}
    for node in walk(roots):
        random[id(node)] = isinstance(node, Draw) or any(random[id(c)] for c in children(node))
    users = (*roots, *(c for n in walk(roots) if not free[id(n)] for c in children(n)))
    return list({id(n): n for n in users if free[id(n)] and random[id(n)]}.values())


# -- draws as comparisons -----------------------------------------------------------------------------------------


def _comparison(b: Builder, draw: Draw, bias: int) -> Node | None:
    words = [b.read(Role.VARIABLE, n, INT, -bias, NEVER - 1 - bias) for n in word_names(draw)]
    p = draw.args[0] if draw.args else None
    match draw.base, p:
        case "categorical", Const() if len(p.flat) <= COMPARED:
            limits = [b.scalar(t - bias) for t in thresholds(p.flat) if t < NEVER]
            return _arranged(b, draw, [_reached(b, limits, w) for w in words])
        case "categorical", Apply() if row_table(p) is not None:
            return _arranged(b, draw, _row_outcomes(b, p, words, bias))
        case "bernoulli", Const():
            each = p.flat * draw.type.size if len(p.flat) == 1 else p.flat
            return _arranged(
                b, draw, [_below(b, w, bernoulli_threshold(q), bias) for w, q in zip(words, each, strict=True)]
            )
        case _:
            return None


def _arranged(b: Builder, draw: Draw, elements: Sequence[Node]) -> Node:
    if draw.type.is_scalar:
        return elements[0]
    return b.structure("reshape", [b.structure("vector", elements)], draw.type.shape)


def _below(b: Builder, word: Node, limit: int, bias: int) -> Node:
    return b.scalar(True) if limit >= NEVER else b.apply("lt", word, b.scalar(limit - bias))


def _reached(b: Builder, limits: Sequence[Node], word: Node) -> Node:
    """How many of the limits are at most the word."""
    total: Node = b.scalar(0)
    for limit in limits:
        total = b.apply("add", total, b.cast(b.apply("le", limit, word), Kind.INT))
    return total


def _row_outcomes(b: Builder, p: Node, words: Sequence[Node], bias: int) -> list[Node]:
    """Draws from the row of a table that is chosen at run time: one look-up for every threshold."""
    found = row_table(p)
    assert found is not None
    table, row = found
    k = table.type.shape[-1]
    rows = [table.flat[i : i + k] for i in range(0, len(table.flat), k)]
    if not bias:  # ints with room for the threshold that no word reaches
        exact = [thresholds(r) for r in rows]
        return [_reached(b, [_column(b, [t[i] for t in exact], row) for i in range(k - 1)], w) for w in words]
    limits, last = threshold_table(rows)
    columns = [_column(b, [int(v) - bias for v in limits[:, i]], row) for i in range(k - 1)]
    most = _column(b, [int(v) for v in last], row)
    return [b.apply("min2", _reached(b, columns, w), most) for w in words]


def _column(b: Builder, values: Sequence[int], row: Node) -> Node:
    if len(set(values)) == 1:
        return b.scalar(values[0])
    return b.structure("index", [b.const(values, Type(Kind.INT, (len(values),))), row])
