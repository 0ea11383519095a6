"""Reports of exams: what a terminal, a page, a picture and a table show of results, against the results themselves."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from html.parser import HTMLParser
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from matplotlib.colors import to_hex
from matplotlib.image import imread

from docs.tools.pictures import DARK, LIGHT, Theme, recolored
from taskspec.base.diagnostics import SpecError
from taskspec.base.display import duration
from taskspec.exam import read
from taskspec.learn.exam import card_charts as pictures
from taskspec.learn.exam import card_picture, findings, report
from taskspec.learn.exam.card import card, matrix
from taskspec.learn.exam.card_text import print_exams
from taskspec.learn.exam.score_rows import FLOOR, RELABELLED, task_rows
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart
from tests.shared.charts import assert_legible, contrast, texts
from tests.shared.commands import Done
from tests.shared.exams import TITLES, entry, exam
from tests.shared.folders import names

RESULTS = Path(__file__).parents[3] / "docs" / "results" / "paper"
PRINTED: dict[str, Any] = {
    "RiskyPath": 1.0, "EarlyTermPos": 1.0, "EarlyTermNeg": [-1.6, -1.8] * 7, "Branching": np.linspace(0, 1, 14).tolist(),
    "NoisyObs": 0.85, "Parabola": np.linspace(0.94, 0.98, 14).tolist(),
}  # fmt: skip
TWINS = {"RiskyPath": 0.2, "EarlyTermPos": 1.0}


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    found = exam(PRINTED, TWINS, seeds=14, learner="gail <im> & co")
    found["scores"] += [entry("Sort", seed, None) for seed in range(14)]
    for score in found["scores"]:
        if score["task"] == "derail/Branching-v0":
            score["curve"] = [[0, 0.0], [250_000, 0.5], [500_000, score["deterministic"]]]
    found["diagnoses"] = findings.diagnose(found, "derail")
    effect = {"effect": -0.8, "low": -0.9, "high": -0.7}
    found["flags"] = [{"kind": "twin", "task": "derail/RiskyPath-v0", "message": "differs from its <twins>", **effect}]
    return found


def rows_of(results: dict[str, Any]) -> dict[str, Any]:
    return {row.name: row for row in task_rows(results)}


def test_rows_are_the_tasks_with_the_scores_of_their_seeds(results: dict[str, Any]) -> None:
    rows = rows_of(results)
    assert list(rows) == list(TITLES)
    assert rows["Branching"].printed.scores == pytest.approx(np.linspace(0, 1, 14))
    assert rows["RiskyPath"].forms[RELABELLED].scores == pytest.approx([0.2] * 14)  # the mean over its two twins
    assert (rows["Sort"].printed.scores, rows["Sort"].printed.failed) == ((), 14)
    assert rows["RiskyPath"].optimum == 1.0
    masters = {"EarlyTermPos", "Parabola"}
    fails = {"RiskyPath", "EarlyTermNeg", "Branching", "NoisyObs"}
    for name, row in rows.items():
        assert (row.grade == "masters") == (name in masters)
        assert (row.grade == "fails") == (name in fails)


def test_positions_are_clipped_and_numbers_are_not(results: dict[str, Any]) -> None:
    row = rows_of(results)["EarlyTermNeg"]
    assert row.printed.words == "−1.70" and pictures.clipped(row.printed.scores) == [-1.0] * 14
    curves = (((0.0, 0.0), (1.0, -3.0)), ((0.0, 0.0), (1.0, 1.0)))
    assert pictures.mean_curve(curves) == ([0.0, 1.0], [0.0, -1.0])


def test_the_first_line_has_scores_and_the_second_one_the_nearest_mistake(results: dict[str, Any]) -> None:
    shown = card(results)
    assert shown.lead.startswith("Fails EarlyTermNeg −1.70, ") and "reward" not in shown.lead
    assert shown.lead.endswith(" and Sort (it raised an error).")
    mistake = "Nearest known mistake: prolongs episodes: its learned reward is positive."
    assert shown.advice == f'{mistake} Let terminal states absorb (`ending="absorb"`) and learn their reward as well.'
    assert [row.name for row in shown.rows] == ["EarlyTermNeg", "RiskyPath", "Branching", "NoisyObs", "Sort"]
    assert shown.passed == "Passed: EarlyTermPos 1.00, Parabola 0.96."


def test_without_twins_what_one_fixed_action_passes_is_told_apart() -> None:
    found = exam({"EarlyTermPos": 1.0, "Parabola": 1.0, "Sort": 0.5})
    assert card(found).passed == "Passed: Parabola 1.00. Passes, but so does one fixed action: EarlyTermPos 1.00."
    assert card(exam({"EarlyTermPos": 1.0})).lead == "Passes, but so does one fixed action: EarlyTermPos."


@pytest.mark.parametrize(
    ("scores", "seeds", "lead"),
    [
        ({"Sort": 0.5, "Parabola": 1.0}, 15, "Fails Sort 0.50."),
        ({"Sort": 1.0, "Parabola": 1.0}, 15, "Passes 2 tasks."),
        ({"Sort": 1.0, "Parabola": 1.0}, 3, "Nothing fails; undecided after 3 seeds: Parabola and Sort."),
    ],
)
def test_the_first_line_without_a_diagnosis(scores: dict[str, float], seeds: int, lead: str) -> None:
    assert card(exam(scores, seeds=seeds)).lead == lead


def test_the_same_flag_on_several_tasks_is_one_line() -> None:
    def flag(task: str, effect: float) -> dict[str, Any]:
        message = f"the score is {-effect:.2f} lower (p = 5e-05)"
        return {"kind": "twin", "task": task, "message": message, "effect": effect, "low": None, "high": None}

    flags = [flag("derail/Sort-v0", -1.0), flag("derail/NoisyObs-v0", -4.27), flag("derail/Parabola-v0", -2.0)]
    (found,) = card(exam({"Sort": 0.5}) | {"flags": flags}).flags
    assert found.words == "NoisyObs: the score is 4.27 lower (p = 5e-05). The same on Parabola and Sort."


def test_what_an_exam_took_is_told_in_words() -> None:
    assert duration(84) == "84 s" and duration(720) == "12 min" and duration(9000) == "2.5 h"


def test_the_terminal_shows_all_of_it(
    results: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    print_exams({"one": results})
    out = re.sub(" +", " ", capsys.readouterr().out)
    for pattern in (
        "Passed: EarlyTermPos 1.00, Parabola 0.96.", "✗ RiskyPath.*○.*●.*1.00 0.20 1.00 0/14", "✗ EarlyTermNeg.*◂.*−1.70 1.00.*",
        "nearest known mistake: prolongs episodes: its learned reward.*", "try Let terminal states absorb.*",
        "twin RiskyPath: differs from its <twins>",
    ):  # fmt: skip
        assert re.search(f"^ ?{pattern} ?$", out, re.MULTILINE), pattern


class Page(HTMLParser):
    """The texts of a page by the classes around them, and everything that it would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[tuple[str, str]] = []
        self.loads: list[str] = []
        self.counts: dict[str, int] = {}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.loads += found.keys() & {"src", "href", "srcset", "action"}
        if tag in ("script", "link", "iframe", "img"):
            self.loads.append(tag)
        name = found.get("class") or tag
        self.counts[name] = self.counts.get(name, 0) + 1
        if tag not in ("meta", "path", "rect", "circle", "polygon"):
            self.open.append(name)

    def handle_endtag(self, tag: str) -> None:
        if tag not in ("path", "rect", "circle", "polygon"):
            self.open.pop()

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.texts.append((self.open[-1], data.strip()))


