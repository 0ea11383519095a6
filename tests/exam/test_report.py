"""Reports of exams: what a terminal, a page, a picture and a table show of results, against the results themselves."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from matplotlib.image import imread

from taskspec.base.diagnostics import SpecError
from taskspec.cli.console import console
from taskspec.cli.report import print_exam
from taskspec.exam import findings, report
from taskspec.exam import score_charts as pictures
from taskspec.exam import score_rows as told
from taskspec.figures import chart
from taskspec.figures.scene import Area, Box, Circle, Label, Line, Scene
from taskspec.printers.text import plain
from tests.shared.commands import Done
from tests.shared.exams import TITLES, entry, exam

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


# -- what is shown ----------------------------------------------------------------------------------------------------


def test_rows_are_the_tasks_with_the_scores_of_their_seeds(results: dict[str, Any]) -> None:
    rows = {row.name: row for row in told.rows(results)}
    assert list(rows) == list(TITLES)
    assert rows["Branching"].printed.scores == pytest.approx(np.linspace(0, 1, 14))
    assert rows["RiskyPath"].twins.scores == pytest.approx([0.2] * 14)  # the mean over its two twins
    assert (rows["Sort"].printed.scores, rows["Sort"].printed.failed) == ((), 14)
    assert rows["RiskyPath"].optimum == 1.0
    grades = {name: row.grade for name, row in rows.items()}
    assert grades | {"LargestSum": "x"} == dict.fromkeys(TITLES, None) | {
        "RiskyPath": "fails", "EarlyTermPos": "masters", "EarlyTermNeg": "fails", "Branching": "fails", "NoisyObs": "fails",
        "Parabola": "masters", "LargestSum": "x",
    }  # fmt: skip


@pytest.mark.parametrize("score", np.linspace(-1.5, 1.5, 61))
def test_numbers_can_be_read_on_their_colours(score: float) -> None:
    """Contrast by the definition of WCAG 2, which asks for 4.5."""
    background = told.colour(score)

    def luminance(rgb: tuple[int, ...]) -> float:
        shares = np.array(rgb) / 255
        linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    ink = tuple(bytes.fromhex(chart.ink(background)[1:]))
    dark, light = sorted([luminance(ink), luminance(background)])
    assert (light + 0.05) / (dark + 0.05) >= 4.5


def test_colours_go_from_worse_than_random_to_the_expert_without_a_jump() -> None:
    found = np.array([told.colour(x) for x in np.linspace(-1, 1, 401)])
    assert np.abs(np.diff(found, axis=0)).max() <= 2
    assert told.colour(-3) == told.colour(-1) and told.colour(2) == told.colour(1)


def test_what_an_exam_took_is_told_in_words() -> None:
    assert told.duration(84) == "84 s" and told.duration(720) == "12 min" and told.duration(9000) == "2.5 h"
    assert told.steps(250_000) == "250k" and told.steps(1_500_000) == "1.5M"
    assert told.decimal(-0.001) == "0.00" and told.decimal(-0.5) == "−0.50" and told.decimal(None) == ""


# -- the terminal -----------------------------------------------------------------------------------------------------


def test_the_terminal_shows_all_of_it(
    results: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    print_exam(results, console(wide=True))
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert "early termination ✗ fails" in lines and "continuous control ✓ masters" in lines
    assert "RiskyPath 1.00 14/14 pass 0.20 1.00 1.00" in lines
    assert "Sort failed · failed 0.00" in lines and "LargestSum · · · 0.00" in lines
    assert any(line.startswith("diagnosis the learned reward is biased upwards") for line in lines)
    assert any(line.startswith("try Let terminal states absorb") for line in lines)
    assert "twin derail/RiskyPath-v0: differs from its <twins>" in lines


# -- pages ------------------------------------------------------------------------------------------------------------


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
        self.loads += [f"{tag} {key}={value}" for key, value in attrs if key in ("src", "href", "srcset", "action")]
        self.loads += [tag] if tag in ("script", "link", "iframe", "img") else []
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
    assert page.loads == [] and not re.search(r"url\(|@import", text)
    assert page.open == []
    assert page.counts["strip"] == len(TITLES) and page.counts["curves"] == 1
    (curve,) = (pictures.small_curves(row) for row in told.rows(results) if row.curves)
    assert sum(item.shade < 1 for item in curve.items if isinstance(item, Line)) == 14
    strips = [pictures.strip(row, pictures.strip_axis(told.rows(results))) for row in told.rows(results)]
    assert sum(len(dots(strip)) for strip in strips) == 14 * (len(PRINTED) + len(TWINS)) == text.count('r="1.9"')
    words = [text for _, text in page.texts]
    assert "gail <im> & co" in words and "differs from its <twins>" in words
    assert "−0.80 (95 % from −0.90 to −0.70)" in words
    assert words.count("−1.70") == 2  # its actions taken, and drawn
    assert "prefers-color-scheme: dark" in text and "width=device-width" in text


# -- pictures and tables ----------------------------------------------------------------------------------------------


def test_pictures_are_written_and_the_same_each_time(results: dict[str, Any], tmp_path: Path) -> None:
    first = report.write(results, tmp_path / "a", ["png", "pdf", "svg"])
    again = report.write(results, tmp_path / "b", ["svg", "pdf"])
    assert [path.name for path in first] == ["report.png", "report.pdf", "report.svg"]
    assert first[2].read_bytes() == again[0].read_bytes() and first[1].read_bytes() == again[1].read_bytes()
    assert first[1].read_bytes().startswith(b"%PDF")
    assert imread(first[0]).shape[1] > 1500


def labels(scene: Scene) -> list[str]:
    return [plain(item.text) for item in scene.items if isinstance(item, Label)]


def dots(scene: Scene) -> list[Circle]:
    """The seeds of box plots."""
    return [item for item in scene.items if isinstance(item, Circle) and item.shade == 0.75]


def test_the_picture_has_every_seed_and_the_interval_of_the_mean(results: dict[str, Any]) -> None:
    drawn = pictures.of_exam(results)
    texts = labels(drawn)
    first = texts.index("1.00")
    assert texts[first : first + 6] == ["1.00", "0.20", "1.00", "1.00", "1.00", "1.00"]
    assert len(dots(drawn)) == 14 * (len(PRINTED) + len(TWINS))
    (at_random,), (at_expert,) = ({item.at[0] for item in drawn.items if isinstance(item, Label) and plain(item.text) == word}
                                  for word in ("random", "expert"))  # fmt: skip
    scores = [(dot.centre[0] - at_random) / (at_expert - at_random) for dot in dots(drawn)]
    assert min(scores) == pytest.approx(-1)  # scores below are cut off, in pictures alone
    branching = next(row for row in told.rows(results) if row.name == "Branching")
    boxes = [
        [(x - at_random) / (at_expert - at_random) for x, _ in item.points]
        for item in drawn.items
        if isinstance(item, Area)
    ]
    assert any((min(xs), max(xs)) == pytest.approx(branching.printed.interval) for xs in boxes)


def test_the_table_of_several_learners_is_grey_where_one_was_not_run() -> None:
    exams = {"BC": exam({"Sort": 0.5, "Parabola": 1.0}), "GAIL": exam({"Parabola": -1.7})}
    drawn = pictures.table(exams)
    cells = [item for item in drawn.items if isinstance(item, Box)]
    names = [text for text in labels(drawn) if text in TITLES]
    assert [text for text in labels(drawn) if text in exams] == ["BC", "GAIL"]
    assert cells[2 * names.index("Sort") + 1].fill == chart.hexadecimal(told.NOT_RUN)
    assert cells[2 * names.index("Parabola") + 1].fill == chart.hexadecimal(told.colour(-1))
    assert "−1.00" in labels(drawn)


@pytest.mark.parametrize(
    ("learners", "shown"),
    [
        (["paper/bc", "paper/mce"], ["bc", "mce"]),
        (["paper/bc", "corrected/bc"], ["paper/bc", "corrected/bc"]),
        (["bc", "a/b.py:train"], ["bc", "a/b.py:train"]),
    ],
)
def test_the_table_of_one_family_leaves_its_name_out(learners: list[str], shown: list[str]) -> None:
    drawn = pictures.table({name: exam({"Sort": 0.5}) for name in learners})
    assert [plain(item.text) for item in drawn.items if isinstance(item, Label) and item.angle] == shown


def test_boxes_stand_side_by_side_with_their_means(results: dict[str, Any]) -> None:
    cells = {row.name: row.printed for row in told.rows(results)}
    texts = labels(pictures.boxes(cells, "gail"))
    assert texts[:2] == ["RiskyPath", "1.00"] and ("Sort", "failed") in itertools.pairwise(texts)


def test_the_table_holds_every_score(results: dict[str, Any], tmp_path: Path) -> None:
    (path,) = report.write(results, tmp_path, ["parquet"])
    read = pyarrow.parquet.read_table(path).to_pylist()
    assert len(read) == len(results["scores"])
    for row, score in zip(read, results["scores"], strict=True):
        assert row["learner"] == results["learner"]
        assert {key: row[key] for key in ("task", "twin", "seed", "deterministic", "error")} == {
            key: score[key] for key in ("task", "twin", "seed", "deterministic", "error")
        }


def test_a_format_that_there_is_not_is_refused(results: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(SpecError) as error:
        report.write(results, tmp_path, ["html", "parket"])
    assert error.value.diagnostics[0].code == "E713" and "parquet" in str(error.value)
    assert list(tmp_path.iterdir()) == []


# -- the command ------------------------------------------------------------------------------------------------------


def stored(folder: Path, results: dict[str, Any]) -> Path:
    """A folder as an exam leaves it."""
    folder.mkdir()
    (folder / "exam.json").write_text(json.dumps(results), encoding="utf-8")
    return folder


def test_the_command_shows_an_exam_again_and_draws_it(results: dict[str, Any], tmp_path: Path) -> None:
    folder = stored(tmp_path / "im", results)
    done = Done("report", folder, "--format", "html,svg")
    assert done.status == 0 and "early termination" in done.out and "report.svg" in done.out
    assert (folder / "report.html").is_file() and (folder / "report.svg").is_file()


def test_the_command_puts_learners_side_by_side(tmp_path: Path) -> None:
    one = stored(tmp_path / "one", exam({"Sort": 0.5, "Parabola": 1.0}, learner="BC", seeds=3))
    two = stored(tmp_path / "two", exam({"Parabola": -1.7}, learner="GAIL", seeds=3))
    done = Done("report", one, two, "-f", "svg", "-f", "parquet", "-o", tmp_path / "out")
    assert done.status == 0
    lines = [line.split() for line in done.out.splitlines()]
    assert ["BC", "GAIL"] in lines and ["Sort", "0.50", "·"] in lines and ["Parabola", "1.00", "−1.70"] in lines
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"table.svg", "task-Sort.svg", "learner-GAIL.svg", "scores.parquet"} <= names
    assert len(names) == 2 + len(TITLES) + 2


def test_the_command_refuses_what_is_no_exam_and_learners_that_are_one(tmp_path: Path) -> None:
    assert Done("report", tmp_path / "none").status == 1
    one = stored(tmp_path / "one", exam({"Sort": 0.5}, seeds=2))
    again = Done("report", one, one)
    assert again.status == 2 and "the same learner" in again.err


# -- files that something has changed ---------------------------------------------------------------------------------

WRONG: dict[type, tuple[Any, ...]] = {
    str: (None, "x", -1.5, []), int: (None, "x", -1.5, 10**400, {"x": 1}), float: (None, "x", -1.5, math.nan, 10**400),
    type(None): ("x", -1.5, [5]), list: (None, "x", {"x": 1}, [5]), dict: (None, "x", [5]),
}  # fmt: skip
"""What takes the place of a value, by the kind of that."""


def leaves(data: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The places of all values without parts."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    parts = list(entries)
    if not parts:
        yield path
    for key, part in parts:
        yield from leaves(part, (*path, key))


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
    for path in leaves(small):
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
