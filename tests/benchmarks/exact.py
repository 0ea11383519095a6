"""A slippery grid, written as a spec: how long it takes to extract and to solve, beside Storm and beside plain loops.

The grid has N x N cells, which are its states, and four actions. A step goes in the wanted direction with probability 0.8
and to either side of it with 0.1; walls hold. A goal pays 1, once. The value asked for is the probability of reaching it
within the horizon. From the middle, episodes of 1,000 steps enter all of a million cells; from near a corner, with the goal in
it, episodes of 300 steps enter few of them. Storm builds all cells, and then leaves out those that cannot reach the goal in the
steps that are left. What is printed is the size of the model that each has built, and the memory of its process.

A sweep over all transitions is bound by memory: its limit is the time in which as many bytes are copied. Programs that pass
over states may be faster than that.
"""

from __future__ import annotations

import importlib
import multiprocessing
import re
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.extras import is_installed
from taskspec.base.limits import also
from taskspec.cli.console import say, write_json
from taskspec.exact.model.extract import extract
from taskspec.exact.solve.bounded import Bounded
from taskspec.exact.solve.solve import Solvers
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.benchmarks.limit import copying
from tests.shared.solved import optimal_return

SPEC = """
taskspec: 1
name: SlipperyGrid
parameters:
  N: {type: int, default: 1000, low: 2, high: 2000, doc: cells on a side}
  steps: {type: int, default: 100, low: 1, high: 10000, doc: horizon}
  start: {type: int, default: 0, low: 0, high: 1999, doc: both coordinates of the first cell}
  goal: {type: int, default: 1, low: 0, high: 1999, doc: both coordinates of the goal}
constants:
  dx: [1, 0, -1, 0]
  dy: [0, 1, 0, -1]
noise:
  turn: {0: 4/5, 1: 1/10, -1: 1/10}
definitions:
  way: (a + turn) % 4
  there: x == goal and y == goal
state:
  x: {type: int, low: 0, high: N - 1}
  y: {type: int, low: 0, high: N - 1}
action:
  a: {type: choice, values: {right: 0, up: 1, left: 2, down: 3}}
horizon: steps
initial:
  x: start
  y: start
dynamics:
  x': x if there else clip(x + dx[way], 0, N - 1)
  y': y if there else clip(y + dy[way], 0, N - 1)
reward: x' == goal and y' == goal and not there
"""

PRISM = """
mdp
const int M = {last};
const int aim = {goal};
formula right = min(x + 1, M);
formula left = max(x - 1, 0);
formula up = min(y + 1, M);
formula down = max(y - 1, 0);
module grid
  x : [0..M] init {start};
  y : [0..M] init {start};
  [r] x != aim | y != aim -> 0.8 : (x' = right) + 0.1 : (y' = up) + 0.1 : (y' = down);
  [u] x != aim | y != aim -> 0.8 : (y' = up) + 0.1 : (x' = left) + 0.1 : (x' = right);
  [l] x != aim | y != aim -> 0.8 : (x' = left) + 0.1 : (y' = down) + 0.1 : (y' = up);
  [d] x != aim | y != aim -> 0.8 : (y' = down) + 0.1 : (x' = right) + 0.1 : (x' = left);
  [end] x = aim & y = aim -> true;
endmodule
label "goal" = x = aim & y = aim;
"""
LASTING = {
    "discount": "horizon: none\ndiscount: 99/100\nterminal: x' == goal and y' == goal",
    "chance": "horizon: none\nterminal: over == 1 or x' == goal and y' == goal",
}
"""Grids without a horizon: with a discount, and with a chance of 1 in 100 that a step ends the episode and earns nothing."""
WAY = 40
"""Cells between the start and the goal on both axes."""
PATIENT = "seconds=1000"
"""Limits that let 1,000 steps of a million states be solved; by default, analyses of more than ten seconds are refused."""


