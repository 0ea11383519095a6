"""Files are whole or not there: on a full disk what was there stays, nothing is left over, and the message says why."""

import ast
import errno
import os
import re
import stat
import threading
from pathlib import Path
from typing import Any

import pytest

from taskspec.base import files
from taskspec.base.diagnostics import SpecError
from tests.shared.apart import taskspec
from tests.shared.folders import names
from tests.shared.sparse import sparse

ROOT = Path(__file__).parents[2]
TASK = str(ROOT / "tasks" / "derail" / "risky_path.yaml")
RUN = ["run", TASK, "--episodes", "1", "-o"]
OUTPUTS = [
    (["schema", "-o", "OUT.json"], "OUT.json"),
    (["reference", "language", "-o", "OUT.md"], "OUT.md"),
    (["new", "Fresh", "-o", "OUT.yaml"], None),
    (["figure", TASK, "-o", "OUT.svg"], "OUT.svg"),
    (["figure", TASK, "-o", "OUT.tex"], "OUT.tex"),
    (["figure", TASK, "-o", "OUT.png"], "OUT.png"),
    (["figure", TASK, "-o", "OUT.pdf"], "OUT.pdf"),
    (["solve", TASK, "-o", "OUT.json"], "OUT.json"),
    (["docs", TASK, "-o", "OUT"], "OUT/index.html"),
    (["docs", TASK, "--format", "markdown", "-o", "OUT"], "OUT/index.md"),
    (["docs", TASK, "--format", "latex", "-o", "OUT"], "OUT/preamble.tex"),
    (["build", TASK, "-o", "OUT"], "OUT/schema.json"),
    ([*RUN, "OUT.gif"], "OUT.gif"),
    ([*RUN, "OUT.mp4"], "OUT.mp4"),
]


@pytest.mark.parametrize(
    ("arguments", "kept"), sparse(OUTPUTS, 4), ids=lambda x: " ".join(x[:1]) + x[-1] if isinstance(x, list) else ""
)
def test_a_full_disk(tmp_path: Path, arguments: list[str], kept: str | None) -> None:
    if kept:
        (tmp_path / kept).parent.mkdir(exist_ok=True)
        (tmp_path / kept).write_text("as it was")
    before = sorted(tmp_path.rglob("*"))
    done = taskspec(tmp_path, *arguments, resources={"RLIMIT_FSIZE": 100}, PYTHONDONTWRITEBYTECODE="1")
    assert done.returncode == 1, done.stderr
    assert "error[E716 file-unwritable]: cannot write '" in done.stderr
    assert "Traceback" not in done.stderr
    for path in tmp_path.rglob("*"):
        if path.is_file() and path not in before:
            assert kept and path.stat().st_size < 100 and not path.name.startswith(".")
    assert kept is None or (tmp_path / kept).read_text() == "as it was"


def refused(place: Path, text: str = "new", new: bool = False) -> str:
    with pytest.raises(SpecError) as caught:
        files.write_text(place, text, new)
    (found,) = caught.value.diagnostics
    assert found.code == "E716"
    return found.message


