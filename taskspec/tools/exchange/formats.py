"""The formats of other tools, one entry each: how a task is written in it, what it cannot carry, and how it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from taskspec.base.diagnostics import spec_error
from taskspec.base.named import entries_by_name
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.extract import extract
from taskspec.exact.model.model import Model
from taskspec.exact.solve.outcomes import LARGEST_TABLE
from taskspec.exact.tables.frozen_task import FrozenTask, tables
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from taskspec.tools.exchange import arrays, umb
from taskspec.tools.exchange.reading import MOST_BYTES, ForeignFile, guarded
from taskspec.tools.exchange.settled import property_of, settled, unsettled


@dataclass(frozen=True)
class ModelFormat:
    """A format of files.

    Attributes:
        write: gives the content of a file.
        read: gives the task of a file.
        is_settled: whether it is for model checkers: in rationals, of a settled task.
        is_text: whether files are text.
    """

    name: str
    suffix: str
    write: Callable[[FrozenTask], bytes]
    read: Callable[[ForeignFile], FrozenTask]
    is_settled: bool = False
    is_text: bool = False


FORMATS: dict[str, ModelFormat] = entries_by_name((
    ModelFormat("umb", ".umb", umb.write, umb.read, is_settled=True),
    ModelFormat("gym-p", ".json", arrays.write_p, arrays.read_p, is_text=True),
    ModelFormat("npz", ".npz", arrays.write_npz, arrays.read_npz),
))  # fmt: skip
STORM_READS = {".drn": "--explicit-drn", ".prism": "--prism", ".nm": "--prism", ".jani": "--jani"}
"""Suffixes of files that Storm converts to UMB, with the option that reads them."""


def exported(task: Task, format: ModelFormat = FORMATS["umb"]) -> tuple[Model, FrozenTask]:
    """Return the exact model of a finite task, or of its abstraction, and its tables.

    Those for model checkers have legal actions alone, those for Python all.

    Raises:
        SpecError: E712 for a task that has no exact model, or is too large.
    """
    finite = _finite(task)
    if not format.is_settled:
        finite = with_all_actions(finite)
    model = extract(finite, reachable=True)
    return model, replace(tables(model, LARGEST_TABLE), name=task.instance_id)


def _finite(task: Task) -> Task:
    abstract = abstraction(task)
    if abstract is None:
        return task
    return abstract.stand_in


def written(frozen: FrozenTask, format: ModelFormat) -> bytes:
    """Return the content of a file."""
    if format.is_settled:
        frozen = settled(frozen)
    return format.write(frozen)


def notes(task: Task, frozen: FrozenTask, format: ModelFormat) -> Iterator[str]:
    """Yield what a format does not carry of a task, and how it says the rest."""
    if _finite(task) is not task:
        yield f"states: those of the abstraction of {task.name}"
    if not task.observation.is_state:
        names = ", ".join(c.name for c in task.observation.components)
        if frozen.seen is None:
            yield f"observations ({names}): not in the file; its states are the task's"
        elif format.is_settled:
            yield f"observations ({names}): numbered"
    if task.mask and not format.is_settled:
        yield "legal actions: not in the file; illegal ones have the outcomes that the equations give"
    if task.process.measures:
        yield f"measures ({', '.join(task.process.measures)}): not in the file"
    if not format.is_settled:
        yield "probabilities and rewards: floats"
    elif any(isinstance(outcome.probability, float) for _, _, outcome in frozen.steps()):
        yield "probabilities: floats; a draw of the task has no rational ones"
    yield from _notes_on_time(frozen, format)


def _notes_on_time(frozen: FrozenTask, format: ModelFormat) -> Iterator[str]:
    if frozen.values and "t" in frozen.values[0]:
        yield "time: the component t of the state"
    if not format.is_settled:
        if frozen.last is not None:
            yield f"end of the episode at t = {frozen.last}: the horizon"
        return
    if frozen.discount != 1:
        yield f"discount {frozen.discount}: after each step the episode ends with probability 1 - {frozen.discount}"
    if sum(probability > 0 for probability in frozen.start) > 1:
        yield "start distribution: the first step, from the state labelled draw"
    ready = settled(frozen)
    yield f"optimal return: {property_of(ready, 'max')}; worst: {property_of(ready, 'min')}"


def read(place: str, format: str | None = None) -> FrozenTask:
    """Return the task of a file, or of an environment of Gymnasium with a table `P`.

    Args:
        place: the path of a file, or the id of an environment.
        format: one of `FORMATS`; that of the file's suffix unless given.

    Raises:
        SpecError: E728 for a file that cannot be read, E726 for a format that is not read.
    """
    path = Path(place)
    if format is None and not path.exists() and not path.suffix:
        return arrays.read_environment(place)
    chosen = _format_of(path, format)
    try:
        if path.stat().st_size > MOST_BYTES:
            raise spec_error("E728", f"{place} has more than {MOST_BYTES:,} bytes")
        source = ForeignFile(place, path.read_bytes())
    except OSError as error:
        raise spec_error("E711", f"{place}: {error.strerror or error}") from error
    task = guarded(chosen.read)(source)
    if not chosen.is_settled:
        return task
    return unsettled(task)


def _format_of(path: Path, name: str | None) -> ModelFormat:
    """Return the format with a name, or else the one of a suffix. SpecError: E726 for others."""
    for known in FORMATS.values():
        if name == known.name or (name is None and known.suffix == path.suffix):
            return known
    hint = "formats that are: " + ", ".join(f"{f.name} ({f.suffix})" for f in FORMATS.values())
    suffix = path.suffix
    if name is not None:
        suffix = f".{name}"
    option = STORM_READS.get(suffix)
    if option is not None:
        hint = f"Storm converts it: storm {option} {path} --buildfull --buildchoicelab --exportbuild {path.stem}.umb"
    raise spec_error("E726", f"'{name or path.suffix}' is not read", hint)
