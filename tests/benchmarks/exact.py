"""A slippery grid, written as a spec: how long it takes to extract and to solve, beside Storm and beside plain loops.

The grid has N x N cells, which are its states, and four actions. A step goes in the wanted direction with probability 0.8
and to either side of it with 0.1; walls hold. The far corner pays 1, once. The value asked for is
the probability of reaching it within the horizon from a cell 40 steps away on both axes. Episodes enter only cells that
are near enough, and Storm builds them all: what is printed is the size of the model that each has built.
"""

from __future__ import annotations

import importlib
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.extras import is_installed
from taskspec.cli.console import say, write_json
from taskspec.exact.model.extract import extract
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.solved import optimal_return

SPEC = """
taskspec: 1
name: SlipperyGrid
parameters:
  N: {type: int, default: 1000, low: 2, high: 2000, doc: cells on a side}
  steps: {type: int, default: 100, low: 1, high: 10000, doc: horizon}
constants:
  dx: [1, 0, -1, 0]
  dy: [0, 1, 0, -1]
noise:
  turn: {0: 4/5, 1: 1/10, -1: 1/10}
definitions:
  way: (a + turn) % 4
  there: x == N - 1 and y == N - 1
state:
  x: {type: int, low: 0, high: N - 1}
  y: {type: int, low: 0, high: N - 1}
action:
  a: {type: choice, values: {right: 0, up: 1, left: 2, down: 3}}
horizon: steps
initial:
  x: max(N - 40, 0)
  y: max(N - 40, 0)
dynamics:
  x': x if there else clip(x + dx[way], 0, N - 1)
  y': y if there else clip(y + dy[way], 0, N - 1)
reward: x' == N - 1 and y' == N - 1 and not there
"""

PRISM = """
mdp
const int M = {last};
formula right = min(x + 1, M);
formula left = max(x - 1, 0);
formula up = min(y + 1, M);
formula down = max(y - 1, 0);
module grid
  x : [0..M] init {start};
  y : [0..M] init {start};
  [r] x < M | y < M -> 0.8 : (x' = right) + 0.1 : (y' = up) + 0.1 : (y' = down);
  [u] x < M | y < M -> 0.8 : (y' = up) + 0.1 : (x' = left) + 0.1 : (x' = right);
  [l] x < M | y < M -> 0.8 : (x' = left) + 0.1 : (y' = down) + 0.1 : (y' = up);
  [d] x < M | y < M -> 0.8 : (y' = down) + 0.1 : (x' = right) + 0.1 : (x' = left);
  [end] x = M & y = M -> true;
endmodule
label "goal" = x = M & y = M;
"""


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds to build a model and to solve it, the size of the model that was built, and the value found."""

    name: str
    cells: int
    steps: int
    states: int
    transitions: int
    build: float
    solve: float
    value: float

    @property
    def total(self) -> float:
        return self.build + self.solve


def grid(n: int, steps: int = 100) -> Task:
    return build(read_text(SPEC, "slippery_grid.yaml"), None, {"N": n, "steps": steps})


def entered(n: int, steps: int) -> Timing:
    """From spec to value, with the states that episodes enter; reading and checking count as building."""
    return _ours("taskspec, states entered", n, steps, reachable=True)


def declared(n: int, steps: int) -> Timing:
    """From spec to value, with all states of the grid."""
    return _ours("taskspec, all states", n, steps, reachable=False)


def _ours(name: str, n: int, steps: int, reachable: bool) -> Timing:
    start = time.perf_counter()
    model = extract(grid(n, steps), reachable=reachable)
    built = time.perf_counter()
    value = optimal_return(model)
    done = time.perf_counter()
    return Timing(name, n * n, steps, model.n_states, model.entries, built - start, done - built, value)


def storm(n: int, steps: int) -> Timing | None:
    """The same by stormpy's sparse engine, which builds all states of the grid; None where it is not installed."""
    if not is_installed("stormpy"):
        return None
    stormpy: Any = importlib.import_module("stormpy")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.prism"
        path.write_text(PRISM.format(last=n - 1, start=max(n - 40, 0)), encoding="utf-8")
        start = time.perf_counter()
        program = stormpy.parse_prism_program(str(path))
        formula = stormpy.parse_properties(f'Pmax=? [F<={steps} "goal"]', program)[0]
        model = stormpy.build_model(program, [formula])
        built = time.perf_counter()
        found = stormpy.model_checking(model, formula)
        value = _at(found, model.initial_states[0])
        done = time.perf_counter()
    return Timing("stormpy", n * n, steps, model.nr_states, model.nr_transitions, built - start, done - built, value)


