"""What a vector program takes out of its steps: values that depend on draws alone, and draws as comparisons of words.

Both rewrite core nodes into core nodes, so that every backend gains: what draws give becomes a read of a named
value with bounds that are certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taskspec.draws import NEVER
from taskspec.lang.builder import Builder
from taskspec.lang.ir import Draw, Node, Read, Role, children, rewrite, walk
from taskspec.lang.types import INT
from taskspec.lang.variates import VARIATES
from taskspec.lang.variates.layout import WordLayout, words_of


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

    found, before = rewrite(roots, leaf, b.remake), tuple(roots)
    while found != before:  # what a draw was given may have been drawn
        found, before = rewrite(found, leaf, b.remake), found
    return found


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
    elements = VARIATES[draw.base].compared(b, draw, words, bias)
    if elements is None or draw.type.is_scalar:
        return None if elements is None else elements[0]
    return b.structure("reshape", [b.structure("vector", elements)], draw.type.shape)
