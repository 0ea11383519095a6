"""`python -m tests.benchmarks`: what the command prints, writes and draws, and what it refuses."""

from __future__ import annotations

import io
import json
import re
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from rich.theme import Theme
from typer.testing import CliRunner

from taskspec.base.extras import is_installed
from taskspec.programs import backend_table as select
from taskspec.programs.backend_table import PROGRAMS
from taskspec.show.terminal.styled_text import STYLES
from tests.benchmarks import accelerator, chart, learners, printed, tables
from tests.benchmarks import vector as bench_vector
from tests.benchmarks.__main__ import app
from tests.benchmarks.race import Contestant, Rate, spread
from tests.conftest import needs_vectors
from tests.shared.charts import assert_legible, texts
from tests.shared.specs import spec_file

ROOT = Path(__file__).parents[2]
QUICK = ("--rounds", "2", "--seconds", "0.001")


class Done:
    """What a command did: its exit status, its standard output and its standard error."""

    def __init__(self, *args: object, columns: int | None = None) -> None:
        env = {"COLUMNS": str(columns) if columns else "", "NO_COLOR": None, "FORCE_COLOR": None}
        result = CliRunner().invoke(app, [str(a) for a in args], env=env)
        self.status = result.exit_code
        self.out = result.stdout
        self.err = result.stderr
        assert "Traceback" not in self.out + self.err
        assert "internal error" not in self.err

    @property
    def data(self) -> Any:
        return json.loads(self.out)


def contestant(
    task: str, program: str, lanes: int, target: float | None = None, rival: str | None = None
) -> Contestant:
    def make() -> Callable[[], int]:
        raise AssertionError("nothing is measured here")

    return Contestant(task, program, lanes, make, target, rival)


# -- the command --------------------------------------------------------------------------------------------------


def test_alone_it_shows_help() -> None:
    done = Done()
    assert all(word in done.out + done.err for word in ("seals", "vector", "exact"))


@needs_vectors()
def test_json_says_all_that_was_measured_and_on_what() -> None:
    args = (
        "vector",
        spec_file("catch"),
        "RiskyPath",
        "-b",
        "scalar",
        "-b",
        "numpy",
        "-l",
        2,
        "-l",
        3,
        "--no-start",
    )
    found = Done(*args, *QUICK, "--json").data
    assert set(found) == {
        "machine", "jax_device", "clock", "num_threads", "rounds", "seconds", "results", "starts", "memory", "missing",
    }  # fmt: skip
    assert {"processor", "cores", "platform", "versions"} == set(found["machine"])
    assert {"python", "taskspec", "numpy", "gymnasium"} <= set(found["machine"]["versions"])
    assert (found["rounds"], found["seconds"], found["clock"], found["starts"]) == (2, 0.001, "processor", [])
    assert [(r["task"], r["program"], r["lanes"]) for r in found["results"]] == [
        (task, program, lanes)
        for task in ("bsuite/Catch-v0", "derail/RiskyPath-v0")
        for program, lanes in (("scalar", 1), ("numpy", 2), ("numpy", 3))
    ]
    for result in found["results"]:
        assert len(result["rounds"]) == 2
        assert result["steps_per_second"] == statistics.median(result["rounds"])
        assert result["spread"] == spread(result["rounds"])
        assert result["target"] is None and result["met"] and result["ratio"] is None
        assert 0 < result["of_limit"] < 1 and result["limit"] > result["steps_per_second"]


@pytest.mark.skipif(not is_installed("jax"), reason="JAX is not installed")
def test_lanes_inside_scan_are_measured_in_wall_clock_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accelerator, "CHOSEN", ())
    monkeypatch.setattr(accelerator, "SUITE", ("RiskyPath",))
    found = Done("accelerator", "-l", 2, "-l", 3, *QUICK, "--json").data
    assert [(r["task"], r["program"], r["lanes"]) for r in found["results"]] == [
        ("RiskyPath", "jax-scan", 2),
        ("RiskyPath", "jax-scan", 3),
    ]
    assert found["missing"] == {} and found["device"] == "cpu"


