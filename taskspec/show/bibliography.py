"""Bibliographies: a small reader of BibTeX, enough for the regular form of such files; and sources without an entry."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from taskspec.base.diagnostics import Collector, Diagnostic, suggest
from taskspec.base.display import listed
from taskspec.language.task.merge import merge
from taskspec.language.task.task import Task

_ENTRY = re.compile(r"@(\w+)\s*\{\s*([\w:.+/-]+)\s*,")
_FIELD = re.compile(r"[\s,]*(\w+)\s*=\s*")
_BARE = re.compile(r"[^,}\s]*")
_ACCENTS = re.compile(r"\\['`^\"~=.uvHtcdb]\s*\{?(\w)\}?")
NAME = "references.bib"


@dataclass(frozen=True)
class Reference:
    """An entry: its kind, its key and its fields as written."""

    kind: str
    key: str
    fields: Mapping[str, str]

    def plain(self, field: str) -> str:
        """Return a field as text, without TeX's braces and accents."""
        text = _ACCENTS.sub(r"\1", self.fields.get(field, ""))
        return re.sub(r"\s+", " ", text.replace("{", "").replace("}", "").replace("--", "–").replace("~", " ")).strip()

    @property
    def authors(self) -> str:
        """Family names: `A and B`, `A, B and C`, `A et al.` for more than four."""
        names = []
        for person in self.plain("author").split(" and "):
            if "," in person:
                names.append(person.partition(",")[0])
            elif person:
                names.append(person.rsplit(" ", 1)[-1])
        if len(names) > 4:
            return f"{names[0]} et al."
        return listed(names or [""])

    @property
    def venue(self) -> str:
        for field in ("journal", "booktitle", "howpublished", "publisher"):
            if field in self.fields:
                return self.plain(field)
        return ""

    def bibtex(self) -> str:
        lines = [f"@{self.kind}{{{self.key},"]
        for name, value in self.fields.items():
            lines.append(f"  {name} = {{{value}}},")
        return "\n".join((*lines, "}", ""))


@lru_cache(maxsize=16)
def read(text: str) -> Mapping[str, Reference]:
    """Return the entries of a BibTeX text by key; what cannot be read is passed over."""
    references = {}
    for match in _ENTRY.finditer(text):
        fields = dict(_fields(text, match.end()))
        references[match[2]] = Reference(match[1].lower(), match[2], fields)
    return references


def _fields(text: str, at: int) -> Iterator[tuple[str, str]]:
    """Yield the fields of the entry whose key ends at an offset; values stand in braces, in quotes, or bare."""
    while match := _FIELD.match(text, at):
        start = match.end()
        opening = text[start : start + 1]
        at = start
        if opening == "{":
            depth = 0
            while at < len(text):
                depth += {"{": 1, "}": -1}.get(text[at], 0)
                at += 1
                if depth == 0:
                    break
        elif opening == '"':
            at = text.find('"', start + 1) + 1 or len(text)
        else:
            bare = _BARE.match(text, start)
            at = bare.end() if bare else start
        value = text[start:at]
        if opening in ("{", '"'):
            value = value[1:-1]
        yield match[1].lower(), value


def beside(specs: Iterable[str | Path]) -> dict[str, Reference]:
    """Read the entries of every `references.bib` in the folder of one of the specs or in the folder above it."""
    references: dict[str, Reference] = {}
    for folder in dict.fromkeys(Path(spec).parent for spec in specs):
        for path in (folder / ".." / NAME, folder / NAME):
            if path.is_file():
                references |= read(path.read_text(encoding="utf-8"))
    return references


def unknown_sources(task: Task) -> tuple[Diagnostic, ...]:
    """Look for sources without an entry in a bibliography (W531): pages print their keys."""
    merged = merge(task.source.document, task.source.variant)
    known = beside([task.source.document.origin.name])
    collector = Collector()
    for i, source in enumerate(task.spec.sources):
        if source.key not in known:
            message = f"no {NAME} has the source '{source.key}', and pages print the key"
            hint = suggest(source.key, known) or f"add an entry to {NAME} beside the spec, or in the folder above"
            collector.add("W531", merged.span(("sources", i)), message, hint)
    return collector.diagnostics
