"""What a command was pointed at: ids, paths, folders and suites, all interchangeable; and parameters from `-p L=20`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec import registry
from taskspec.cli.failures import misuse, refuse
from taskspec.diagnostics import suggest

if TYPE_CHECKING:
    from taskspec.task.task import Task


@dataclass(frozen=True, slots=True)
class File:
    """A spec's file, and the variants that were asked for (None: all that are complete)."""

    path: Path
    suite: str
    variants: tuple[str | None, ...] | None = None


def task_of(target: str, variant: str | None, parameters: Sequence[str]) -> Task:
    """The one task that a command is about.

    Raises:
        SpecError: no such task, a folder, a bad parameter, or any mistake in the spec.
    """
    if Path(target).is_dir():
        raise refuse(
            "E711", f"'{target}' is a folder; this command takes one task", "`taskspec list FOLDER` shows what is in it"
        )
    values = assignments(parameters)
    return registry.load(shown_path(target), variant, **values)


def shown_path(target: str) -> str | Path:
    """A target as `registry.load` wants it; a shipped task's file goes by its short path."""
    if registry.is_path(target):
        return Path(target)
    registry.find(target)  # an unknown id is reported before anything is read
    return target


def files_of(targets: Sequence[str]) -> list[File]:
    """The files behind ids, paths, folders and suites, each once; all known tasks for none.

    Raises:
        SpecError: E701, E710 when one of them is nothing of the kind, or a folder without specs.
    """
    if not targets:
        return _joined(_of_entries(registry.known().values(), whole=True))
    return _joined([file for target in targets for file in _files(target)])


def _files(target: str) -> list[File]:
    path = Path(target)
    if path.is_dir():
        return _of_folder(path)
    if registry.is_path(target) or ("/" in target and path.exists()):
        return [File(path, registry.suite_of(path))]
    suite = [e for e in registry.known().values() if e.suite == target]
    if suite:
        return _of_entries(suite, whole=True)
    if _looks_like_path(target):
        raise refuse("E710", f"there is no file or folder '{target}'")
    return _of_entries([registry.find(target)], whole=False)


def _looks_like_path(target: str) -> bool:
    """Whether a target that does not exist was meant as a path: it starts or ends like one."""
    return target.startswith((".", "/", "~")) or target.endswith("/")


def _of_folder(folder: Path) -> list[File]:
    """The specs of a folder and of its sub-folders."""
    found = [
        File(path, registry.suite_of(path))
        for each in (folder, *sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".")))
        for path in registry.spec_files(each)
    ]
    if not found:
        raise refuse("E710", f"there is no spec (*.yaml) in '{folder}'", "`taskspec new Name` writes one to start from")
    return found


def _of_entries(entries: Iterable[registry.Entry], whole: bool) -> list[File]:
    return [File(near(e.path), e.suite, None if whole else (e.variant,)) for e in entries]


def near(path: Path) -> Path:
    """A path as seen from the current folder, where it lies below that."""
    try:
        return path.relative_to(Path.cwd())
    except (ValueError, OSError):
        return path


def _joined(files: Iterable[File]) -> list[File]:
    """Each file once, with all that was asked of it, in order of first mention."""
    merged: dict[Path, File] = {}
    for file in files:
        key = file.path.resolve()
        old = merged.get(key)
        if old is None:
            merged[key] = file
        elif old.variants is None or file.variants is None:
            merged[key] = File(old.path, old.suite)
        else:
            merged[key] = File(old.path, old.suite, tuple(dict.fromkeys((*old.variants, *file.variants))))
    return list(merged.values())


# -- parameters ---------------------------------------------------------------------------------------------------


def assignments(texts: Sequence[str]) -> dict[str, Any]:
    """Parameter values from `name=value` texts.

    Raises:
        SpecError: E713 for a text of another form, or a name given twice.
    """
    values: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        name = name.strip()
        if not sign or not name.isidentifier():
            raise refuse("E713", f"'-p {text}' is not of the form name=value", "for example: -p L=20")
        if name in values:
            raise refuse("E713", f"parameter '{name}' is given twice")
        values[name] = read_value(value.strip())
    return values


_WORDS = {"true": True, "false": False}


def read_value(text: str) -> Any:
    """A value as a spec would read it: a number (`1e-3` and `1/3` are some), true or false, or a word."""
    if text in _WORDS:
        return _WORDS[text]
    for kind in (int, float, _fraction):
        try:
            return kind(text.replace("_", "x"))
        except (ValueError, ZeroDivisionError):
            continue
    return text


def _fraction(text: str) -> float:
    top, bottom = text.split("/")
    return int(top) / int(bottom)


def checked_choice(name: str, value: str, allowed: Sequence[str]) -> str:
    """An option's value.

    Raises:
        UsageError: when it is not one of those allowed.
    """
    if value not in allowed:
        listed = ", ".join(allowed)
        raise misuse(f"{name} is one of {listed}, not '{value}'", suggest(value, allowed))
    return value
