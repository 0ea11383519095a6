"""The folder of compiled kernels: nothing is run from it that this user did not write there."""

from __future__ import annotations

import hashlib
import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("numba")

from taskspec.programs.numba import loading

WORKERS = """
import sys
from pathlib import Path
from taskspec.programs.numba import loading

own = sys.argv[2]
for i in range(40):
    folder = loading.private_folder(Path(sys.argv[1]))
    for name in ("shared", own):
        found = loading.read(folder / name)
        assert found is None or len(set(found)) == 1 and len(found) == 5000, found
        loading.write(folder / name, own.encode() * 5000)
    assert loading.read(folder / own) == own.encode() * 5000
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where kernels are kept; every load looks there, and compiling is stood in for."""
    monkeypatch.setenv("TASKSPEC_CACHE", str(tmp_path))
    monkeypatch.setattr(loading, "_linked", lambda code: code)
    monkeypatch.setattr(loading, "import_module", lambda name: Compiler)
    Compiler.made = 0
    loading.load.cache_clear()
    loading._warn_once.cache_clear()
    yield tmp_path / "numba"
    loading.load.cache_clear()


class Compiler:
    """Stands for Numba, and counts."""

    made = 0

    @staticmethod
    def machine_code(source: str, machine: Any) -> bytes:
        Compiler.made += 1
        return b"machine code of " + source.encode()


def load(source: str = "a") -> tuple[bytes, bool]:
    """What is run for a source, and whether it was compiled just now."""
    loading.load.cache_clear()
    before = Compiler.made
    code: Any = loading.load(source)
    return code, Compiler.made > before


def kernel_in(folder: Path) -> Path:
    (found,) = folder.glob("*.o")
    return found


def test_what_is_kept_is_found_again_and_is_private(folder: Path) -> None:
    code = b"machine code of a"
    assert load() == (code, True)
    assert load() == (code, False)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert [stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()] == [0o600]


def replaced(kernel: Path) -> None:
    kernel.write_bytes(b"foreign code" * 100)


def rehashed(kernel: Path) -> None:
    code = b"foreign code" * 100
    kernel.write_bytes(hashlib.sha256(code).digest() + code)


def under_another_name(kernel: Path) -> None:
    load("b")
    (other,) = set(kernel.parent.glob("*.o")) - {kernel}
    kernel.write_bytes(other.read_bytes())


def truncated(kernel: Path) -> None:
    kernel.write_bytes(kernel.read_bytes()[:-1])


def cut_to(size: int) -> Callable[[Path], None]:
    return lambda kernel: kernel.write_bytes(kernel.read_bytes()[:size])


def flipped(kernel: Path) -> None:
    whole = bytearray(kernel.read_bytes())
    whole[-1] ^= 1
    kernel.write_bytes(bytes(whole))


def a_symbolic_link(kernel: Path) -> None:
    moved = kernel.rename(kernel.parent.parent / "elsewhere")
    kernel.symlink_to(moved)


def a_pipe(kernel: Path) -> None:
    kernel.unlink()
    os.mkfifo(kernel)


def a_folder(kernel: Path) -> None:
    kernel.unlink()
    kernel.mkdir()


def writable_by_all(kernel: Path) -> None:
    kernel.chmod(0o666)


DAMAGES = (
    replaced, rehashed, under_another_name, truncated, cut_to(0), cut_to(31), cut_to(32), flipped,
    a_symbolic_link, a_pipe, writable_by_all,
)  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__qualname__)
def test_what_is_damaged_is_compiled_again(folder: Path, damage: Callable[[Path], None]) -> None:
    load()
    damage(kernel_in(folder))
    assert load() == (b"machine code of a", True)
    assert load() == (b"machine code of a", False)
    assert not list(folder.glob(".*")), "an unfinished file is left"


def test_what_cannot_be_replaced_is_done_without(folder: Path) -> None:
    load()
    a_folder(kernel_in(folder))
    assert load() == (b"machine code of a", True)
    assert not list(folder.glob(".*"))


# -- folders ------------------------------------------------------------------------------------------------------


def refused(folder: Path, caplog: pytest.LogCaptureFixture, why: str) -> None:
    """Nothing is read from the folder or written to it, and one line says why."""
    before = {path.name: path.read_bytes() for path in folder.glob("*")}
    assert load() == (b"machine code of a", True)
    assert load() == (b"machine code of a", True)
    assert {path.name: path.read_bytes() for path in folder.glob("*")} == before
    (record,) = caplog.records
    assert why in record.message
    assert record.message.startswith("taskspec: compiled kernels are not kept, since ")
    assert "\n" not in record.message


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o707, 0o1777, 0o720])
def test_a_folder_that_others_may_write_to_is_refused(
    folder: Path, caplog: pytest.LogCaptureFixture, mode: int
) -> None:
    load()
    folder.chmod(mode)
    refused(folder, caplog, f"others may write to {folder} (mode {mode:o}")


def test_a_symbolic_link_is_refused(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    load()
    folder.symlink_to(folder.rename(folder.with_name("elsewhere")))
    refused(folder, caplog, f"{folder} is a symbolic link")


def test_a_folder_of_another_user_is_refused(
    folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    load()
    monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    refused(folder, caplog, f"{folder} belongs to another user")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives files away")
def test_files_of_another_user_are_not_read(folder: Path) -> None:
    load()
    os.chown(kernel_in(folder), 65534, 65534)
    assert load() == (b"machine code of a", True)


def test_a_folder_that_others_only_look_into_is_closed(folder: Path) -> None:
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    assert load() == (b"machine code of a", True)
    assert load() == (b"machine code of a", False)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_file_in_the_place_of_the_folder_is_done_without(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.write_text("no folder")
    assert load() == (b"machine code of a", True)
    assert not caplog.records


# -- processes ----------------------------------------------------------------------------------------------------


def test_processes_that_write_at_once_never_see_each_other_unfinished(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WORKERS, str(tmp_path / "kept")]
    workers = [subprocess.Popen([*command, name], stderr=subprocess.PIPE, text=True) for name in "abcd"]
    errors = [worker.communicate(timeout=60)[1] for worker in workers]
    assert [worker.returncode for worker in workers] == [0] * 4, errors
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == [*"abcd", "shared"]
