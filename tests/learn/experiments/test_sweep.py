"""Sweeps, through the command and the function: what is measured, kept, written, and told when something fails."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest

import taskspec
from taskspec import experiments
from taskspec.base import limits
from taskspec.exact.scores.difficulty import MEASURES
from taskspec.experiments import sweep
from taskspec.learn.experiments import picture
from taskspec.learn.jobs.running import Running
from taskspec.learn.jobs.store import Store
from tests.shared.charts import assert_legible
from tests.shared.commands import Done
from tests.shared.exams import column

pytestmark = pytest.mark.usefixtures("warm")

NOISE = """
experiment: 1
name: noise
tasks:
  - task: derail/NoisyObs
    parameters: {L: [5, 50, 500], M: 7}
  - task: derail/Branching
    parameters: {L: {range: [2, 6, 2]}, B: [2, 3]}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "noise.yaml"
    path.write_text(NOISE, encoding="utf-8")
    return path


def swept(path: Path, *options: str) -> list[dict[str, Any]]:
    done = Done("sweep", path, "--out", path.parent / "results", "--json", "-j", "2", *options)
    assert done.status in (0, 1), done.err
    return json.loads(done.out)  # type: ignore[no-any-return]


def endings(folder: Path) -> set[str]:
    return {path.suffix for path in folder.iterdir()}


def test_a_row_for_each_instance_with_what_theory_says(file: Path) -> None:
    rows = swept(file)
    for row in rows:
        assert row["error"] is None and row["status"] == "done"
        assert row.keys() >= MEASURES.keys()
    for row, length in zip(rows[:3], (5, 50, 500), strict=True):
        assert row["id"] == f"derail/NoisyObs-v0?L={length}&M=7"
        assert (row["states"], row["optimal"], row["optimal_half"]) == (49, 16, 0)
        assert row["random"] == pytest.approx(taskspec.exact.scores(row["id"]).random.value)
    for row in rows[3:]:
        n = row["parameters"]["L"]
        b = row["parameters"]["B"]
        assert row["states"] == n * b + 1 and row["random"] == pytest.approx(b**-n)
        assert row["episodes_to_reward"] == pytest.approx(b**n) and row["solution_length"] == n


