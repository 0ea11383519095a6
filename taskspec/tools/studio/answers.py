"""The answers to questions of a page about a text: its page, figure, scores and claims, sweeps, other forms, results in files.

This runs in processes of its own (see `processes`). Everything that it says comes from the other folders of the package.
"""

from __future__ import annotations

import copy
import json
import math
import shlex
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import SpecError, TaskspecError, raise_if_errors, records, spec_error
from taskspec.base.display import decimal, json_data
from taskspec.base.ids import assigned
from taskspec.base.named import entries_by_name
from taskspec.exact.check.report import Report
from taskspec.exact.rules.claim_verdicts import verdicts
from taskspec.exact.rules.examples import wrong_examples
from taskspec.exact.scores.returns import Results
from taskspec.exact.soundness.soundness import examine
from taskspec.language.registry import suite_of
from taskspec.language.source import packed
from taskspec.language.task.parts import Parameter
from taskspec.language.task.task import Task
from taskspec.learn.documents.document_models import Experiment
from taskspec.learn.exam import report, results
from taskspec.learn.exam.card import card
from taskspec.learn.experiments.experiment_file import RETURNS
from taskspec.learn.experiments.instances import Instance
from taskspec.learn.experiments.picture import figure
from taskspec.learn.experiments.sweeping import Measured, Questions, measure
from taskspec.learn.jobs.work import Late, interrupted, late
from taskspec.show.bibliography import beside
from taskspec.show.figures import chart, scene, svg
from taskspec.show.pages import gather, page
from taskspec.show.pages.facts import Facts, Setting, by_claim, lines
from taskspec.show.pages.hypertext import HtmlWriter, article
from taskspec.show.pages.render.html import marked_states
from taskspec.show.pages.render.latex import document
from taskspec.show.pages.render.markdown import markdown
from taskspec.show.pages.render.suite import Suite
from taskspec.show.pages.sections import results as result_sections
from taskspec.show.pages.write import gather_pages
from taskspec.tools.studio import episodes
from taskspec.tools.studio.folder import FileRefused, Folder, text_of
from taskspec.tools.targets import File, name_of, task_in, variants_of


class Question:
    """A question about a text, as a page sends it: `text`, the `path` of its file, `settings`, and what else the kind needs."""

    def __init__(self, message: Mapping[str, Any], folder: Folder) -> None:
        self.message = message
        self.folder = folder
        self.place = folder.place(message.get("path") or "untitled.yaml")
        settings = message.get("settings") or {}
        self.parameters: dict[str, Any] = settings.get("parameters") or {}
        self.modifiers = tuple(settings.get("modifiers") or ())
        text = str(message.get("text", ""))
        self.file = File(self.place, suite_of(self.place), None, self.parameters, self.modifiers, text)
        self.variant: str | None = settings.get("variant")

    @cached_property
    def task(self) -> Task:
        """The task in question, at the values of the settings."""
        return self.at({})

    def at(self, values: Mapping[str, Any]) -> Task:
        """Return the task with other values of some parameters."""
        variant = self.variant or variants_of(self.file)[0]
        return task_in(replace(self.file, parameters={**self.parameters, **values}), variant)


def answered(message: bytes, root: Path) -> bytes:
    """Return the answer to a question; mistakes in the text are an answer, too."""
    start = time.perf_counter()
    given = json.loads(message)
    try:
        answer = {"ok": True, **KINDS[given["kind"]](Question(given, Folder(root)))}
    except SpecError as error:
        first = error.diagnostics[0]
        answer = {"ok": False, "message": first.message, "hint": first.hint, "problems": records(error.diagnostics)}
    except FileRefused as error:
        answer = {"ok": False, "message": str(error), "refused": error.why}
    except TaskspecError as error:  # such as an action of a policy in a file that is none
        answer = {"ok": False, "message": str(error)}
    except Exception as error:  # a mistake of ours, or a message of another form
        answer = {"ok": False, "message": f"this could not be worked out: {type(error).__name__}: {error}"}
    answer |= {"id": given.get("id"), "kind": given["kind"], "milliseconds": 1000 * (time.perf_counter() - start)}
    return json.dumps(json_data(answer), ensure_ascii=False, default=str).encode(errors="replace")


# -- the page and the scores ------------------------------------------------------------------------------------------


def task_page(asked: Question) -> dict[str, Any]:
    """Return the mathematics, the figure, the parameters and the variants."""
    task = asked.task
    shown_page = page(task)
    drawn = scene(task)
    writer = HtmlWriter(beside([str(asked.place)]), marked_states(shown_page))
    sections = [section for section in shown_page.sections if section.key != "claims"]
    heading = shown_page.name
    if shown_page.title != shown_page.name:
        heading = f"{shown_page.name}: {shown_page.title}"
    variants = []
    for each in variants_of(asked.file):
        variants.append({"name": each, "title": name_of(asked.file, each)})
    return {
        "name": task.name, "title": task.title, "capability": task.spec.capability or "", "id_of_task": task.id,
        "mathematics": article(heading, shown_page.summary, shown_page.description, sections, writer),
        "figure": episodes.svg_of(drawn), "caption": getattr(drawn, "caption", ""), "variants": variants,
        "parameters": [_parameter(p) for p in task.parameters],
        "actions": episodes.keys(task), "horizon": task.horizon, "has_expert": task.annotations.expert is not None,
    }  # fmt: skip


