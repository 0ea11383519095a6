"""The card of an exam as a picture: for a screen, for a telephone, and for one or two columns of a paper."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.base.display import plural
from taskspec.learn.exam.card import Card
from taskspec.learn.exam.card_charts import (
    GRADES,
    LETTER,
    Ends,
    axis_words,
    backdrop,
    last_step,
    learning_curves,
    marks,
    marks_key,
    score_ends,
    steps_words,
)  # fmt: skip
from taskspec.learn.exam.score_rows import FIXED, PUBLISHED, RELABELLED, SAMPLED, TaskRow, forms_of
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart


@dataclass(frozen=True)
class Layout:
    """The layout of a card.

    Attributes:
        width: of the picture, in inches.
        size: of letters, in points.
        forms: whose scores are numbers in columns.
        is_stacked: whether names and numbers are above the strips, not beside them.
        has_curves: whether learning curves are beside the strips.
        has_words: whether the verdict is above the strips in words, as on a screen; else a line below says what is shown.
    """

    width: float
    size: float
    forms: tuple[str, ...]
    is_stacked: bool = False
    has_curves: bool = True
    has_words: bool = True


CENTIMETRE = 1 / 2.54
WIDE = Layout(9.6, 9, (PUBLISHED, RELABELLED, SAMPLED, FIXED))
NARROW = Layout(3.75, 9, (PUBLISHED, RELABELLED), is_stacked=True, has_curves=False)
"""As wide as a telephone's screen: 360 pixels."""
PAPER = {
    "paper-one-column": Layout(
        8.4 * CENTIMETRE, 7, (PUBLISHED, RELABELLED), is_stacked=True, has_curves=False, has_words=False
    ),
    "paper-two-columns": Layout(17 * CENTIMETRE, 7, (PUBLISHED, RELABELLED, FIXED), has_words=False),
}
"""For papers, by the stems of files."""
MARGIN = 0.06
LANE = 0.28
"""The height of a strip, in inches."""
SPARK = 1.1
"""The width of a learning curve beside a strip, in inches."""


def picture(shown: Card, layout: Layout = WIDE) -> Chart:
    """Draw the card of an exam: what is wrong in words, a strip for each task that needs a look, and learning curves."""
    lines = [(f"{shown.learner}: {shown.terms}", chart.MUTED, "normal"), (shown.lead, chart.INK, "bold")]
    lines += [(shown.advice.replace("`", ""), chart.INK, "normal"), (shown.passed, chart.MUTED, "normal")]
    rows = shown.rows
    if not layout.has_words:
        rows = tuple(row for row in shown.tasks if row.printed.scores)
    named = [(row.name, row) for row in rows]
    return strips(named, lines, f"Exam of {shown.learner}. {shown.lead}", layout, _captions(shown))


def strips(
    named: Sequence[tuple[str, TaskRow]], lines: Sequence[tuple[str, str, str]], alt: str, layout: Layout = WIDE,
    captions: Sequence[str] = (),
) -> Chart:  # fmt: skip
    """Draw lines of words, and below them for each task its name, its strip, its scores, and its learning curves.

    Args:
        named: what each row is called.
        lines: text, colour and weight; wrapped.
        alt: the picture in words.
        captions: candidates for the line below, where there are no words above; the first that is short enough is drawn.
    """
    with chart.style():
        return Chart(_Picture(named, lines, layout, captions).drawn(), alt, is_tight=False)


def _captions(shown: Card) -> list[str]:
    """Return lines that say what a picture shows, from the longest to the shortest."""
    count = max((len(row.printed.scores) for row in shown.tasks), default=0)
    seeds = plural(count, "seed")
    scale = "0 is the score of random actions, 1 of the expert"
    return [
        f"Scores of {shown.learner} on {shown.suite} after {shown.steps} steps: mean and {seeds}; {scale}.",
        f"Scores of {shown.learner}: mean and {seeds}; {scale}.",
        f"Mean and {seeds}; {scale}.",
        f"Mean and {seeds}; 0: random actions, 1: expert.",
    ]


