"""Sweeps: every instance of an experiment is measured in parallel, and its results are kept in files."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base import __version__, limits
from taskspec.base.display import json_data
from taskspec.base.files import whole, write_text
from taskspec.base.jobs.code_hash import code_hash
from taskspec.base.jobs.running import Running, run
from taskspec.base.jobs.store import Job, JobResult, Store
from taskspec.base.limits import also, tell
from taskspec.envs.data.datasets import write_table
from taskspec.exact import Results, Return
from taskspec.exact.policies.files import is_function, place_of
from taskspec.exact.scores.difficulty import difficulty
from taskspec.exact.scores.returns import why_no_expert
from taskspec.language import registry
from taskspec.language.modifiers import modify
from taskspec.language.source import Document, Packed, packed, unpacked
from taskspec.language.task.build import build
from taskspec.language.task.schema.experiments import Experiment
from taskspec.language.task.task import Task
from taskspec.learn.experiments.experiment_file import COLUMNS, RETURNS, SPEEDS, ExperimentFile
from taskspec.learn.experiments.instances import Expanded, Instance, expand


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
        found: dict[str, Any] = {
            "states": None if model is None else int(model.entered.sum()),
            "actions": None if model is None else model.n_actions,
            "horizon": task.horizon,
            "discount": task.discount,
        }
        for name in RETURNS:
            value: Return | None = getattr(results, name)
            for key, entry in ((name, "value"), (f"{name}_half", "half"), (f"{name}_status", "status")):
                if value is None:
                    found[key] = None
                else:
                    found[key] = getattr(value, entry)
        found |= {**hard, "why_not": {**_reasons(results), **hard.why_not}}
        found["policies"] = {name: _rolled_out(task, name, wanted) for name in wanted.policies}
        if wanted.speed:
            from taskspec.envs.speed import steps_per_second

            found |= zip(SPEEDS, steps_per_second(task, LANES, SECONDS), strict=True)
        return found


def _reasons(results: Results) -> dict[str, str]:
    found = {}
    if results.why_not is not None:
        found["returns"] = results.why_not
    no_expert = why_no_expert(results.task)
    if no_expert is not None:
        found["expert"] = no_expert
    return found


def _rolled_out(task: Task, policy: str, wanted: Questions) -> dict[str, Any]:
    """Return the mean return of a policy in all episodes of all seeds, half its 95 % confidence interval, and their mean
    length.
    """
    from taskspec.envs.data.episodes import recorded

    parts = [recorded(task, policy, wanted.episodes, None, seed * wanted.episodes, 1) for seed in range(wanted.seeds)]
    means = [Return.estimated(part.returns(task.discount)) for part in parts]
    mean = Return.estimated(np.concatenate([part.returns(task.discount) for part in parts]))
    return {
        "mean": mean.value, "half": mean.half, "length": float(np.mean(np.concatenate([part.lengths for part in parts]))),
        "episodes": mean.episodes, "seeds": [each.value for each in means],
    }  # fmt: skip


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
        """Return plain data for JSON, with None for what is not known."""
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
        """Return the same with one value in each column: `parameters.L`, `policies.random.mean`."""
        return {**dict(_flat(self.record())), "modifiers": "+".join(self.instance.modifiers)}


def _flat(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from ((f"{name}.{key}", each) for key, each in _flat(value))
        else:
            yield name, value


def table(rows: Sequence[Measured]) -> tuple[list[str], list[list[Any]]]:
    """Return names of columns, and the values of every row; None where a row has none."""
    flat = [row.flat() for row in rows]
    known = dict.fromkeys(name for each in flat for name in each)
    first = [name for name in known if name in ("id", "task")]
    first += [name for name in known if name.startswith("parameters.")]
    names = list(dict.fromkeys([*first, *known]))
    return names, [[each.get(name) for name in names] for each in flat]


def write_json(rows: Sequence[Measured], path: Path) -> None:
    """Write a list of one object for each instance."""
    write_text(path, json.dumps(json_data([row.record() for row in rows]), indent=1) + "\n")


def write_csv(rows: Sequence[Measured], path: Path) -> None:
    """Write a line for each instance, under names of columns."""
    names, values = table(rows)
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(values)
    write_text(path, text.getvalue())


def write_parquet(rows: Sequence[Measured], path: Path) -> None:
    """Write the same columns in Parquet."""
    names, values = table(rows)
    with whole(path) as unfinished:
        write_table(unfinished, {name: _of_one_type([row[i] for row in values]) for i, name in enumerate(names)})


def _of_one_type(values: Sequence[Any]) -> list[Any]:
    kinds = {
        bool if isinstance(v, bool) else float if isinstance(v, int | float) else str for v in values if v is not None
    }
    if len(kinds) < 2:
        return list(values)
    return [None if v is None else str(v) for v in values]


WRITERS = {"json": write_json, "csv": write_csv, "parquet": write_parquet}
"""Formats of tables by name, which is the suffix of their files, too."""


# Sweeps: every instance of an experiment measured, in parallel, and kept so that a sweep goes on where it was stopped.


@dataclass(frozen=True)
class Swept:
    """Results of a sweep, an entry for each instance, in the order of the experiment."""

    experiment: Experiment
    rows: tuple[Measured, ...]

    @property
    def failed(self) -> tuple[Measured, ...]:
        """The instances that could not be measured."""
        return tuple(row for row in self.rows if row.error is not None)


def sweep(
    written: ExperimentFile,
    store: Path,
    *,
    expanded: Expanded | None = None,
    running: Running | None = None,
) -> Swept:
    """Measure every instance that has no result in the store yet.

    Args:
        store: the SQLite file of the results; it is made, or gone on with.
        expanded: the instances, where they are known already.
        running: how many processes, time limits, a cluster.

    Raises:
        SpecError: with every mistake in the experiment; E705 without an extra.
    """
    if expanded is None:
        found = expand(written)
    else:
        found = expanded
    found.raise_if_wrong()
    wanted = wanted_of(written.experiment)
    jobs = {i.id: _job(i, wanted) for i in found.instances if i.problem is None}
    with Store(store) as kept:
        done = run(jobs.values(), kept, running or Running(), written.experiment.name)
        rows = tuple(_row(i, jobs.get(i.id), done, kept) for i in found.instances)
    return Swept(written.experiment, rows)


def wanted_of(experiment: Experiment) -> Questions:
    """Return what an experiment asks of every instance."""
    if experiment.measures is None:
        measures = None
    else:
        measures = tuple(experiment.measures)
    functions = [place_of(name) for name in experiment.policies if is_function(name)]
    code = tuple(code_hash(path, function) for path, function in functions)
    return Questions(
        measures, tuple(experiment.policies), experiment.seeds or 1, experiment.episodes, experiment.speed, code,
        limits.written(),
    )  # fmt: skip


def _job(instance: Instance, wanted: Questions) -> Job:
    source = registry.load(instance.source, instance.variant).source
    arguments = (packed(source.document), source.suite, instance, wanted)
    return Job(key(instance.content_hash, instance.modifiers, wanted), instance.id, measure, arguments)


def _row(instance: Instance, job: Job | None, results: Mapping[str, JobResult], store: Store) -> Measured:
    if job is None:
        return Measured(instance, "failed", error=instance.problem)
    found = results[job.key]
    if found.status != "done":
        return Measured(instance, found.status, error=found.message, seconds=found.seconds)
    if not isinstance(found.value, dict):
        raise store.damaged(found.name, "it holds no measurements")
    values = dict(found.value)
    return Measured(instance, "done", values, values.pop("policies", {}), seconds=found.seconds)
