"""Finds task specs, gives them ids, and loads them.

A suite is a folder of specs; a task's id is `suite/Name-vN`. The shipped suites are always known;
`taskspec.register` adds others.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from taskspec.base import ids
from taskspec.base.diagnostics import spec_error, suggest
from taskspec.language.source import Document, Kind, kind_of_text, read_file, read_text
from taskspec.language.source.document import EXTENDS
from taskspec.language.task.merge import REQUIRED, variant_names
from taskspec.language.task.task import Task, TaskLike

if TYPE_CHECKING:
    from taskspec.language.modifiers import Written

_VERSION = re.compile(r"-v(\d+)$")


@dataclass(frozen=True, slots=True)
class Entry:
    """A task that is known by its id: where its spec is, and which variant of it."""

    suite: str
    name: str
    version: int
    path: Path
    variant: str | None

    @property
    def id(self) -> str:
        return f"{self.suite}/{self.name}-v{self.version}"


_registered: dict[str, Entry] = {}


def tasks_root() -> Path:
    """Return the folder of the shipped suites, one sub-folder of YAML specs per suite.

    A wheel carries the folder inside the package; an editable install finds it beside the package.
    """
    package = Path(__file__).resolve().parents[1]
    inside = package / "tasks"
    if inside.is_dir():
        return inside
    return package.parent / "tasks"


@cache
def shipped() -> dict[str, Entry]:
    by_id = {}
    for folder in sorted(tasks_root().iterdir()):
        if folder.is_dir():
            by_id.update({entry.id: entry for entry in entries(folder)})
    return by_id


def entries(folder: Path) -> Iterator[Entry]:
    """Yield the tasks of a suite's folder, in order of file and variant.

    Raises:
        SpecError: when the text of a spec is not valid YAML.
    """
    suite = folder.resolve().name
    for path, text in _texts(folder):
        if not text or kind_of_text(text) != "taskspec":
            continue
        data = read_text(text, str(path), known={}).data
        if not isinstance(data, dict):
            continue
        version = data.get("version")
        if type(version) is not int or version < 0:
            version = 0
        is_complete = EXTENDS in data or data.keys() >= set(REQUIRED)
        for name, variant in variant_names(data).items():
            if variant is not None or is_complete:
                yield Entry(suite, name, version, path, variant)


def files_in(folder: Path) -> list[tuple[Path, Kind]]:
    """Return the YAML files of a folder, sorted by name, and what each of them holds."""
    return [(path, kind_of_text(text)) for path, text in _texts(folder)]


def _texts(folder: Path) -> Iterator[tuple[Path, str]]:
    for path in sorted(folder.iterdir()):
        if path.suffix not in (".yaml", ".yml"):
            continue
        try:
            yield path, path.read_text(encoding="utf-8", errors="replace")
        except OSError:  # a folder, or a link to nothing
            yield path, ""


def known() -> dict[str, Entry]:
    """Return every task known by id: the shipped ones and those registered."""
    return {**shipped(), **_registered}


def add(entry: Entry) -> None:
    """Know a task by its id from now on."""
    _registered[entry.id] = entry


def task_ids() -> list[str]:
    """List the ids of all known tasks.

    Returns:
        Ids of the form `suite/Name-vN`, sorted: of the shipped tasks and of registered ones.
    """
    return sorted(known())


# -- loading ------------------------------------------------------------------------------------------------------


def load(
    source: TaskLike, /, variant: str | None = None, *, modifiers: Iterable[Written] = (), **parameters: Any
) -> Task:
    """Return the task of an id, of a spec's file, or the task itself, with parameters bound.

    Args:
        source: `suite/Name-vN` (the version, and the suite when the name is unique, may be left out), a path, or a task.
            Values of parameters and modifiers may stand behind an id or a path: `derail/NoisyObs-v0?L=50&M=7+sticky=0.25`.
        variant: for a path or a task, the variant to load, by its key or its task's name.
        modifiers: what to change of the task, in order (see `taskspec.modify`), after those that it has.
        **parameters: values of the task's parameters; the others keep their defaults, or the values that a given task has.

    Returns:
        The task, immutable and complete.

    Raises:
        SpecError: unknown id, or any mistake in the spec, each with its place; modifiers that the task cannot be given.
    """
    task = _found(source, variant, parameters)
    wanted = listed(modifiers)
    if isinstance(source, str):
        wanted = (*instance(source).modifiers, *wanted)
    if not wanted:
        return task
    from taskspec.language.modifiers import modify

    return modify(task, *wanted)


def role(task: Task, who: Literal["expert", "learner"]) -> Task:
    """Task in the variant in which the expert or the learner acts; the task itself where its spec has no roles."""
    key = task.roles.get(who)
    if key is None or key == task.source.variant:
        return task
    values = {}
    for p in task.parameters:
        if p.value != p.default:
            values[p.name] = p.value
    return load(task, key, **values)


def listed(modifiers: Any) -> tuple[Written, ...]:
    """Check that modifiers are given as a list: a text and a mapping are iterable, too.

    Raises:
        SpecError: E718 for anything but a list or its like.
    """
    if isinstance(modifiers, str | Mapping) or not isinstance(modifiers, Iterable):
        hint = 'for example modifiers=["sticky=0.25"]'
        raise spec_error("E718", f"modifiers are given as a list, not as {modifiers!r}", hint)
    return tuple(modifiers)


def _found(source: TaskLike, variant: str | None, parameters: dict[str, Any]) -> Task:
    from taskspec.language.task.build import build

    if not isinstance(source, Task | str | os.PathLike):
        raise spec_error("E701", f"a task is named by its id or a path, not by {source!r}")
    given: object = variant
    if not isinstance(given, str | None):
        hint = None
        if type(given) is int:
            hint = f"the number of environments is `num_envs={given}`"
        raise spec_error("E211", f"a variant is named by a text, not by {given!r}", hint)
    if isinstance(source, Task):
        return _changed(source, variant, parameters)
    if isinstance(source, str):
        asked = instance(source)
    else:
        asked = ids.InstanceId(os.fspath(source), {})
    for name in parameters:
        if name in asked.parameters:
            raise spec_error("E713", f"'{name}' is given in the id and separately; give it once")
    parameters = {**asked.parameters, **parameters}
    if not isinstance(source, str) or is_path(asked.name):
        return build(document(asked.name), variant, parameters, suite_of(asked.name))
    entry = find(asked.name)
    return build(document(str(entry.path)), variant or entry.variant, parameters, entry.suite)


def instance(source: str) -> ids.InstanceId:
    """Return what an id or a path names, with the parameters and modifiers behind it.

    Raises:
        SpecError: E713 for something else than values behind it.
    """
    if is_path(source):
        return ids.InstanceId(source, {})
    return ids.parse(source)


def _changed(task: Task, variant: str | None, parameters: dict[str, Any]) -> Task:
    if variant is None and not parameters:
        return task
    from taskspec.language.modifiers import modify
    from taskspec.language.task.build import build

    names = {p.alias: p.name for p in task.parameters}
    given = {}
    for name, value in parameters.items():
        given[names.get(name, name)] = value
    if not variant:
        given = {**task.given, **given}
    return modify(
        build(task.source.document, variant or task.source.variant, given, task.source.suite), *task.modifiers
    )


def is_path(name: str) -> bool:
    """Return whether a name is meant as a file and not as an id."""
    try:
        return name.endswith((".yaml", ".yml")) or Path(name).is_file()
    except (OSError, ValueError):  # too long for a path, or with characters that none has
        return False


def find(task_id: str) -> Entry:
    """Return the entry of an id; the version may be left out, and the suite when the name is unique.

    Raises:
        SpecError: E701 when there is none, or more than one.
    """
    entries = known()
    if task_id in entries:
        return entries[task_id]
    matches = []
    for e in entries.values():
        if task_id in (f"{e.suite}/{e.name}", e.name, f"{e.name}-v{e.version}"):
            matches.append(e)
    if len(matches) == 1:
        return matches[0]
    if matches:
        message = f"'{task_id}' could be {' or '.join(e.id for e in matches)}"
        raise spec_error("E701", message)
    near = suggest(_VERSION.sub("", task_id), [f"{e.suite}/{e.name}" for e in entries.values()])
    hint = near or "`taskspec list` shows the tasks; a path ends in .yaml"
    raise spec_error("E701", f"there is no task '{task_id}'", hint)


_documents: dict[str, tuple[Document, list[tuple[int, int]]]] = {}
"""Documents by path, each with the states of its files when it was read."""


def document(path: str) -> Document:
    """Return the document of a file as it is now; it is read again if the file, or one that it extends, has changed.

    Raises:
        SpecError: when it cannot be read.
    """
    if path in _documents:
        known, states = _documents[path]
        if states == list(map(_state_of, (path, *known.files))):
            return known
    before = _state_of(path)
    read = read_file(path)
    _documents[path] = (read, [before, *map(_state_of, read.files)])
    return read


def _state_of(file: str) -> tuple[int, int]:
    try:
        state = Path(file).stat()
    except (OSError, ValueError):
        return 0, 0  # reading it will say what is wrong
    return state.st_mtime_ns, state.st_size


def suite_of(path: str | os.PathLike[str]) -> str:
    """Return the suite that a spec's folder makes, or none where the folder's name could not be part of an id."""
    try:
        name = Path(os.path.realpath(path)).parent.name
    except (OSError, ValueError):  # no path at all; reading it will say so
        return ""
    if re.fullmatch(r"[\w:-]+", name):
        return name
    return ""


CAPABILITIES = {
    "exploration": "Find rewards that random actions hardly ever reach.",
    "credit assignment": "Tell which action earned a reward that comes later, or among noise.",
    "memory": "Act on earlier observations, where the present one does not show enough.",
    "information gathering": "Spend steps on finding out what is hidden, before acting on it.",
    "planning": "Choose among long sequences of actions, where one step alone does not show which is right.",
    "chance": "Weigh outcomes by their probabilities, risks included.",
    "control": "Steer continuous quantities, such as positions and speeds.",
    "value estimation": "Learn values without bias: from rewards of any size, other policies' data, or features.",
    "termination": "Give the end of an episode its right value, whether by the task or by a time limit.",
    "generalisation": "Act well in instances, such as goals and maps, that were not seen before.",
    "distribution shift": "Act well where states or rules differ from those that were learned from.",
    "robustness to noise": "Ignore parts of the observation that mean nothing.",
    "high dimensionality": "Use long vectors of which every number matters.",
    "reward inference": "Work out from demonstrations or preferences what shall be achieved.",
    "safety": "Do what is meant where the reward does not say so.",
}  # fmt: skip
"""Capabilities, each with its definition: what a learner has to do. A word that is not among them goes to `keywords`."""
