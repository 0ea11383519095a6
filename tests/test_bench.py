"""`taskspec bench`: how rates are taken, what is measured, what is printed, written and drawn, and what is refused."""

from __future__ import annotations

import builtins
import io
import json
import statistics
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from rich.console import Console
from rich.theme import Theme
from typer.testing import CliRunner

import taskspec
from taskspec.backends import select
from taskspec.cli import bench as bench_options
from taskspec.cli import bench_chart, bench_print, bench_vector
from taskspec.cli.app import app
from taskspec.cli.console import STYLES
from taskspec.diagnostics import TaskspecError
from taskspec.envs import measure
from taskspec.envs.measure import Contestant, Rate, peers, tables
from taskspec.envs.measure.programs import scalar
from taskspec.envs.vector import VectorEnvironment

ROOT = Path(__file__).parent.parent
SPECS = ROOT / "tests" / "specs"
QUICK = ("--rounds", "2", "--seconds", "0.001")
NEEDS = {"scalar": (), "numpy": (), "numba": ("numba",), "jax": ("jax",), "jax-scan": ("jax",)}


class Done:
    """What a command did: its exit status, its standard output and its standard error."""

    def __init__(self, *args: object, columns: int | None = None) -> None:
        env = {"COLUMNS": str(columns) if columns else "", "NO_COLOR": "", "FORCE_COLOR": ""}
        result = CliRunner().invoke(app, ["bench", *(str(a) for a in args)], env=env)
        self.status, self.out, self.err = result.exit_code, result.stdout, result.stderr
        assert "Traceback" not in self.out + self.err
        assert "internal error" not in self.err

    @property
    def data(self) -> Any:
        return json.loads(self.out)


def needed(program: str) -> None:
    for package in NEEDS[program]:
        pytest.importorskip(package)


def contestant(
    task: str, program: str, lanes: int, target: float | None = None, rival: str | None = None
) -> Contestant:
    def make() -> Callable[[], int]:
        raise AssertionError("nothing is measured here")

    return Contestant(task, program, lanes, make, target, rival)


# -- rates --------------------------------------------------------------------------------------------------------


class Machine:
    """A clock that only drives move, and drives that take as long as they are said to."""

    def __init__(self) -> None:
        self.now, self.order = 0.0, ""

    def drive(self, name: str, steps: int, seconds: float) -> Callable[[], int]:
        def drive() -> int:
            self.now += seconds
            self.order += name
            return steps

        return drive


@pytest.mark.parametrize("rounds", [1, 4])
def test_rates_are_steps_over_the_time_of_a_clock_and_sides_take_turns(rounds: int) -> None:
    machine, ticks = Machine(), []
    drives = [machine.drive("a", 10, 0.25), machine.drive("b", 6, 0.5)]
    found = measure.race(drives, rounds, 1.0, lambda: machine.now, lambda: ticks.append(1))
    assert found == [(40.0,) * rounds, (12.0,) * rounds]
    assert machine.order.endswith("aaaabb" * rounds)
    assert len(ticks) == rounds


@pytest.mark.parametrize("seconds", [1e-4, 1e-3, 0.05, 3.0])
def test_a_measurement_takes_about_as_long_as_it_should_however_fast_the_drive_is(seconds: float) -> None:
    machine = Machine()
    drive = machine.drive("", 1, seconds)
    measure.race([drive], 0, 1.0, lambda: machine.now)
    calibration = machine.now
    measure.race([drive], 1, 1.0, lambda: machine.now)
    assert machine.now - 2 * calibration == pytest.approx(max(1.0, seconds), rel=0.05)


def test_spread_is_half_the_distance_of_the_quartiles_over_the_median() -> None:
    values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    low, high = np.quantile(values, [0.25, 0.75], method="weibull")
    assert measure.spread(values) == pytest.approx((high - low) / 2 / 4)
    assert measure.spread([3.0]) is None


@pytest.mark.parametrize("program", NEEDS)
@pytest.mark.parametrize("task", ["Parabola", "Branching", SPECS / "lights_out.yaml", SPECS / "lqr.yaml"], ids=str)
def test_every_program_steps_lanes(program: str, task: Any) -> None:
    needed(program)
    lanes = 1 if program == "scalar" else 5
    drive = measure.ours(taskspec.load(task), program, lanes).make()
    steps = drive()
    assert steps > 0 and steps % lanes == 0
    assert drive() == steps


def test_a_scalar_drive_takes_the_steps_that_it_counts() -> None:
    taken = []

    class Counted(gymnasium.Wrapper[Any, Any, Any, Any]):
        def step(self, action: Any) -> Any:
            taken.append(action)
            return super().step(action)

    steps = scalar(Counted(taskspec.make("RiskyPath")))()
    assert steps == len(taken)


def test_clocks_count_the_time_of_the_processor_unless_several_things_work_at_once() -> None:
    assert [measure.clock_for(*x)[0] for x in ((None, 1), ("cpu", 1), ("cpu", 2), ("gpu", 1))] == [
        "processor", "processor", "wall", "wall",
    ]  # fmt: skip
    assert measure.jax_device(["numpy", "gymnax"]) is None


