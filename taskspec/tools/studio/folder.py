"""The files of a studio: nothing outside of one folder is read or written."""

from __future__ import annotations

import ast
import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.files import write_text
from taskspec.base.limits import limits
from taskspec.language import registry
from taskspec.language.source import kind_of_text

SPECS = (".yaml", ".yml")
SCRIPTS = (".json", ".csv")
MOST_NAMES = 20_000
DEPTH = 4
"""Names that are looked at, and folders below one another."""


class FileRefused(Exception):
    """A file was not read or not written; `why` is a word for programs."""

    def __init__(self, why: str, message: str) -> None:
        super().__init__(message)
        self.why = why


@dataclass(frozen=True)
class Folder:
    """A folder; paths of its files are relative to it, with slashes."""

    root: Path

    def place(self, path: str) -> Path:
        """Return where a file is; links are followed.

        Raises:
            FileRefused: it lies outside of the folder.
        """
        try:
            inside = (self.root / path).resolve()
            is_inside = inside.is_relative_to(self.root) and inside != self.root
            if is_inside:
                return inside
        except (OSError, ValueError):  # no path at all
            pass
        raise FileRefused("outside", f"'{path}' is not in the folder {self.root.name}")

    def spec(self, path: str) -> Path:
        """Return where a spec is or may be written.

        Raises:
            FileRefused: it lies outside of the folder, or its name is not that of a spec.
        """
        inside = self.place(path)
        if inside.suffix not in SPECS or inside.name.startswith("."):
            raise FileRefused("name", f"a spec ends in .yaml, and '{path}' does not")
        return inside

    def files(self, *suffixes: str) -> Iterator[Path]:
        """Yield the files with some suffixes, folder by folder, without links that lead out; a large folder is not read whole."""
        seen = 0
        for folder, folders, names in os.walk(self.root):
            deep = len(Path(folder).relative_to(self.root).parts)
            inside = []
            for name in sorted(folders):
                if not name.startswith((".", "__")) and deep < DEPTH:
                    inside.append(name)
            folders[:] = inside
            for name in sorted(names):
                path = Path(folder) / name
                if name.endswith(suffixes) and name[0] != "." and path.resolve().is_relative_to(self.root):
                    yield path
            seen += len(names)
            if seen > MOST_NAMES:
                return

    def relative(self, place: Path) -> str:
        return place.relative_to(self.root).as_posix()

    # -- what a page asks for -----------------------------------------------------------------------------------------

    def listing(self, opened: str | None) -> dict[str, Any]:
        """Return the specs and policies of the folder, and what a new spec can start from."""
        entries = registry.known().values()
        files = list(filter(_is_spec, self.files(*SPECS)))
        drawn = [place for place in files if _FIGURE.search(text_of(place))]
        first = None
        if files:
            first = self.relative((drawn or files)[0])
        policies = []
        for place in self.files(".py"):
            policies += [f"{self.relative(place)}:{name}" for name in functions(place)]
        return {
            "folder": self.root.name,
            "root": self.root.as_uri(),
            "opened": opened,
            "files": list(map(self.relative, files)),
            "first": first,
            "policies": policies + [self.relative(place) for place in self.files(*SCRIPTS)],
            "templates": [{"id": TEMPLATE, "title": "A corridor, with a comment on each section"}],
            "library": [{"id": entry.id, "title": entry.name} for entry in entries],
        }

    def open(self, path: str) -> dict[str, Any]:
        """Return the text of a spec, with the digest that `save` asks for."""
        place = self.spec(path)
        text = text_of(place)
        return {"path": self.relative(place), "text": text, "digest": digest(text), "uri": place.as_uri()}

    def save(self, path: str, text: str, known: str | None) -> dict[str, Any]:
        """Write the text of a spec, all of it or nothing.

        Args:
            known: the digest of the text that the page has seen in the file; None for a new file.

        Raises:
            FileRefused: the file exists although it should be new, or has another text than the page has seen.
        """
        place = self.spec(path)
        present = digest(text_of(place)) if place.exists() else None
        if present != known:
            why = "exists" if known is None else "changed"
            raise FileRefused(why, f"'{path}' is new, or was changed by another program; it was not overwritten")
        write_text(place, text, new=known is None)
        return {"path": self.relative(place), "digest": digest(text), "uri": place.as_uri()}


_FIGURE = re.compile(r"^figure:", re.MULTILINE)
"""The section of a spec that says how it is drawn."""
TEMPLATE = "template:corridor"
"""What names the template, beside the ids of the library."""


def new(source: str, path: str | None, template: str) -> dict[str, Any]:
    """Return the text of a new spec: that of the template, or of a task of the library; nothing is written."""
    if source == TEMPLATE:
        words = re.findall("[A-Za-z0-9]+", Path(path or "new_task").stem)
        name = "".join(word[:1].upper() + word[1:] for word in words).lstrip("0123456789") or "NewTask"
        text = template.format(name=name, title=" ".join(words).capitalize())
    else:
        text = text_of(registry.find(source).path)
    return {"path": path, "text": text}


def _is_spec(place: Path) -> bool:
    try:
        return kind_of_text(text_of(place)) == "taskspec"
    except SpecError:
        return False


def functions(place: Path) -> list[str]:
    """Return the names of the functions of a Python file that could be policies: of one argument; nothing is run."""
    try:
        body = ast.parse(text_of(place)).body
    except (SyntaxError, ValueError, SpecError):
        return []
    names = []
    for node in body:
        if isinstance(node, ast.FunctionDef) and len(node.args.args) == 1 and not node.name.startswith("_"):
            names.append(node.name)
    return names


def digest(text: str) -> str:
    """Return what tells texts apart."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()


def text_of(place: Path) -> str:
    """Return the text of a file, with the line ends that it has."""
    try:
        if place.stat().st_size > limits().file:
            raise spec_error("E711", f"'{place.name}' is larger than {limits().file:,} bytes")
        with place.open(encoding="utf-8", newline="") as file:
            return file.read()
    except (OSError, UnicodeDecodeError) as error:
        raise spec_error("E711", f"cannot read '{place.name}': {error}") from None
