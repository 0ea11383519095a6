"""What may be wrong with a value of a spec, whatever its form; and what a name is."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Iterator
from typing import NamedTuple

from taskspec.diagnostics import suggest
from taskspec.task.schema.elsewhere import advice

OWN_WORDS = ("and", "or", "not", "in", "if", "else", "for", "true", "false", "True", "False")
"""Words that expressions use."""
WORDS = (*keyword.kwlist, "true", "false")
"""What no name can be: words that expressions use, and other words of Python, by whose grammar they are read."""


class Problem(NamedTuple):
    """What is wrong with a part of a value: `path` leads from the value to the part."""

    code: str
    path: tuple[str | int, ...]
    message: str
    hint: str | None = None
    of_key: bool = False

    def below(self, *steps: str | int) -> Problem:
        """The same problem, as seen from further up."""
        return self._replace(path=(*steps, *self.path))


def kind(value: object) -> str:
    """A value as a person would call it: `the number 3`, `the text 'x'`, `a list`."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "`true`" if value else "`false`"
        case int() | float():
            return f"the number {value}"
        case str():
            short = value if len(value) <= 30 else value[:29] + "…"
            return f"the text `{short}`"
        case list():
            return "a list"
    return "a mapping"


def wrong_kind(expected: str, value: object, hint: str | None = None) -> Problem:
    """The problem of a value that is not what belongs here."""
    if value is None:
        return Problem("E218", (), f"there is no value here; expected {expected}", hint)
    return Problem("E204", (), f"expected {expected}, found {kind(value)}", hint)


def name_problem(name: str) -> str | None:
    """Why a text cannot be a name in expressions, or None."""
    if name in OWN_WORDS:
        return f"`{name}` is a word of the language"
    if name in WORDS:
        return f"`{name}` is a word of Python, by whose grammar expressions are read; no name can be one"
    if not name.isidentifier():
        return f"`{name}` is not a name: a letter, then letters, digits and `_`"
    if name.startswith("_"):
        return f"`{name}` is not a name: it starts with `_`"
    if unicodedata.normalize("NFKC", name) != name or "\N{MODIFIER LETTER PRIME}" in name:
        return f"`{name}` has letters that look like others"
    return None


def name(text: str, path: tuple[str | int, ...] = ()) -> Iterator[Problem]:
    """A name that expressions can use."""
    if trouble := name_problem(text):
        better = re.sub(r"\W+", "_", text.strip()).strip("_")
        if better in WORDS:
            better += "_"
        usable = better != text and better and not name_problem(better)
        hint = f"for example `{better}`" if usable else None
        yield Problem("E205", path, trouble, hint, of_key=True)


def unknown_key(key: str, known: tuple[str, ...]) -> Problem:
    """The problem of a key that is not known here, with what to write instead."""
    hint = advice(key, known) or suggest(key, known) or ("it can be one of: " + ", ".join(known))
    return Problem("E202", (), f"unknown key `{key}`", hint, of_key=True)
