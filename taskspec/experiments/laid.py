"""The modifiers of an experiment: an argument may have several values, each of which makes instances of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.experiments.values import count, listed, misplaced
from taskspec.limits import how_to_raise, limits
from taskspec.modifiers import MODIFIERS, Modifier, modifier
from taskspec.task.schema import SPANS


@dataclass(frozen=True, slots=True)
class Option:
    """One of the modifiers that an entry of an experiment stands for, and the arguments in which it differs from the others."""

    modifier: Modifier
    varied: Mapping[str, Any] = field(default_factory=dict)


def options(written: str | Mapping[str, Any]) -> list[Option]:
    """What a modifier stands for: `{sticky: [0.1, 0.25]}` is two, `{distractors: {count: [1, 4], kind: normal}}` as well.

    Raises:
        SpecError: E718 for one that does not exist, E719 for its arguments, E214 for numbers with a rule that give no values.
    """
    if isinstance(written, str):
        return [Option(modifier(written))]
    ((name, given),) = written.items()
    arguments = MODIFIERS[name].arguments if name in MODIFIERS else ()
    kinds = {a.name: a.kind for a in arguments}
    if not isinstance(given, dict) or set(given) & set(SPANS):
        given = {arguments[0].name: given} if arguments and given is not None else given
    if not isinstance(given, dict):
        return [Option(modifier({name: given}))]
    _bound(given)
    many = {key: _values(value, kinds.get(key, "")) for key, value in given.items()}
    found = [dict(zip(many, chosen, strict=True)) for chosen in itertools.product(*many.values())]
    first = arguments[0].name if arguments else ""
    titles = {key: name if key == first else f"{name} {key}" for key, values in many.items() if len(values) > 1}
    return [Option(modifier({name: each}), {titles[key]: each[key] for key in titles}) for each in found]


def _bound(given: Mapping[str, Any]) -> None:
    """Refuse (E314) arguments with more values than there may be instances, before they are written out."""
    wanted = math.prod(count(value) for value in given.values() if misplaced(value) is None)
    most = limits().instances
    if wanted > most:
        message = f"{wanted:,} instances are too many; the limit is {most:,}"
        raise SpecError([Diagnostic("E314", None, message, how_to_raise("instances", wanted))])


def _values(written: Any, kind: str) -> list[Any]:
    problem = misplaced(written)
    if problem is not None:
        raise SpecError([Diagnostic("E214", None, problem)])
    found = listed(written, kind)
    if callable(found):
        raise SpecError(
            [Diagnostic("E214", None, "arguments of modifiers are not drawn", "list them, or give a `range`")]
        )
    return found