# -- what there is to measure -------------------------------------------------------------------------------------


def test_names_of_programs_are_those_of_the_help() -> None:
    assert tuple(measure.PROGRAMS) == bench_options.PROGRAMS == tuple(NEEDS)
    assert set(measure.PROGRAMS) < set(bench_chart.MARKS)


def test_pairs_cover_every_task_of_the_suite() -> None:
    twins = {entry.name for entry in taskspec.registry.shipped().values() if entry.name.endswith("Seals")}
    assert {pair.ours for pair in measure.PAIRS} == twins


def test_games_are_the_specs_that_the_tests_compare_with_their_sources() -> None:
    for path in tables.GAMES.iterdir():
        assert path.read_text(encoding="utf-8") == (SPECS / path.name).read_text(encoding="utf-8")


def test_the_own_table_has_a_group_for_each_task_and_its_targets() -> None:
    groups = measure.own(taskspec.load)
    assert [{c.task for c in group} for group in groups] == [{name} for name in tables.SUITE]
    aimed = {(c.task, c.program, c.lanes): c.target for group in groups for c in group if c.target}
    assert aimed[("RiskyPath", "numpy", 1024)] == 40e6
    assert not any(task == "LargestSum" for task, _, _ in aimed)
    assert measure.target_of(taskspec.load("Branching"), "numpy", 1024) == 40e6
    assert measure.target_of(taskspec.load("Branching", L=20), "numpy", 1024) is None
    assert measure.target_of(taskspec.load("Branching"), "numpy", 1023) is None


def test_whoever_has_the_same_task_is_compared_with_a_program_that_runs_beside_it() -> None:
    for group in measure.games(taskspec.load):
        ours = {(c.program, c.lanes) for c in group if c.rival is None}
        assert all((c.rival, c.lanes) in ours or ("numpy", c.lanes) in ours for c in group if c.rival)


PEERS = {
    "gymnasium": lambda: peers.gymnasium_cart_pole(3),
    "envpool": lambda: peers.envpool_cart_pole(3),
    "seals": lambda: peers.seals_sync("seals/Parabola-v0", "Parabola", 3),
    "gymnax": lambda: peers.gymnax("UmbrellaChain-bsuite", "Umbrella", 3, {"n_distractor": 4}, {"chain_length": 9}),
}


@pytest.mark.parametrize("package", PEERS)
def test_others_step_as_many_lanes(package: str) -> None:
    pytest.importorskip(package)
    found = PEERS[package]()
    assert found.lanes == 3
    steps = found.make()()
    assert steps > 0 and steps % 3 == 0


# -- starting, and memory -----------------------------------------------------------------------------------------


def test_starts_and_memory_of_a_task_with_parameters() -> None:
    found = Done("vector", "Branching", "-p", "L=3", "-b", "numpy", "-l", 2, *QUICK, "--json").data
    (start,), (memory,) = found["starts"], found["memory"]
    assert start["task"] == memory["task"] == "derail/Branching-v0 L=3"
    assert start["warm"] == statistics.median(start["rounds"]) and len(start["rounds"]) == bench_vector.REPEATS
    assert 0 < min(start["rounds"]) <= start["warm"] and start["cold"] > 0
    assert memory["bytes_per_lane"] == memory["bytes"] / memory["lanes"] > 0


def test_a_process_that_takes_no_step_is_reported() -> None:
    with pytest.raises(TaskspecError, match="E713"):
        measure.start_times(taskspec.load("RiskyPath"), "abacus", 1)


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
@pytest.mark.parametrize("name", ["RiskyPath", "NoisyObs"])
def test_memory_is_that_of_the_arrays_and_of_what_goes_with_them(name: str, backend: str) -> None:
    needed(backend)
    task = taskspec.load(name)
    lanes = 20_000
    arrays = VectorEnvironment(task, lanes, backend=backend, autoreset_mode="SameStep").nbytes
    found = measure.memory(task, backend, lanes)
    assert arrays < found.bytes < 5 * arrays
    assert measure.memory(task, backend, 2 * lanes).per_lane == pytest.approx(found.per_lane, rel=0.5)


# -- the command --------------------------------------------------------------------------------------------------


def test_alone_it_shows_help() -> None:
    done = Done()
    assert all(word in done.out + done.err for word in ("seals", "vector", "exact"))


def test_json_says_all_that_was_measured_and_on_what() -> None:
    args = (
        "vector",
        SPECS / "umbrella.yaml",
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
        for task in ("specs/Umbrella-v0", "derail/RiskyPath-v0")
        for program, lanes in (("scalar", 1), ("numpy", 2), ("numpy", 3))
    ]
    for result in found["results"]:
        assert len(result["rounds"]) == 2
        assert result["steps_per_second"] == statistics.median(result["rounds"])
        assert result["spread"] == measure.spread(result["rounds"])
        assert result["target"] is None and result["met"] and result["ratio"] is None


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
    assert "2 threads on Numba" in done.out and "time as it passes" in done.out


