"""What may be wrong with a value of a spec, and what other formats call its keys."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from taskspec.base.diagnostics import suggest

_NAMES: Mapping[str, str] = {
    "terminal": "done terminated termination terminate terminals is_terminal goal end until",
    "horizon": "max_steps max_episode_steps episode_length steps time_limit truncation truncated truncate",
    "discount": "gamma discount_factor",
    "state": "states fluents state_fluents state_space",
    "action": "actions action_fluents action_space",
    "observation": "obs observations observ_fluents observation_space",
    "reward": "rewards utility",
    "dynamics": "transition transitions next step cpfs update",
    "initial": "init init_state initial_state reset start",
    "constants": "non_fluents consts",
    "definitions": "derived derived_fluents intermediate functions let define defines where macros helpers formulas",
    "parameters": "params args arguments",
    "expert": "policy",
    "default": "value initial init",
    "type: real": "float float32 float64 double continuous number",
    "type: int": "integer int32 int64 discrete multidiscrete",
    "type: bool": "boolean binary multibinary",
    "type: choice": "categorical enum str string",
    "type: int, shape: [n]": "list array vector tuple ndarray",
    "type": "dtype kind",
    "high": "max maximum upper ub",
    "low": "min minimum lower lb",
    "low: 0, high: n - 1": "n",
    "shape": "length size len dim dims",
    "values": "options choices labels categories",
    "doc": "desc description comment help",
}
_FORMS: Mapping[str, list[str]] = {
    name: [form for form, names in _NAMES.items() if name in names.split()]
    for name in " ".join(_NAMES.values()).split()
}


def advice(word: str, known: Collection[str]) -> str | None:
    """Return what to write for a word of others, given the keys that are known here; None where nothing is known of it."""
    forms = _FORMS.get(word.lower().replace("-", "_"), [])
    return next((f"write `{form}`" for form in forms if re.split(r"\W", form)[0] in known), None)


# Problems of values of any form, and the rules for names.

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
        """Return the same problem, as seen from further up."""
        return self._replace(path=(*steps, *self.path))


def kind(value: object) -> str:
    """Return a value as a person would call it: `the number 3`, `the text 'x'`, `a list`."""
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
    """Return the problem of a value that is not what belongs here."""
    if value is None:
        return Problem("E218", (), f"there is no value here; expected {expected}", hint)
    return Problem("E204", (), f"expected {expected}, found {kind(value)}", hint)


def name_problem(name: str) -> str | None:
    """Return why a text cannot be a name in expressions, or None."""
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
    """Yield a name that expressions can use."""
    if trouble := name_problem(text):
        better = re.sub(r"\W+", "_", text.strip()).strip("_")
        if better in WORDS:
            better += "_"
        usable = better != text and better and not name_problem(better)
        hint = f"for example `{better}`" if usable else None
        yield Problem("E205", path, trouble, hint, of_key=True)


def unknown_key(key: str, known: tuple[str, ...]) -> Problem:
    """Return the problem of a key that is not known here, with what to write instead."""
    hint = advice(key, known) or suggest(key, known) or ("it can be one of: " + ", ".join(known))
    return Problem("E202", (), f"unknown key `{key}`", hint, of_key=True)
