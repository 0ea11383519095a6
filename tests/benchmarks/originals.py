"""How many times faster than its original a task is: `python -m tests.benchmarks.originals`, where originals are installed.

The NumPy vector environment and a loop over the original take turns in one process, both with random actions. The ratios
are written into a file that docs/reference/library.md shows; those of originals that are not here stay as they are.
"""

from __future__ import annotations

import contextlib
import json
import statistics
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from tests.verification.originals.beside import Case

FILE = Path(__file__).parents[2] / "docs" / "tools" / "library_speed.json"
MODULES = ("bsuite", "gridworlds", "gymnasium", "popgym")
LANES = 1024
ROUNDS = 7
SECONDS = 0.1


def every_case() -> Iterator[Case]:
    """One case for each task whose original can be imported."""
    found: dict[str, Case] = {}
    for name in MODULES:
        with contextlib.suppress(pytest.skip.Exception):
            module = import_module(f"tests.verification.originals.test_{name}")
            for case in [*module.CASES, *getattr(module, "MORE", [])]:
                found.setdefault(case.task, case)
    yield from found.values()


def rate(step: Callable[[], Any]) -> float:
    """Calls in a second."""
    start = time.perf_counter()
    calls = 0
    while time.perf_counter() - start < SECONDS:
        step()
        calls += 1
    return calls / (time.perf_counter() - start)


def ratio(case: Case) -> float:
    rng = np.random.default_rng(0)
    ours = taskspec.make_vec(case.task, num_envs=LANES, backend="numpy", **case.parameters)
    ours.reset(seed=0)
    ours.action_space.seed(0)
    batch = ours.action_space.sample()
    theirs = case.original()
    theirs.reset(seed=0)
    state = theirs.state()
    space = ours.single_action_space
    actions = [case.act(rng, state, space) for _ in range(64)]

    def step() -> None:
        for action in actions:
            found = theirs.step(action)
            if found.terminated or found.truncated:
                theirs.reset(seed=0)

    ratios = []
    for _ in range(ROUNDS):
        ratios.append(rate(lambda: ours.step(batch)) * LANES / (rate(step) * len(actions)))
    return statistics.median(ratios)


if __name__ == "__main__":
    known = json.loads(FILE.read_text()) if FILE.is_file() else {}
    for case in every_case():
        known[case.task] = float(f"{ratio(case):.2g}")
        print(case.task, known[case.task], flush=True)
    FILE.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n")
