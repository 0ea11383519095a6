"""Ids of instances: a task's id with the values of its parameters, such as `derail/NoisyObs-v0?L=50&M=7`.

Modifiers stand behind it, in the order in which they are laid over the task: `derail/NoisyObs-v0?L=50&M=7+sticky=0.25`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote, unquote

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.records import dataclass

_FORM = re.compile(r"(?P<name>.*?\.ya?ml|[^?+]*)(?:\?(?P<values>[^?+]*))?(?P<modifiers>(?:\+[^+]+)*)", re.DOTALL)
_KEPT = "-._~/,()"
"""What stands in a value as it is, besides letters and digits."""


@dataclass(frozen=True, slots=True)
class InstanceId:
    """What an instance is called: a task's id or the path of its spec, values of parameters, and modifiers as texts."""

    name: str
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...] = ()

    def __str__(self) -> str:
        values = "&".join(f"{name}={quote(shown(value), safe=_KEPT)}" for name, value in self.parameters.items())
        return "".join(
            (self.name, "?" * bool(values), values, *(f"+{quote(m, safe=_KEPT + '=')}" for m in self.modifiers))
        )


def parse(text: str) -> InstanceId:
    """An id, or a path, with the parameters and modifiers that stand behind it, if any do.

    Raises:
        SpecError: E713 for something else than `name=value` behind the question mark, or a name that stands there twice.
    """
    found = _FORM.fullmatch(text)
    if found is None:
        raise SpecError([Diagnostic("E713", None, f"'{text}' is not the id of a task", _HINT)])
    values: dict[str, Any] = {}
    for part in (found["values"] or "").split("&"):
        name, sign, value = part.partition("=")
        if not part:
            continue
        if not sign or not name.isidentifier():
            raise SpecError([Diagnostic("E713", None, f"'{part}' in '{text}' is not of the form name=value", _HINT)])
        if name in values:
            raise SpecError([Diagnostic("E713", None, f"'{text}' gives '{name}' twice")])
        values[name] = read_value(unquote(value))
    modifiers = (unquote(part) for part in found["modifiers"].split("+")[1:])
    return InstanceId(found["name"], values, tuple(modifiers))


_HINT = "an id with parameters is written as derail/NoisyObs-v0?L=50&M=7"


def is_instance(text: str) -> bool:
    """Whether a text says more than the name of a task, or its path."""
    found = _FORM.fullmatch(text)
    return found is not None and found["name"] != text


# -- values as texts ----------------------------------------------------------------------------------------------

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


def shown(value: Any) -> str:
    """A value as `read_value` reads it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def assigned(values: Iterable[tuple[str, Any]]) -> str:
    """Values of parameters for people: `L=5, M=7`."""
    return ", ".join(f"{name}={shown(value)}" for name, value in values)