def test_the_page_stands_alone_and_shows_every_seed(results: dict[str, Any], tmp_path: Path) -> None:
    (path,) = report.write(results, tmp_path, ["html"])
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert page.loads == [] and not re.search(r"url\((?!#)|@import", text)
    assert page.open == []
    assert page.counts["strip"] == 5 and page.counts["curves"] == 1
    curve = pictures.curves(rows_of(results)["Branching"]).figure
    assert sum(line.get_alpha() is not None for line in curve.axes[0].lines) == 14
    words = [text for _, text in page.texts]
    assert "gail <im> & co" in words and "RiskyPath: differs from its <twins>" in words
    assert words.count("−1.70") == 2  # as published, and beside the mark of the strip; the sampled scores are the same
    assert "prefers-color-scheme: dark" in text and "width=device-width" in text


def test_without_matplotlib_the_page_has_all_but_pictures(
    results: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("taskspec.show.figures.chart.is_available", lambda: False)
    (path,) = report.write(results, tmp_path, chart.possible(["html", "svg"]))
    text = path.read_text(encoding="utf-8")
    assert "<svg" not in text and "−1.70" in text and "[figures]" in text


def test_pictures_are_written_and_the_same_each_time(results: dict[str, Any], tmp_path: Path) -> None:
    first = report.write(results, tmp_path / "a", ["png", "pdf", "svg"])
    again = report.write(results, tmp_path / "b", ["svg", "pdf"])
    assert list(map(attrgetter("name"), first)) == ["report.png", "report.pdf", "report.svg"]
    assert first[2].read_bytes() == again[0].read_bytes() and first[1].read_bytes() == again[1].read_bytes()
    assert first[1].read_bytes().startswith(b"%PDF")
    assert imread(first[0]).shape[1] > 1500


def labels(drawn: Chart) -> list[str]:
    return [text for text, _ in texts(drawn.figure)]


LAYOUTS = {"wide": card_picture.WIDE, "narrow": card_picture.NARROW, **card_picture.PAPER}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_the_picture_has_every_seed_and_the_mean_of_the_data(
    results: dict[str, Any], layout: card_picture.Layout
) -> None:
    shown = card(results)
    drawing = card_picture.picture(shown, layout)
    written = "\n".join(["", *labels(drawing), ""])
    scores: list[float] = []
    for row in shown.tasks:
        is_shown = row in shown.rows if layout.has_words else row.printed.scores
        if is_shown:
            assert f"\n{row.name}\n" in written and f"\n{row.printed.words}" in written
            scores += row.printed.scores
    drawn: list[float] = []
    for axes in drawing.figure.axes:
        for line in axes.lines:
            if line.get_markersize() == pictures.MARKS["one seed"]["markersize"]:
                drawn += line.get_xdata().tolist()
    assert sorted(drawn) == pytest.approx(np.sort(np.clip(scores, -1, None)))
    assert_legible(drawing.figure)


def test_pictures_for_papers_have_the_width_of_a_column_and_letters_of_seven_points(
    results: dict[str, Any], tmp_path: Path
) -> None:
    report.write_paper(results, tmp_path)
    for columns, centimetres in (("one-column", 8.4), ("two-columns", 17.0)):
        assert (tmp_path / f"paper-{columns}.pdf").is_file()
        text = (tmp_path / f"paper-{columns}.svg").read_text(encoding="utf-8")
        width = re.search(r'<svg[^>]* width="([\d.]+)pt"', text)
        assert width is not None and float(width[1]) == pytest.approx(centimetres / 2.54 * 72)
        sizes = np.array(re.findall(r"font-size: ([\d.]+)px", text), float)
        assert sizes.min() >= 7
        assert text.count("14 seeds; 0") == 1


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=lambda theme: theme.name)
def test_seeds_can_be_seen_on_light_and_on_dark_paper(theme: Theme) -> None:
    for color in pictures.GRADES.values():
        for ground in (chart.WORSE, chart.BETWEEN):
            if (color, ground) == (chart.BLUE, chart.WORSE):  # what is worse than random masters nothing
                continue
            assert contrast(recolored(color, theme), recolored(ground, theme)) >= 4.5


