"""Sweeps: every instance of an experiment measured, in parallel, and kept so that a sweep goes on where it was stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from taskspec import registry
from taskspec.base import limits
from taskspec.experiments.instances import Expanded, Instance, expand
from taskspec.experiments.measure import Order, Questions, Sent, key, measure
from taskspec.experiments.reading import ExperimentFile
from taskspec.experiments.results import Measured
from taskspec.jobs.code import code_hash
from taskspec.jobs.engine import Standing, run
from taskspec.jobs.store import Job, JobResult, Store
from taskspec.policies.files import is_function, place_of
from taskspec.source import packed
from taskspec.task.schema.experiments import Experiment


@dataclass(frozen=True)
class Swept:
    """What a sweep found, an entry for each instance, in the order of the experiment."""

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
    workers: int | None = None,
    cluster: str | None = None,
    seconds: float | None = None,
    retry: bool = False,
    progress: Callable[[Standing], None] | None = None,
) -> Swept:
    """Measure every instance that has no result in the store yet.

    Args:
        store: the SQLite file of the results; it is made, or gone on with.
        expanded: the instances, where they are known already.
        workers: processes; as many as there are processors unless given.
        cluster: the address of a Dask scheduler, `tcp://...`, to which the jobs are handed instead.
        seconds: the longest that one instance may take.
        retry: whether instances that failed before are tried again.

    Raises:
        SpecError: with every mistake in the experiment; E705 without an extra.
    """
    found = expand(written) if expanded is None else expanded
    found.raise_if_wrong()
    wanted = wanted_of(written.experiment)
    jobs = {i.id: _job(i, wanted) for i in found.instances if i.problem is None}
    with Store(store) as kept:
        done = run(
            jobs.values(),
            kept,
            workers=workers,
            cluster=cluster,
            seconds=seconds,
            retry_failed=retry,
            progress=progress,
        )
        rows = tuple(_row(i, jobs.get(i.id), done.rows, kept) for i in found.instances)
    return Swept(written.experiment, rows)


def wanted_of(experiment: Experiment) -> Questions:
    """Return what an experiment asks of every instance."""
    measures = None if experiment.measures is None else tuple(experiment.measures)
    functions = [place_of(name) for name in experiment.policies if is_function(name)]
    code = tuple(code_hash(path, function) for path, function in functions)
    return Questions(
        measures, tuple(experiment.policies), experiment.seeds or 1, experiment.episodes, experiment.speed, code,
        limits.written(),
    )  # fmt: skip


def _job(instance: Instance, wanted: Questions) -> Job:
    task = registry.load(instance.source, instance.variant)
    about = Sent(packed(task.document), task.suite, task.variant, instance.parameters, instance.modifiers)
    return Job(key(instance.content_hash, instance.modifiers, wanted), instance.id, measure, (Order(about, wanted),))


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
