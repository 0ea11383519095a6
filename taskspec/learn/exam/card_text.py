"""Cards of exams as text and tables on the terminal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from taskspec.base.display import fixed, interval, plural
from taskspec.learn.documents.seed_scores import short_name
from taskspec.learn.exam.card import Card, LearnerMatrix, card, matrix, nearest
from taskspec.learn.exam.comparison import LearnersComparison, compare, lines
from taskspec.learn.exam.results import Exam
from taskspec.learn.exam.score_rows import FIXED, FLOOR, PUBLISHED, RELABELLED, SAMPLED, TaskRow, forms_of
from taskspec.learn.exam.verdicts import MASTERED
from taskspec.show.terminal.styled_text import Columns, VisibleText, console, line

GRADES = {"masters": "good", "passes": "warn", "unsure": "warn", "fails": "bad"}
BOTH = "as published and relabelled"
CLIPPED = "below −1"
RANDOM = "random actions: 0"
MARKS = {PUBLISHED: "●", RELABELLED: "○", BOTH: "◉", FIXED: "◆", CLIPPED: "◂", RANDOM: "│", str(MASTERED): "┊"}
"""The marks of a strip; each means one thing."""
NARROWEST = 15  # the least width of a strip
WIDEST = 41
Printed = VisibleText | Columns | str


def print_exams(exams: Mapping[str, Exam]) -> None:
    """Print the card of an exam; of several, their matrix, what is wrong with each learner, and numbers over all runs.

    Args:
        exams: what `exam.json` holds, by the name of the learner.
    """
    if len(exams) == 1:
        (exam,) = exams.values()
        prose = console()
        for part in card_text(card(exam), prose.width):
            prose.print(part)
        return
    print_matrix(exams)
    wide = console(wide=True)
    wide.print()
    for part in comparison_text(compare(exams)):
        wide.print(part)


def print_matrix(exams: Mapping[str, Exam]) -> None:
    """Print learners and tasks as a matrix of scores and flags, and what is wrong with each learner."""
    found = matrix({name: card(exam) for name, exam in exams.items()})
    wide = console(wide=True)
    wide.print(matrix_text(found))
    wide.print()
    prose = console()
    for part in leads_text(found):
        prose.print(part)


def card_text(shown: Card, width: int) -> Iterator[Printed]:
    """Yield the card of an exam, with the nearest known mistakes and its flags, from top to bottom.

    Args:
        shown: the card.
        width: of the terminal, in letters.
    """
    yield line((shown.learner, "title"), (f"  {shown.terms}", "quiet"))
    yield VisibleText(shown.lead, style="title")
    for text, style in ((shown.advice, ""), (shown.passed, "quiet")):
        if text:
            yield VisibleText(text, style=style)
    yield ""
    table, drawn = _strips(shown, width)
    yield table
    yield VisibleText("  ".join(f"{mark} {meaning}" for meaning, mark in MARKS.items() if mark in drawn), style="quiet")
    for each in shown.diagnoses:
        yield ""
        yield VisibleText(nearest(each), style="warn")
        table = Columns("", "", fold=(1,), styles=("quiet",), gap=1)
        table.add_row("  ", VisibleText("; ".join(each["evidence"]), style="quiet"))
        for head in ("cause", "try", "source"):
            table.add_row(f"  {head}", VisibleText(each[head]))
        yield table
    if shown.flags:
        yield ""
    for flag in shown.flags:
        yield line((flag.kind, "bad"), f"  {flag.words}")
    if shown.laws:
        yield ""
        yield _laws(shown.laws)
    for text in shown.notes:
        yield VisibleText(text, style="quiet")
    yield ""
    yield VisibleText(shown.facts["Cost"], style="quiet")


def _laws(scores: Sequence[Mapping[str, Any]]) -> Columns:
    """Return a row for each law: the tasks that it was tried on, and those where it is broken."""
    table = Columns("law", "tasks", "broken", right=(1,), styles=("name", "quiet"), fold=(2,))
    by_law: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for score in scores:
        by_law[score["law"]].append(score)
    for law, own in by_law.items():
        texts = []
        errors = []
        for score in own:
            if score["error"] is not None:
                errors.append(score["error"].splitlines()[0])
            elif score["broken"]:
                name = short_name(score["task"])
                texts.append(f"{name} {score['printed']:.2f} → {score['changed']:.2f} (p = {score['p_value']:.2g})")
        if errors:
            texts.append(f"not tried on {plural(len(errors), 'task')}: {errors[0]}")
        text = VisibleText("no", style="quiet")
        if texts:
            text = VisibleText("; ".join(texts), style="warn")
        table.add_row(law, str(len(own) - len(errors)), text)
    return table


def _strips(shown: Card, width: int) -> tuple[Columns, str]:
    """Return a row for each task that needs a look: a strip, its scores, and the seeds that pass; and all strips as a text."""
    forms = forms_of(shown.rows)
    heads = [form.replace(" ", "\n") for form in forms]
    names = max((len(row.name) for row in shown.rows), default=0)
    taken = 5 + names + 7
    for head in heads:
        taken += 2 + max(map(len, head.split()))
    marks = min(max((width - taken) // 2 * 2 - 1, NARROWEST), WIDEST)
    half = marks // 2
    header = f"−1{'0':>{half - 1}}{'1':>{half}}"
    if half > len("random expert"):
        header = f"{'worse':<{half - 2}}random{'expert':>{half - 3}}"
    last = 3 + len(forms)
    spare = [last]
    for form in (SAMPLED, FIXED):
        if form in forms:
            spare.append(3 + forms.index(form))
    right = range(3, last + 1)
    table = Columns("", "", header, *heads, "seeds\npass", right=right, names=1, spare=spare)
    drawn = ""
    for row in shown.rows:
        style = GRADES.get(row.grade or "fails", "bad")
        strip = _strip(row, marks, style)
        drawn += strip.plain
        styles = dict.fromkeys(forms, "") | {PUBLISHED: style}
        numbers = [VisibleText(row.forms[form].words, style=styles[form]) for form in forms]
        table.add_row(VisibleText(row.sign, style=style), row.name, strip, *numbers, row.passed)
    return table, drawn


def _strip(row: TaskRow, width: int, style: str) -> VisibleText:
    """Return the scores of a task as marks on an axis; those of the relabelled task are joined to the published ones."""

    def place(score: float) -> int:
        share = (min(max(score, FLOOR), 1.0) - FLOOR) / (1.0 - FLOOR)
        return round(share * (width - 1))

    cells = [" "] * (width // 2) + ["·"] * (width - width // 2)
    styles = ["quiet"] * width
    cells[place(0.0)] = MARKS[RANDOM]
    cells[min(place(MASTERED), width - 2)] = MARKS[str(MASTERED)]
    means = row.means
    if FIXED in means:
        cells[place(means[FIXED])] = MARKS[FIXED]
    ends = sorted(place(means[form]) for form in (PUBLISHED, RELABELLED) if form in means)
    for i in range(ends[0], ends[-1] + 1) if len(ends) == 2 else ():
        cells[i] = "─"
        styles[i] = style
    for form in (RELABELLED, PUBLISHED):
        if form not in means:
            continue
        mark = MARKS[form]
        if len(ends) == 2 and ends[0] == ends[1]:
            mark = MARKS[BOTH]
        if means[form] < FLOOR:
            mark = MARKS[CLIPPED]
        cells[place(means[form])] = mark
        styles[place(means[form])] = style
    text = VisibleText()
    for cell, own in zip(cells, styles, strict=True):
        text.append(cell, own)
    return text


def matrix_text(found: LearnerMatrix) -> Columns:
    """Return learners and tasks as a matrix of scores and flags."""
    table = Columns("", *found.tasks, right=range(1, len(found.tasks) + 1), styles=("name",), names=0)
    for name, cells in zip(found.learners, found.cells, strict=True):
        words = []
        for cell in cells:
            style = GRADES.get(cell.grade or "", "quiet")
            below = ""
            if cell.word:
                below = f"\n{cell.word}"
            words.append(line((cell.printed.words or "·", style), (below, "quiet")))
        table.add_row(name, *words)
    return table


def leads_text(found: LearnerMatrix) -> Iterator[Printed]:
    """Yield what is wrong with each learner, and its flags."""
    for name, own in zip(found.learners, found.cards.values(), strict=True):
        yield line((name, "name"), f"  {own.lead} ", (own.advice, "quiet"))
        for flag in own.flags:
            yield line(("  " + flag.kind, "bad"), f"  {flag.words}")


def comparison_text(found: LearnersComparison) -> Iterator[Printed]:
    """Yield numbers over all runs of learners, and the chance that one is better than another."""
    table = Columns(
        "", "IQM [95 %]", "above 0.5", "above 0.9", "steps to 0.9", right=range(1, 5), styles=("name",), names=0
    )
    for row in lines(found):
        table.add_row(*row)
    yield table
    for pair in found["pairs"]:
        chance = pair["probability"]
        shown = f"{fixed(chance['value'], 2)} {interval(chance['low'], chance['high'])}"
        yield VisibleText(f"P({pair['first']} > {pair['second']}) = {shown} for a run of each on the same task")
