"""What the signs on pages mean: one paragraph for all formats, with the sentences that the pages need."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from taskspec.appendix.page import Page
from taskspec.appendix.prose import Formula, Inline, Inlines, Mark, inlines
from taskspec.printers.plain import plain

_ALWAYS = (
    r"$t$ is the number of steps taken, from $0$, and $T$ the horizon, at which episodes are truncated. A prime marks what a "
    r"step leads to: $s'$ is the state after $s$. Indices count from $0$."
)
_SIGNS = (
    ("𝟙", r"$\mathbb{1}[\cdot]$ is $1$ where the condition holds and $0$ elsewhere."),
    (r"\bclip\(", r"$\mathrm{clip}(x, a, b)$ is the number from $a$ to $b$ that is nearest to $x$."),
    (r"\bswap_", r"$\mathrm{swap}_{i, j}(x)$ is $x$ with its elements $i$ and $j$ exchanged."),
    (r"\[[^][]* ← ", r"$x[q \leftarrow f]$ is $x$ with $f$ in place of its element $q$."),
    ("#", r"$\#\{\cdot\}$ is the number of elements of the set."),
    ("ξ", r"$\xi$, with an index where there are several, is drawn at random, independently of everything else, whenever "
          r"the equation is evaluated."),
    (r"\bUnif\b", r"$\mathrm{Unif}$ is the uniform distribution: over the elements of a set, or over the real numbers from one "
                  r"bound to the other; its power $n$ is that of $n$ independent draws."),
    ("ℙ_", r"$\mathbb{P}_\pi(\cdot)$ is the probability that an episode of the policy $\pi$ ever reaches a state in which the "
            r"condition holds."),
)  # fmt: skip
_RETURNS = (
    "A return is the expected sum of the rewards of an episode: the optimal one is the highest that a policy can have, the "
    "worst one the lowest, and the random one that of actions drawn uniformly."
)
_MARKS = (
    ("proved", "What is marked as proved follows from the form of the equations, or from exact results whose rounding errors are "
               "bounded."),
    ("tested", "What is marked as tested was not contradicted by simulated episodes, or follows from a finite abstraction that "
               "agreed with them."),
)  # fmt: skip


def notation(pages: Iterable[Page]) -> Inlines:
    """The paragraph for some pages: what always holds, then the signs, the returns and the marks that occur on them."""
    pages = tuple(pages)
    pieces = [piece for page in pages for piece in _pieces(page)]
    written = "\n".join({plain(piece.math) for piece in pieces if isinstance(piece, Formula)})
    marked = [piece.text for piece in pieces if isinstance(piece, Mark)]
    told = [_ALWAYS, *(text for sign, text in _SIGNS if re.search(sign, written))]
    told += [_RETURNS] if any(page.section("scores") for page in pages) else []
    return inlines(
        " ".join([*told, *(text for word, text in _MARKS if any(found.startswith(word) for found in marked))])
    )


def _pieces(page: Page) -> Iterator[Inline]:
    """All that stands in the sections of a page, its settings and its tables included."""
    for section in page.sections:
        for line in section.lines:
            yield from line.content
            yield from (piece for values in line.values for piece in values)
        for row in section.table.rows if section.table else ():
            yield from (piece for cell in row for piece in cell)
