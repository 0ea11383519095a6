"""Compiled kernels on disk: found by the next process, made again where they are damaged, and read from private folders only."""

import json
import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("numba")

from taskspec.programs.numba import module

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
hits = lanes._engine._module.step.stats.cache_hits
print(json.dumps({"same": seen == one, "kept": bool(hits)}))
"""


def run(folder: Path, threads: int) -> dict[str, bool]:
    """What the program says in a process of its own."""
    environment = {**os.environ, "TASKSPEC_CACHE": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(threads)], env=environment, capture_output=True, text=True, check=False
    )
    assert not done.returncode, done.stderr
    result: dict[str, bool] = json.loads(done.stdout)
    return result


def test_a_second_process_loads_what_the_first_one_compiled(tmp_path: Path) -> None:
    assert run(tmp_path, 1) == {"same": True, "kept": False}
    assert run(tmp_path, 2) == {"same": True, "kept": True}


# -- files ----------------------------------------------------------------------------------------------------------

SOURCE = """
from taskspec.programs.numba.runtime import kernel

@kernel
def step(x):
    return x + {}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where kernels are kept."""
    monkeypatch.setenv("TASKSPEC_CACHE", str(tmp_path))
    module._warn_once.cache_clear()
    yield tmp_path / "numba"
    module.load.cache_clear()


def outcome(number: int = 1) -> tuple[int, bool]:
    """The result of a function for 1, and whether Numba had it on disk."""
    module.load.cache_clear()
    function = module.load(SOURCE.format(number)).step
    return module.compiled(function, 1)(1), bool(function.stats.cache_hits)


def test_what_is_kept_is_found_again_and_is_private(folder: Path) -> None:
    assert outcome() == (2, False)
    assert outcome() == (2, True)
    assert outcome(2) == (3, False)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert len(list(folder.iterdir())) == 2


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def truncated(file: Path) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])


def replaced(file: Path) -> None:
    file.write_text("raise SystemExit('foreign code')")


@pytest.mark.parametrize("damage", [emptied, truncated, replaced, Path.unlink], ids=lambda f: f.__name__)
@pytest.mark.parametrize("file", ["*.nbi", "*.nbc", "kernel.py"])
def test_what_is_damaged_is_made_again(folder: Path, file: str, damage: Callable[[Path], None]) -> None:
    assert outcome() == (2, False)
    (kept,) = folder.rglob(file)
    damage(kept)
    assert outcome()[0] == 2
    assert outcome() == (2, True)


def test_what_cannot_be_written_is_done_without(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", full)
    assert outcome() == (2, False)


# -- folders --------------------------------------------------------------------------------------------------------


def refused(folder: Path, caplog: pytest.LogCaptureFixture, why: str) -> None:
    """Nothing is read from the folder or written to it, and one line says why."""
    before = sorted(folder.rglob("*"))
    for file in folder.rglob("kernel.py"):
        replaced(file)
    assert outcome()[0] == 2
    assert outcome() == (2, True)  # from a folder of this process
    assert sorted(folder.rglob("*")) == before
    (record,) = caplog.records
    assert why in record.message
    assert record.message.startswith("taskspec: compiled kernels are not kept, since ")
    assert "\n" not in record.message


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o707, 0o1777, 0o720])
def test_a_folder_that_others_may_write_to_is_refused(
    folder: Path, caplog: pytest.LogCaptureFixture, mode: int
) -> None:
    outcome()
    folder.chmod(mode)
    refused(folder, caplog, f"others may write to {folder} (mode {mode:o}")


def test_a_symbolic_link_is_refused(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    outcome()
    folder.symlink_to(folder.rename(folder.with_name("elsewhere")))
    refused(folder, caplog, f"{folder} is a symbolic link")


def test_a_folder_of_another_user_is_refused(
    folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome()
    monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    refused(folder, caplog, f"{folder} belongs to another user")


def test_a_folder_that_others_only_look_into_is_closed(folder: Path) -> None:
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    assert outcome() == (2, False)
    assert outcome() == (2, True)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("place", ["/proc/taskspec", "file"])
def test_a_place_that_cannot_be_a_folder_is_done_without(
    folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    (folder.parent / "file").write_text("no folder")
    monkeypatch.setenv("TASKSPEC_CACHE", str(folder.parent / place))
    assert outcome()[0] == 2
    assert outcome() == (2, True)
    assert not caplog.records


WORKER = """
import sys
from taskspec.programs.numba import module

source, own = sys.argv[1:]
for number in (*range(20), own):
    function = module.load(source.format(number)).step
    assert module.compiled(function, 1)(1) == 1 + int(number)
"""


@pytest.mark.slow
def test_processes_that_compile_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    environment = {**os.environ, "TASKSPEC_CACHE": str(tmp_path)}
    command = [sys.executable, "-c", WORKER, SOURCE]
    workers = [
        subprocess.Popen([*command, str(own)], env=environment, stderr=subprocess.PIPE, text=True)
        for own in range(100, 104)
    ]
    errors = [worker.communicate(timeout=300)[1] for worker in workers]
    assert [worker.returncode for worker in workers] == [0] * 4, errors
    assert len(list((tmp_path / "numba").iterdir())) == 24