def test_a_task_is_measured_on_all_that_suits_it_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_vector, "LANES", (2,))
    found = Done("vector", "Branching", "--no-start", *QUICK, "--json").data
    installed = [p for p, packages in NEEDS.items() if measure.installed(*packages) and p != "jax"]
    assert [r["program"] for r in found["results"]] == installed


def test_seals_beside_ours_alone_and_in_lanes() -> None:
    pytest.importorskip("seals")
    args = ("seals", "--task", "RiskyPath", "--task", "Sort", *QUICK)
    found = Done(*args, "--json").data
    assert [r["task"] for r in found["results"]] == ["derail/RiskyPathSeals-v0", "derail/SortSeals-v0"]
    assert all(r["ratio"] > 1 and r["target"] and len(r["rounds"]["seals"]) == 2 for r in found["results"])
    assert found["machine"]["versions"]["seals"] == "0.2.1"
    shown = Done(*args, columns=80).out
    assert "RiskyPath" in shown and max(map(len, shown.splitlines())) <= 80
    lanes = Done(*args, "--lanes", 4, "--backend", "numpy", "--json").data
    assert (lanes["lanes"], lanes["backend"]) == (4, "numpy")
    assert all(r["target"] is None for r in lanes["results"])
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


def _without(monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
    real = builtins.__import__

    def importing(name: str, *args: Any, **options: Any) -> Any:
        if name.partition(".")[0] == missing:
            raise ImportError(name)
        return real(name, *args, **options)

    monkeypatch.setattr(builtins, "__import__", importing)


def test_without_seals_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    _without(monkeypatch, "seals")
    done = Done("seals")
    assert done.status == 1
    assert "E705" in done.err
    assert 'pip install "taskspec[bench]"' in done.err


@pytest.mark.parametrize(("program", "package"), [("numba", "numba"), ("jax", "jax"), ("jax-scan", "jax")])
def test_without_a_backend_it_says_what_to_install(program: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = select.find_spec
    monkeypatch.setattr(select, "find_spec", lambda name: None if name == package else real(name))
    done = Done("vector", "Branching", "-b", program)
    assert (done.status, done.out) == (1, "")
    assert "E705" in done.err and f'pip install "taskspec[{package}]"' in done.err


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
    return [Rate(c, tuple(10 ** rng.uniform(*_decades(c)) * rng.uniform(0.9, 1.1, 5))) for c in found]


def _decades(c: Contestant) -> tuple[float, float]:
    return (6.0, 9.3) if c.program in measure.PROGRAMS else (4.0, 7.5)


def _printed(table: Any, width: int = 80) -> list[str]:
    out = io.StringIO()
    Console(file=out, width=width, theme=Theme(STYLES)).print(table)
    return out.getvalue().splitlines()


def test_tables_fit_into_80_columns(rates: list[Rate]) -> None:
    suite, games = rates[: 7 * len(tables.SUITE)], rates[7 * len(tables.SUITE) :]
    for table, rows in ((bench_print.matrix(suite), 12), (bench_print.sections(games), 15)):
        lines = _printed(table)
        assert len(lines) == rows
        assert max(map(len, lines)) <= 80
        assert "…" not in "".join(lines)


def test_a_ratio_is_that_of_the_medians_of_the_same_task_and_lanes(rates: list[Rate]) -> None:
    for rate in rates:
        c = rate.contestant
        found = bench_print.ratio_of(rate, rates)
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
    assert bench_print.millions(value) == shown


@pytest.mark.parametrize("kind", ["svg", "png", "pdf"])
def test_a_chart_is_the_same_every_time(kind: str, rates: list[Rate], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    paths = [tmp_path / f"{name}.{kind}" for name in "ab"]
    for path in paths:
        bench_chart.draw(rates, path)
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    if kind == "svg":
        assert all(f"<!-- {task} -->".encode() in first for task in tables.SUITE)


def _texts(figure: Any) -> Iterator[tuple[str, Any]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).draw()
    (axes,), (legend,) = figure.axes, figure.legends
    low, high = axes.get_xlim()
    ticks = [text for text in axes.get_xticklabels() if low <= text.get_position()[0] <= high]
    assert len(ticks) > 1
    for text in (*axes.get_yticklabels(), *ticks, axes.xaxis.label, *legend.get_texts()):
        if text.get_text():
            yield text.get_text(), text.get_window_extent()


@pytest.mark.parametrize("count", [1, 7, None])
def test_no_words_of_a_chart_overlap_or_leave_it(count: int | None, rates: list[Rate]) -> None:
    pytest.importorskip("matplotlib")
    figure = bench_chart.figure(rates[:count])
    words = list(_texts(figure))
    width, height = figure.canvas.get_width_height()
    for name, box in words:
        assert box.x0 >= 0 and box.x1 <= width and box.y0 >= 0 and box.y1 <= height, name
    for i, (name, box) in enumerate(words):
        assert not any(box.overlaps(other) for _, other in words[:i]), name


def test_a_chart_is_written_beside_the_table(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "deep" / "chart.svg"
    done = Done("vector", "Branching", "-b", "numpy", "-l", 2, "--no-start", *QUICK, "--chart", path)
    assert f"wrote {path}" in done.out
    assert "<svg" in path.read_text(encoding="utf-8")