def _at(result: Any, state: int) -> float:
    """The value of a state; versions of stormpy differ in how they give it."""
    return float(result.at(state) if hasattr(result, "at") else result.get_value(state))


def loops(n: int, steps: int) -> Timing:
    """The same by loops over times, states and actions in plain Python, as published evaluation code has them."""
    start = time.perf_counter()
    outcomes = [[_outcomes(s, a, n) for a in range(4)] for s in range(n * n)]
    built = time.perf_counter()
    value = [0.0] * (n * n)
    for _ in range(steps):
        better = []
        for s in range(n * n):
            best = -float("inf")
            for a in range(4):
                best = max(best, sum(p * (r + value[s2]) for p, r, s2 in outcomes[s][a]))
            better.append(best)
        value = better
    first = max(n - 40, 0)
    done = time.perf_counter()
    transitions = sum(len(found) for actions in outcomes for found in actions)
    at_start = value[first * n + first]
    return Timing("plain Python", n * n, steps, len(outcomes), transitions, built - start, done - built, at_start)


def _outcomes(s: int, a: int, n: int) -> list[tuple[float, float, int]]:
    x, y = divmod(s, n)
    if s == n * n - 1:
        return [(1.0, 0.0, s)]
    found = []
    for turn, p in ((0, 0.8), (1, 0.1), (-1, 0.1)):
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[(a + turn) % 4]
        s2 = min(max(x + dx, 0), n - 1) * n + min(max(y + dy, 0), n - 1)
        found.append((p, float(s2 == n * n - 1), s2))
    return found


Solver = Callable[[int, int], Timing | None]
PLANS: tuple[tuple[int, int, tuple[Solver, ...]], ...] = (
    (1000, 200, (entered, declared, storm)),
    (1000, 300, (entered, declared, storm)),
    (100, 100, (declared, loops)),
)
"""Cells on a side, steps, and who solves that grid."""


def run(plans: Sequence[tuple[int, int, Sequence[Solver]]] = PLANS, repeat: int = 3) -> list[Timing]:
    """Return the best of some runs of each solver on each grid.

    Compilation is paid beforehand. Raises AssertionError when values differ.
    """
    declared(450, 1)  # compiles the sweeps, where Numba is installed
    timings = []
    for n, steps, solvers in plans:
        best = []
        for solver in solvers:
            runs = [t for t in (solver(n, steps) for _ in range(repeat)) if t is not None]
            if runs:
                best.append(min(runs, key=lambda t: t.total))
        values = [t.value for t in best]
        assert np.ptp(values) < 1e-9, values
        timings += best
    return timings


def record(timings: Sequence[Timing]) -> list[dict[str, Any]]:
    """As plain data for JSON."""
    return [asdict(t) | {"total": t.total} for t in timings]


def table(timings: Sequence[Timing]) -> str:
    """As a table in text: a heading for each grid, a row for each solver with the size of the model that it built."""
    lines = [f"{'':26}{'states':>12}{'transitions':>14}{'build s':>10}{'solve s':>10}{'total s':>10}"]
    for (cells, steps), rows in groupby(timings, lambda t: (t.cells, t.steps)):
        lines.append(f"{cells:,} cells, {steps} steps")
        for t in rows:
            size = f"{t.states:>12,}{t.transitions:>14,}"
            lines.append(f"  {t.name:24}{size}{t.build:>10.3f}{t.solve:>10.3f}{t.total:>10.3f}")
    return "\n".join(lines)


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
