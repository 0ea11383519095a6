"""The input of renderers: pages with figures and references, and the paragraph on notation."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from taskspec.language.task.merge import lineage
from taskspec.show.bibliography import Reference
from taskspec.show.figures import Scene
from taskspec.show.pages.equations import LETTERS, Writing
from taskspec.show.pages.facts import Setting
from taskspec.show.pages.page import Page, anchor
from taskspec.show.pages.prose import Formula, Inline, Inlines, Mark, inlines
from taskspec.show.printers import tree as m
from taskspec.show.printers.cases import IF
from taskspec.show.printers.markup import latex
from taskspec.show.printers.text import plain


@dataclass(frozen=True, slots=True)
class Other:
    """The figure of a setting of the parameters."""

    title: str
    anchor: str
    scene: Scene

    @property
    def caption(self) -> str:
        return f"{self.title}. {self.scene.caption}"


def setting_anchor(page: Page, setting: Setting) -> str:
    return f"{page.anchor}-{anchor(setting.title)}"


@dataclass(frozen=True)
class Suite:
    """The pages of some tasks; `scenes` are their figures by the pages' anchors, and by those of their settings."""

    title: str
    pages: tuple[Page, ...]
    scenes: Mapping[str, Scene]
    references: Mapping[str, Reference]
    brief: bool = False

    @cached_property
    def cited(self) -> dict[str, Reference]:
        """The references that are cited and known, in the order of their keys."""
        keys = set()
        for page in self.pages:
            keys |= {cite.key for cite in page.sources}
        return {key: self.references[key] for key in sorted(keys & self.references.keys())}

    @cached_property
    def folded(self) -> dict[str, tuple[Page, ...]]:
        """Pages of variants by the anchor of the page that they are based on, directly or not."""
        known = {}
        for page in self.pages:
            source = page.task.source
            known[source.document.origin.name, source.variant] = page.anchor
        by_task: dict[str, tuple[Page, ...]] = {}
        for page in self.pages:
            first = page.anchor
            for document, variant in lineage((page.task.source.document, page.task.source.variant)):
                first = known.get((document.origin.name, variant), first)
            by_task.setdefault(first, ())
            if page.anchor != first:
                by_task[first] += (page,)
        return by_task

    def others(self, page: Page) -> list[Other]:
        others = []
        for setting in page.settings:
            name = setting_anchor(page, setting)
            if name in self.scenes:
                others.append(Other(setting.title, name, self.scenes[name]))
        return others


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
    ("⊙", r"$x \odot y$ multiplies vectors element by element; $x \cdot y$ is their inner product."),
    ("↦", r"A label stands for the number or vector behind its arrow $\mapsto$ where it is calculated with."),
    (r"\|", r"$|x|$ is the absolute value of a number, and the length of a vector."),
    (r"_\((?:[^()]*, )?[^(),]*: ", r"$x_{a:b}$ has the elements of $x$ from $a$ to $b - 1$."),
    (r"\bargsort\(", r"$\mathrm{argsort}(x)$ has the places of the elements of $x$, the smallest element first."),
    (r"\breverse\(", r"$\mathrm{reverse}(x)$ is $x$ with its last element first."),
    (r"\bcumsum\(", r"$\mathrm{cumsum}(x)$ has the sums of the first elements of $x$."),
    (r"\be(_|[₀-₉ₐ-ₜᵢ-ᵥ])", r"$e_i$ is the vector with $1$ at place $i$ and $0$ elsewhere."),
    (r"\bUnif\b", r"$\mathrm{Unif}$ is the uniform distribution: over the elements of a set, or over the real numbers from one "
                  r"bound to the other."),
    (r"\bPerm\b", r"$\mathrm{Perm}(n)$ is the uniform distribution over the permutations of $0, \ldots, n - 1$."),
    (r"∼ \([^∼]*\)(\^|[⁰-⁹ⁿ¹²³])", r"A power of a distribution is that of independent draws, as many as the power says; "
                                  r"$n \times m$ stands for a matrix of them."),
    ("ℙ", r"$\mathbb{P}_\pi(\cdot)$ is the probability that an episode of the policy $\pi$ ever reaches a state in which the "
            r"condition holds."),
    ("𝔼", r"$\mathbb{E}_\pi(\cdot)$ is the expected sum of a measure over an episode of the policy $\pi$, discounted like "
            r"rewards."),
)  # fmt: skip
_DRAWN = (
    "{}, with an index where there are several, is drawn at random, independently of everything else, whenever the equation is "
    "evaluated."
)
_CASES = "Of several cases the first counts whose condition holds."
_RETURNS = (
    "A return is the expected sum of the rewards of an episode{discounted}: the optimal one is the highest that a policy can "
    "have, the worst one the lowest, and the random one that of actions drawn uniformly."
)
_DISCOUNTED = r", where a task with a discount $\gamma$ multiplies that of the step after $t$ others by $\gamma^t$"
_MARKS = (
    ("proved", "What is marked as proved follows from the form of the equations, or from exact results whose rounding errors are "
               "bounded."),
    ("tested", "What is marked as tested was not contradicted by simulated episodes."),
)  # fmt: skip


def notation(pages: Iterable[Page]) -> Inlines:
    """Return the paragraph for some pages: what always holds, then the signs, the returns and the marks that occur on them."""
    pages = tuple(pages)
    pieces = list(chain.from_iterable(map(_pieces, pages)))
    formulas = [piece.math for piece in pieces if isinstance(piece, Formula)]
    marks = [piece.text for piece in pieces if isinstance(piece, Mark)]
    written = "\n".join(set(map(plain, formulas)))
    sentences = [_ALWAYS]
    for sign, text in _SIGNS:
        if re.search(sign, written):
            sentences.append(text)
    sentences += _draws(pages)
    if any(map(_has_cases, formulas)):
        sentences.append(_CASES)
    if any(page.section("scores") for page in pages):
        discounts = {page.task.discount for page in pages}
        for page in pages:
            discounts |= {setting.task.discount for setting in page.settings}
        discounted = "" if discounts == {1} else _DISCOUNTED
        sentences.append(_RETURNS.format(discounted=discounted))
    for word, text in _MARKS:
        if any(mark.startswith(word) for mark in marks):
            sentences.append(text)
    return inlines(" ".join(sentences))


def _draws(pages: Iterable[Page]) -> Iterator[str]:
    letters: dict[str, m.Math] = {}
    for page in pages:
        writing = Writing(page.task, {})
        letter = writing.notation.symbol(writing.drawn)
        for piece in _pieces(page):
            if isinstance(piece, Formula) and letter in m.parts(piece.math):
                letters[writing.drawn] = letter
    if letters:
        usual, *others = [f"${latex(letters[name])}$" for name in LETTERS if name in letters]
        instead = ""
        if others:
            instead = f" ({' or '.join(others)} where the task has such a name)"
        yield _DRAWN.format(usual + instead)


def _has_cases(tree: m.Math) -> bool:
    for part in m.parts(tree):
        if isinstance(part, m.Cases) and sum(IF in m.children(condition) for _, condition in part.rows) > 1:
            return True
    return False


def _pieces(page: Page) -> Iterator[Inline]:
    for section in page.sections:
        contents: list[Inlines] = []
        for line in section.lines:
            contents += [line.content, *line.values]
        if section.table:
            contents += chain.from_iterable(section.table.rows)
        for content in contents:
            yield from content
