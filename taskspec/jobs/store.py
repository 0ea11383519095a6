"""Jobs, and their results in one SQLite file: written by one process at a time, read by any."""

from __future__ import annotations

import importlib
import json
import pickle
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, NamedTuple, get_args

from taskspec.base.diagnostics import Diagnostic, SpecError

# What is to be done, and what came of it.

Status = Literal["done", "failed", "timed_out", "quarantined"]
"""How a job ended: with a result, with an error, at its time limit, or with the death of its process, twice."""


@dataclass(frozen=True, slots=True)
class Job:
    """One call of a function, which gives JSON data.

    Args:
        key: a content hash of all that the result depends on; it names the result for ever.
        name: what people call it.
        function: at the top level of a module other than `__main__`, or its place as text, `"module:name"`.
        arguments: for the function, in order; whatever can be pickled.
    """

    key: str
    name: str
    function: Callable[..., Any] | str
    arguments: tuple[Any, ...] = ()

    def packed(self) -> bytes:
        """Return the call as bytes; in place of one that cannot be pickled, a call that fails for that reason."""
        try:
            return pickle.dumps((self.function, self.arguments))
        except Exception as error:
            return pickle.dumps((_unpicklable, (str(error),)))


def _unpicklable(reason: str) -> None:
    raise TypeError(f"the call cannot be pickled: {reason}")


def unpacked(call: bytes) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """Return the function and the arguments of a call."""
    function, arguments = pickle.loads(call)
    if isinstance(function, str):
        module, _, name = function.partition(":")
        function = getattr(importlib.import_module(module), name)
    return function, arguments


class Ending(NamedTuple):
    """How a call ended, as its process says it; `died` is said by those who waited for one that no longer says anything."""

    status: Literal["done", "failed", "timed_out", "died"]
    result: str | None = None
    message: str | None = None
    seconds: float = 0.0
    versions: Mapping[str, str] = {}


@dataclass(frozen=True, slots=True)
class JobResult:
    """What is kept of a job.

    Args:
        result: JSON text; None unless the job is done.
        message: why it is not done, for people; None if it is.
        seconds: that the last attempt took.
        attempts: how often it was begun, in the runs that say how it ended.
        when: it ended, in UTC, as ISO 8601 writes it.
        versions: of Python and taskspec, where it ran.
    """

    key: str
    name: str
    status: Status
    result: str | None
    message: str | None
    seconds: float
    attempts: int
    when: str
    versions: Mapping[str, str]

    @property
    def value(self) -> Any:
        """The result as JSON data; None unless the job is done."""
        return None if self.result is None else json.loads(self.result)


# Results in one SQLite file: written by one process at a time, read by any, whole after every `kill -9`.

