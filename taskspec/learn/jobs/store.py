"""Jobs, and their results in one SQLite file: written by one process at a time, read by any. Long lists on disk."""

from __future__ import annotations

import json
import pickle
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, overload

from taskspec.base.diagnostics import SpecError, spec_error

T = TypeVar("T")
Status = Literal["done", "failed", "timed_out", "quarantined"]
"""How a job ended: with a result, with an error, at its time limit, or with the death of its process, twice."""


@dataclass(frozen=True, slots=True)
class Job:
    """One call of a function that returns JSON data.

    Args:
        key: a content hash of all that the result depends on; it names the result for ever.
        name: for people.
        function: at the top level of a module other than `__main__`, or its place as text, `"module:name"`.
        arguments: for the function, in order; they have to be picklable.
        group: jobs of one group share what a process remembers, and are done by as few processes as can be.
        limits_itself: whether the function applies the time limit to a part of its work, by `within_limit`.
    """

    key: str
    name: str
    function: Callable[..., Any] | str
    arguments: tuple[Any, ...] = ()
    group: str = ""
    limits_itself: bool = False


@dataclass(frozen=True, slots=True)
class JobResult:
    """The stored result of a job.

    Args:
        result: JSON text; None unless the job is done.
        message: why it is not done, for people; None if it is.
        seconds: that the last attempt took.
        attempts: how often it was begun, in the runs that say how it ended.
    """

    key: str
    name: str
    status: Status
    result: str | None
    message: str | None
    seconds: float
    attempts: int

    @property
    def value(self) -> Any:
        """The result as JSON data; None unless the job is done."""
        if self.result is None:
            return None
        return json.loads(self.result)


APPLICATION = 0x74736B73
SCHEMA = 2
"""Marks of our files in their header: of the application, and the version of the table."""
TABLE = f"""
begin immediate;
pragma application_id = {APPLICATION};
pragma user_version = {SCHEMA};
create table if not exists results (
    key text primary key not null,
    name text not null,
    status text not null check (status in ('done', 'failed', 'timed_out', 'quarantined')),
    result text,
    message text,
    seconds real not null,
    attempts integer not null
);
commit;
"""
RECORD = """
insert into results values (?, ?, ?, ?, ?, ?, ?)
on conflict (key) do update set name = excluded.name, status = excluded.status, result = excluded.result,
    message = excluded.message, seconds = excluded.seconds, attempts = excluded.attempts
where results.status != 'done'
"""


class Store:
    """A file of results, made if it is not there.

    What is recorded is in the write-ahead log at once, and survives the end of any process. Nobody waits for the disk: a power
    failure may cost the last results, but not the file.

    Raises:
        SpecError: E716, the file cannot be read or written; E721, it is of another program or version.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._is_writing = False
        with self._reported():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._database = sqlite3.connect(self.path, isolation_level=None)
            try:
                self._open()
            except BaseException:
                self._database.close()
                raise

    def _open(self) -> None:
        if self._number("select count(*) from sqlite_master") == 0 and self._number("pragma application_id") == 0:
            with self.writing():
                self._database.executescript(TABLE)
        marks = (self._number("pragma application_id"), self._number("pragma user_version"))
        if marks != (APPLICATION, SCHEMA):
            raise self._foreign("holds no results of this version of taskspec", "give another place")
        self._database.execute("pragma journal_mode = wal")
        self._database.execute("pragma synchronous = normal")

    def _number(self, question: str) -> int:
        return int(self._database.execute(question).fetchone()[0])

    def results(self, keys: Iterable[str] | None = None) -> dict[str, JobResult]:
        """Return the results of these jobs, in their order, or of all, in the order in which they were recorded first."""
        if keys is None:
            return self._read("select * from results order by rowid")
        wanted = list(keys)
        known = self._read("select * from results where key in (select value from json_each(?))", json.dumps(wanted))
        return {key: known[key] for key in wanted if key in known}

    def _read(self, question: str, *values: str) -> dict[str, JobResult]:
        results = dict[str, JobResult]()
        with self._reported():
            for entry in self._database.execute(question, values):
                key, name, status, result, message, seconds, attempts = entry
                try:
                    json.loads(result or "null")
                    if (status == "done") != (result is not None):
                        raise ValueError(f"its status is {status!r}")
                    results[key] = JobResult(key, name, status, result, message, float(seconds), int(attempts))
                except (TypeError, ValueError) as error:
                    raise self.damaged(name, str(error)) from error
        return results

    def record(self, rows: Sequence[JobResult]) -> None:
        """Keep results, all or none. They replace earlier ones of jobs that were not done, and no others.

        Raises:
            SpecError: E716; E722, another process is writing.
        """
        if not rows:
            return
        with self.writing(), self._reported(), self._database:
            self._database.execute("begin immediate")
            self._database.executemany(RECORD, map(astuple, rows))

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Within the block, nobody else writes.

        The lock is SQLite's own, on an empty file beside this one; it goes with the process, however that ends.

        Raises:
            SpecError: E722, another process is writing.
        """
        if self._is_writing:
            yield
            return
        with self._reported():
            lock = sqlite3.connect(f"{self.path}-lock", timeout=0, isolation_level=None)
        with closing(lock):
            with self._reported():
                lock.execute("begin exclusive")
            self._is_writing = True
            try:
                yield
            finally:
                self._is_writing = False

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def damaged(self, name: object, reason: str) -> SpecError:
        """Return the error E721: what is kept of a job is not what was recorded."""
        hint = "move the file away, and its results are computed again"
        return self._foreign(f"is damaged: the entry of {str(name)!r} cannot be read ({reason})", hint)

    def _foreign(self, what: str, hint: str) -> SpecError:
        return spec_error("E721", f"{str(self.path)!r} {what}; it was left as it is", hint)

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn errors of SQLite and of the system into messages."""
        try:
            yield
        except (sqlite3.OperationalError, OSError) as error:
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
                message = f"another process is writing to {str(self.path)!r}"
                raise spec_error("E722", message, "wait until it is finished, or give another file") from error
            reason = getattr(error, "strerror", None) or error
            raise spec_error("E716", f"cannot use {str(self.path)!r}: {reason}") from error
        except sqlite3.DatabaseError as error:
            raise self._foreign(f"holds no results of taskspec ({error})", "give another place") from error


class DiskList(Sequence[T]):
    """Things that can be pickled, in order, each with a key, in a temporary file: a list that may be longer than the memory."""

    def __init__(self) -> None:
        self._database = sqlite3.connect("", isolation_level=None, check_same_thread=False)
        self._database.execute("create table things (number integer primary key, key text unique, thing blob)")
        self._database.execute("begin")  # nobody else reads the file, so that nothing is ever committed
        self._count = 0

    def add(self, key: str, thing: T) -> None:
        """Add a thing at the end, unless there is one with its key already."""
        row = (self._count, key, pickle.dumps(thing))
        self._count += self._database.execute("insert or ignore into things values (?, ?, ?)", row).rowcount

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[T]: ...
    def __getitem__(self, index: int | slice) -> T | Sequence[T]:
        numbers = range(self._count)[index]
        if isinstance(numbers, int):
            return self._thing(numbers)
        return [self._thing(number) for number in numbers]

    def _thing(self, number: int) -> T:
        (pickled,) = self._database.execute("select thing from things where number = ?", (number,)).fetchone()
        thing: T = pickle.loads(pickled)
        return thing