@pytest.mark.parametrize("step", ["fsync", "replace", "write"])
def test_an_error_at_any_step_leaves_things_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    def fails(*args: Any, **options: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    place = tmp_path / "file.txt"
    place.write_text("old")
    target: Any = os if step == "fsync" else Path
    monkeypatch.setattr(target, {"write": "write_text"}.get(step, step), fails)
    assert refused(place) == f"cannot write {str(place)!r}: No space left on device"
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == [place] and place.read_text() == "old"


def test_an_interrupt_leaves_things_as_they_were(tmp_path: Path) -> None:
    place = tmp_path / "file.txt"
    place.write_text("old")
    writing = files.whole(place)
    writing.__enter__().write_text("half")
    assert not writing.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert list(tmp_path.iterdir()) == [place] and place.read_text() == "old"


@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_permissions(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        for name in ("fresh", "kept"):
            files.write_text(tmp_path / name, "text\r\n")
            assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o666 & ~umask
        (tmp_path / "kept").chmod(0o640)
        files.write_text(tmp_path / "kept", "text")
        assert stat.S_IMODE((tmp_path / "kept").stat().st_mode) == 0o640
    finally:
        os.umask(before)
    assert (tmp_path / "fresh").read_bytes() == b"text\r\n"


def test_links_stay_links(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder" / "file")
    for text in ("one", "two"):
        files.write_text(tmp_path / "link", text)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "folder" / "file").read_text() == text
    assert len(list((tmp_path / "folder").iterdir())) == 1


def test_folders_are_made(tmp_path: Path) -> None:
    files.write_text(tmp_path / "a" / "b" / "c.txt", "text")
    assert (tmp_path / "a" / "b" / "c.txt").read_text() == "text"


def test_what_is_no_file_is_written_to_where_it_is(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    read = []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    files.write_text(pipe, "text")
    reader.join(10)
    assert read == ["text"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    assert "Is a directory" in refused(tmp_path)
    assert "File exists" in refused(tmp_path / "file" / "below") or "Not a directory" in refused(
        tmp_path / "file" / "below"
    )
    assert "already exists" in refused(tmp_path / "file", new=True)
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    assert "already exists" in refused(tmp_path / "dangling", new=True)
    assert names(tmp_path) == ["dangling", "file"]
    assert (tmp_path / "file").read_text() == "old"


def test_a_new_file_that_fails_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(handle: int) -> None:
        raise OSError(errno.EIO, "broken")

    monkeypatch.setattr(os, "fsync", fails)
    assert "broken" in refused(tmp_path / "file", new=True)
    assert not list(tmp_path.iterdir())


HOSTILE = [
    "", ".", "..", "../x", "/etc/passwd", "a/b", "a\\b", "a\0b", "a\nb", "-rf", ".hidden", "x.", "x ", "x" * 5000, "ё" * 300,
    "con", "NUL.txt", "aux.", "COM1", "a:b", "a*b?", '"<|>', "\u202egpj", "\ud800", "a-b",
]  # fmt: skip


@pytest.mark.parametrize("name", ["noise", "my noise", "L=5-M=7", "tremble=0.0", "mine-train", "Größe", "v1.2+x"])
def test_names_that_are_safe_stay(name: str) -> None:
    assert files.safe_name(name) == name


def test_names_of_files_are_safe_and_of_their_own(tmp_path: Path) -> None:
    for hostile in HOSTILE:
        name = files.safe_name(hostile)
        assert re.fullmatch(r"[^\W]([\w .=,+()-]*[\w)=+,(])?", name), name
        assert len(name.encode()) < 120 and name.split(".")[0].lower() not in ("con", "nul", "aux", "com1")
        files.write_text(tmp_path / f"{name.lower()}.json", name)
    assert len(list(tmp_path.iterdir())) == len(HOSTILE)


WRITERS = {"savefig", "write_text", "write_bytes", "get_writer", "open"}


def test_nothing_is_written_by_another_way() -> None:
    """Every file of the package goes through `files`, but for machine code, arrays and traces of crashes."""
    own = {"files.py", "loading.py", "datasets.py", "work.py"}
    for path in sorted((ROOT / "taskspec").rglob("*.py")):
        if path.name in own:
            continue
        text = path.read_text(encoding="utf-8")
        for call in ast.walk(ast.parse(text)):
            if not isinstance(call, ast.Call):
                continue
            name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
            if name not in WRITERS:
                continue
            written = ast.get_source_segment(text, call) or ""  # slow, so of few
            if name == "savefig":
                assert "picture" in written, f"{path}: {written}"  # in memory
            elif name in ("write_text", "write_bytes") and isinstance(call.func, ast.Attribute):
                pytest.fail(f"{path}: {written}")
            elif name == "get_writer":
                assert "_target" in written or "file.path" in written, f"{path}: {written}"
            elif name == "open" and "fileobj=" not in written:  # an archive in memory
                assert not re.search(r"[\"'][wax+]", written), f"{path}: {written}"