def test_no_words_of_a_matrix_overlap(results: dict[str, Any]) -> None:
    assert_legible(report.table(matrix(dict.fromkeys(("one", "two"), card(results)))).figure)


def test_no_number_of_a_picture_is_cut_at_the_floor() -> None:
    exams = {"BC": exam({"Sort": 0.5, "Parabola": 1.0}), "GAIL": exam({"Parabola": [-1.7, -3.1] * 7 + [-2.4]})}
    drawn = dict(report.of_several(matrix({name: card(each) for name, each in exams.items()})))
    assert "−2.40" in labels(drawn["table"]) and "−1.00" not in labels(drawn["table"])
    assert labels(drawn["learner-GAIL"]).count("−2.40") == 2


def test_the_matrix_has_the_verdict_as_colour_and_as_word() -> None:
    gail = exam({"EarlyTermPos": 1.0, "EarlyTermNeg": -3.0, "Sort": 0.5}, learner="GAIL")
    gail["diagnoses"] = findings.diagnose(gail, "derail")
    found = matrix({"BC": card(exam({"Sort": 1.0})), "GAIL": card(gail)})
    assert tuple(found.learners) == ("BC", "GAIL")
    of_bc, of_gail = (dict(zip(found.tasks, row, strict=True)) for row in found.cells)
    assert of_gail["EarlyTermPos"].word == "passes"
    assert of_gail["EarlyTermNeg"].word == of_gail["Sort"].word == "fails"
    assert of_bc["Sort"].grade == "masters" and of_bc["EarlyTermNeg"].grade is None
    fills = report.table(found).figure.axes[0].collections
    filled = fills[len(found.tasks) + found.tasks.index("EarlyTermNeg")].get_facecolor()
    assert to_hex(filled[0]) == report.TINTS["fails"]
    page = report.page_of_several(found)
    assert "−3.00" in page and "earest known mistake: prolongs episodes: its learned reward is positive" in page