@dataclass(frozen=True, slots=True)
class Grid:
    """A grid of `n` x `n` cells, the coordinates of its start and of its goal, and the horizon; `name` says where these lie.

    One without a horizon has 0 `steps`, and `lasting` says what ends its episodes.
    """

    name: str
    n: int
    steps: int
    start: int
    goal: int
    lasting: str = ""

    @property
    def task(self) -> Task:
        values = {"N": self.n, "start": self.start, "goal": self.goal}
        text = SPEC
        if self.lasting:
            text = text.replace("horizon: steps", LASTING[self.lasting])
        else:
            values["steps"] = self.steps
        if self.lasting == "chance":
            text = text.replace("noise:", "noise:\n  over: {1: 1/100, 0: 99/100}").replace(
                "not there", "not there and over == 0"
            )
        return build(read_text(text, "slippery_grid.yaml"), None, values)

    @property
    def prism(self) -> str:
        """The same for Storm: a discount is a chance to end."""
        text = PRISM
        if self.lasting:
            end = "0.01 : (x' = 0) & (y' = 0) & (over' = true)"
            for before, after in (("0.8", "0.792"), ("0.1", "0.099")):
                text = text.replace(f"{before} :", f"{after} :")
            text = text.replace("] x != aim | y != aim", "] !over & (x != aim | y != aim)")
            text = re.sub(r"(-> 0\.792.*);", rf"\1 + {end};", text)
            text = text.replace("[end] x = aim & y = aim", "[end] over | x = aim & y = aim")
            text = text.replace('"goal" = x', '"goal" = !over & x').replace(
                "module grid", "module grid\n  over : bool init false;"
            )
        return text.format(last=self.n - 1, start=self.start, goal=self.goal)

    @property
    def words(self) -> str:
        endings = {"": f"{self.steps:,} steps", "discount": "discount 0.99", "chance": "ends with 0.01 in each step"}
        return f"{self.n * self.n:,} cells, {self.name}, {endings[self.lasting]}"


def from_middle(n: int, steps: int) -> Grid:
    start = (n - 1) // 2
    return Grid("from the middle", n, steps, start, min(start + WAY, n - 1))


def lasting(n: int, why: str) -> Grid:
    return replace(from_middle(n, 0), lasting=why)


def to_corner(n: int, steps: int) -> Grid:
    return Grid("into the corner", n, steps, max(n - WAY, 0), n - 1)


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds of processor time, of all threads, to build a model and to solve it; its size, the value, and the bytes of memory
    of the process (None: unknown).

    `limit` is the time in which as many bytes are copied as sweeps over the whole model move: one for each step, or one alone
    where there is no horizon.
    """

    name: str
    grid: Grid
    states: int
    transitions: int
    build: float
    solve: float
    value: float
    limit: float = 0.0
    memory: int | None = None

    @property
    def total(self) -> float:
        return self.build + self.solve


def ours(grid: Grid) -> Timing:
    """From spec to value, with the states that `extract` takes; reading and checking count as building."""
    return _ours("taskspec", grid, None)


def declared(grid: Grid) -> Timing:
    """From spec to value, with all states of the grid."""
    return _ours("taskspec, all states", grid, False)


def _ours(name: str, grid: Grid, reachable: bool | None) -> Timing:
    _compile()
    with also(PATIENT):
        start = time.process_time()
        model = extract(grid.task, reachable=reachable)
        built = time.process_time()
        if grid.lasting:
            found = Solvers(model).in_floats.best()
            assert found.high - found.low < 1e-9
            value = float(found.value)
        else:
            value = optimal_return(model)
        done = time.process_time()
    if grid.lasting == "discount":
        value *= 0.99  # for Storm the step into the goal may fail, too
    return Timing(name, grid, model.n_states, model.entries, built - start, done - built, value)


def _compile() -> None:
    """Compile the sweeps beforehand, where Numba is installed."""
    if is_installed("numba"):
        from taskspec.exact.solve.kernels_numba import extreme_values

        extreme_values(Bounded(extract(to_corner(5, 1).task)), True)
        Solvers(extract(lasting(100, "discount").task)).in_floats.best()


def storm(grid: Grid) -> Timing | None:
    """The same by stormpy's sparse engine, which builds all states of the grid; None where it is not installed."""
    if not is_installed("stormpy"):
        return None
    stormpy: Any = importlib.import_module("stormpy")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.prism"
        path.write_text(grid.prism, encoding="utf-8")
        start = time.process_time()
        program = stormpy.parse_prism_program(str(path))
        within = "" if grid.lasting else f"<={grid.steps}"
        formula = stormpy.parse_properties(f'Pmax=? [F{within} "goal"]', program)[0]
        model = stormpy.build_model(program, [formula])
        built = time.process_time()
        environment = _sound(stormpy) if grid.lasting else stormpy.Environment()
        found = stormpy.model_checking(model, formula, environment=environment)
        value = _at(found, model.initial_states[0])
        done = time.process_time()
    return Timing("Storm", grid, model.nr_states, model.nr_transitions, built - start, done - built, value)


