"""Finds task specs, gives them ids, loads them, and registers them with Gymnasium.

A suite is a folder of specs; a task's id is `suite/Name-vN`. The shipped suites are always known; `register` adds others.
Gymnasium is imported inside functions only: its plugin hook may load this module while `import gymnasium` is still running.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec import scan
from taskspec.diagnostics import Diagnostic, SpecError, suggest

if TYPE_CHECKING:
    import gymnasium

    from taskspec.envs.vector import VectorEnvironment
    from taskspec.source import Document
    from taskspec.spec.task import Task

SPEC_ID = "taskspec/Spec-v0"
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
    """The folder of the shipped suites, one sub-folder of YAML specs per suite.

    A wheel carries the folder inside the package; an editable install finds it beside the package.
    """
    package = Path(__file__).parent
    inside = package / "tasks"
    return inside if inside.is_dir() else package.parent / "tasks"


@lru_cache(maxsize=1)
def shipped() -> dict[str, Entry]:
    """The shipped tasks by id."""
    found = [entry for folder in sorted(tasks_root().iterdir()) if folder.is_dir() for entry in entries(folder)]
    return {entry.id: entry for entry in found}


def entries(folder: Path) -> Iterable[Entry]:
    """The tasks of a suite's folder, in order of file and variant."""
    for path in spec_files(folder):
        found = scan.scan(path.read_text(encoding="utf-8", errors="replace"))
        for name, variant in found.tasks:
            yield Entry(folder.resolve().name, name, found.version, path, variant)


def spec_files(folder: Path) -> list[Path]:
    """The specs of a folder, sorted by name."""
    return sorted(p for p in folder.iterdir() if p.suffix in (".yaml", ".yml"))


def known() -> dict[str, Entry]:
    """Every task known by id: the shipped ones and those registered."""
    return {**shipped(), **_registered}


def task_ids() -> list[str]:
    """The ids of all known tasks."""
    return sorted(known())


# -- loading ------------------------------------------------------------------------------------------------------


def load(id_or_path: str | os.PathLike[str], variant: str | None = None, /, **parameters: Any) -> Task:
    """The task of an id or of a spec's file, with parameters bound.

    Args:
        id_or_path: `suite/Name-vN` (the version, and the suite when the name is unique, may be left out), or a path.
        variant: for a path, the variant to load, by its key or its task's name.
        **parameters: values of the task's parameters; the others keep their defaults.

    Raises:
        SpecError: unknown id, or any mistake in the spec, each with its place.
    """
    if not isinstance(id_or_path, str | os.PathLike):
        raise SpecError([Diagnostic("E701", None, f"a task is named by its id or a path, not by {id_or_path!r}")])
    if variant is not None and not isinstance(variant, str):
        raise SpecError([Diagnostic("E211", None, f"a variant is named by a text, not by {variant!r}")])
    if isinstance(id_or_path, os.PathLike) or is_path(id_or_path):
        return _load_file(Path(id_or_path), variant, parameters)
    entry = find(id_or_path)
    return _load_file(entry.path, variant or entry.variant, parameters, entry.suite)


def is_path(name: str) -> bool:
    """Whether a name is meant as a file and not as an id."""
    try:
        return name.endswith((".yaml", ".yml")) or Path(name).is_file()
    except (OSError, ValueError):  # too long for a path, or with characters that none has
        return False


def find(task_id: str) -> Entry:
    """The entry of an id; the version may be left out, and the suite when the name is unique.

    Raises:
        SpecError: E701 when there is none, or more than one.
    """
    entries = known()
    if task_id in entries:
        return entries[task_id]
    matches = [e for e in entries.values() if task_id in (f"{e.suite}/{e.name}", e.name, f"{e.name}-v{e.version}")]
    if len(matches) == 1:
        return matches[0]
    if matches:
        message = f"'{task_id}' could be {' or '.join(e.id for e in matches)}"
        raise SpecError([Diagnostic("E701", None, message)])
    near = suggest(_VERSION.sub("", task_id), [f"{e.suite}/{e.name}" for e in entries.values()])
    hint = near or "`taskspec list` shows the tasks; a path ends in .yaml"
    raise SpecError([Diagnostic("E701", None, f"there is no task '{task_id}'", hint)])


def _load_file(path: Path, variant: str | None, parameters: dict[str, Any], suite: str | None = None) -> Task:
    try:
        stamp = path.stat()
        version = (stamp.st_mtime_ns, stamp.st_size)
    except (OSError, ValueError):
        version = (0, 0)  # reading it will say what is wrong
    suite = suite_of(path) if suite is None else suite
    # 1, 1.0 and True are one key to a dictionary, but not one value to a parameter.
    given = tuple((name, type(value).__name__, value) for name, value in parameters.items())
    try:
        hash(given)
    except TypeError:  # a list, say: no parameter takes one, and the build says so
        return _built.__wrapped__(str(path), version, variant, given, suite)
    return _built(str(path), version, variant, given, suite)