def _parameter(p: Parameter) -> dict[str, Any]:
    fields = ("name", "kind", "low", "high", "default", "value", "doc")
    return {name: getattr(p, name) for name in fields} | {"choices": p.values}


def scores(asked: Question) -> dict[str, Any]:
    """Return exact returns; a task that is not sound has none."""
    task = asked.task.with_annotations(claims=(), examples=())
    sound = examine(task)
    raise_if_errors(sound.diagnostics)
    solved = results_of(task)
    facts = gather(Report(task, (), sound.method, results=solved))
    title = "Exact scores" if solved.model is not None else "Scores"
    return {"title": title, "rows": list(_rows(task, facts)), "states": facts.states, "remark": solved.why_not}


def claims(asked: Question) -> dict[str, Any]:
    """Return the claims with their mathematics and verdicts, and what is wrong with claims and examples."""
    task = asked.task
    said = tuple(verdicts(task, results_of(task), results_of))
    (section,) = result_sections([Setting("", task, Facts())])
    writer = HtmlWriter({})
    shown = []
    for claim, line, fact in zip(task.annotations.claims, section.lines, by_claim(task, said), strict=True):
        own = [verdict for verdict in said if verdict.claim is claim]
        worst = min(own, key=lambda verdict: bool(verdict.holds))
        shown.append({
            "text": claim.text, "html": writer.prose(line.content), "status": worst.status, "holds": fact.holds,
            "words": fact.text, "detail": worst.detail, "line": claim.expr.place.span.line,
        })  # fmt: skip
    problems = list(filter(None, [verdict.diagnostic for verdict in said]))
    problems += [diagnostic for _, diagnostic in wrong_examples(task)]
    return {"claims": shown, "problems": records(problems)}


KEPT = 16
LARGE = 1_000_000
"""Tasks whose results are kept, and entries of their models together."""
_results: dict[tuple[str, ...], Results] = {}


def results_of(task: Task) -> Results:
    """Return the results of a task; the last ones are kept, so that words and claims can change without another model."""
    key = (task.content_hash, *map(str, task.modifiers))
    if key not in _results:
        entries = 0
        for each in _results.values():
            if each.model is not None:
                entries += each.model.entries
        if len(_results) >= KEPT or entries > LARGE:
            _results.clear()
        _results[key] = Results(task)
    kept = copy.copy(_results[key])
    kept.task = task
    _results[key] = kept
    return kept


def _rows(task: Task, facts: Facts) -> Iterator[dict[str, Any]]:
    writer = HtmlWriter({})
    for label, *value in lines(task, facts):
        name = label.text.strip()  # type: ignore[union-attr]
        score = facts.scores.get(name)
        row = {"label": name, "html": writer.prose(tuple(value)), "exact": None, "decimal": None, "estimated": False}
        if score is not None:
            number = float(score.value)
            row |= {"decimal": decimal(number, 10), "estimated": not score.exact}
            if score.exact:
                row["exact"] = episodes.fraction(number)
        yield row


# -- other answers ----------------------------------------------------------------------------------------------------

POINTS = 12
"""Values of a parameter in a sweep, unless the page gives them."""
AT_ONCE = 1.0
AT_MOST = 20.0
"""Seconds of a sweep after which what is known is sent, and seconds that one value may take."""
_measured: dict[tuple[Any, ...], Measured] = {}
"""What was measured for the sweeps of this process."""


def sweep(asked: Question) -> dict[str, Any]:
    """Return exact returns at several values of a parameter, and their curves; `left` are values to ask for again."""
    task = asked.task
    name = asked.message["parameter"]
    parameter = entries_by_name(task.parameters).get(name)
    if parameter is None:
        raise spec_error("E713", f"{task.id} has no parameter '{name}'")
    start = time.perf_counter()
    rows = []
    left = []
    for value in asked.message.get("values") or values_of(parameter):
        key = (task.content_hash, asked.modifiers, name, repr(value))
        if key in _measured or time.perf_counter() - start < AT_ONCE:
            given = {**asked.parameters, name: value}
            instance = Instance(task.id, "", task.source.variant, given, asked.modifiers, {name: value})
            _measured[key] = _measured.get(key) or _measure(task, instance)
            rows.append(_measured[key])
        else:
            left.append(value)
    known = set()
    for row in rows:
        known |= {key for key, value in row.values.items() if value is not None}
    shown = [key for key in RETURNS if key in known]
    drawn = None
    if shown and chart.is_available():
        plot = {"x": name, "show": shown}
        about = Experiment(experiment=1, name=task.name, title=task.id, tasks=[{"task": task.id}], plot=plot)  # type: ignore[arg-type, list-item]
        drawn = chart.svg(figure(about, rows))
    table = []
    for row in rows:
        entry = {"value": row.instance.varied[name], "error": row.error}
        for column in RETURNS:
            entry |= {column: row.values.get(column), f"{column}_half": row.values.get(f"{column}_half")}
        table.append(entry)
    return {"parameter": name, "chart": drawn, "left": left, "rows": table}