def _sound(stormpy: Any) -> Any:
    """Sound value iteration, with Storm's own precision: a relative error of at most one in a million."""
    environment = stormpy.Environment()
    solver = environment.solver()
    solver.force_soundness = True
    developer: Any = importlib.import_module("stormpy.developer")
    solver.min_max().method = developer.MinMaxMethod.SOUND_VALUE_ITERATION
    return environment


def _at(result: Any, state: int) -> float:
    """The value of a state; versions of stormpy differ in how they give it."""
    return float(result.at(state) if hasattr(result, "at") else result.get_value(state))


def loops(grid: Grid) -> Timing:
    """The same by loops over times, states and actions in plain Python, as published evaluation code has them."""
    start = time.process_time()
    cells = grid.n * grid.n
    outcomes = [[_outcomes(s, a, grid) for a in range(4)] for s in range(cells)]
    built = time.process_time()
    value = [0.0] * cells
    for _ in range(grid.steps):
        better = []
        for s in range(cells):
            best = -float("inf")
            for a in range(4):
                best = max(best, sum(p * (r + value[s2]) for p, r, s2 in outcomes[s][a]))
            better.append(best)
        value = better
    done = time.process_time()
    transitions = sum(len(found) for actions in outcomes for found in actions)
    at_start = value[grid.start * grid.n + grid.start]
    return Timing("plain Python", grid, len(outcomes), transitions, built - start, done - built, at_start)


def _outcomes(s: int, a: int, grid: Grid) -> list[tuple[float, float, int]]:
    n = grid.n
    goal = grid.goal * n + grid.goal
    x, y = divmod(s, n)
    if s == goal:
        return [(1.0, 0.0, s)]
    found = []
    for turn, p in ((0, 0.8), (1, 0.1), (-1, 0.1)):
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[(a + turn) % 4]
        s2 = min(max(x + dx, 0), n - 1) * n + min(max(y + dy, 0), n - 1)
        found.append((p, float(s2 == goal), s2))
    return found


# -- what is measured -------------------------------------------------------------------------------------------------

Solver = Callable[[Grid], Timing | None]
PLANS: tuple[tuple[Grid, tuple[Solver, ...]], ...] = (
    (from_middle(1000, 100), (ours, storm)),
    (from_middle(1000, 300), (ours, storm)),
    (from_middle(1000, 1000), (ours, storm)),
    (to_corner(1000, 300), (ours, declared, storm)),
    (lasting(100, "discount"), (ours, storm)),
    (lasting(300, "discount"), (ours, storm)),
    (lasting(1000, "discount"), (ours, storm)),
    (lasting(100, "chance"), (ours, storm)),
    (lasting(300, "chance"), (ours, storm)),
    (to_corner(100, 100), (declared, loops)),
)
"""Grids, and who solves each."""
ENTRY = 12
"""Bytes of a transition in a sweep: its column and its probability."""
ROW = 12
"""Bytes of an action in a state beside its transitions: where these begin, and the reward."""
STATE = 16
"""Bytes of a value that is read and of one that is written."""


