"""Names of a spec -> how mathematics writes them: Greek letters, subscripts, upright words."""

from __future__ import annotations

import re

from taskspec.printers.tex import GREEK, read
from taskspec.printers.tree import Ident, Math, Num, Script, Sym, Words, upright

_NUMBERED = re.compile(r"([^\W\d_]+?)_?(\d+)")
_CONSTANTS = {"inf": "∞", "nan": "NaN"}


def symbol(name: str, given: str | None = None) -> Math:
    """Return the symbol of a name; the author's own, in TeX, comes first."""
    if given is not None:
        return _given(given)
    found = _letter(name)
    if found is not None:
        return found
    numbered = _NUMBERED.fullmatch(name)
    if numbered:
        return Script(_base(numbered[1]), Num(numbered[2]))
    head, bar, rest = name.partition("_")
    base = _letter(head)
    if bar and base is not None and rest:
        return Script(base, _letter(rest) or upright(rest.replace("_", "-")))
    return upright(name.replace("_", "-"))


def _given(text: str) -> Math:
    """Return a symbol in TeX; a bare word (`dx`) is a name, not a product of letters."""
    if text.isalnum() and len(text) > 1 and not text.isdigit():
        return Ident(text)
    return read(text)


def _letter(name: str) -> Math | None:
    if len(name) == 1 and name.isalpha():
        return Ident(name)
    if name in GREEK:
        return Ident(GREEK[name])
    return Ident(_CONSTANTS[name]) if name in _CONSTANTS else None


def _base(name: str) -> Math:
    return _letter(name) or upright(name)


def label(name: str, given: str | None = None) -> Math:
    """Return the symbol of a label of a choice: the author's, or the word itself."""
    if given is not None:
        found = _given(given)
        return Ident(found.text) if isinstance(found, Sym) else found
    if re.fullmatch(r"-?\d+(\.\d+)?", name):
        return Num(name.replace("-", "−"))
    return Words(name.replace("_", " "))
