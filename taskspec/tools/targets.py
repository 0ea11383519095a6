"""Targets: ids, paths, folders, suites and experiments, which of them name which specs, and the tasks of each.

A document is read once, however many tasks it defines.
"""

from __future__ import annotations

import itertools
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from taskspec.base import ids
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.files import near, safe_name
from taskspec.language import registry
from taskspec.language.modifiers import modify
from taskspec.language.source import Document, Kind, kind_of_text, read_text
from taskspec.language.task.build import build, check_document, outline
from taskspec.language.task.merge import complete, task_name
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.experiments.experiment_file import read, read_if_experiment
from taskspec.learn.experiments.instances import expand

if TYPE_CHECKING:
    from taskspec.language.task.build import Outline

T = TypeVar("T")
OTHERS: tuple[Kind, ...] = ("experiment", "exam", "findings")
"""Kinds of files that are no specs."""


@dataclass(frozen=True, slots=True)
class File:
    """A spec's file, the variants asked for (None: all that are complete), values of their parameters, and modifiers."""

    path: Path
    suite: str
    variants: tuple[str | None, ...] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    modifiers: tuple[str, ...] = ()
    text: str | None = None
    """The text in an editor, where it is not the one on disk."""

    def at(self, values: Mapping[str, Any], modifiers: Sequence[str] = ()) -> File:
        """Add values of parameters, and modifiers.

        Raises:
            SpecError: E713 for one that has a value.
        """
        for name in values:
            if name in self.parameters:
                raise spec_error("E713", f"'{name}' is given in the id and separately; give it once")
        return replace(self, parameters={**self.parameters, **values}, modifiers=(*self.modifiers, *modifiers))


def tasks_of(target: str, variant: str | None, parameters: Sequence[str], modifiers: Sequence[str] = ()) -> list[Task]:
    """Return the task of a target, once for each setting of its parameters.

    Raises:
        SpecError: no such task, a folder, a bad parameter or modifier, or any mistake in the spec.
    """
    if Path(target).is_dir():
        hint = "`taskspec list FOLDER` shows what is in it"
        raise spec_error("E711", f"'{target}' is a folder; this command takes one task", hint)
    tasks = []
    for values in settings(parameters):
        tasks.append(registry.load(target, variant, modifiers=modifiers, **values))
    return tasks


GIT = "git:"


