"""Runs of many jobs: whatever fails, hangs, dies or is killed, each job is done once, and its result or its message is kept."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.base.extras import is_installed
from taskspec.base.limits import progress_listener
from taskspec.learn.jobs import running
from taskspec.learn.jobs.code_hash import code_hash
from taskspec.learn.jobs.engines import AHEAD, Workers
from taskspec.learn.jobs.running import Running, run
from taskspec.learn.jobs.store import DiskList, Job, JobResult, Store
from tests.conftest import ROOT
from tests.shared import jobs

pytestmark = pytest.mark.skipif(os.name != "posix", reason="processes are killed by signals")
needs_cluster = pytest.mark.skipif(not is_installed("distributed"), reason="Dask is not installed")
PATIENCE = 60


def wait_for(condition: Callable[[], bool]) -> None:
    for _ in range(50 * PATIENCE):
        if condition():
            return
        time.sleep(0.02)
    pytest.fail(f"nothing came of it in {PATIENCE} seconds")


def kept(path: Path) -> dict[str, JobResult]:
    """What a reader finds while others may write."""
    with Store(path) as store:
        return store.results()


def begun(log: Path) -> list[int]:
    if not log.exists():
        return []
    return list(map(int, log.read_text().split()))


def program(*arguments: object) -> subprocess.Popen[str]:
    """`python -m tests.shared.jobs`, in a process group of its own."""
    command = [sys.executable, "-m", "tests.shared.jobs", *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def finished(process: subprocess.Popen[str]) -> tuple[int, str]:
    out, err = process.communicate(timeout=PATIENCE)
    assert err == ""
    return process.returncode, out


def code(error: pytest.ExceptionInfo[SpecError]) -> str:
    (found,) = error.value.diagnostics
    return found.code


def job(name: str, function: Any, *arguments: Any, **options: Any) -> Job:
    return Job(name, name, function, arguments, **options)


def troubles(folder: Path) -> list[Job]:
    return [
        job("wrong", jobs.wrong, "no luck"), job("refused", jobs.refused), job("no data", jobs.odd),
        job("leaves", jobs.leave), job("not there", "nowhere:at_all"), job("not packed", jobs.square, lambda: 0),
        job("by its place", "tests.shared.jobs:square", 5), job("dies", jobs.die, str(folder / "dies")),
        job("dies once", jobs.die_once, str(folder / "dies once")), job("turns", jobs.turn), job("deaf", jobs.deaf),
        job("holds", jobs.hold),
    ]  # fmt: skip


def numbered(rows: Iterable[JobResult], count: int) -> bool:
    """Whether these are the results of `jobs.squares`."""
    return [row.value for row in rows] == [jobs.square(x) for x in range(count)]


TROUBLE = {
    "wrong": ("failed", "ValueError: no luck\n  at "),
    "refused": ("failed", "error[E713 invalid-option]: no such thing\n      = hint: take another"),
    "no data": ("failed", "the result is not JSON data"),
    "leaves": ("failed", "SystemExit: 3"),
    "not there": ("failed", "No module named 'nowhere'"),
    "not packed": ("failed", "cannot be pickled"),
    "dies": ("quarantined", "its process died: SIGKILL(-9) (2 times)"),
    "turns": ("timed_out", "it took longer than 1 s: "),
    "deaf": ("timed_out", "could not be interrupted"),
    "holds": ("timed_out", "could not be interrupted"),
}


def check_troubles(rows: dict[str, JobResult], folder: Path) -> None:
    found = {row.name: row for row in rows.values()}
    for name, (status, words) in TROUBLE.items():
        assert found[name].status == status, found[name]
        assert words in (found[name].message or ""), found[name]
        assert found[name].result is None
    assert found["by its place"].value == {"x": 5, "square": 25}
    assert found["dies once"].value == {"x": 7, "square": 49}
    assert (found["dies"].attempts, found["dies once"].attempts, found["wrong"].attempts) == (2, 2, 1)
    assert (len(begun(folder / "dies")), len(begun(folder / "dies once"))) == (2, 1)
    assert numbered(list(rows.values())[-20:], 20)


def test_what_fails_hangs_or_dies_is_named_while_the_rest_is_done(tmp_path: Path) -> None:
    told: list[tuple[str, float | None]] = []
    wanted = [*troubles(tmp_path), *jobs.squares(20)]
    with Store(tmp_path / "store") as store, progress_listener(lambda *words: told.append(words)):
        rows = run(wanted, store, Running(2, seconds=1.0))
        check_troubles(rows, tmp_path)
        assert list(rows) == [job.key for job in wanted]
        assert {row.name for row in rows.values() if row.status != "done"} == set(TROUBLE)
        assert told[0] == ("jobs 0/32", 0.0) and told[-1] == ("jobs 32/32, 10 failed", 1.0)
        assert told == sorted(told, key=lambda words: words[1] or 0)
        assert run(wanted, store, Running(2)) == rows
        again = run(wanted[:1], store, Running(1, retry=True))
        assert again["wrong"].attempts == 2


def test_jobs_are_taken_when_they_are_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "WAITING", 5)
    taken = 0
    with Store(tmp_path / "store") as store:

        def many() -> Iterator[Job]:
            nonlocal taken
            for job in jobs.squares(60):
                assert taken - len(store.results()) <= 2 * 5 + AHEAD
                taken += 1
                yield job
                yield job

        running.run_many(many(), 120, store, Running(1))
        assert numbered(store.results().values(), 60)


def test_a_list_on_disk_is_one_of_different_things() -> None:
    plain = [{"number": number} for number in range(1234)]
    kept = DiskList[dict[str, int]]()
    for thing in (*plain, {"number": 7}):
        kept.add(str(thing["number"]), thing)
    assert list(kept) == plain and kept[-1] == plain[-1] and kept[5:600:3] == plain[5:600:3]
    with pytest.raises(IndexError):
        kept[1234]


def test_a_limit_may_hold_for_a_part_of_a_job(tmp_path: Path) -> None:
    wanted = [
        job("work of its own", jobs.partly_limited, 0.6, 0.0, limits_itself=True),
        job("the limited part", jobs.partly_limited, 0.0, 0.6, limits_itself=True),
    ]
    with Store(tmp_path / "store") as store:
        rows = run(wanted, store, Running(1, seconds=0.3))
    assert (rows["work of its own"].status, rows["the limited part"].status) == ("done", "timed_out")


def test_each_group_stays_with_its_process(tmp_path: Path) -> None:
    """The first and the last job of each group wait for those of the other, so that both processes are at work all the time."""
    wanted = []
    for group, other in (("a", "b"), ("b", "a")):
        for number in range(5):
            name = f"{group}{number}"
            waits_for = f"{other}{number}" if number in (0, 4) else name
            wanted.append(job(name, jobs.meet, str(tmp_path), name, waits_for, group=group))
    with Store(tmp_path / "store") as store:
        rows = run(wanted, store, Running(2))
    for name, row in rows.items():
        assert row.value == rows[f"{name[0]}0"].value
    assert rows["a0"].value != rows["b0"].value


def test_what_jobs_print_is_kept_apart(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    printed = tmp_path / "printed.txt"
    one = job("one", jobs.talk, "this is one", str(tmp_path / "one"))
    two = job("two", jobs.talk, "this is two", str(tmp_path / "two"))
    with Store(tmp_path / "store") as store:
        run([one, two, *jobs.squares(1)], store, Running(2), printed=printed)
    found = printed.read_text().replace("\n-- ", "\n\n-- ").strip().split("\n\n")
    assert sorted(found) == 2 * ["-- one\nthis is one\nand aloud"] + 2 * ["-- two\nthis is two\nand aloud"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
@pytest.mark.skipif(os.cpu_count() == 1, reason="there is one thread anyway")
@pytest.mark.parametrize(("given", "count"), [(None, 1), ("2", 2)])
def test_libraries_have_one_thread_in_each_process_unless_told_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str | None, count: int
) -> None:
    """JAX, and those with OpenMP; and JAX keeps what it compiled when a module is run again."""
    pytest.importorskip("jax")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if given is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", given)
        monkeypatch.setenv("PJRT_NPROC", given)
    wanted = [
        job("openmp", "tests.shared.jobs:variable", "OMP_NUM_THREADS"), job("jax", "tests.shared.jobs:threads"),
        job("hits", jobs.compiled_again),
    ]  # fmt: skip
    with Store(tmp_path / "results.sqlite") as store:
        found = run(wanted, store, Running(1))
    assert (found["openmp"].value, found["jax"].value) == (str(count), count)
    first, both = found["hits"].value
    assert both > first


@pytest.mark.parametrize("wrong", [{"workers": 0}, {"workers": 2, "cluster": "tcp://x"}, {"seconds": 0.0}], ids=str)
def test_numbers_that_cannot_be_are_a_message(tmp_path: Path, wrong: dict[str, Any]) -> None:
    with Store(tmp_path / "store") as store, pytest.raises(SpecError) as error:
        run(jobs.squares(1), store, Running(**wrong))
    assert code(error) == "E713"


def result(key: str, status: Any = "done", value: Any = 1) -> JobResult:
    text = json.dumps(value) if status == "done" else None
    return JobResult(key, key.upper(), status, text, None, 0.5, 1)


def test_the_file_gives_back_what_was_recorded_and_keeps_what_is_done(tmp_path: Path) -> None:
    path = tmp_path / "new" / "store"
    with Store(path) as store:
        first = [result("a", value={"x": [1, 2.5, None]}), result("b", "failed"), result("c", "timed_out")]
        store.record(first)
        store.record([result("a", value=2), result("b", value=3)])
        assert store.results() == kept(path) == {"a": first[0], "b": result("b", value=3), "c": first[2]}
        assert list(store.results(["c", "x", "a"])) == ["c", "a"]
        many = list(map(str, range(1200)))
        store.record(map(result, many))
        assert list(store.results([*many, "z"])) == many
    assert sorted(path.parent.iterdir()) == [path, path.parent / "store-lock"]


def test_files_of_others_are_left_alone(tmp_path: Path) -> None:
    text = tmp_path / "text"
    database = tmp_path / "database"
    newer = tmp_path / "newer"
    text.write_text("not a database\n" * 100)
    Store(newer).close()
    for path, statement in ((database, "create table results (key)"), (newer, "pragma user_version = 99")):
        connection = sqlite3.connect(path)
        connection.execute(statement)
        connection.close()
    for path in (text, database, newer):
        before = path.read_bytes()
        with pytest.raises(SpecError) as error:
            Store(path)
        assert code(error) == "E721" and path.read_bytes() == before
    with pytest.raises(SpecError) as error:
        Store(text / "below")
    assert code(error) == "E716"


def test_one_run_at_a_time_writes_and_others_read(tmp_path: Path) -> None:
    path = tmp_path / "store"
    log = tmp_path / "log"
    with Store(path) as mine, Store(path) as other:
        with mine.writing():
            with pytest.raises(SpecError) as error:
                run(jobs.squares(1), other)
            assert code(error) == "E722" and other.results() == {}
            status, out = finished(program(path, log, 1, 0))
            assert status == 1 and "error[E722 results-in-use]" in out
        other.record([result("a")])
        assert list(mine.results()) == ["a"]


class _Full:
    """A connection to a file on a disk that is full."""

    def execute(self, question: str) -> None:
        error = sqlite3.OperationalError("database or disk is full")
        error.sqlite_errorcode = sqlite3.SQLITE_FULL
        raise error

    def close(self) -> None:
        pass


def test_a_full_disk_is_called_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Store(tmp_path / "store") as store:
        monkeypatch.setattr("taskspec.learn.jobs.store.sqlite3.connect", lambda *arguments, **options: _Full())
        with pytest.raises(SpecError) as error:
            run(jobs.squares(1), store, Running(1))
    assert code(error) == "E716" and "disk is full" in str(error.value)


@pytest.mark.parametrize("change", ["result = '[1'", "result = null", "attempts = 'x'"])
def test_an_entry_that_is_damaged_is_named(tmp_path: Path, change: str) -> None:
    with Store(tmp_path / "store") as store:
        store.record([result("a"), result("b")])
    with closing(sqlite3.connect(tmp_path / "store")) as connection:
        connection.execute(f"update results set {change} where key = 'b'")
        connection.commit()
    with Store(tmp_path / "store") as store:
        with pytest.raises(SpecError) as error:
            run([Job("b", "B", jobs.square, (1,))], store, Running(1))
        assert code(error) == "E721" and "the entry of 'B' cannot be read" in str(error.value)
        assert list(store.results(["a"])) == ["a"]


def killed_twice(folder: Path, seconds: float, *cluster: str, meanwhile: Callable[[int], None]) -> None:
    """A run of 200 jobs, killed twice with all that it started, ends as if it had not been; nothing recorded is begun again."""
    path = folder / "store"
    log = folder / "log"
    Store(path).close()
    before: list[tuple[int, dict[str, JobResult]]] = []
    for number, enough in enumerate((30, 130)):
        process = program(path, log, 200, seconds, *cluster)
        wait_for(lambda enough=enough, process=process: len(kept(path)) >= enough or process.poll() is not None)  # type: ignore[misc]
        meanwhile(number)
        assert process.poll() is None
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        before.append((len(begun(log)), kept(path)))
    assert finished(program(path, log, 200, seconds, *cluster)) == (0, "")
    rows = kept(path)
    for x in range(200):
        row = rows[f"k{x}"]
        assert (row.name, row.status, row.value) == (f"the square of {x}", "done", {"x": x, "square": x * x})
    assert len(rows) == 200
    for count, then in before:
        assert len(then) < 200 and then.items() <= rows.items()
        for x in begun(log)[count:]:
            assert f"k{x}" not in then


def test_a_run_that_is_killed_goes_on_where_it_was(tmp_path: Path) -> None:
    killed_twice(tmp_path, 0.02, meanwhile=lambda number: None)


def test_processes_end_with_the_one_that_they_work_for(tmp_path: Path) -> None:
    path = tmp_path / "store"
    log = tmp_path / "log"
    process = program(path, log, 4, 1000)
    wait_for(lambda: len(begun(log)) == 2)
    process.kill()
    process.communicate()  # until nobody holds its standard output any more


@pytest.fixture(scope="module")
def cluster() -> Iterator[tuple[str, int]]:
    """The address of a cluster of two workers, and the process of one of them."""
    process = program()
    assert process.stdout is not None
    address, pid, _ = process.stdout.readline().split()
    yield address, int(pid)
    process.communicate()


@needs_cluster
@pytest.mark.slow
def test_a_run_on_a_cluster_survives_itself_and_a_worker(tmp_path: Path, cluster: tuple[str, int]) -> None:
    address, pid = cluster

    def kill(number: int) -> None:
        if number == 1:
            os.kill(pid, signal.SIGKILL)

    killed_twice(tmp_path, 0.05, address, meanwhile=kill)


@needs_cluster
@pytest.mark.slow
def test_a_cluster_survives_its_jobs(tmp_path: Path, cluster: tuple[str, int]) -> None:
    with Store(tmp_path / "store") as store:
        rows = run([*troubles(tmp_path), *jobs.squares(20)], store, Running(cluster=cluster[0], seconds=1.0))
    check_troubles(rows, tmp_path)


@needs_cluster
@pytest.mark.slow
def test_ctrl_c_and_the_loss_of_a_cluster_are_messages(tmp_path: Path) -> None:
    process = program()
    assert process.stdout is not None
    address = process.stdout.readline().split()[0]
    for number, (victim, status, words) in enumerate(((1, 130, "interrupted: "), (0, 1, "error[E723 no-cluster]"))):
        path = tmp_path / f"store{number}"
        log = tmp_path / f"log{number}"
        Store(path).close()
        runner = program(path, log, 400, 0.1, address)
        wait_for(lambda path=path, runner=runner: len(kept(path)) > 0 or runner.poll() is not None)  # type: ignore[misc]
        os.killpg((process.pid, runner.pid)[victim], (signal.SIGKILL, signal.SIGINT)[victim])
        ended, out = finished(runner)
        assert ended == status and out.startswith(words) and 0 < len(kept(path)) < 400
    process.communicate()


@needs_cluster
def test_an_address_without_a_cluster_is_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskspec.learn.jobs.engines.PATIENCE", 0.5)
    with Store(tmp_path / "store") as store, pytest.raises(SpecError) as error:
        run(jobs.squares(1), store, Running(cluster="tcp://127.0.0.1:1"))
    assert code(error) == "E723"


def test_time_limits_hold_where_there_are_no_signals(tmp_path: Path) -> None:
    """As on Windows: the process is ended, and the next job has a new one."""
    with Store(tmp_path / "store") as store, Workers(1) as workers:
        run([job("first", jobs.without_signals)], store, workers=workers)
        rows = run([job("turn", jobs.turn), *jobs.squares(2)], store, Running(seconds=0.5), workers=workers)
    late = rows.pop("turn")
    assert late.status == "timed_out" and "could not be interrupted" in str(late.message)
    assert numbered(rows.values(), 2)


def test_the_hash_of_a_function_covers_what_its_file_imports_from_its_folder(tmp_path: Path) -> None:
    files = {
        "model.py": "import json\nfrom parts import inner\n\ndef act(seen):\n    import later\n    return 0\n",
        "later.py": "x = 1\n",
        "other.py": "x = 1\n",
        "parts/__init__.py": "",
        "parts/inner.py": "from . import deep\nfrom ..outside import x\n",
        "parts/deep.py": "import parts.inner\n",
    }
    for name, text in files.items():
        place = tmp_path / "one" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    before = code_hash(tmp_path / "one" / "model.py", "act")
    assert code_hash(tmp_path / "two" / "model.py", "act") == before
    assert code_hash(tmp_path / "one" / "model.py", "other") != before
    for name in files:
        place = tmp_path / "two" / name
        text = place.read_text()
        place.write_text(text + "y = 2\n")
        now = code_hash(tmp_path / "two" / "model.py", "act")
        assert (now == before) == (name == "other.py"), name
        place.write_text(text)
    (tmp_path / "two" / "model.py").write_text("def act(:")
    assert code_hash(tmp_path / "two" / "model.py", "act") != before