@pytest.mark.skipif(not is_installed("jax"), reason="JAX is not installed")
def test_what_two_trainings_have_in_common_is_no_part_of_their_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    trained = {learners.SHORT: (12_000, 10.0), learners.LONG: (480_000, 14.0)}
    monkeypatch.setattr(learners, "_trained", lambda name, task, seeds, steps: trained[steps])
    (row,) = Done("learners", "ppo", "--seeds", 5, "--json").data["results"]
    assert row["steps_per_second"] == 5 * (480_000 - 12_000) / 4


@needs_vectors()
def test_targets_are_checked_where_there_are_some(monkeypatch: pytest.MonkeyPatch) -> None:
    args = ("vector", "RiskyPath", "-b", "numpy", "-l", 1024, "--no-start", *QUICK, "--strict")
    monkeypatch.setitem(tables.TARGETS, ("numpy", 1024), {"tabular": 1.0})
    assert Done(*args).status == 0
    monkeypatch.setitem(tables.TARGETS, ("numpy", 1024), {"tabular": 1e18})
    missed = Done(*args)
    assert missed.status == 1
    assert "missed: derail/RiskyPath-v0 on numpy, 1024 lanes" in missed.out
    assert "0 of 1 targets met" in missed.out


def test_threads_are_measured_by_time_as_it_passes() -> None:
    pytest.importorskip("numba")
    done = Done("vector", "RiskyPath", "-b", "numba", "-l", 64, "--num-threads", 2, "--no-start", *QUICK)
    assert "2 threads on Numba" in done.out and "wall-clock time" in done.out


@needs_vectors()
def test_a_task_is_measured_on_all_that_suits_it_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_vector, "LANES", (2,))
    found = Done("vector", "Branching", "--no-start", *QUICK, "--json").data
    optional = {"numba": "numba", "jax-scan": "jax"}
    installed = ["scalar", "numpy", *(p for p, package in optional.items() if is_installed(package))]
    assert [r["program"] for r in found["results"]] == installed


@needs_vectors()
@pytest.mark.slow
def test_starts_and_memory_of_a_task_with_parameters() -> None:
    found = Done("vector", "Branching", "-p", "L=3", "-b", "numpy", "-l", 2, *QUICK, "--json").data
    (start,) = found["starts"]
    (memory,) = found["memory"]
    assert start["task"] == memory["task"] == "derail/Branching-v0 L=3"
    assert start["warm"] == statistics.median(start["rounds"]) and len(start["rounds"]) == bench_vector.REPEATS
    assert 0 < min(start["rounds"]) <= start["warm"] and start["cold"] > 0
    assert memory["bytes_per_lane"] == memory["bytes"] / memory["lanes"] > 0


@needs_vectors()
def test_seals_beside_ours_alone_and_in_lanes() -> None:
    pytest.importorskip("seals")
    args = ("seals", "--task", "RiskyPath", "--task", "Sort", *QUICK)
    found = Done(*args, "--json").data
    assert [r["task"] for r in found["results"]] == ["derail/RiskyPathSeals-v0", "derail/SortSeals-v0"]
    assert all(r["ratio"] > 1 and r["target"] and len(r["rounds"]["seals"]) == 2 for r in found["results"])
    assert all(0 < r["of_empty"] < 1 for r in found["results"])
    assert found["machine"]["versions"]["seals"] == "0.2.1"
    shown = Done(*args, columns=80).out
    assert "RiskyPath" in shown and max(map(len, shown.splitlines())) <= 80
    lanes = Done(*args, "--lanes", 4, "--backend", "numpy", "--json").data
    assert (lanes["lanes"], lanes["backend"]) == (4, "numpy")
    assert all(r["target"] is None and r["of_empty"] is None for r in lanes["results"])
    assert "SyncVectorEnv" in Done(*args, "--lanes", 4, "--backend", "numpy").out


@pytest.mark.slow
def test_the_own_table_is_measured_whole() -> None:
    found = Done("vector", "--rounds", 1, "--seconds", 0.001, "--no-start", "--json").data
    plan = bench_vector._own()
    wanted = [(c.task, c.program, c.lanes) for group in [*plan.suite, *plan.others] for c in group]
    got = [(r["task"], r["program"], r["lanes"]) for r in found["results"]]
    assert got == [each for each in wanted if each[1] not in found["missing"]]
    ratios = {r["task"] for r in found["results"] if r["program"] == "CartPoleVectorEnv" and r["ratio"] > 0}
    assert ratios == {"CartPole"}


