"""Learners of the table by name or file, with the settings of a family, and called to train."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from types import NoneType
from typing import Any, ClassVar, Literal, TypeVar, get_args, get_origin, get_type_hints

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.learners.interface import LearnerCase
from taskspec.learners.table import BUILT_IN, BuiltIn
from taskspec.source import Document, read_file
from taskspec.source import Path as Place

FAMILIES = {
    "corrected": "the mistakes of the published code corrected",
    "paper": "the code that the figures of the paper come from",
    "released": "the code as it was published in the end, its mistakes included",
}
"""What the same learners are set to."""
_FOLDER = Path(__file__).parent / "families"
_KEYS = ("learner", "family", "settings")


@dataclass(frozen=True)
class Learner:
    """`learner(case)` gives a policy for each of `case.seeds`, all of them trained together.

    Attributes:
        name, family: which one it is.
        settings: a frozen dataclass.
        learns_from: what it has to be granted, of "reward", "demonstrations" and "preferences".
        trainer: `module:function`, as in the table.
    """

    name: str
    family: str
    settings: Any
    learns_from: tuple[str, ...]
    trainer: str
    together: ClassVar[bool] = True

    def __call__(self, case: LearnerCase) -> list[Any]:
        """Train; raises SpecError: E705 where JAX or optax are not installed, E713 for tasks that it cannot learn."""
        module, _, function = self.trainer.partition(":")
        return getattr(import_module(module), function)(self.settings, case)  # type: ignore[no-any-return]


def learner(source: str | os.PathLike[str], family: str = "corrected") -> Learner:
    """Return a learner by its name, or as a file has it: `learner: gail_im`, and maybe a `family` and `settings`.

    A name may have its family in front: `paper/gail_im`.

    Raises:
        SpecError: E710, E713 for a name that there is none of; E2xx for mistakes in the file, each with its place.
    """
    name = os.fspath(source)
    before, slash, rest = name.partition("/")
    if slash and before in FAMILIES and rest in BUILT_IN:
        return _in_family(BUILT_IN[rest], before)
    if name in BUILT_IN:
        return _in_family(BUILT_IN[name], family)
    if not name.endswith((".yaml", ".yml")):
        hint = suggest(name, BUILT_IN) or f"there are {', '.join(BUILT_IN)}; a path ends in .yaml"
        raise SpecError([Diagnostic("E713", None, f"there is no learner '{name}'", hint)])
    document = read_file(Path(source))
    found = _in_family(_named_in(document), document.data.get("family", family))
    if "settings" not in document.data:
        return found
    return replace(found, settings=changed(found.settings, document, ("settings",)))


def _named_in(document: Document) -> BuiltIn:
    """Return the table's entry that a file names."""
    data = document.data
    if not isinstance(data, dict) or "learner" not in data:
        raise SpecError([Diagnostic("E203", document.span(()), "a learner's file says which one: `learner: bc`")])
    stray = next((key for key in data if key not in _KEYS), None)
    if stray is not None:
        hint = suggest(stray, _KEYS) or f"it has {', '.join(_KEYS)}"
        raise SpecError([Diagnostic("E202", document.key_span((stray,)), f"unknown key `{stray}`", hint)])
    for key, known in (("learner", BUILT_IN), ("family", FAMILIES)):
        if key in data and data[key] not in known:
            near = suggest(str(data[key]), tuple(known))
            message = f"{data[key]!r} is not one of {', '.join(known)}"
            raise SpecError([Diagnostic("E206", document.span((key,)), message, near)])
    return BUILT_IN[data["learner"]]


def _in_family(entry: BuiltIn, family: str) -> Learner:
    if family not in FAMILIES:
        hint = suggest(family, FAMILIES) or f"there are {', '.join(FAMILIES)}"
        raise SpecError([Diagnostic("E713", None, f"there is no family '{family}'", hint)])
    document = read_file(_FOLDER / f"{family}.yaml")
    settings = entry.settings
    for i, rule in enumerate(document.data):
        if any(fnmatchcase(entry.name, pattern) for pattern in rule["learners"]):
            settings = changed(settings, document, (i, "settings"))
    return Learner(entry.name, family, settings, entry.learns_from, entry.trainer)


# -- settings in files, checked against dataclasses ----------------------------------------------------------------

T = TypeVar("T")
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", NoneType: "null"}


def changed(base: T, document: Document, path: Place) -> T:
    """Return settings with those at a path of a document in their place, section by section."""
    data: Any = document.data
    for step in path:
        data = data[step]
    problems: list[Diagnostic] = []
    found = _changed(base, data, document, path, problems)
    if problems:
        raise SpecError(problems)
    return found  # type: ignore[no-any-return]


def _changed(base: Any, data: Any, document: Document, path: Place, problems: list[Diagnostic]) -> Any:
    if not isinstance(data, dict):
        problems.append(Diagnostic("E201", document.span(path), "settings are a mapping: `name: value`"))
        return base
    hints = _hints(type(base))
    found: dict[str, Any] = {}
    for name, value in data.items():
        place = (*path, name)
        if name not in hints:
            message = f"{type(base).__name__} has no setting '{name}'"
            hint = suggest(name, hints) or f"it has {', '.join(hints)}"
            problems.append(Diagnostic("E202", document.key_span(place), message, hint))
            continue
        now = getattr(base, name)
        section = next((t for t in _options(hints[name]) if is_dataclass(t)), None)
        if section is not None and value is not None:
            found[name] = _changed(now if now is not None else section(), value, document, place, problems)  # type: ignore[operator]
        elif (fitting := list(_fitting(hints[name], value))) != []:
            found[name] = fitting[0]
        else:
            problems.append(_unfit(hints[name], value, document, place))
    return replace(base, **found)


def _unfit(hint: Any, value: Any, document: Document, place: Place) -> Diagnostic:
    words = [repr(word) for option in _options(hint) if get_origin(option) is Literal for word in get_args(option)]
    if words:
        return Diagnostic("E206", document.span(place), f"{value!r} is not one of {', '.join(words)}")
    kinds = [_KINDS.get(option, "a list of numbers") for option in _options(hint)]
    return Diagnostic("E204", document.span(place), f"{value!r} is not {' or '.join(kinds)}")


def _fitting(hint: Any, value: Any) -> Iterator[Any]:
    """Yield the value as each of the allowed types that it fits."""
    for option in _options(hint):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if get_origin(option) is Literal and value in get_args(option):
            yield value
        elif get_origin(option) is tuple and isinstance(value, list):
            of = get_args(option)
            each = [list(_fitting(of[0], v)) for v in value]
            if all(each) and (of[-1] is Ellipsis or len(of) == len(value)):
                yield tuple(v[0] for v in each)
        elif option is float and number:
            yield float(value)
        elif (option is int and number and isinstance(value, int)) or (option is bool and isinstance(value, bool)):
            yield value
        elif option is NoneType and value is None:
            yield None


def _options(hint: Any) -> tuple[Any, ...]:
    """Return the types of a union; a single type by itself."""
    return (hint,) if isinstance(hint, type) or get_origin(hint) in (tuple, Literal) else get_args(hint)


def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {f.name: hints[f.name] for f in fields(kind)}
