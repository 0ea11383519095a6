"""Sweeps: every instance of an experiment is measured in parallel, and its results are kept in files, or shown as a table."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any, overload

import numpy as np

from taskspec.base import __version__, limits
from taskspec.base.display import decimal, estimate, json_data
from taskspec.base.files import whole, whole_text
from taskspec.base.limits import also, tell
from taskspec.exact import Results, Return
from taskspec.exact.policies.python_files import is_function, place_of
from taskspec.exact.scores.difficulty import difficulty
from taskspec.exact.scores.returns import why_no_expert
from taskspec.language import registry
from taskspec.language.modifiers import modify
from taskspec.language.source import Document, Packed, packed, unpacked
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.learn.data.datasets import write_table
from taskspec.learn.documents.document_models import Experiment
from taskspec.learn.experiments.experiment_file import COLUMNS, RETURNS, SPEEDS, ExperimentFile
from taskspec.learn.experiments.instances import Expanded, Instance, expand
from taskspec.learn.jobs.code_hash import code_hash
from taskspec.learn.jobs.running import Running, run_many
from taskspec.learn.jobs.store import Job, JobResult, Store
from taskspec.show.terminal.styled_text import Columns, VisibleText


@lru_cache(maxsize=16)
def _document(text: Packed) -> Document:
    return unpacked(text)


# What is worked out of one instance: what a sweep hands to a worker, and gets back as plain data.


@dataclass(frozen=True)
class Questions:
    """Questions about every instance: measures of difficulty (None: all), roll-outs, steps per second.

    `code` are hashes of the policies that are functions of files, and `limits` those that hold, as `limits.also` takes them.
    """

    measures: tuple[str, ...] | None = None
    policies: tuple[str, ...] = ()
    seeds: int = 1
    episodes: int = 1000
    speed: bool = False
    code: tuple[str, ...] = ()
    limits: str = ""


def key(content_hash: str, modifiers: tuple[str, ...], wanted: Questions) -> str:
    """Return what a result is kept under: a hash of the task, of the modifiers, of what is asked, and of the version."""
    content = [content_hash, modifiers, sorted(vars(wanted).items()), __version__]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def measure(text: Packed, suite: str, instance: Instance, wanted: Questions) -> dict[str, Any]:
    """Return sizes, returns, measures of difficulty and roll-outs of an instance, as JSON data.

    Args:
        text: of the spec and those that it extends; the task is built from it here, which may be on another machine.
    """
    with also(wanted.limits):
        task = modify(build(_document(text), instance.variant, instance.parameters, suite), *instance.modifiers)
        tell("the exact model")
        results = Results(task, wanted.episodes)
        hard = difficulty(results, wanted.measures)
        model = results.model
        measured: dict[str, Any] = {
            "states": None, "actions": None, "horizon": task.horizon, "discount": task.discount,
        }  # fmt: skip
        if model is not None:
            measured |= {"states": int(model.entered.sum()), "actions": model.n_actions}
        for name in RETURNS:
            value: Return | None = getattr(results, name)
            measured |= {
                name: getattr(value, "value", None), f"{name}_half": getattr(value, "half", None),
                f"{name}_status": getattr(value, "status", None),
            }  # fmt: skip
        why_not = {"returns": results.why_not, "expert": why_no_expert(results.task)}
        known = {name: reason for name, reason in why_not.items() if reason is not None}
        measured |= {**hard, "why_not": {**known, **hard.why_not}}
        measured["policies"] = {name: _rolled_out(task, name, wanted) for name in wanted.policies}
        if wanted.speed:
            from taskspec.learn.experiments.speed import steps_per_second

            measured |= zip(SPEEDS, steps_per_second(task, LANES, SECONDS), strict=True)
        return measured


def _rolled_out(task: Task, policy: str, wanted: Questions) -> dict[str, Any]:
    """Return the mean return of a policy in all episodes of all seeds, half its 95 % confidence interval, and their mean
    length.
    """
    from taskspec.learn.data.episodes import recorded

    returns = []
    lengths = []
    means = []
    for seed in range(wanted.seeds):
        part = recorded(task, policy, wanted.episodes, None, seed * wanted.episodes, 1)
        returns.append(part.returns(task.discount))
        lengths.append(part.lengths)
        means.append(Return.estimated(returns[-1]).value)
    mean = Return.estimated(np.concatenate(returns))
    return {
        "mean": mean.value, "half": mean.half, "length": float(np.mean(np.concatenate(lengths))),
        "episodes": mean.episodes, "seeds": means,
    }  # fmt: skip


CHUNK = 500
"""Rows that are read from the store at a time."""
LANES = 64
SECONDS = 0.2
"""How many environments are stepped together for the speed of many, and how long each is timed."""


@dataclass(frozen=True)
class Measured:
    """One instance with what was measured; `error` is why nothing was (None: all is well).

    `values` are the numbers by name; `policies` those of roll-outs by name of the policy.
    """

    instance: Instance
    status: str
    values: Mapping[str, Any] = field(default_factory=dict)
    policies: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    error: str | None = None
    seconds: float = 0.0

    def record(self) -> dict[str, Any]:
        """Write the measurements as plain data.

        Returns:
            Every column by its name, None for what is not known; policies are mappings.
        """
        about = {
            "id": self.instance.id, "task": self.instance.task, "parameters": dict(self.instance.parameters),
            "modifiers": list(self.instance.modifiers), "status": self.status, "error": self.error, "seconds": self.seconds,
        }  # fmt: skip
        return {
            **about,
            **dict.fromkeys(COLUMNS),
            **self.values,
            "policies": {k: dict(v) for k, v in self.policies.items()},
        }

    def flat(self) -> dict[str, Any]:
        """Write the measurements as a row of a table.

        Returns:
            One value for each column, such as `parameters.L` and `policies.random.mean`.
        """
        return {**dict(_flat(self.record())), "modifiers": "+".join(self.instance.modifiers)}


def _flat(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            for key, each in _flat(value):
                yield f"{name}.{key}", each
        else:
            yield name, value


def columns(rows: Sequence[Measured]) -> list[str]:
    """Return the names of the columns of `Measured.flat` that any row has: ids and parameters first."""
    known = dict.fromkeys(chain.from_iterable(row.flat() for row in rows))
    return sorted(known, key=_rank)


def _rank(column: str) -> int:
    if column in ("id", "task"):
        return 0
    if column.startswith("parameters."):
        return 1
    return 2


def write_json(rows: Sequence[Measured], path: Path) -> None:
    """Write a list of one object for each instance."""
    with whole_text(path) as file:
        file.write("[")
        before = "\n "
        for row in rows:
            text = json.dumps(json_data(row.record()), indent=1)
            file.write(before + text.replace("\n", "\n "))
            before = ",\n "
        file.write("\n]\n")


def write_csv(rows: Sequence[Measured], path: Path) -> None:
    """Write a line for each instance, under names of columns."""
    with whole_text(path) as file:
        writer = csv.DictWriter(file, columns(rows), lineterminator="\n")
        writer.writeheader()
        writer.writerows(row.flat() for row in rows)


def write_parquet(rows: Sequence[Measured], path: Path) -> None:
    """Write the same columns in Parquet."""
    values: dict[str, list[Any]] = {name: [] for name in columns(rows)}
    for row in rows:
        flat = row.flat()
        for name, column in values.items():
            column.append(flat.get(name))
    with whole(path) as unfinished:
        write_table(unfinished, {name: _of_one_type(column) for name, column in values.items()})


def _of_one_type(values: list[Any]) -> list[Any]:
    """Return values as texts where they are of several types; None stays."""
    kinds = set(map(type, values)) - {type(None)}
    if len(kinds) < 2 or kinds == {int, float}:
        return values
    texts: list[str | None] = []
    for value in values:
        if value is None:
            texts.append(None)
        else:
            texts.append(str(value))
    return texts


WRITERS = {"json": write_json, "csv": write_csv, "parquet": write_parquet}
"""Formats of tables by name, which is the suffix of their files, too."""


# Sweeps: every instance of an experiment measured, in parallel, and kept so that a sweep goes on where it was stopped.


class MeasuredRows(Sequence[Measured]):
    """An entry for each instance, in order, read from the store when it is needed."""

    def __init__(self, instances: Sequence[Instance], wanted: Questions, store: Path) -> None:
        self._instances = instances
        self._wanted = wanted
        self._store = store

    def __len__(self) -> int:
        return len(self._instances)

    def __iter__(self) -> Iterator[Measured]:
        for start in range(0, len(self), CHUNK):
            yield from self[start : start + CHUNK]

    @overload
    def __getitem__(self, index: int) -> Measured: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Measured]: ...
    def __getitem__(self, index: int | slice) -> Measured | Sequence[Measured]:
        if isinstance(index, int):
            return self._read([self._instances[index]])[0]
        return self._read(self._instances[index])

    def _read(self, instances: Sequence[Instance]) -> list[Measured]:
        keys = [key(i.content_hash, i.modifiers, self._wanted) for i in instances]
        with Store(self._store) as kept:
            results = kept.results(keys)
            return [_row(i, results.get(name), kept) for i, name in zip(instances, keys, strict=True)]


@dataclass(frozen=True)
class Swept:
    """Results of a sweep, an entry for each instance, in the order of the experiment, as long as its store is there."""

    experiment: Experiment
    rows: Sequence[Measured]

    @property
    def failed(self) -> tuple[Measured, ...]:
        """The instances that could not be measured."""
        return tuple(row for row in self.rows if row.error is not None)


def sweep(
    written: ExperimentFile, store: Path, *, expanded: Expanded | None = None, running: Running | None = None
) -> Swept:
    """Measure every instance that has no result in the store yet.

    Args:
        store: the SQLite file of the results; it is made, or gone on with.
        expanded: the instances, where they are known already.
        running: how many processes, time limits, a cluster.

    Returns:
        An entry for each instance, in the order of the experiment; those that failed say why.

    Raises:
        SpecError: with every mistake in the experiment; E705 without an extra.
    """
    expanded = expanded or expand(written)
    expanded.raise_if_wrong()
    wanted = wanted_of(written.experiment)
    total = sum(instance.problem is None for instance in expanded.instances)
    jobs = jobs_of(expanded.instances, wanted)
    with Store(store) as kept:
        run_many(jobs, total, kept, running or Running(), written.experiment.name)
    return Swept(written.experiment, MeasuredRows(expanded.instances, wanted, store))


def wanted_of(experiment: Experiment) -> Questions:
    """Return what an experiment asks of every instance."""
    measures = None
    if experiment.measures is not None:
        measures = tuple(experiment.measures)
    code = []
    for name in filter(is_function, experiment.policies):
        code.append(code_hash(*place_of(name)))
    return Questions(
        measures, tuple(experiment.policies), experiment.seeds or 1, experiment.episodes, experiment.speed, tuple(code),
        limits.written(),
    )  # fmt: skip


def jobs_of(instances: Iterable[Instance], wanted: Questions) -> Iterator[Job]:
    """Yield the job of each instance that there is."""
    for instance in instances:
        if instance.problem is None:
            source = registry.load(instance.source, instance.variant).source
            arguments = (packed(source.document), source.suite, instance, wanted)
            yield Job(key(instance.content_hash, instance.modifiers, wanted), instance.id, measure, arguments)


def _row(instance: Instance, result: JobResult | None, store: Store) -> Measured:
    if instance.problem is not None:
        return Measured(instance, "failed", error=instance.problem)
    if result is None:
        return Measured(instance, "failed", error=f"{str(store.path)!r} has its result no more")
    if result.status != "done":
        return Measured(instance, result.status, error=result.message, seconds=result.seconds)
    if not isinstance(result.value, dict):
        raise store.damaged(result.name, "it holds no measurements")
    values = dict(result.value)
    return Measured(instance, "done", values, values.pop("policies", {}), seconds=result.seconds)


MEASURES = ("solution_length", "best_at_random")
"""Measures in the table, where the experiment names none; files have all."""
MOST = 1000
"""Instances of which the table has a row; files have all."""


def measured_table(rows: Sequence[Measured], measures: Sequence[str] | None) -> Columns:
    """Return a row for each instance, the first `MOST`: sizes, returns, measures, roll-outs."""
    shown = rows[:MOST]
    if measures is None:
        measures = MEASURES
    chosen = [name for name in measures if name not in ("states", "actions")]
    policies = dict.fromkeys(chain.from_iterable(row.policies for row in shown))
    headers = [name.replace("_", " ") for name in chosen] + [f"{name}, rolled out" for name in policies]
    numbers = range(1, 5 + len(headers))
    table = Columns("", "states", "optimal", "expert", "random", *headers, styles=("name",), right=numbers, names=0)
    for row in shown:
        if row.error is not None:
            table.add_row(row.instance.id, VisibleText(row.status.replace("_", " "), style="bad"))
            continue
        values = row.values
        states = values.get("states")
        cells = ["" if states is None else f"{states:,}"]
        for name in ("optimal", "expert", "random", *chosen):
            cells.append(_number(values.get(name), values.get(f"{name}_half")))
        for name in policies:
            means = row.policies.get(name, {})
            cells.append(_number(means.get("mean"), means.get("half")))
        table.add_row(row.instance.id, *cells)
    if len(rows) > MOST:
        table.add_row(f"and {len(rows) - MOST:,} more")
    return table


def _number(value: Any, half: Any = None) -> str:
    if not isinstance(value, int | float):
        if value is None:
            return ""
        return str(value)
    if not half or half <= 1e-9 * abs(value):
        return decimal(value, 6)
    mean, width = estimate(value, half)
    return f"{mean} ± {width}"