def run(plans: Sequence[tuple[Grid, Sequence[Solver]]] = PLANS, repeat: int = 3, apart: bool = True) -> list[Timing]:
    """Return the best of some runs of each solver on each grid, with their limits. AssertionError: values differ.

    Args:
        apart: each run in a process of its own, the memory of which is measured.
    """
    timings = []
    for grid, solvers in plans:
        best = []
        for solver in solvers:
            runs = [_run(solver, grid, apart) for _ in range(repeat)]
            known = [t for t in runs if t is not None]
            if known:
                best.append(min(known, key=lambda t: t.total))
        values = [t.value for t in best]
        assert np.ptp(values) < (1e-6 if grid.lasting else 1e-9), values
        timings += [replace(t, limit=_limit(t)) for t in best]
    return timings


def _run(solver: Solver, grid: Grid, apart: bool) -> Timing | None:
    if not apart:
        return solver(grid)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        found = pool.submit(solver, grid).result()
        if found is None:
            return None
        return replace(found, memory=pool.submit(memory).result())


def memory() -> int | None:
    """The largest number of bytes that this process has had in memory, where the system says so."""
    path = Path("/proc/self/status")
    if not path.exists():
        return None
    found = re.search(r"^VmHWM:\s*(\d+) kB", path.read_text(encoding="utf-8"), re.MULTILINE)
    return int(found[1]) * 1024 if found else None


def _limit(timing: Timing) -> float:
    """Seconds in which as many bytes are copied as sweeps over all of the model move, on one core."""
    rows = 4 * timing.states
    moved = ENTRY * timing.transitions + ROW * rows + STATE * timing.states
    copy = copying(moved)
    seconds = []
    for _ in range(5):
        start = time.process_time()
        copy()
        seconds.append(time.process_time() - start)
    return min(seconds) * max(1, timing.grid.steps)


def record(timings: Sequence[Timing]) -> list[dict[str, Any]]:
    """As plain data for JSON."""
    return [asdict(t) | {"total": t.total} for t in timings]


def table(timings: Sequence[Timing]) -> str:
    """As a table in text: a heading for each grid, a row for each solver with the size of the model that it built."""
    heads = ("states", "transitions", "build s", "solve s", "total s", "limit s", "of it", "MB")
    lines = [f"{'':22}" + "".join(f"{head:>{width}}" for head, width in zip(heads, WIDTHS, strict=True))]
    for grid, rows in groupby(timings, lambda t: t.grid):
        lines.append(grid.words)
        for t in rows:
            limit = "<0.01"
            if t.limit >= 0.01:
                limit = f"{t.limit:.2f}"
            memory = "" if t.memory is None else f"{t.memory / 1e6:,.0f}"
            cells = (
                f"{t.states:,}", f"{t.transitions:,}", f"{t.build:.2f}", f"{t.solve:.2f}", f"{t.total:.2f}", limit,
                f"{t.limit / t.solve:.0%}", memory,
            )  # fmt: skip
            lines.append(f"  {t.name:20}" + "".join(f"{cell:>{w}}" for cell, w in zip(cells, WIDTHS, strict=True)))
    return "\n".join(lines)


WIDTHS = (10, 12, 8, 8, 8, 8, 7, 6)
FASTER = 100.0
"""How many times as long plain loops take as we do, at least, on the same states."""


def bench(rounds: int, json: bool) -> bool:
    """Measure and print; return whether the target is met."""
    timings = run(repeat=rounds)
    if json:
        write_json(record(timings))
    else:
        say(table(timings))
    *_, own, theirs = timings
    return theirs.total >= FASTER * own.total
