"""Ids of instances: a task's id with the values of its parameters, such as `derail/NoisyObs-v0?L=50&M=7`.

Modifiers follow, in the order in which they are applied: `derail/NoisyObs-v0?L=50&M=7+sticky=0.25`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, unquote

from taskspec.base.diagnostics import spec_error

_FORM = re.compile(r"(?P<name>.*?\.ya?ml|[^?+]*)(?:\?(?P<values>[^?+]*))?(?P<modifiers>(?:\+[^+]+)*)", re.DOTALL)
_KEPT = "-._~/,()"
"""Characters that are not quoted in values, apart from letters and digits."""


@dataclass(frozen=True, slots=True)
class InstanceId:
    """The id of an instance: a task's id or the path of its spec, values of parameters, and modifiers as texts."""

    name: str
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...] = ()

    def __str__(self) -> str:
        values = "&".join(f"{name}={quote(shown(value), safe=_KEPT)}" for name, value in self.parameters.items())
        return "".join(
            (self.name, "?" * bool(values), values, *(f"+{quote(m, safe=_KEPT + '=')}" for m in self.modifiers))
        )


def parse(text: str) -> InstanceId:
    """Read an id or a path, with the parameters and modifiers behind it."""
    match = _FORM.fullmatch(text)
    if match is None:
        raise spec_error("E713", f"'{text}' is not the id of a task", _HINT)
    values: dict[str, Any] = {}
    for part in (match["values"] or "").split("&"):
        name, sign, value = part.partition("=")
        if not part:
            continue
        if not sign or not name.isidentifier():
            raise spec_error("E713", f"'{part}' in '{text}' is not of the form name=value", _HINT)
        if name in values:
            raise spec_error("E713", f"'{text}' gives '{name}' twice")
        values[name] = read_value(_unquoted(value))
    modifiers = map(_unquoted, match["modifiers"].split("+")[1:])
    return InstanceId(match["name"], values, tuple(modifiers))


def _unquoted(text: str) -> str:
    if "%" not in text:
        return text

    return unquote(text)


_HINT = "an id with parameters is written as derail/NoisyObs-v0?L=50&M=7"


def is_instance(text: str) -> bool:
    """Return whether a text has values or modifiers behind the name or path of a task."""
    match = _FORM.fullmatch(text)
    return match is not None and match["name"] != text


_WORDS = {"true": True, "false": False}


def read_value(text: str) -> Any:
    """Read a value as specs do: a number such as `1e-3` or `1/3`, true or false, or a word."""
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


def shown(value: Any) -> str:
    """Return a value as `read_value` reads it."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


def assigned(values: Iterable[tuple[str, Any]]) -> str:
    """Return values of parameters for people: `L=5, M=7`."""
    return ", ".join(f"{name}={shown(value)}" for name, value in values)
