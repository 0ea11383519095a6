"""A slippery grid, written as a spec: how long it takes to extract and to solve, beside Storm and beside plain loops.

The grid has N x N cells and four actions. A step goes in the wanted direction with probability 0.8
and to either side of it with 0.1; walls hold. The far corner pays 1, once. The value asked for is
the probability of reaching it within the horizon from a cell 40 steps away on both axes.
"""

from __future__ import annotations

import importlib
import math
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.extras import is_installed
from taskspec.cli.console import say, write_json
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model
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
    """Seconds to build the model and to solve it, and the value found. `peak_mb` is that of the whole process so far."""

    name: str
    states: int
    steps: int
    build: float
    solve: float
    value: float
    peak_mb: float

    @property
    def total(self) -> float:
        return self.build + self.solve


def grid(n: int, steps: int = 100) -> Task:
    return build(read_text(SPEC, "slippery_grid.yaml"), None, {"N": n, "steps": steps})


def ours(n: int, steps: int = 100) -> Timing:
    """Spec to value: reading, checking and extracting count as building."""
    start = time.perf_counter()
    model = extract(grid(n, steps))
    built = time.perf_counter()
    value = optimal_return(model)
    return _timing("taskspec", n, steps, start, built, value)


def storm(n: int, steps: int = 100) -> Timing | None:
    """The same by stormpy's sparse engine; None where it is not installed."""
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
    return _timing("stormpy", n, steps, start, built, _at(found, model.initial_states[0]))


def _at(result: Any, state: int) -> float:
    """The value of a state; versions of stormpy differ in how they give it."""
    return float(result.at(state) if hasattr(result, "at") else result.get_value(state))


def loops(n: int, steps: int = 100) -> Timing:
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
    return _timing("plain Python", n, steps, start, built, value[first * n + first])


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


def _timing(name: str, n: int, steps: int, start: float, built: float, value: float) -> Timing:
    done = time.perf_counter()
    return Timing(name, n * n, steps, built - start, done - built, value, _peak())


def _peak() -> float:
    """Return the most memory that this process has taken so far, in MB; NaN where the system does not say."""
    if not is_installed("resource"):
        return math.nan
    import resource

    unit = 2**20 if sys.platform == "darwin" else 2**10  # bytes there, KiB elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def memory(model: Model) -> int:
    """Bytes in a model's arrays."""
    total = 0
    for step in {id(x): x for x in model.steps}.values():
        for matrix in (step.P, *([] if step.P_end is None else [step.P_end])):
            total += matrix.data.nbytes + matrix.indices.nbytes + matrix.indptr.nbytes
        total += step.R.nbytes
    return total


def run(side: int = 1000, small: int = 100, steps: int = 100, repeat: int = 3) -> list[Timing]:
    """The benchmark: a large grid beside Storm and a small one beside plain loops; the best of some runs of each.

    Compilation is paid beforehand. Raises AssertionError when the values differ.
    """
    ours(small, 1)
    _warm(small)
    plans: list[tuple[int, Callable[[int, int], Timing | None]]] = [
        (side, ours),
        (side, storm),
        (small, ours),
        (small, loops),
    ]
    found = []
    for n, function in plans:
        runs = [t for t in (function(n, steps) for _ in range(1 if function is loops else repeat)) if t is not None]
        if runs:
            found.append(min(runs, key=lambda t: t.total))
    for n in (side, small):
        values = [t.value for t in found if t.states == n * n]
        assert np.ptp(values) < 1e-9, values
    return found


def _warm(n: int) -> None:
    """Compile the sweeps, where Numba is installed, before anything is timed."""
    if is_installed("numba"):
        ours(max(n, 450), 1)


def record(timings: list[Timing]) -> list[dict[str, Any]]:
    """As plain data for JSON."""
    return [asdict(t) | {"total": t.total} for t in timings]


def table(timings: list[Timing]) -> str:
    """As a table in text, with the ratios."""
    lines = [f"{'':14}{'states':>10}{'build s':>10}{'solve s':>10}{'total s':>10}{'times ours':>12}{'peak MB':>10}"]
    for t in timings:
        own = next(o for o in timings if o.name == "taskspec" and o.states == t.states)
        ratio = f"{t.total / own.total:.1f}"
        lines.append(
            f"{t.name:14}{t.states:>10,}{t.build:>10.3f}{t.solve:>10.3f}{t.total:>10.3f}{ratio:>12}{t.peak_mb:>10,.0f}"
        )
    return "\n".join(lines)


TARGETS = {"storm": 3.0, "loops": 100.0}
"""The smallest ratio of the time of others to ours, by a part of their name."""


def bench(rounds: int, json: bool) -> bool:
    """Measure and print; return whether every target is met."""
    timings = run(repeat=rounds)
    if json:
        write_json(record(timings))
    else:
        say(table(timings))
    return all(_met(timings, name, factor) for name, factor in TARGETS.items())


def _met(timings: Sequence[Timing], name: str, factor: float) -> bool:
    """Return whether a rival, where it was measured, took that many times as long as ours on the same grid."""
    for rival in (t for t in timings if name in t.name.lower()):
        own = next(t for t in timings if t.name == "taskspec" and t.states == rival.states)
        if rival.total < factor * own.total:
            return False
    return True
