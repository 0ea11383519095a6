"""The formats of other tools, one entry each: how a task is written in it, what it cannot carry, and how it is read.

An imported task becomes a spec, with the returns of its source as claims.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from taskspec.base.diagnostics import spec_error
from taskspec.base.limits import limits
from taskspec.base.named import all_names, entries_by_name
from taskspec.exact.abstraction.abstraction import abstraction
from taskspec.exact.model.extract import OVERHEAD, SWEEP, extract, tabulated
from taskspec.exact.model.model import Model, NoModel
from taskspec.exact.solve.backward import Greedy, Uniform
from taskspec.exact.solve.outcomes import LARGEST_TABLE, Number
from taskspec.exact.solve.solve import Solvers
from taskspec.language.task.legal import with_all_actions
from taskspec.language.task.task import Task
from taskspec.tools.exchange import arrays, umb
from taskspec.tools.exchange.freezing import pays_after_ends, tables
from taskspec.tools.exchange.frozen_task import (
    FrozenTask,
    cleared,
    components_name,
    numbered,
    plain_names,
    separated,
)
from taskspec.tools.exchange.reading import MOST_BYTES, ForeignFile, guarded, listed
from taskspec.tools.exchange.settled import ENDED, PHASE, property_of, settled, unsettled
from taskspec.tools.exchange.spec_text import has_mean_rewards


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
        names = ", ".join(all_names(task.observation.components))
        if frozen.seen is None:
            yield f"observations ({names}): not in the file; its states are the task's"
        elif format.is_settled:
            yield f"observations ({names}): numbered"
    if task.mask and not format.is_settled:
        yield "legal actions: not in the file; illegal ones have the outcomes that the equations give"
    if task.process.measures:
        yield f"measures ({', '.join(task.process.measures)}): not in the file"
    if pays_after_ends(task):
        yield "absorbing reward: not in the file"
    if not format.is_settled:
        yield "probabilities and rewards: floats"
    elif not frozen.is_rational:
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
    if len(frozen.starts) > 1:
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
    known_formats = [f"{known.name} ({known.suffix})" for known in FORMATS.values()]
    hint = f"formats that are: {', '.join(known_formats)}"
    suffix = f".{name}" if name is not None else path.suffix
    option = STORM_READS.get(suffix)
    if option is not None:
        hint = f"Storm converts it: storm {option} {path} --buildfull --buildchoicelab --exportbuild {path.stem}.umb"
    raise spec_error("E726", f"'{name or path.suffix}' is not read", hint)


NAME = re.compile(r"[A-Z][A-Za-z0-9]{0,59}")


def imported(place: str, format: str | None = None, name: str | None = None, horizon: int | None = None) -> FrozenTask:
    """Return the task of a file or an environment, ready to be written as a spec.

    Args:
        place: the path of a file, or the id of an environment of Gymnasium.
        format: of the file, where its suffix does not say it.
        name: of the task; made from that of the file or environment unless given.
        horizon: of episodes, in place of the source's.

    Raises:
        SpecError: E728, E726, E711 or E701 where it cannot be read, E713 for a name that is none.
    """
    if name is not None and not NAME.fullmatch(name):
        raise spec_error("E713", f"'{name}' is not a name", "a capital letter, and letters and digits")
    task = read(place, format)
    if task.labels:
        task = task.remarked(f"lost: labels ({listed(list(task.labels))})")
    if horizon is not None:
        task = replace(task, horizon=horizon)
    width = _width(task)
    if width is None:
        task = cleared(task)
    names = _names(task, width)
    cells = len(names) ** 2 * len(task.actions)
    task = separated(replace(task, states=names, width=width), everywhere=cells > limits().cells)
    if has_mean_rewards(task):
        task = task.remarked(
            "rewards: their mean for each state and action, as a table by next state would be too large"
        )
    text = {"title": f"{Path(place).stem}, imported", "summary": f"The decision process of {Path(place).name}."}
    return replace(task, name=name or _name(place), text=text, claims=_returns(task))


def _name(place: str) -> str:
    """Return a name for the task of a file or environment: `FrozenLake` for `FrozenLake-v1`."""
    words = re.findall(r"[A-Za-z0-9]+", re.sub(r"-v\d+$", "", Path(place).stem))
    joined = "".join(word[0].upper() + word[1:] for word in words)
    if NAME.fullmatch(joined):
        return joined
    return "Imported"


def _names(task: FrozenTask, width: int | None) -> tuple[str, ...]:
    """Return names of states: their components with their values, where the source has them; rows and columns of a grid."""
    is_numbered = task.states == numbered("s", len(task.states))
    if not task.values and width is not None and is_numbered:
        return tuple(f"r{s // width}c{s % width}" for s in range(len(task.states)))
    if not task.values:
        return task.states
    names = []
    for row in task.values:
        components = dict(row)
        phase = components.pop(PHASE, None)
        parts = [components_name(components)]
        if phase == ENDED:
            parts.append("end")
        names.append("_".join(filter(None, parts)))
    return plain_names(names, "s")


def _width(task: FrozenTask) -> int | None:
    n = len(task.states)
    firsts = set(task.starts)
    moves = set()
    for s, _, outcome in task.taken_steps():
        if outcome.state != s and outcome.state not in firsts:
            moves.add((s, outcome.state))
    sizes = {abs(to - s) for s, to in moves} - {1}
    if len(sizes) != 1:
        return None
    (width,) = sizes
    if width < 2 or n % width or any(abs(to - s) == 1 and to // width != s // width for s, to in moves):
        return None
    return width


def _returns(task: FrozenTask) -> dict[str, Number]:
    """Return the optimal and random return of the tables themselves, without the spec.

    Both are left out where they would take too long, and those of endless tasks where some policy never ends an episode.
    """
    outcomes = []
    legal = np.zeros((len(task.actions), len(task.states)), np.bool_)
    for s, a, _ in task.steps():
        legal[a, s] = True
    for s, a, o in task.taken_steps():
        outcomes.append((s, a, o.state, float(o.probability), float(o.reward), o.ends))
    if (task.horizon or 0) * (len(outcomes) + OVERHEAD) > limits().seconds * SWEEP:
        return {}
    start = np.array(task.start, np.float64)
    model = tabulated(outcomes, start, len(task.actions), task.horizon, float(task.discount), legal)
    solver = Solvers(model).in_floats
    returns: dict[str, Number] = {}
    for name, rule in (("optimal_return", Greedy()), ("random_return", Uniform())):
        with suppress(NoModel):
            returns[name] = solver.value(rule).value
    return returns