def _measure(task: Task, instance: Instance) -> Measured:
    try:
        with interrupted(AT_MOST):
            values = measure(packed(task.source.document), task.source.suite, instance, Questions(()))
        return Measured(instance, "done", values)
    except SpecError as error:
        return Measured(instance, "failed", error=error.diagnostics[0].message)
    except Late:
        return Measured(instance, "timed_out", error=late(AT_MOST))


def values_of(p: Parameter) -> list[Any]:
    """Return values of a parameter for a sweep: all of a few, else some in even steps around its present value."""
    if p.values is not None:
        return list(p.values)
    if p.kind == "bool":
        return [False, True]
    size = max(abs(p.value), 1)
    low = p.value - size if p.low is None else p.low
    high = low + 4 * size
    if p.high is not None:
        high = min(p.high, max(high, p.value))
    if p.kind == "int":
        step = max(1, math.ceil((high - low) / (POINTS - 1)))
        return list(range(int(low), int(high) + 1, step))
    return [low + (high - low) * i / (POINTS - 1) for i in range(POINTS)]


MOST_RESULTS = 40


def results_in_files(asked: Question) -> dict[str, Any]:
    """Return the cards of exams and the plots in the folder, the newest first."""
    exams = []
    places = sorted(asked.folder.files("exam.json", "exam.json.gz", ".svg"), key=lambda place: -place.stat().st_mtime)
    for place in places[:MOST_RESULTS]:
        entry = {"path": asked.folder.relative(place), "title": place.stem}
        with suppress(SpecError):  # too large, or not an exam of this version
            if place.suffix == ".svg":
                entry |= {"kind": "plot", "svg": text_of(place)}
            else:
                exam = results.read(place.parent)
                entry |= {"kind": "exam", "title": exam["learner"], "html": report.page(card(exam))}
            exams.append(entry)
    return {"results": exams, "more": max(0, len(places) - MOST_RESULTS)}


def copied(asked: Question) -> dict[str, Any]:
    """Return the task in another form."""
    form = asked.message["format"]
    if form not in FORMS:
        raise spec_error("E726", f"'{form}' is not a form of a task", f"use {', '.join(FORMS)}")
    return {"format": form, "text": FORMS[form](asked)}


def _page_in(asked: Question, written: Callable[[Suite], dict[str, str]], ending: str) -> str:
    suite = gather_pages([asked.task])
    return written(suite)[f"{suite.pages[0].anchor}.{ending}"]


def _svg(asked: Question) -> str:
    drawn = scene(asked.task)
    if drawn is None:
        raise spec_error("E713", f"{asked.task.id} has no figure that can be drawn")
    return svg(drawn)


def _python(asked: Question) -> str:
    given = [f"{name}={value!r}" for name, value in asked.parameters.items()]
    if asked.variant is not None:
        given.insert(0, f"variant={asked.variant!r}")
    if asked.modifiers:
        given.append(f"modifiers={list(asked.modifiers)!r}")
    path = asked.folder.relative(asked.place)
    return f"import taskspec\n\nenv = taskspec.make({', '.join([repr(path), *given])})\n"


def _command(asked: Question) -> str:
    options = ["-v", asked.variant] if asked.variant is not None else []
    for each in asked.parameters.items():
        options += ["-p", assigned([each])]
    for modifier in asked.modifiers:
        options += ["-m", modifier]
    path = asked.folder.relative(asked.place)
    given = shlex.join([path, *options])
    return f"taskspec check {given}\ntaskspec solve {given}\ntaskspec run {given}\n"


FORMS: dict[str, Callable[[Question], str]] = {
    "latex": lambda asked: _page_in(asked, document, "tex"),
    "markdown": lambda asked: _page_in(asked, markdown, "md"),
    "svg": _svg, "python": _python, "command": _command,
}  # fmt: skip


KINDS: dict[str, Callable[[Question], dict[str, Any]]] = {
    "page": task_page, "scores": scores, "claims": claims, "sweep": sweep, "results": results_in_files, "copy": copied,
    "values": lambda asked: episodes.values(results_of(asked.task), asked.message),
    "play": lambda asked: episodes.play(results_of(asked.task), asked.message),
    "rollout": lambda asked: episodes.rollout(asked.task, asked.message, asked.folder),
}  # fmt: skip
"""What answers each kind of question."""
