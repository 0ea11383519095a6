"""Compiled kernels on disk: found by the next process, which does without Numba, and made again where they are damaged."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

PROGRAM = """
import json, sys
import numpy as np
import taskspec

lanes = taskspec.make_vec("derail/ProcGoal-v0", num_envs=70, backend="numba", num_threads=int(sys.argv[1]))
alone = taskspec.make("derail/ProcGoal-v0")
seen = [lanes.reset(seed=3)[0][9].tolist()]
one = [alone.reset(seed=12)[0].tolist()]
for k in range(40):
    *results, _ = lanes.step(np.full(70, k % 5))
    seen.append([results[0][9].tolist(), *(r[9].item() for r in results[1:])])
    if k and one[-1][-1]:
        one.append([alone.reset()[0].tolist(), 0.0, False, False])
    else:
        observation, *rest = alone.step(k % 5)
        one.append([observation.tolist(), *rest[:-1]])
print(json.dumps({"same": seen == one, "numba": "numba" in sys.modules}))
"""


def run(cache: Path, threads: int = 1, program: str = PROGRAM) -> dict[str, bool]:
    """What a program says in a process of its own."""
    environment = {**os.environ, "TASKSPEC_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", program, str(threads)], env=environment, capture_output=True, text=True, check=False
    )
    assert not done.returncode, done.stderr
    found: dict[str, bool] = json.loads(done.stdout)
    return found


def test_a_second_process_loads_what_the_first_one_compiled_without_numba(tmp_path: Path) -> None:
    assert run(tmp_path) == {"same": True, "numba": True}
    (kernel,) = (tmp_path / "numba").glob("*.o")
    assert run(tmp_path) == {"same": True, "numba": False}
    assert run(tmp_path, threads=2) == {"same": True, "numba": False}
    whole = kernel.read_bytes()
    kernel.write_bytes(whole[:-100] + bytes(100))
    assert run(tmp_path) == {"same": True, "numba": True}
    assert kernel.read_bytes() == whole


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path) -> None:
    (tmp_path / "numba").write_text("not a folder")
    assert run(tmp_path) == {"same": True, "numba": True}


FORGETFUL = """
import gc, json
import numpy as np
import taskspec
from taskspec.programs.numba import engine, loading

def forget():
    loading.load.cache_clear()
    engine.compile_numba.cache_clear()
    gc.collect()

def ended(env, action):
    env.reset(seed=0)
    return [bool(env.step(action)[3].all()) for _ in range(20)].index(True)

kept, found = [], []
for length in (5, 6, 5, 7):
    kept.append(taskspec.make_vec("derail/Branching-v0", num_envs=4, backend="numba", L=length))
    forget()
    del kept[:-2]
    gc.collect()
    found += [ended(env, np.ones(4, np.int64)) == env.task.horizon - 1 for env in kept]
reals = taskspec.make_vec("derail/Parabola-v0", num_envs=4, backend="numba")
for dtype in (np.float64, np.float32, np.float64):
    found.append(ended(reals, np.zeros((4, 1), dtype)) == reals.task.horizon - 1)
    forget()
print(json.dumps({"same": all(found)}))
"""


@pytest.mark.slow
def test_kernels_live_as_long_as_the_environments_that_run_them(tmp_path: Path) -> None:
    assert run(tmp_path, program=FORGETFUL) == {"same": True}
