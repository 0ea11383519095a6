"""`taskspec report`: exams on the terminal and in files, alone, side by side, or compared with findings of a paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from taskspec.base.columns import Columns
from taskspec.base.display import fixed, interval, plural, visible_json
from taskspec.base.files import near, safe_name, write_text
from taskspec.base.terminal import Console, VisibleText, console, line
from taskspec.cli.console import misuse, say, write_json
from taskspec.cli.options import Json, folder_option, formats_option, split_names

if TYPE_CHECKING:
    from taskspec.exam import Exam
    from taskspec.experiments import LearnersExamined
    from taskspec.language.task.schema.experiments import Experiment
    from taskspec.learn.exam.card import Card
    from taskspec.learn.exam.comparison import LearnersComparison
    from taskspec.learn.exam.score_rows import TaskRow

FORMATS = ("html", "png", "pdf", "svg", "parquet")
GRADES = {"masters": "good", "passes": "warn", "unsure": "warn", "fails": "bad"}
KEY = "● as published  ○ relabelled  | best fixed action  ◂ below −1  ┊ 0.9; 0 is random, 1 the expert"
NARROWEST = 15  # the least width of a strip
WIDEST = 41
OUTCOMES = {"confirmed": "good", "refuted": "bad", "undecided": "warn", "not run": "quiet"}
Folders = Annotated[list[Path], Argument(metavar="FOLDER...", help="Results of exams: folders with an exam.json.")]
Suite = Annotated[
    str | None,
    Option(
        "--findings",
        metavar="SUITE",
        help="Evaluate the findings of a suite; the exams in one folder are a set of results.",
    ),
]


def report(
    folders: Folders,
    format: Annotated[
        list[str] | None, formats_option(FORMATS, "What to write; may be repeated, or given with commas.")
    ] = None,
    output: Annotated[
        Path | None,
        folder_option("Where to write: the exam's own folder, or build/report for several, unless given."),
    ] = None,
    findings: Suite = None,
    json: Json = False,
) -> None:
    """Show and plot the results of an exam, or of several exams side by side.

    For one exam: what is wrong and what to do, scores, diagnoses and flags, and as files a page ([green]html[/]), a
    plot ([green]png[/], [green]pdf[/], [green]svg[/]), or the scores as a table ([green]parquet[/]). For several: a
    matrix of learners and tasks with diagnoses, and as files also strips of scores for each learner and each task.

    With [green]--findings derail[/]: which findings of the paper the exams confirm and which they refute. Exams in the
    same folder ([cyan]results/paper/bc[/], [cyan]results/paper/ppo[/]) are one set. A folder includes all exams below it.
    """
    from taskspec.exam import read
    from taskspec.learn.exam.report import write_several

    if findings is not None:
        _report_findings(findings, folders, output or Path("build/report"), json)
        return
    places = [place for folder in folders for place in _exams_in(folder)]
    exams = {}
    for place in places:
        found = read(place)
        if found["learner"] in exams:
            raise misuse("two of these exams are of the same learner", "give one exam of each")
        exams[found["learner"]] = found
    folder = Path("build/report")
    if len(places) == 1 and places[0].is_dir():
        folder = places[0]
    written = write_several(exams, output or folder, split_names(format))
    if json:
        write_json({"exams": list(exams.values()), "files": list(map(str, written))})
    else:
        show(exams, written)


def show(exams: Mapping[str, Exam], written: Sequence[Path]) -> None:
    """Print an exam, or several side by side, and the files that were written."""
    from taskspec.learn.exam.comparison import compare

    if len(exams) == 1:
        (exam,) = exams.values()
        print_exam(exam)
    else:
        print_several(exams, compare(exams))
    for path in written:
        say(f"wrote {near(path)}")


def _exams_in(folder: Path) -> list[Path]:
    """Return the folders with an exam, where there are some below this one; else what was given."""
    from taskspec.learn.exam.results import NAMES

    if folder.is_file():
        return [folder.parent]
    below = {path.parent for name in NAMES for path in folder.rglob(name)}
    return sorted(below) or [folder]


def print_exam(exam: Mapping[str, Any], out: Console | None = None) -> None:
    """Print the card of an exam, as `exam.json` holds it, with its diagnoses and flags."""
    from taskspec.learn.exam.card import card

    out = out or console()
    shown = card(exam)
    out.print(line((shown.learner, "title"), (f"  {shown.terms}", "quiet")))
    out.print(VisibleText(shown.lead, style="title"))
    for text, style in ((shown.advice, ""), (shown.passed, "quiet")):
        if text:
            out.print(VisibleText(text, style=style))
    out.print()
    out.print(_strips(shown, out.width))
    out.print(VisibleText(KEY, style="quiet"))
    for each in shown.diagnoses:
        out.print()
        out.print(line(("diagnosis ", "warn"), (each["message"], "title")))
        facts = (("", "; ".join(each["evidence"])), *((head, each[head]) for head in ("cause", "try", "source")))
        table = Columns("", "", fold=(1,), styles=("quiet",), gap=1)
        for head, words in facts:
            table.add_row(f"  {head}", VisibleText(words, style="" if head else "quiet"))
        out.print(table)
    if shown.flags:
        out.print()
    for flag in shown.flags:
        out.print(line((flag.kind, "bad"), f"  {flag.words}"))
    if exam.get("laws"):
        out.print()
        out.print(_laws(exam["laws"]))
    for text in shown.notes:
        out.print(VisibleText(text, style="quiet"))
    out.print()
    out.print(VisibleText(shown.costs, style="quiet"))


def _laws(scores: Sequence[Mapping[str, Any]]) -> Columns:
    """Return a row for each law: the tasks that it was tried on, and those where it is broken."""
    from taskspec.exact.rules.score_rules import short_name

    table = Columns("law", "tasks", "broken", right=(1,), styles=("name", "quiet"), fold=(2,))
    for law in dict.fromkeys(score["law"] for score in scores):
        own = [score for score in scores if score["law"] == law]
        tried = [score for score in own if score["error"] is None]
        texts = []
        for score in tried:
            if score["broken"]:
                name = short_name(score["task"])
                texts.append(f"{name} {score['printed']:.2f} → {score['changed']:.2f} (p = {score['p_value']:.2g})")
        if len(tried) < len(own):
            errors = [score["error"].splitlines()[0] for score in own if score["error"] is not None]
            texts.append(f"not tried on {plural(len(errors), 'task')}: {errors[0]}")
        if texts:
            text = VisibleText("; ".join(texts), style="warn")
        else:
            text = VisibleText("no", style="quiet")
        table.add_row(law, str(len(tried)), text)
    return table


def _strips(shown: Card, width: int) -> Columns:
    """Return a row for each task that needs a look: a strip, its scores, and the seeds that pass."""
    from taskspec.learn.exam.score_rows import FIXED, PUBLISHED, SAMPLED, forms_of

    forms = forms_of(shown.rows)
    heads = [form.replace(" ", "\n") for form in forms]
    names = max((len(row.name) for row in shown.rows), default=0)
    taken = 5 + names + sum(2 + max(map(len, head.split())) for head in heads) + 7
    marks = min(max((width - taken) // 2 * 2 - 1, NARROWEST), WIDEST)
    half = marks // 2
    header = f"−1{'0':>{half - 1}}{'1':>{half}}"
    if half > len("random expert"):
        header = f"{'worse':<{half - 2}}random{'expert':>{half - 3}}"
    last = 3 + len(forms)
    table = Columns(
        "", "", header, *heads, "seeds\npass", right=range(3, last + 1), names=1,
        spare=(last, *(3 + forms.index(form) for form in (SAMPLED, FIXED) if form in forms)),
    )  # fmt: skip
    for row in shown.rows:
        style = GRADES.get(row.grade or "fails", "bad")
        numbers = [VisibleText(row.forms[form].words, style=style if form == PUBLISHED else "") for form in forms]
        table.add_row(VisibleText(row.sign, style=style), row.name, _strip(row, marks, style), *numbers, row.passed)
    return table


def _strip(row: TaskRow, width: int, style: str) -> VisibleText:
    """Return the scores of a task as marks on an axis: relabelled ○ joined to published ●, and | for the best fixed action."""
    from taskspec.learn.exam.score_rows import FIXED, FLOOR, PUBLISHED, RELABELLED
    from taskspec.learn.exam.verdicts import MASTERED

    def place(score: float) -> int:
        share = (min(max(score, FLOOR), 1.0) - FLOOR) / (1.0 - FLOOR)
        return round(share * (width - 1))

    cells = [" "] * (width // 2) + ["·"] * (width - width // 2)
    styles = ["quiet"] * width
    cells[place(0.0)] = "│"
    cells[min(place(MASTERED), width - 2)] = "┊"
    means = {form: cell.mean for form, cell in row.forms.items() if cell.mean is not None}
    if FIXED in means:
        cells[place(means[FIXED])] = "|"
    ends = sorted(place(means[form]) for form in (PUBLISHED, RELABELLED) if form in means)
    for i in range(ends[0], ends[-1] + 1) if len(ends) == 2 else ():
        cells[i] = "─"
        styles[i] = style
    for form, mark in ((RELABELLED, "○"), (PUBLISHED, "●")):
        if form in means:
            cells[place(means[form])] = mark if means[form] >= FLOOR else "◂"
            styles[place(means[form])] = style
    text = VisibleText()
    for cell, own in zip(cells, styles, strict=True):
        text.append(cell, own)
    return text


def print_exams(experiment: Experiment, found: LearnersExamined, folder: Path) -> None:
    """Show the exams of an experiment, and write the report of each, and pictures of them all."""
    from taskspec.learn.exam.report import write, write_several
    from taskspec.learn.experiments.picture import draw
    from taskspec.show.figures import chart

    print_matrix(found.exams)
    written: list[Path] = []
    for name, exam in found.exams.items():
        written += write(exam, found.folders[name])
    written += write_several(found.exams, folder, chart.possible(["html", "svg"]))
    if chart.is_available() and any(instance.varied for instance in found.instances):
        path = folder / f"{safe_name(experiment.name)}.svg"
        draw(experiment, found.rows(), path, tuple(found.exams))
        written.append(path)
    for path in written:
        say(f"wrote {near(path)}")


def print_several(exams: Mapping[str, Mapping[str, Any]], found: LearnersComparison) -> None:
    """Print learners side by side: the matrix of scores and diagnoses, and numbers over all runs."""
    from taskspec.learn.exam.comparison import lines

    print_matrix(exams)
    out = console(wide=True)
    out.print()
    table = Columns(
        "", "IQM [95 %]", "above 0.5", "above 0.9", "steps to 0.9", right=range(1, 5), styles=("name",), names=0
    )
    for row in lines(found):
        table.add_row(*row)
    out.print(table)
    for pair in found["pairs"]:
        chance = pair["probability"]
        shown = f"{fixed(chance['value'], 2)} {interval(chance['low'], chance['high'])}"
        out.print(VisibleText(f"P({pair['first']} > {pair['second']}) = {shown} for a run of each on the same task"))


def print_matrix(exams: Mapping[str, Mapping[str, Any]]) -> None:
    """Print learners and tasks as a matrix of scores and diagnoses, and what is wrong with each learner in a line."""
    from taskspec.learn.exam.card import matrix

    found = matrix(exams)
    out = console(wide=True)
    table = Columns("", *found.tasks, right=range(1, len(found.tasks) + 1), styles=("name",), names=0)
    for name, cells in zip(found.learners, found.cells, strict=True):
        words = []
        for cell in cells:
            style = GRADES.get(cell.grade, "quiet")
            words.append(line((cell.score or "·", style), (f"\n{cell.word}" if cell.word else "", "quiet")))
        table.add_row(name, *words)
    out.print(table)
    out.print()
    prose = console()
    for name, own in zip(found.learners, found.cards, strict=True):
        prose.print(line((name, "name"), f"  {own.lead} ", (own.advice, "quiet")))
        for flag in own.flags:
            prose.print(line(("  " + flag.kind, "bad"), f"  {flag.words}"))


def _report_findings(suite: str, folders: Sequence[Path], output: Path, json: bool) -> None:
    """Evaluate a suite's findings, show them, and write them as a page and as JSON data."""
    from taskspec.exam import read
    from taskspec.learn.exam.findings import evaluate, html, markdown, sets_of, setups

    places = dict.fromkeys(place.resolve() for folder in folders for place in _exams_in(folder))
    exams = {place: read(place) for place in places}
    found = evaluate(suite, sets_of(exams))
    how = setups(list(exams.values()))
    texts = {"md": markdown(found, how), "html": html(found, how), "json": visible_json(found.data) + "\n"}
    for suffix, text in texts.items():
        write_text(output / f"findings.{suffix}", text)
    if json:
        write_json(found.data)
        return
    table = Columns("", "the paper says", *found.sets, fold=(1,), styles=("name",), names=1)
    for each in found.results:
        outcomes = map(each.outcome, found.sets)
        table.add_row(each.name, each.entry.says, *(VisibleText(word, style=OUTCOMES[word]) for word in outcomes))
    counts = list(map(found.counts, found.sets))
    for outcome, style in OUTCOMES.items():
        numbers = [str(count[outcome]) for count in counts]  # type: ignore[index]  # the same words
        table.add_row("", VisibleText(outcome, style=style), *numbers)
    console(wide=True).print(table)
    for suffix in texts:
        say(f"wrote {near(output / f'findings.{suffix}')}")
