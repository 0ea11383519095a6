"""Learners of the table by name or file, with the settings of a family."""

from __future__ import annotations

import json
import os
from dataclasses import is_dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error, suggest
from taskspec.language.source import Document, read_file
from taskspec.language.source import Path as Place
from taskspec.learn.learners.built_in import BUILT_IN, Learner

FAMILIES = {
    "corrected": "the mistakes of the published code corrected",
    "paper": "the code that the figures of the paper come from",
    "released": "the code as it was published in the end, its mistakes included",
}
"""Families of settings: `paper` in `paper_settings.py`; how the others differ from it, in `corrected_settings.yaml` and so on."""
_FOLDER = Path(__file__).parent
_KEYS = ("learner", "family", "settings")


def learner(source: str | os.PathLike[str], family: str = "corrected") -> Learner:
    """Return a learner by its name, or as a file has it: `learner: gail_im`, and maybe a `family` and `settings`.

    A name may have its family in front: `paper/gail_im`.

    Raises:
        SpecError: E710, E725 for a name that there is none of; E2xx for mistakes in the file, each with its place.
    """
    name = os.fspath(source)
    before, slash, rest = name.partition("/")
    if slash and before in FAMILIES and rest in BUILT_IN:
        return _in_family(BUILT_IN[rest], before)
    if name in BUILT_IN:
        return _in_family(BUILT_IN[name], family)
    if not name.endswith((".yaml", ".yml")):
        hint = suggest(name, BUILT_IN) or f"there are {', '.join(BUILT_IN)}; a path ends in .yaml"
        raise spec_error("E725", f"there is no learner '{name}'", hint)
    document = read_file(Path(source))
    chosen = _in_family(_named_in(document), document.data.get("family", family))
    if "settings" not in document.data:
        return chosen
    return replace(chosen, settings=changed(chosen.settings, document, ("settings",)))


def _named_in(document: Document) -> Learner:
    data = document.data
    if not isinstance(data, dict) or "learner" not in data:
        raise SpecError([Diagnostic("E203", document.span(()), "a learner's file says which one: `learner: bc`")])
    for key in data:
        if key not in _KEYS:
            hint = suggest(key, _KEYS) or f"it has {', '.join(_KEYS)}"
            raise SpecError([Diagnostic("E202", document.key_span((key,)), f"unknown key `{key}`", hint)])
    for key, known in (("learner", BUILT_IN), ("family", FAMILIES)):
        if key in data and data[key] not in known:
            near = suggest(str(data[key]), tuple(known))
            message = f"{data[key]!r} is not one of {', '.join(known)}"
            raise SpecError([Diagnostic("E206", document.span((key,)), message, near)])
    return BUILT_IN[data["learner"]]


def _in_family(entry: Learner, family: str) -> Learner:
    if family not in FAMILIES:
        hint = suggest(family, FAMILIES) or f"there are {', '.join(FAMILIES)}"
        raise spec_error("E713", f"there is no family '{family}'", hint)
    settings = entry.settings
    if family != "paper":
        document = read_file(_FOLDER / f"{family}_settings.yaml")
        for i, rule in enumerate(document.data):
            if any(fnmatchcase(entry.name, pattern) for pattern in rule["learners"]):
                settings = changed(settings, document, (i, "settings"))
    return replace(entry, family=family, settings=settings)


# -- settings in files, checked against dataclasses ----------------------------------------------------------------

T = TypeVar("T")


def changed(base: T, document: Document, path: Place) -> T:
    """Return settings with those at a path of a document in their place, section by section."""
    data: Any = document.data
    for step in path:
        data = data[step]
    problems: list[Diagnostic] = []
    instance = _changed(base, data, document, path, problems)
    if problems:
        raise SpecError(problems)
    return instance


def _changed(base: Any, data: Any, document: Document, path: Place, problems: list[Diagnostic]) -> Any:
    if not isinstance(data, dict):
        problems.append(Diagnostic("E201", document.span(path), "settings are a mapping: `name: value`"))
        return base
    types = get_type_hints(type(base))
    values: dict[str, Any] = {}
    for name, value in data.items():
        place = (*path, name)
        if name not in types:
            message = f"{type(base).__name__} has no setting '{name}'"
            hint = suggest(name, types) or f"it has {', '.join(types)}"
            problems.append(Diagnostic("E202", document.key_span(place), message, hint))
            continue
        sections = list(filter(is_dataclass, (types[name], *get_args(types[name]))))
        if sections and value is not None:
            present = getattr(base, name) or sections[0]()  # type: ignore[operator]
            values[name] = _changed(present, value, document, place, problems)
            continue
        try:
            values[name] = TypeAdapter(types[name]).validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            first = error.errors()[0]
            code = "E206" if first["type"] == "literal_error" else "E204"
            problems.append(Diagnostic(code, document.span(place), f"{value!r} does not fit: {first['msg']}"))
    return replace(base, **values)
