"""The files that a spec, or a variant of it, extends: read with it, so that a document is whole wherever it goes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.source.document import Document
from taskspec.source.document import Path as Steps

Packed: TypeAlias = tuple[str, str, tuple[tuple[str, Any], ...]]
"""A document as its text, its name, and the packed documents that it extends by how it names them."""
Read: TypeAlias = Callable[[str], Document]

KEY = "extends"


def others(document: Document, read: Read) -> dict[str, Document]:
    """The documents that a document extends, by how it names them.

    Raises:
        SpecError: for every one that cannot be read, at the place that names it.
    """
    found: dict[str, Document] = {}
    problems: list[Diagnostic] = []
    for path, name in _named(document.data):
        try:
            if name not in found:
                found[name] = read(_beside(document, name))
        except SpecError as error:
            problems += [d if d.span else replace(d, span=document.span(path)) for d in error.diagnostics]
    if problems:
        raise SpecError(problems)
    return found


def _named(data: Any) -> Iterator[tuple[Steps, str]]:
    """Every mention of another file, with its path."""
    if not isinstance(data, dict):
        return
    variants = data.get("variants")
    listed: Mapping[str, Any] = variants if isinstance(variants, dict) else {}
    entries: list[tuple[Steps, Any]] = [((), data), *((("variants", key), value) for key, value in listed.items())]
    for path, entry in entries:
        if not isinstance(entry, dict):
            continue
        if isinstance(entry.get(KEY), str):
            yield (*path, KEY), entry[KEY]


def _beside(document: Document, name: str) -> str:
    """The path of another file, from where we are: it is named as seen from the document that names it."""
    if not name.endswith((".yaml", ".yml")):
        message = f"`{KEY}` names the file of a spec, which ends in .yaml, not {name!r}"
        raise SpecError([Diagnostic("E711", None, message)])
    return os.path.normpath(Path(document.origin.name).parent / name)


def circle(chain: tuple[str, ...], name: str) -> SpecError:
    """The error that a spec extends itself by way of others."""
    words = " -> ".join(Path(each).name for each in (*chain[chain.index(name) :], name))
    return SpecError([Diagnostic("E212", None, f"these specs extend each other: {words}")])


def packed(document: Document) -> Packed:
    """A document as texts, from which `source.unpacked` makes it again."""
    return (
        document.origin.text,
        document.origin.name,
        tuple((name, packed(other)) for name, other in document.others.items()),
    )