def task_at(target: str, variant: str | None) -> Task:
    """Load a task by its id or path, or a spec as it was at a revision, `git:REV:PATH`.

    Raises:
        SpecError: E711 where git cannot give the file, E713 for another form after `git:`, or any mistake in the spec.
    """
    if not target.startswith(GIT):
        return registry.load(target, variant)
    revision, _, path = target.removeprefix(GIT).partition(":")
    if not revision or not path or revision.startswith("-"):
        raise spec_error("E713", f"'{target}' is not of the form git:REV:PATH", "git:HEAD~1:tasks/my.yaml")
    try:
        done = subprocess.run(["git", "show", f"{revision}:./{path}"], capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise spec_error("E711", "git is not installed") from None
    except subprocess.CalledProcessError as error:
        raise spec_error("E711", f"git cannot show '{target}': {error.stderr.strip()}") from None
    return build(read_text(done.stdout, path), variant, {}, registry.suite_of(Path(path)))


def task_of(target: str, variant: str | None, parameters: Sequence[str], modifiers: Sequence[str] = ()) -> Task:
    """Return the task of a target, with one setting of its parameters.

    Raises:
        SpecError: as `tasks_of`, and E713 for several values of a parameter.
    """
    tasks = tasks_of(target, variant, parameters, modifiers)
    if len(tasks) > 1:
        raise spec_error("E713", "this command takes one value of each parameter")
    return tasks[0]


def files_of(targets: Sequence[str], parameters: Sequence[str] = (), modifiers: Sequence[str] = ()) -> list[File]:
    """Return the files behind targets, each once for each setting of parameters; without targets, the files of all known tasks.

    Raises:
        SpecError: E701, E710 when one of them is nothing of the kind, or a folder without specs; E713 as `settings`.
    """
    if targets:
        files = []
        for target in targets:
            files += _files(target)
    else:
        files = _suites(registry.known().values())
    chosen = []
    for file in _joined(files):
        for values in settings(parameters):
            chosen.append(file.at(values, modifiers))
    return chosen


def others_of(targets: Sequence[str]) -> list[tuple[Path, Kind]]:
    """Return the files behind targets that are not specs, kind by kind; without targets, the files of all suites."""
    others: list[tuple[Path, Kind]] = []
    if not targets:
        others += _below(near(registry.tasks_root()), depth=3)
    for target in targets:
        suite = registry.tasks_root() / target
        kind = kind_of(target)
        if kind is not None:
            others.append((Path(target), kind))
        elif Path(target).is_dir():
            others += _below(Path(target))
        elif target.isidentifier() and suite.is_dir():
            others += _below(near(suite))
    known = dict.fromkeys(other for other in others if other[1] in OTHERS)
    return sorted(known, key=lambda other: OTHERS.index(other[1]))


def kind_of(target: str) -> Kind | None:
    path = Path(target)
    if not path.is_file():
        return None
    return kind_of_text(path.read_text(encoding="utf-8", errors="replace"))


def _below(folder: Path, depth: int = 2) -> list[tuple[Path, Kind]]:
    files = registry.files_in(folder)
    for inside in sorted(folder.iterdir()) if depth else ():
        if inside.is_dir() and not inside.name.startswith("."):
            files += _below(inside, depth - 1)
    return files


def _files(target: str) -> list[File]:
    path = Path(target)
    if path.is_dir():
        return _of_folder(path)
    asked = registry.instance(target)
    if asked.parameters or asked.modifiers:
        files = []
        for file in _files(asked.name):
            files.append(file.at(asked.parameters, asked.modifiers))
        return files
    if registry.is_path(target) or ("/" in target and path.exists()):
        if kind_of(target) in (None, "taskspec"):
            return [File(path, registry.suite_of(path))]
        return []
    suite = []
    for e in registry.known().values():
        if e.suite == target:
            suite.append(e)
    if suite:
        return _suites(suite)
    if target.startswith((".", "/", "~")) or target.endswith("/"):
        raise spec_error("E710", f"there is no file or folder '{target}'")
    entry = registry.find(target)
    return [File(near(entry.path), entry.suite, (entry.variant,))]


def _of_folder(folder: Path) -> list[File]:
    specs = []
    for path, kind in _below(folder, 1):
        if kind == "taskspec":
            specs.append(File(path, registry.suite_of(path)))
    if not specs and not any(kind in OTHERS for _, kind in _below(folder)):
        hint = "`taskspec new Name` writes one to start from"
        raise spec_error("E710", f"there is no spec (*.yaml) in '{folder}'", hint)
    return specs


def _suites(entries: Iterable[registry.Entry]) -> list[File]:
    return [File(near(e.path), e.suite) for e in entries]


def _joined(files: Iterable[File]) -> list[File]:
    merged: dict[tuple[Path, str], File] = {}
    for file in files:
        key = (file.path.resolve(), repr((file.parameters, file.modifiers)))
        old = merged.setdefault(key, file)
        if old.variants is None or file.variants is None:
            merged[key] = replace(old, variants=None)
        else:
            merged[key] = replace(old, variants=tuple(dict.fromkeys((*old.variants, *file.variants))))
    return list(merged.values())


def with_files(tasks: Sequence[Task], path: Path) -> Iterator[tuple[Task, Path]]:
    """Yield settings of a task, each with its file: of several, `scores-L=5-M=7.json` for `scores.json`."""
    if len(tasks) == 1:
        yield tasks[0], path
        return
    for task in tasks:
        values = [f"{name}={ids.shown(value)}" for name, value in task.values.items()]
        yield task, path.with_name(f"{path.stem}-{safe_name('-'.join(values))}{path.suffix}")


def settings(texts: Sequence[str]) -> list[dict[str, Any]]:
    """Return the settings of parameters, one for each combination of values: `L=5,10` and `B=2` are two settings.

    Several parameters may stand in one text, `L=5,10,B=2`: a value without a name is one more of the parameter before it.

    Raises:
        SpecError: E713 for a text of another form, or a name given twice.
    """
    values: dict[str, list[Any]] = {}
    for text in texts:
        name = ""
        for part in text.split(","):
            value = part.strip()
            if "=" in part:
                name, value = map(str.strip, part.split("=", 1))
                if name in values:
                    raise spec_error("E713", f"parameter '{name}' is given twice", f"several values: -p {name}=1,2")
            if not name.isidentifier() or not value:
                hint = "for example: -p L=20, or -p L=5,10,20"
                raise spec_error("E713", f"'-p {text}' is not of the form name=value", hint)
            values.setdefault(name, []).append(ids.read_value(value))
    combinations = []
    for chosen in itertools.product(*values.values()):
        combinations.append(dict(zip(values, chosen, strict=True)))
    return combinations


def _document(file: File) -> Document:
    path = str(file.path)
    if file.text is None:
        document = registry.document(path)
    else:
        document = _of_text(file.text, path)
    check_document(document)
    return document


@lru_cache(maxsize=8)
def _of_text(text: str, name: str) -> Document:
    return read_text(text, name)


def variants_of(file: File) -> list[str | None]:
    """Return the variants that are tasks (None for the spec itself), in written order.

    A spec that leaves sections to its variants is no task itself; without variants, it is one that lacks something.

    Raises:
        SpecError: when the file cannot be read, or has not the shape of a spec.
    """
    if file.variants is not None:
        return list(file.variants)
    return complete(_document(file))


def name_of(file: File, variant: str | None) -> str:
    name = str(_document(file).data.get("name"))
    if variant is None:
        return name
    return task_name(name, variant)


def task_in(file: File, variant: str | None) -> Task:
    """Return one task of a file, with the values and the modifiers of the target.

    Raises:
        SpecError: with every mistake found.
    """
    return modify(build(_document(file), variant, file.parameters, file.suite), *file.modifiers)


def outline_in(file: File, variant: str | None) -> Task | Outline:
    """Return the outline of one task of a file, or the task itself where modifiers change it.

    Raises:
        SpecError: with every mistake in what is declared.
    """
    if file.modifiers:
        return task_in(file, variant)
    return outline(_document(file), variant, file.parameters, file.suite)


def all_in(files: Iterable[File], read_task: Callable[[File, str | None], T]) -> tuple[list[T], list[Diagnostic]]:
    """Return what `task_in` or `outline_in` makes of all tasks of files, in order, and the mistakes in others."""
    tasks = []
    problems: list[Diagnostic] = []
    for file in files:
        try:
            variants = variants_of(file)
        except SpecError as error:
            variants = []
            problems += error.diagnostics
        for variant in variants:
            try:
                tasks.append(read_task(file, variant))
            except SpecError as error:
                problems += error.diagnostics
    return tasks, problems


def all_tasks(targets: Sequence[str], modifiers: Sequence[str] = ()) -> tuple[list[Task], list[Diagnostic]]:
    """Return all tasks of ids, files and folders, and of experiments that are named, and what is wrong with others."""
    named = [target for target in targets if kind_of(target) == "experiment"]
    others = [target for target in targets if target not in named]
    tasks: list[Task] = []
    problems: list[Diagnostic] = []
    if others or not named:
        tasks, problems = all_in(files_of(others, modifiers=modifiers), task_in)
    for target in named:
        try:
            tasks += [modify(task, *modifiers) for task in expand(read(target)).tasks()]
        except SpecError as error:
            problems += error.diagnostics
    return tasks, problems


def tasks_named(names: Sequence[str]) -> list[TaskLike]:
    """Return tasks by name; those of an experiment where one is named."""
    tasks: list[TaskLike] = []
    for name in names:
        written = read_if_experiment(name)
        if written is None:
            tasks.append(name)
        else:
            tasks += expand(written).tasks()
    return tasks