def test_all_formats_hold_the_same(file: Path) -> None:
    rows = swept(file, "-f", "json,csv,parquet,svg,png,pdf")
    folder = file.parent / "results"
    assert json.loads((folder / "noise.json").read_text(encoding="utf-8")) == rows
    lines = csv.DictReader((folder / "noise.csv").read_text(encoding="utf-8").splitlines())
    for line, row in zip(lines, rows, strict=True):
        assert line["id"] == row["id"]
        assert float(line["random"]) == row["random"]
        assert line["parameters.L"] == str(row["parameters"]["L"])
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(folder / "noise.parquet").to_pylist()
    assert column(table, "optimal") == column(rows, "optimal")
    assert endings(folder) >= {".sqlite", ".json", ".csv", ".parquet", ".svg", ".png", ".pdf"}
    assert (folder / "noise.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
def test_what_is_known_is_not_worked_out_again(file: Path) -> None:
    first = swept(file)
    file.write_text(NOISE.replace("[5, 50, 500]", "[5, 50, 60]").replace("name: noise", "name: noise\ntitle: More"))
    second = swept(file)
    other = column(first, "id").index("derail/NoisyObs-v0?L=500&M=7")
    assert column(second, "id")[other] == "derail/NoisyObs-v0?L=60&M=7"
    del first[other], second[other]
    assert column(first, "id") == column(second, "id")
    assert column(first, "seconds") == column(second, "seconds")
    with Store(file.parent / "results" / "noise.sqlite") as store:
        assert len(store.results()) == len(first) + 2


@pytest.mark.slow
def test_other_questions_have_results_of_their_own(file: Path) -> None:
    assert "soft_gap" in swept(file)[0]
    file.write_text(NOISE + "measures: [solution_length]\n")
    row = swept(file)[0]
    assert "soft_gap" not in row and row["solution_length"] == 21


def test_policies_are_rolled_out_and_agree_with_theory(file: Path) -> None:
    file.write_text(NOISE + "policies: [random, expert, epsilon(0.1)]\nepisodes: 500\nseeds: 3\nmeasures: []\n")
    for row in swept(file):
        for name in ("random", "expert"):
            told = row["policies"][name]
            assert told["episodes"] == 1500 and len(told["seeds"]) == 3
            assert abs(told["mean"] - row[name]) <= 2.5 * told["half"] + 1e-9
        assert row["policies"]["epsilon(0.1)"]["mean"] < row["expert"]
        assert row["policies"]["random"]["length"] == row["horizon"]


@pytest.mark.slow
def test_estimates_have_intervals_and_reasons(tmp_path: Path) -> None:
    path = tmp_path / "e.yaml"
    path.write_text("experiment: 1\nname: e\ntasks: [{task: Parabola, parameters: {h: [5, 9]}}]\nspeed: true\n")
    for row in swept(path):
        assert row["random_half"] > 0 and row["random_status"] == "estimated"
        assert row["optimal"] is None and "soft_gap" in row["why_not"]
        assert row["steps_per_second_vectorized"] > 0 and row["steps_per_second"] > 0


MEMORY = """\
experiment: 1
name: e
measures: []
tasks:
  - {task: memory/NBack, parameters: {L: 4}}
  - {task: memory/NBack, parameters: {L: 4}, modifiers: [{sticky: 0.25}]}
  - {task: planning/LightsOut}
"""


def test_every_return_that_is_not_known_has_a_reason(tmp_path: Path) -> None:
    (tmp_path / "e.yaml").write_text(MEMORY)
    as_written, sticky, lights = swept(tmp_path / "e.yaml")
    assert as_written["expert"] == 2.0 and as_written["why_not"] == {}
    assert sticky["expert"] is None and sticky["optimal"] is not None
    assert sticky["why_not"] == {"expert": "the expert of the spec is not for the task with sticky=0.25"}
    assert lights["expert"] is None and lights["why_not"] == {"expert": "the spec gives no expert"}


def test_what_fails_is_told_and_the_rest_goes_on(file: Path) -> None:
    file.write_text(NOISE.replace("[5, 50, 500]", "[5, 0, 500]"))
    rows = swept(file)
    assert column(rows[:3], "status") == ["done", "failed", "done"]
    assert rows[1]["error"] == "parameter L must be at least 1, not 0" and rows[1]["random"] is None
    done = Done("sweep", str(file), "--out", str(file.parent / "results"))
    assert done.status == 1 and "derail/NoisyObs-v0?L=0&M=7: parameter L must be at least 1" in done.out


def test_the_time_limit_ends_one_instance_alone(tmp_path: Path) -> None:
    path = tmp_path / "e.yaml"
    grid = "{task: Branching, parameters: {L: [2, 1000], B: 100}}"
    path.write_text(f"experiment: 1\nname: e\ntasks: [{grid}]\nepisodes: 100000\npolicies: [random]\n")
    rows = swept(path, "--time-limit", "1.5")
    assert rows[1]["status"] == "timed_out" and "1.5" in rows[1]["error"]


def test_values_on_the_command_line_take_the_place_of_those_in_the_file(file: Path) -> None:
    assert column(swept(file, "-p", "L=3,4"), "id") == [
        "derail/NoisyObs-v0?L=3&M=7", "derail/NoisyObs-v0?L=4&M=7", "derail/Branching-v0?B=2&L=3",
        "derail/Branching-v0?B=2&L=4", "derail/Branching-v0?B=3&L=3", "derail/Branching-v0?B=3&L=4",
    ]  # fmt: skip
    assert "no task of the experiment has a parameter 'Q'" in Done("sweep", str(file), "-p", "Q=3").err


def test_mistakes_in_the_file_stop_the_sweep_before_it_begins(file: Path) -> None:
    file.write_text(NOISE + "measures: [solution_lenght]\n")
    done = Done("sweep", str(file), "--out", str(file.parent / "results"))
    assert done.status == 1 and "did you mean 'solution_length'" in done.err
    assert not (file.parent / "results").exists()


def test_the_picture_has_curves_over_one_parameter_and_maps_over_two(file: Path, tmp_path: Path) -> None:
    found = sweep(experiments.read(file), tmp_path / "s.sqlite", running=Running(2))
    figure = picture.figure(found.experiment, found.rows).figure
    curves, heat_map, _ = figure.axes
    assert (curves.get_title(), heat_map.get_title()) == ("derail/NoisyObs-v0", "derail/Branching-v0: random")
    lines = {line.get_label(): line.get_xydata().tolist() for line in curves.lines}
    assert lines["optimal"] == [[5, 16], [50, 16], [500, 16]]
    assert curves.get_xscale() == "log"
    assert [text.get_text() for text in heat_map.texts] == ["0.25", "0.0625", "0.111", "0.0123"]
    assert_legible(figure)


POLICY = """
experiment: 1
name: e
tasks: [{task: derail/Branching, parameters: {L: 2, B: 2}, modifiers: []}]
policies: ["MODEL:act"]
episodes: 10
measures: []
"""


def test_all_that_a_result_depends_on_decides_whether_it_still_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The function of a policy, what it imports, modifiers and limits: each that changes is worked out anew, and nothing else."""
    file = tmp_path / "e.yaml"
    model = tmp_path / "model.py"
    helper = tmp_path / "helper.py"
    text = POLICY.replace("MODEL", str(model))
    file.write_text(text)
    model.write_text("from helper import choice\n\ndef act(seen):\n    return choice\n")
    helper.write_text("choice = 0\n")

    def results() -> int:
        assert column(swept(file), "error") == [None]
        with Store(tmp_path / "results" / "e.sqlite") as store:
            return len(store.results())

    assert results() == 1
    helper.write_text("choice = 1\n")
    assert results() == 2
    model.write_text(model.read_text() + "\n")
    assert results() == 3
    file.write_text(text.replace("modifiers: []", "modifiers: [{sticky: 0.25}]"))
    assert results() == 4
    monkeypatch.setenv("TASKSPEC_LIMITS", "transitions=1000")
    limits.limits.cache_clear()
    assert results() == 5
    assert results() == 5
    monkeypatch.undo()
    limits.limits.cache_clear()
    assert results() == 5


def test_a_sweep_off_a_terminal_says_how_far_it_is(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskspec.cli.console.BETWEEN_LINES", 0.0)
    done = Done("sweep", str(file), "--out", str(file.parent / "results"), "-j", "1", "-p", "L=2,3", "-f", "json")
    assert done.status == 0 and "noise 6/6" in done.err


@pytest.mark.parametrize("name", ["../x", "FOLDER/x", "a\0$\\frac$", "n" * 5000])
def test_files_of_results_lie_in_their_folder_whatever_the_name(name: str, tmp_path: Path) -> None:
    name = name.replace("FOLDER", str(tmp_path))
    path = tmp_path / "e.yaml"
    about = {"experiment": 1, "name": name, "tasks": [{"task": "Branching", "parameters": {"L": 2}}], "measures": []}
    path.write_text(json.dumps(about))
    (tmp_path / "x.json").write_text("mine")
    swept(path)
    assert sorted(tmp_path.iterdir()) == [path, tmp_path / "results", tmp_path / "x.json"]
    assert (tmp_path / "x.json").read_text() == "mine"
    assert endings(tmp_path / "results") >= {".json", ".csv", ".sqlite"}