class _Picture:
    """A picture under way; places are in inches from its upper left corner."""

    def __init__(
        self, named: Sequence[tuple[str, TaskRow]], lines: Sequence[tuple[str, str, str]], layout: Layout,
        captions: Sequence[str],
    ) -> None:  # fmt: skip
        self.named = named
        self.layout = layout
        self.captions = captions
        self.letter = layout.size * LETTER
        self.line = layout.size * 0.0205  # from line to line
        rows = [row for _, row in named]
        known = forms_of(rows)
        self.forms = [form for form in layout.forms if form in known]
        self.marked = known
        self.ends: Ends = score_ends(rows)
        self.has_curves = layout.has_curves and any(row.curves for row in rows)
        self.words = []
        if layout.has_words:
            self.words = self._wrapped(lines)
        self.name_above = 0.0
        if layout.is_stacked:
            self.name_above = self.line
        self.pitch = LANE + self.name_above
        self.top = MARGIN + self.line * len(self.words) + 2.2 * self.line
        self.bottom = self.top + self.pitch * max(1, len(rows))
        ticks = 0.0
        if self.has_curves:
            ticks = 0.15
        lines_below = 1.3
        if captions and not layout.has_words:
            lines_below = 2.3
        self.height = self.bottom + ticks + self.line * lines_below
        self.figure = chart.figure(layout.width, self.height)
        self.page = self.figure.add_axes((0, 0, 1, 1))
        self.page.set_xlim(0, layout.width)
        self.page.set_ylim(self.height, 0)
        self.page.axis("off")

    def _wrapped(self, lines: Sequence[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
        found = []
        for text, color, weight in lines:
            letters = int((self.layout.width - 2 * MARGIN) / self.letter)
            if weight == "normal":
                letters = int(1.12 * letters)
            found += [(part, color, weight) for part in textwrap.wrap(text, letters)]
        return found

    def write(
        self, x: float, y: float, text: str, color: str = chart.INK, size: float | None = None, **look: Any
    ) -> None:
        """Write a text; its middle is at the height."""
        look = {"va": "center_baseline"} | look
        self.page.text(x, y, text, color=color, fontsize=size or self.layout.size, **look)

    def drawn(self) -> Any:
        """Draw all parts, and return the figure."""
        for i, (text, color, weight) in enumerate(self.words):
            self.write(MARGIN, MARGIN + self.line * (i + 0.5), text, color, weight=weight)
        left, right = self._columns()
        for i, (name, row) in enumerate(self.named):
            top = self.top + self.pitch * i + self.name_above
            self._strip(row, left, right, top)
            self._name(name, row, top)
        head = self._axes(left, self.top - self.line, right - left, self.line)
        head.set_xlim(self.ends)
        head.axis("off")
        axis_words(head, self.ends, 0.25, min(self.layout.size, 8))
        self._below()
        return self.figure

    def _columns(self) -> tuple[float, float]:
        """Write the heads of the columns of numbers, and return where strips begin and end."""
        longest = max((len(name) for name, _ in self.named), default=0)
        self.places: dict[str, float] = {}
        right = self.layout.width - MARGIN
        if self.has_curves:
            right -= SPARK + 0.25
            self.spark = right + 0.12
        column = self.letter * 11
        for form in reversed(self.forms):
            self.places[form] = right - column / 2
            right -= column
        if self.layout.is_stacked:
            left = MARGIN
            strip_end = self.layout.width - MARGIN
        else:
            left = MARGIN + self.letter * (longest + 4)
            strip_end = right - 0.05
        size = min(self.layout.size, 8)
        for form, x in self.places.items():
            if not self.layout.is_stacked:
                head = form.replace(" ", "\n", 1)
                self.write(x, self.top - 0.04, head, chart.MUTED, size, ha="center", va="bottom", linespacing=1.0)
        if self.has_curves:
            self.last = max(last_step(row) for _, row in self.named if row.curves)
            head = f"score over\n{steps_words(self.last)} steps"
            middle = self.spark + SPARK / 2
            self.write(middle, self.top - 0.04, head, chart.MUTED, size, ha="center", va="bottom", linespacing=1.0)
        return left, strip_end

    def _axes(self, left: float, top: float, width: float, height: float) -> Any:
        whole = self.layout.width
        return self.figure.add_axes(
            (left / whole, 1 - (top + height) / self.height, width / whole, height / self.height)
        )

    def _strip(self, row: TaskRow, left: float, right: float, top: float) -> None:
        axes = self._axes(left, top + 0.01, right - left, LANE - 0.02)
        axes.set_ylim(-0.5, 0.5)
        backdrop(axes, self.ends)
        marks(axes, row, 0.06, min(self.layout.size, 7.5))
        if self.has_curves and row.curves:
            small = self._axes(self.spark, top + 0.03, SPARK, LANE - 0.06)
            learning_curves(small, row)
            small.axis("off")
            ends = small.get_ylim()
            for score, word in ((1.0, "1"), (0.0, "0")):
                share = (score - ends[0]) / (ends[1] - ends[0])
                y = top + 0.03 + (LANE - 0.06) * (1 - share)
                self.write(self.spark - 0.03, y, word, chart.MUTED, 7, ha="right", va="center")

    def _name(self, name: str, row: TaskRow, top: float) -> None:
        color = GRADES[row.grade]
        y = top + LANE / 2
        if self.layout.is_stacked:
            y = top - self.line / 2
        self.write(MARGIN, y, row.sign, color, weight="bold")
        self.write(MARGIN + self.letter * 2, y, name)
        if self.layout.is_stacked:
            numbers = row.forms[PUBLISHED].words or "–"
            if row.forms[RELABELLED].words:
                numbers += f", relabelled {row.forms[RELABELLED].words}"
            self.write(self.layout.width - MARGIN, y, numbers, color, ha="right")
            return
        for form, x in self.places.items():
            shade = color if form == PUBLISHED else chart.INK
            self.write(x, y, row.forms[form].words or "–", shade, ha="center")

    def _below(self) -> None:
        """Write below the strips what their marks mean, the axis of the curves, and a caption where there are no words."""
        size = min(self.layout.size, 8)
        y = self.bottom + 0.04
        if self.has_curves:
            self.write(self.spark, y, "0", chart.MUTED, 7, ha="center", va="top")
            self.write(self.spark + SPARK, y, steps_words(self.last), chart.MUTED, 7, ha="center", va="top")
        handles = marks_key(self.marked)
        corner = (MARGIN / self.layout.width, 1 - y / self.height)
        self.page.legend(
            handles=handles, loc="upper left", bbox_to_anchor=corner, ncols=len(handles), fontsize=size,
            labelcolor=chart.MUTED, handletextpad=0.3, borderaxespad=0.0, borderpad=0.1, handlelength=0.9,
            columnspacing=0.9,
        )  # fmt: skip
        if self.layout.has_words:
            return
        letters = int((self.layout.width - 2 * MARGIN) / self.letter)
        fitting = [text for text in self.captions if len(text) <= letters]
        if fitting:
            self.write(MARGIN, self.height - self.line / 2, fitting[0])