APPLICATION = 0x74736B73
SCHEMA = 1
"""What the header of a file says that is ours, and the version of its tables."""
AT_ONCE = 500
"""Keys in one question; SQLite takes about a thousand at least."""
COLUMNS = "key, name, status, result, message, seconds, attempts, ended, versions"
TABLES = f"""
begin immediate;
pragma application_id = {APPLICATION};
pragma user_version = {SCHEMA};
create table results (
    key text primary key not null,
    name text not null,
    status text not null check (status in ('done', 'failed', 'timed_out', 'quarantined')),
    result text,
    message text,
    seconds real not null,
    attempts integer not null,
    ended text not null,
    versions text not null
);
commit;
"""
RECORD = f"""
insert into results ({COLUMNS}) values (?, ?, ?, ?, ?, ?, ?, ?, ?)
on conflict (key) do update set name = excluded.name, status = excluded.status, result = excluded.result,
    message = excluded.message, seconds = excluded.seconds, attempts = excluded.attempts, ended = excluded.ended,
    versions = excluded.versions
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
                if self._number("select count(*) from sqlite_master") == 0:
                    self._database.executescript(TABLES)
        if self._number("pragma application_id") != APPLICATION:
            raise self._foreign("holds no results of taskspec", "give another place")
        version = self._number("pragma user_version")
        if version != SCHEMA:
            raise self._foreign(
                f"has tables of version {version}, and this taskspec reads {SCHEMA}", "use the one that wrote it"
            )
        self._database.execute("pragma journal_mode = wal")
        self._database.execute("pragma synchronous = normal")

    def results(self, keys: Iterable[str] | None = None) -> dict[str, JobResult]:
        """Return what is kept of these jobs, in their order, or of all, in the order in which they were recorded first."""
        with self._reported():
            if keys is None:
                return self._read(f"select {COLUMNS} from results order by rowid", ())
            wanted = list(keys)
            found = dict[str, JobResult]()
            for start in range(0, len(wanted), AT_ONCE):
                part = wanted[start : start + AT_ONCE]
                marks = ", ".join("?" * len(part))
                found |= self._read(f"select {COLUMNS} from results where key in ({marks})", part)
        return {key: found[key] for key in wanted if key in found}

    def missing(self, keys: Iterable[str]) -> list[str]:
        """Return those of the keys, each once, that nothing is kept of."""
        wanted = list(dict.fromkeys(keys))
        found = self.results(wanted)
        return [key for key in wanted if key not in found]

    def record(self, rows: Sequence[JobResult]) -> None:
        """Keep results, all or none. They replace earlier ones of jobs that were not done, and no others.

        Raises:
            SpecError: E716; E722, another process is writing.
        """
        if not rows:
            return
        entries = [
            (r.key, r.name, r.status, r.result, r.message, r.seconds, r.attempts, r.when, json.dumps(dict(r.versions)))
            for r in rows
        ]
        with self.writing(), self._reported(), self._database:
            self._database.execute("begin immediate")
            self._database.executemany(RECORD, entries)

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
        with ExitStack() as stack:
            with self._reported():
                lock = sqlite3.connect(f"{self.path}-lock", timeout=0, isolation_level=None)
                stack.enter_context(closing(lock))
            with self._reported():
                lock.execute("begin exclusive")
            self._is_writing = True
            stack.callback(setattr, self, "_is_writing", False)
            yield

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _number(self, question: str) -> int:
        return int(self._database.execute(question).fetchone()[0])

    def _read(self, question: str, keys: Sequence[str]) -> dict[str, JobResult]:
        """Return the rows that a question selects, by key."""
        found = dict[str, JobResult]()
        for entry in self._database.execute(question, keys):
            try:
                found[entry[0]] = _result(entry)
            except (TypeError, ValueError) as error:
                raise self.damaged(entry[1], str(error)) from error
        return found

    def damaged(self, name: object, reason: str) -> SpecError:
        """Return the error E721: what is kept of a job is not what was recorded."""
        hint = "move the file away, and its results are worked out anew"
        return self._foreign(f"is damaged: the entry of {str(name)!r} cannot be read ({reason})", hint)

    def _foreign(self, what: str, hint: str) -> SpecError:
        return SpecError([Diagnostic("E721", None, f"{str(self.path)!r} {what}; it was left as it is", hint)])

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """What SQLite or the system says is a message."""
        try:
            yield
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
                message = f"another process is writing to {str(self.path)!r}"
                hint = "wait until it is finished, or give another file"
                raise SpecError([Diagnostic("E722", None, message, hint)]) from error
            hint = "results that were recorded earlier are kept"
            raise SpecError([Diagnostic("E716", None, f"cannot use {str(self.path)!r}: {error}", hint)]) from error
        except sqlite3.DatabaseError as error:
            raise self._foreign(f"holds no results of taskspec ({error})", "give another place") from error
        except OSError as error:
            message = f"cannot use {str(self.path)!r}: {error.strerror or error}"
            raise SpecError([Diagnostic("E716", None, message)]) from error


def _result(entry: Sequence[Any]) -> JobResult:
    """Return a row as it was recorded.

    Raises:
        ValueError, TypeError: it was not recorded like this.
    """
    key, name, status, result, message, seconds, attempts, when, versions = entry
    if status not in get_args(Status) or (status == "done") != (result is not None):
        raise ValueError(f"its status is {status!r}")
    if result is not None:
        json.loads(result)
    return JobResult(
        key, name, status, result, message, float(seconds), int(attempts), when, dict(json.loads(versions))
    )
