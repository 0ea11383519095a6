"""Specs as files: which tasks a file defines, read once however many there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from taskspec import registry
from taskspec.cli.targets import File
from taskspec.diagnostics import SpecError
from taskspec.source import Document

if TYPE_CHECKING:
    from taskspec.task.task import Task


def _document(path: str) -> Document:
    """The document of a file whose shape is right."""
    from taskspec.diagnostics import has_errors
    from taskspec.task.build import mistakes
    from taskspec.task.schema import check_shape

    document = registry.document(path)
    if has_errors(check_shape(document)):
        raise SpecError(mistakes(document))
    return document


def variants_of(file: File) -> list[str | None]:
    """The variants that are tasks (None for the spec itself), in written order.

    A spec that leaves sections to its variants is no task itself; without variants, it is one that lacks something.

    Raises:
        SpecError: when the file cannot be read, or has not the shape of a spec.
    """
    from taskspec.task.merge import merge, variant_names

    if file.variants is not None:
        return list(file.variants)
    document = _document(str(file.path))
    named = list(variant_names(document.data).values())
    return named[1:] if len(named) > 1 and merge(document).missing else named


def name_of(file: File, variant: str | None) -> str:
    """The name of a task of a file."""
    from taskspec.scan import task_name

    name = str(_document(str(file.path)).data.get("name"))
    return name if variant is None else task_name(name, variant)


def task_in(file: File, variant: str | None) -> Task:
    """One task of a file, at the values and with the modifiers that the file is asked for.

    Raises:
        SpecError: with every mistake found.
    """
    from taskspec.modifiers import modify
    from taskspec.task.build import build

    return modify(build(_document(str(file.path)), variant, file.parameters, file.suite), *file.modifiers)


def tasks_in(files: Iterable[File]) -> Iterator[Task | SpecError]:
    """The tasks of files in order, with what is wrong in place of those that cannot be built."""
    for file in files:
        try:
            variants = variants_of(file)
        except SpecError as error:
            yield error
            continue
        for variant in variants:
            try:
                yield task_in(file, variant)
            except SpecError as error:
                yield error