# -- what is refused, and what does not run -----------------------------------------------------------------------

REFUSED = [
    (["speed"], 2, "speed"),
    (["vector", "Branchng"], 1, "did you mean"),
    (["vector", "nope/"], 1, "E710"),
    (["vector", "Branching", "-p", "L"], 1, "name=value"),
    (["vector", "Branching", "-p", "Q=1"], 1, "E702"),
    (["vector", "Branching", "--backend", "numbs"], 2, "did you mean 'numba'?"),
    (["vector", "Branching", "--lanes", "0"], 2, "--lanes"),
    (["vector", "Branching", "--lanes", "many"], 2, "--lanes"),
    (["vector", "Branching", "--lanes", "99999999999"], 2, "--lanes"),
    (["vector", "Branching", "--num-threads", "0"], 2, "--num-threads"),
    (["vector", "Branching", "--chart", "x.gif"], 2, ".svg, .png, .pdf"),
    (["vector", "--backend", "numpy"], 2, "need a TASK"),
    (["vector", "-p", "L=20"], 2, "need a TASK"),
    (["seals", "--task", "Risky"], 1, "E701"),
    (["seals", "--backend", "numpy"], 2, "--lanes"),
    (["seals", "--backend", "numbs", "--lanes", "4"], 2, "did you mean 'numba'?"),
    (["seals", "--lanes", "0"], 2, "--lanes"),
]


@pytest.mark.parametrize(
    ("args", "status", "words"), REFUSED, ids=lambda x: " ".join(x) if isinstance(x, list) else None
)
def test_every_misuse_gets_one_clear_message(args: list[str], status: int, words: str) -> None:
    if args[0] == "seals" and status == 1:
        pytest.importorskip("seals")
    done = Done(*args)
    assert done.status == status
    assert words in done.err
    assert done.out == ""


def test_without_seals_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "seals", None)
    done = Done("seals")
    assert done.status == 1
    assert "E705" in done.err
    assert 'pip install -e ".[bench]"' in done.err


@pytest.mark.parametrize(("program", "package"), [("numba", "numba"), ("jax", "jax"), ("jax-scan", "jax")])
def test_without_a_backend_it_says_what_to_install(program: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = select.is_installed
    monkeypatch.setattr(select, "is_installed", lambda name: name != package and real(name))
    done = Done("vector", "Branching", "-b", program)
    assert (done.status, done.out) == (1, "")
    assert "E705" in done.err and f'pip install -e ".[{package}]"' in done.err


def test_others_that_do_not_run_are_noted_and_ours_are_errors() -> None:
    def broken() -> Any:
        raise RuntimeError("oh")

    def full() -> Any:
        raise MemoryError

    found = bench_vector.Found("processor", None)
    assert bench_vector._made(Contestant("CartPole", "EnvPool", 4, broken), found) is None
    assert found.missing == {"EnvPool": "RuntimeError: oh"}
    assert bench_vector._made(Contestant("CartPole", "numpy", 4, full), found) is None
    (error,) = found.errors
    assert "no memory for 4 lanes of CartPole on numpy" in str(error)
    with pytest.raises(RuntimeError):
        bench_vector._made(Contestant("CartPole", "numpy", 4, broken), found)


# -- what it looks like -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rates() -> list[Rate]:
    """Every place that the own table may have, with made-up rates from very slow to very fast."""
    rng = np.random.default_rng(0)
    places = [("scalar", 1), ("seals", 1), ("SyncVectorEnv", 64), *tables.TARGETS]
    found = [contestant(task, p, lanes, 1e6) for task in tables.SUITE for p, lanes in places]
    for game, lanes in (("CartPole", (1024, 16384)), ("MemoryLength", (4096,))):
        for n in lanes:
            found += [contestant(game, p, n) for p in ("numpy", "numba", "jax-scan")]
            found += [contestant(game, "gymnax", n, rival="jax-scan"), contestant(game, "EnvPool", n, rival="numba")]
            found.append(contestant(game, "CartPoleVectorEnv", n, rival="numba"))
    rates = []
    for c in found:
        rounds = 10 ** rng.uniform(*_decades(c)) * rng.uniform(0.9, 1.1, 5)
        limits = None
        if c.program in PROGRAMS:
            limits = tuple(rounds * 10 ** rng.uniform(0.1, 3))
        rates.append(Rate(c, tuple(rounds), limits))
    return rates


def _decades(c: Contestant) -> tuple[float, float]:
    return (6.0, 9.3) if c.program in PROGRAMS else (4.0, 7.5)


def _printed(table: Any, width: int = 80) -> list[str]:
    out = io.StringIO()
    Console(file=out, width=width, theme=Theme(STYLES)).print(table)
    return out.getvalue().splitlines()


def test_tables_fit_into_80_columns(rates: list[Rate]) -> None:
    suite = rates[: 7 * len(tables.SUITE)]
    games = rates[7 * len(tables.SUITE) :]
    for table, rows in ((printed.matrix(suite), 2 + 3 * 10), (printed.sections(games), 1 + 2 * 7 + 6)):
        lines = _printed(table)
        assert len(lines) == rows
        assert max(map(len, lines)) <= 80
        assert "…" not in "".join(lines)


def test_a_ratio_is_that_of_the_medians_of_the_same_task_and_lanes(rates: list[Rate]) -> None:
    for rate in rates:
        c = rate.contestant
        found = printed.ratio_of(rate, rates)
        assert (found is None) == (c.rival is None)
        if found:
            (own,) = [
                r for r in rates
                if (r.contestant.task, r.contestant.program, r.contestant.lanes) == (c.task, c.rival, c.lanes)
            ]  # fmt: skip
            assert found == (c.rival, statistics.median(own.rounds) / statistics.median(rate.rounds))


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1_131_000_000, "1,131"),
        (420e6, "420"),
        (29.06e6, "29.1"),
        (537_000, "0.537"),
        (53_700, "0.054"),
        (8, "0.000008"),
    ],
)
def test_rates_have_three_digits(value: float, shown: str) -> None:
    assert printed.millions(value) == shown