@lru_cache(maxsize=128)
def _built(path: str, version: tuple[int, int], variant: str | None, given: tuple[Any, ...], suite: str) -> Task:
    """A task of an unchanged file is built once: tasks are immutable."""
    from taskspec.spec.build import build

    return build(_document(path, version), variant, {name: value for name, _, value in given}, suite)


@lru_cache(maxsize=64)
def _document(path: str, version: tuple[int, int]) -> Document:
    from taskspec.source import read_file

    return read_file(path)


def suite_of(path: Path) -> str:
    """The suite that a spec's folder makes, or none where the folder's name could not be part of an id."""
    try:
        name = path.resolve().parent.name
    except (OSError, ValueError):  # no path at all; reading it will say so
        return ""
    return name if re.fullmatch(r"[\w:-]+", name) else ""


# -- Gymnasium ----------------------------------------------------------------------------------------------------


def make(
    id_or_path: str | os.PathLike[str],
    variant: str | None = None,
    /,
    *,
    render_mode: str | None = None,
    ending: str = "terminate",
    observe_time: bool = False,
    **parameters: Any,
) -> gymnasium.Env[Any, Any]:
    """The scalar environment of a task: `load` and `Task.make` in one call."""
    task = load(id_or_path, variant, **parameters)
    return task.make(render_mode=render_mode, ending=ending, observe_time=observe_time)


def register(folder: str | os.PathLike[str]) -> list[str]:
    """Register the specs of a folder, and of its sub-folders, with Gymnasium; gives the ids.

    Raises:
        SpecError: when the folder does not exist or a spec in it cannot be read.
    """
    root = Path(folder)
    if not root.is_dir():
        raise SpecError([Diagnostic("E710", None, f"there is no folder '{root}'")])
    found = [e for each in (root, *sorted(p for p in root.iterdir() if p.is_dir())) for e in entries(each.resolve())]
    for entry in found:
        _registered[entry.id] = entry
        _add(entry.id, {"path": str(entry.path), "variant": entry.variant})
    return [entry.id for entry in found]


def register_shipped() -> None:
    """Register the shipped tasks with Gymnasium: once, cheaply, without reading their specs in full."""
    for entry in shipped().values():
        _add(entry.id, {"task": entry.id})
    _add(SPEC_ID, {})


def _add(task_id: str, kwargs: dict[str, Any]) -> None:
    from gymnasium.envs.registration import register as add
    from gymnasium.envs.registration import registry

    if task_id in registry and registry[task_id].kwargs == kwargs:
        return
    registry.pop(task_id, None)
    # The environment checks order, horizon and actions itself, so that `gym.make` can return it bare.
    add(
        task_id,
        "taskspec.registry:make_registered",
        vector_entry_point="taskspec.registry:make_vec_registered",
        order_enforce=False,
        disable_env_checker=True,
        kwargs=kwargs,
    )


def make_vec(
    id_or_path: str | os.PathLike[str],
    variant: str | None = None,
    /,
    *,
    num_envs: int = 1,
    backend: str = "auto",
    autoreset_mode: Any = "NextStep",
    reuse: bool = False,
    num_threads: int = 1,
    ending: str = "terminate",
    observe_time: bool = False,
    render_mode: str | None = None,
    **parameters: Any,
) -> VectorEnvironment:
    """Many environments of a task, stepped together: `load` and `taskspec.envs.vector.VectorEnvironment` in one call.

    Raises:
        SpecError: E705 when Gymnasium is older than 1.1 or the backend's package is not installed.
    """
    from taskspec.envs.vector import VectorEnvironment

    return VectorEnvironment(
        load(id_or_path, variant, **parameters),
        num_envs,
        backend=backend,
        autoreset_mode=autoreset_mode,
        reuse=reuse,
        num_threads=num_threads,
        ending=ending,
        observe_time=observe_time,
        render_mode=render_mode,
    )


def make_registered(
    *, task: str | None = None, path: str | None = None, variant: str | None = None, **options: Any
) -> gymnasium.Env[Any, Any]:
    """What `gym.make` calls: `task` is an id, `path` a spec's file; options are parameters and those of `make`."""
    return make(_source(task, path), variant, **options)


def make_vec_registered(
    *, task: str | None = None, path: str | None = None, variant: str | None = None, **options: Any
) -> VectorEnvironment:
    """What `gym.make_vec` calls; options are parameters and those of `make_vec`."""
    return make_vec(_source(task, path), variant, **options)


def _source(task: str | None, path: str | None) -> str | Path:
    if task is not None and path is not None:
        raise SpecError([Diagnostic("E713", None, "give `task` or `path`, not both")])
    source = task if path is None else Path(path)
    if source is None:
        hint = 'gym.make("taskspec/Spec-v0", path="my.yaml")'
        raise SpecError([Diagnostic("E713", None, f"{SPEC_ID} needs a spec", hint)])
    return source
