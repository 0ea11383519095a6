"""What notebooks show of a task, its results, scores, a report, a figure and an exam."""

import json
from html.parser import HTMLParser
from xml.etree import ElementTree

import taskspec
from taskspec.exact import Results, check, scores
from taskspec.exam import read as read_exam
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.pages.page import page
from tests.shared.sections import build_text, text


class Cells(HTMLParser):
    """The text of every cell, row by row; tags that are left open are an error."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


def test_scores_and_reports_are_tables() -> None:
    task = taskspec.load("Branching", L=4)
    shown = Cells(scores(task)._repr_html_()).rows
    assert shown[0] == ["return", "value", "error", "status"]
    assert ["random", "0.0625", "0.0", "exact"] in shown
    report = check(task)
    rows = Cells(report._repr_html_()).rows[1:]
    assert [row[0] for row in rows] == [v.status for v in report.verdicts]
    assert rows[0][2] == "optimal_return == 1"


def test_one_warning_is_not_warnings() -> None:
    report = check(build_text(text(parameters="{p: {type: int, default: 1}}")))
    assert [d.code for d in report.warnings] == ["W506"]
    assert ": 0 errors, 1 warning<" in report._repr_html_() and ": 1 problem, 0 verdicts>" in repr(report)


def test_a_task_tells_what_it_has() -> None:
    rows = Cells(taskspec.load("Branching", L=4)._repr_html_()).rows
    assert ["parameter", "L", "4", "number of choices on the path"] in rows
    assert ["state", "s", "int", "position, a multiple of B on the path and anything else in a dead end"] in rows
    assert ["horizon", "", "4", ""] in rows and ["observations", "", "Discrete(9)", ""] in rows


def test_a_task_shows_its_figure_and_mathematics() -> None:
    html = taskspec.load("RiskyPath")._repr_html_()
    assert html.count("<svg") == 1 and "<h2>RiskyPath" in html and "<math" in html
    assert taskspec.load("RiskyPath", modifiers=["sticky=0.5"])._repr_html_().count("<h2>") == 0


def test_results_are_returns_and_a_figure_of_the_best_values_and_actions() -> None:
    found = Results("RiskyPath")
    html = found._repr_html_()
    assert ["random", "−122.21875", "exact"] in Cells(html).rows
    assert taskspec.drawing("RiskyPath", ["values", "policy"]).svg in html
    assert "<svg" not in Results("classic_control/MountainCar", episodes=10)._repr_html_()


def test_an_exam_is_a_card() -> None:
    exam = read_exam("derail/bc")
    html = exam._repr_html_()
    assert html.startswith("<svg") and "bc" in Cells(html).text
    assert json.loads(json.dumps(exam)) == exam


def test_figures_are_drawn_in_memory() -> None:
    task = taskspec.load("RiskyPath")
    found = taskspec.drawing(task)._repr_svg_()
    assert found is not None and found == taskspec.drawing("RiskyPath")._repr_svg_()
    assert ElementTree.fromstring(found).tag == "{http://www.w3.org/2000/svg}svg"
    assert found != taskspec.drawing(task, ["values"]).svg


HOSTILE = """
taskspec: 1
name: Hostile
summary: <script>alert(1)</script>
state: {s: {type: bool, doc: "<b>&"}}
action: {a: {type: bool}}
initial: {s: false}
dynamics: {s': a}
horizon: 3
reward: s
claims: [1 < 0]
"""


def test_nothing_that_a_spec_holds_is_read_as_html() -> None:
    task = build(read_text(HOSTILE), None, {}, "")
    for shown in (task, check(task)):
        html = shown._repr_html_()
        assert "<script" not in html and "<b>" not in html
    assert ["state", "s", "bool", "<b>&"] in Cells(task._repr_html_()).rows
    assert "error E601" in {row[0] for row in Cells(check(task)._repr_html_()).rows}


def test_a_page_shows_what_is_printed() -> None:
    task = taskspec.load("NoisyObs")
    shown = Cells(page(task)._repr_html_())
    assert "<h2>NoisyObs" in page(task)._repr_html_()
    assert "Observations" in shown.text and "Dynamics" in shown.text and "Corrections to the source" in shown.text
    unsafe = read_text(SPEC.replace("SUMMARY", "<script>alert(1)</script>"))
    assert "<script>" not in page(build(unsafe))._repr_html_()


SPEC = """
taskspec: 1
name: Walk
summary: SUMMARY
state: {s: {type: int, low: 0, high: 5}}
action: {a: {type: bool}}
horizon: 9
initial: {s: 0}
dynamics: {s': "min(s + a, 5)"}
reward: s'
"""