@pytest.mark.parametrize("kind", ["svg", "png", "pdf"])
def test_a_chart_is_the_same_every_time(kind: str, rates: list[Rate], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    paths = [tmp_path / f"{name}.{kind}" for name in "ab"]
    for path in paths:
        chart.draw(rates, path)
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    if kind == "svg":
        assert all(f">{task}</text>".encode() in first for task in tables.SUITE)


@pytest.mark.parametrize("count", [1, 7, None])
def test_no_words_of_a_chart_overlap_or_leave_it(count: int | None, rates: list[Rate]) -> None:
    pytest.importorskip("matplotlib")
    figure = chart.figure(rates[:count])
    assert_legible(figure)
    width, height = figure.canvas.get_width_height()
    for name, box in texts(figure):
        assert box.x0 >= 0 and box.x1 <= width and box.y0 >= 0 and box.y1 <= height, name


@needs_vectors()
def test_a_chart_is_written_beside_the_table(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "deep" / "chart.svg"
    done = Done("vector", "Branching", "-b", "numpy", "-l", 2, "--no-start", *QUICK, "--chart", path)
    assert f"wrote {path}" in done.out
    assert "<svg" in path.read_text(encoding="utf-8")


# -- an earlier commit --------------------------------------------------------------------------------------------


def compared(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.benchmarks", "compare", *words, "--rounds", "2", "--seconds", "0.001"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no checkout")
def test_a_commit_is_compared_in_turns() -> None:
    done = compared("HEAD", "--tasks", "RiskyPath,Nothing", "--kinds", "scalar")
    assert done.returncode == 0, done.stderr
    first, measured, missing = done.stdout.splitlines()
    assert re.fullmatch(r"this tree beside [0-9a-f]+: .* 2 rounds .*", first)
    assert re.fullmatch(r"RiskyPath scalar +[\d.]+×  [\d.]+–[\d.]+(  faster|  slower)?", measured)
    assert missing.split() == ["Nothing", "scalar", "not", "measured"]
    wrong = compared("no-such-commit")
    assert wrong.returncode == 1
    assert "there is no commit 'no-such-commit'" in wrong.stderr
    assert "Traceback" not in wrong.stderr