@pytest.mark.parametrize(
    ("learners", "shown"),
    [
        (["paper/bc", "paper/mce"], ["bc", "mce"]),
        (["paper/bc", "corrected/bc"], ["paper/bc", "corrected/bc"]),
        (["bc", "a/b.py:train"], ["bc", "a/b.py:train"]),
    ],
)
def test_the_table_of_one_family_leaves_its_name_out(learners: list[str], shown: list[str]) -> None:
    assert list(matrix({name: card(exam({"Sort": 0.5})) for name in learners}).learners) == shown


def test_the_table_holds_every_score(results: dict[str, Any], tmp_path: Path) -> None:
    (path,) = report.write(results, tmp_path, ["parquet"])
    read = pyarrow.parquet.read_table(path).to_pylist()
    assert len(read) == len(results["scores"])
    for row, score in zip(read, results["scores"], strict=True):
        assert row["learner"] == results["learner"]
        for key in ("task", "twin", "seed", "deterministic", "error"):
            assert row[key] == score[key]


def test_a_format_that_there_is_not_is_refused(results: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(SpecError) as error:
        report.write(results, tmp_path, ["html", "parket"])
    assert error.value.diagnostics[0].code == "E726" and "parquet" in str(error.value)
    assert list(tmp_path.iterdir()) == []


def stored(folder: Path, results: dict[str, Any]) -> Path:
    """A folder as an exam leaves it."""
    folder.mkdir()
    (folder / "exam.json").write_text(json.dumps(results), encoding="utf-8")
    return folder


def test_the_command_shows_an_exam_again_and_draws_it(results: dict[str, Any], tmp_path: Path) -> None:
    folder = stored(tmp_path / "im", results)
    assert Done("report", "derail/bc", "-f", "svg", "-o", tmp_path / "shipped").status == 0
    done = Done("report", folder, "--format", "html,svg")
    assert done.status == 0 and "EarlyTermNeg" in done.out and "report.svg" in done.out
    assert (folder / "report.html").is_file() and (folder / "report.svg").is_file()


def test_the_command_writes_the_file_that_is_named(results: dict[str, Any], tmp_path: Path) -> None:
    folder = stored(tmp_path / "im", results)
    for arguments in (["-o", "a.svg"], ["-o", "a.svg"], ["-o", "b.png", "--narrow"], ["-o", "c.html"]):
        place = tmp_path / arguments[1]
        assert Done("report", folder, "-o", place, *arguments[2:]).status == 0
        assert place.is_file()
    assert Done("report", folder, "-o", tmp_path / "new").status == 0
    assert (tmp_path / "new" / "report.html").is_file()
    for arguments in (["-o", "a.svg", "-f", "png"], ["-o", "a.svg", "--paper"], ["--narrow"]):
        assert Done("report", folder, *arguments).status == 2


def test_evidence_has_the_names_of_the_tasks_that_were_run() -> None:
    shown = card(read(RESULTS / "gail_im"))
    run = {row.name for row in shown.tasks}
    for diagnosis in shown.diagnoses:
        assert set(re.findall(r"(?:score|sampled)\((\w+)\)", " ".join(diagnosis["evidence"]))) <= run


def test_the_command_puts_learners_side_by_side(tmp_path: Path) -> None:
    one = stored(tmp_path / "one", exam({"Sort": 0.5, "Parabola": 1.0}, learner="BC", seeds=3))
    two = stored(tmp_path / "two", exam({"Parabola": -1.7}, learner="GAIL", seeds=3))
    done = Done("report", one, two, "-f", "svg", "-f", "parquet", "-o", tmp_path / "out")
    assert done.status == 0
    header, row, *_ = map(str.split, done.out.splitlines())
    assert row[0] == "BC" and row[1 + header.index("Sort")] == "0.50"
    files = names(tmp_path / "out")
    assert {"table.svg", "task-Sort.svg", "learner-GAIL.svg", "scores.parquet"} <= set(files)
    assert len(files) == 2 + len(TITLES) + 2


def test_the_command_refuses_what_is_no_exam_and_learners_that_are_one(tmp_path: Path) -> None:
    assert Done("report", tmp_path / "none").status == 1
    one = stored(tmp_path / "one", exam({"Sort": 0.5}, seeds=2))
    again = Done("report", one, one)
    assert again.status == 2 and "the same learner" in again.err


WRONG: dict[type, tuple[Any, ...]] = {
    str: (None, "x", -1.5, []), int: (None, "x", -1.5, 10**400, {"x": 1}), float: (None, "x", -1.5, math.nan, 10**400),
    type(None): ("x", -1.5, [5]), list: (None, "x", {"x": 1}, [5]), dict: (None, "x", [5]),
}  # fmt: skip
"""What takes the place of a value, by the kind of that."""


def leaves(data: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The places of all values without parts."""
    if not data or not isinstance(data, dict | list):
        yield path
    elif isinstance(data, dict):
        for key, part in data.items():
            yield from leaves(part, (*path, key))
    else:
        for number, part in enumerate(data):
            yield from leaves(part, (*path, number))


def at(data: Any, path: tuple[str | int, ...]) -> Any:
    """The value at a place."""
    for step in path:
        data = data[step]
    return data


def changed(data: Any, path: tuple[str | int, ...], value: Any) -> Any:
    """Data with another value at a place."""
    copy = json.loads(json.dumps(data))
    at(copy, path[:-1])[path[-1]] = value
    return copy


@pytest.fixture(scope="module")
def small() -> dict[str, Any]:
    """An exam that has everything, each once or twice."""
    found = exam({"RiskyPath": 1.0}, {"RiskyPath": -1.6}, seeds=1)
    found["tasks"] = {"derail/RiskyPath-v0": found["tasks"]["derail/RiskyPath-v0"]}
    found["scores"] = [*found["scores"][:2], entry("RiskyPath", 1, None)]
    found["scores"][0]["curve"] = [[0, None], [500, 1.0]]
    told_of = {"mean": 1.0, "low": None, "high": None}
    found["verdicts"] = {
        "stochastic transitions": {
            "verdict": "unsure", **told_of, "tasks": ["derail/RiskyPath-v0"], "seeds": 1,
            "twins": {"verdict": "unsure", **told_of},
        }
    }  # fmt: skip
    effect = {"effect": -0.8, "low": -0.9, "high": None}
    found["flags"] = [{"kind": "twin", "task": "derail/RiskyPath-v0", "message": "it differs", **effect}]
    found["diagnoses"] = [
        {
            "name": "x", "message": "a", "cause": "b", "try": "c", "source": "d", "tasks": ["derail/RiskyPath-v0"],
            "evidence": ["e"],
        }
    ]  # fmt: skip
    return found


def test_no_value_of_a_wrong_kind_ends_in_a_traceback(small: dict[str, Any], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert Done("report", stored(tmp_path / "exam", small), "-f", "html", "-o", out).status == 0
    file = tmp_path / "exam" / "exam.json"
    outcomes = Counter[int]()
    for path in list(leaves(small))[::9]:
        for value in WRONG[type(at(small, path))]:
            file.write_text(json.dumps(changed(small, path, value), indent=1), encoding="utf-8")
            done = Done("report", file, "-f", "html", "-o", out)
            assert done.status in (0, 1), (path, value, done.err)
            assert done.status == 0 or "error[E7" in done.err, (path, value, done.err)
            outcomes[done.status] += 1
    assert outcomes[1] > 2 * outcomes[0]


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        (("scores", 1, "half"), "x", "scores[1].half: expected a number, found the text `x`"),
        (("seeds", 0), None, "seeds[0]: there is no value here; expected a whole number"),
        (("scores", 0, "task"), "Sort", "scores[0].task: the exam has no task 'Sort'"),
        (("flags", 0, "kind"), "odd", "flags[0].kind: the text `odd` is not one of twin"),
        (("scores", 0, "curve", 1), [5.0], "scores[0].curve[1]: a point of a learning curve"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_told_with_its_place(
    small: dict[str, Any], tmp_path: Path, path: tuple[Any, ...], value: Any, told: str
) -> None:
    folder = stored(tmp_path / "exam", small)
    text = json.dumps(changed(small, path, "HERE"), indent=1)
    (folder / "exam.json").write_text(text.replace('"HERE"', json.dumps(value)), encoding="utf-8")
    done = Done("report", folder)
    assert done.status == 1 and "exam.json'," in done.err and "E721" in done.err
    assert told in " ".join(done.err.split())


def test_numerals_are_the_means_of_the_data() -> None:
    """In the matrix and in its picture, of the stored exams of the paper's learners; clipped scores are not among them."""
    exams = {path.parent.name: read(path.parent) for path in sorted(RESULTS.glob("*/exam.json*"))}
    are_clipped = False
    expected = []
    for each in exams.values():
        scores: dict[str, list[float]] = {task: [] for task in each["tasks"]}
        for score in each["scores"]:
            if score["twin"] is None and score["deterministic"] is not None:
                scores[score["task"]].append(score["deterministic"])
        for task, about in each["tasks"].items():
            if about.get("cannot"):
                expected.append("cannot")
            else:
                mean = np.mean(scores[task])
                are_clipped |= mean < FLOOR
                expected.append(f"{mean:.2f}".replace("-", "−").replace("−0.00", "0.00"))
    assert are_clipped
    found = matrix({name: card(each) for name, each in exams.items()})
    page = report.page_of_several(found)
    assert re.findall(r'<td class="\w*">([^<]*)', page) == expected
    drawn = re.findall(r"^(−?\d+\.\d\d|cannot)$", "\n".join(labels(report.table(found))), re.MULTILINE)
    assert sorted(drawn) == sorted(expected)
