"""Diagnostics from pydantic's errors: the place in the file, and words for a person."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from taskspec.base.diagnostics import Advice, Collector, Diagnostic, Span, raise_if_errors, suggest
from taskspec.base.limits import how_to_raise, limits
from taskspec.language.source import Document, Path
from taskspec.language.source.document import EXTENDS
from taskspec.language.task.merge import NAMED, Merged, merge, statement, variant_names
from taskspec.language.task.schema import typed, values
from taskspec.language.task.schema.export import keys_at
from taskspec.language.task.schema.models import CHANGES, FORMAT, LIST, Extension, Spec
from taskspec.language.task.schema.values import Problem, advice

# Expected values, by the type of pydantic's error.
_EXPECTED = {
    "string_type": "text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "`true` or `false`",
    "list_type": "a list",
}
OTHER_FORMATS = {
    "experiment": ("an experiment", "`taskspec sweep {}` runs it"),
    "exam": ("an exam", "`taskspec check {}` checks it"),
    "findings": ("a list of findings", "`taskspec check {}` checks it"),
}
"""Documents that are no specs, by their first key: what they are, and what to do with one."""
Shape = TypeVar("Shape", bound=BaseModel)
_MAPPINGS = ("dict_type", "model_type", "model_attributes_type")


class Located(Protocol):
    """Data that knows where each part of it was written: a document, or a merged variant."""

    @property
    def data(self) -> Any: ...

    def span(self, path: Path) -> Span: ...

    def key_span(self, path: Path) -> Span: ...


@lru_cache(maxsize=64)
def check_shape(document: Document) -> tuple[Diagnostic, ...]:
    """Problems with the sections, keys and kinds of values of a whole document.

    Variants are checked alone here; `validated` checks them together with what they are based on.
    """
    collector = Collector()
    for other in document.others.values():
        collector.extend(check_shape(other))
    for problem in _indented(document.data, _problems(document)):
        add_problem(collector, document, problem)
    return collector.diagnostics


def _problems(document: Document) -> list[Problem]:
    data = document.data
    if key := _other_format(document):
        what, hint = OTHER_FORMATS[key]
        return [Problem("E201", (key,), f"this is {what}, not a spec", hint.format(document.origin.name), of_key=True)]
    if not isinstance(data, dict):
        message = f"a spec is a mapping of sections, not {values.kind(data)}"
        return [Problem("E201", (), message, "start it with `taskspec: 1`")]
    model = Extension if EXTENDS in data else Spec
    return [*_format(data), *_too_many_variants(data), *_bases(document), *_roles(data), *fitted(data, model)[1]]


def _indented(data: Any, problems: list[Problem]) -> Iterator[Problem]:
    """Yield problems; an unknown key below an empty section is one that is not indented, and then the section is not empty."""
    unknown = set()
    for problem in problems:
        if problem.code == "E202" and len(problem.path) == 1:
            unknown.add(problem.path[0])
    owners: dict[Any, str] = {}
    owner = None
    for key in data if unknown else ():
        if key not in unknown:
            owner = key if data[key] is None else None
        elif owner is not None:
            owners[key] = owner
    for problem in problems:
        (first, *rest) = problem.path or ("",)
        if not rest and problem.code == "E202" and first in owners:
            message = f"`{first}` is not indented, and no section"
            yield problem._replace(
                message=message, hint=f"what is part of `{owners[first]}` stands two spaces to the right"
            )
        elif rest or first not in owners.values():
            yield problem


def remainder(document: Document) -> tuple[Document | None, set[str]]:
    """Leave out entries whose shape is wrong: the rest of a document, and the words in them; None if the rest means nothing."""
    problems = _problems(document)
    codes = {problem.code for problem in problems}
    is_lost = _other_format(document) is not None or not codes.isdisjoint(("E207", "E211", "E212", "E314"))
    if is_lost or any(map(check_shape, document.others.values())):
        return None, set()
    places = []
    for problem in problems:
        place = problem.path
        if problem.code != "E202":
            start = 0
            if place[:1] == ("variants",):
                start = 2
            is_named = bool(set(place[start : start + 1]) & set(NAMED))
            place = place[: start + 1 + is_named]
        places.append(place)
    data, words = without(document.data, places)
    return None if data is None else replace(document, data=data), words


def without(data: Any, places: Iterable[Path]) -> tuple[Any, set[str]]:
    """Leave out the innermost entries that contain given places: the rest, and their words; None if one is in no entry."""
    rest = copy.deepcopy(data)
    words: set[str] = set()
    for place in places:
        owner = None
        key = ""
        inner: Any = rest
        for step in place:
            if isinstance(inner, dict):
                owner = inner
                key = str(step)
            try:
                inner = inner[step]
            except (KeyError, IndexError, TypeError):  # it is missing, or went with another one
                break
        if owner is None:
            return None, words
        words |= set(re.findall(r"\w+", f"{key} {owner.pop(key, None)}"))
    return rest, words


def _other_format(document: Document) -> str | None:
    if not isinstance(document.data, dict) or "taskspec" in document.data:
        return None
    return next((key for key in OTHER_FORMATS if key in document.data), None)


def shaped(document: Document, variant: str | None) -> Merged:
    """Merge the sections of a spec or variant, and check their shape.

    Raises:
        SpecError: with every mistake of the shape of the document; or, where it has none, of the sections together.
    """
    raise_if_errors(check_shape(document))
    merged = merge(document, variant)
    validated(merged)
    return merged


@lru_cache(maxsize=256)
def validated(merged: Merged) -> Spec:
    """Validate a merged spec or variant as a whole task.

    Raises:
        SpecError: for a section that is missing, an entry that a variant changes though there is none, and keys that do not go
            together once the keys of a variant stand among the keys of its base.
    """
    collector = Collector()
    for problem in _strays(merged):
        add_problem(collector, merged, problem)
    for section in merged.missing:
        _add_missing(collector, merged, section)
    spec = None
    if not merged.strays:
        spec = validate(merged, collector, Spec)
    collector.raise_if_errors()
    assert spec is not None
    return spec


def validate(located: Located, collector: Collector, model: type[Shape]) -> Shape | None:
    """Validate data by a model; None where something is wrong, which goes to the collector."""
    value, problems = fitted(located.data, model)
    for problem in problems:
        add_problem(collector, located, problem)
    return value


def fitted(data: Any, model: type[Shape]) -> tuple[Shape | None, list[Problem]]:
    """Validate data by a model: the model, or None and the problems."""
    try:
        return model.model_validate(data), []
    except ValidationError as error:
        problems: list[Problem] = []
        for details in error.errors(include_url=False):
            problems += problems_of(dict(details), model)
    return None, list(dict.fromkeys(problems))


def add_problem(collector: Collector, located: Located, problem: Problem) -> None:
    """Report a problem at its place."""
    if problem.of_key:
        place = located.key_span
    else:
        place = located.span
    collector.add(problem.code, place(problem.path), problem.message, problem.hint)


def problems_of(error: dict[str, Any], model: type[BaseModel]) -> Iterator[Problem]:
    """Translate one of pydantic's errors to problems, with paths from the root of the data."""
    loc: Path = tuple(step for step in error["loc"] if step not in (LIST, CHANGES))
    if loc and loc[-1] == "[key]":
        loc = loc[:-1]
    match error["type"]:
        case typed.PROBLEMS:
            yield from values.below(error["ctx"]["problems"], *loc)
        case "missing":
            yield _missing_key(loc)
        case "extra_forbidden":
            yield values.unknown_key(str(loc[-1]), keys_at(model, loc[:-1])).below(*loc)
        case "literal_error":
            yield _not_an_option(error["input"], error["ctx"]["expected"], loc[-1:]).below(*loc)
        case other:
            yield _wrong_kind(other, error).below(*loc)


def _missing_key(loc: Path) -> Problem:
    if loc == ("taskspec",):
        message = "the file does not say in which format it is"
        return Problem("E203", (), message, "start it with `taskspec: 1`")
    owner = "this entry"
    if len(loc) > 1 and isinstance(loc[-2], str):
        owner = f"`{loc[-2]}`"
    if loc in (("experiment",), ("exam",), ("findings",)):
        return Problem("E203", (), "the file does not say in which format it is", f"start it with `{loc[0]}: 1`")
    if len(loc) == 1:
        return Problem("E203", (), f"the file has no `{loc[-1]}`")
    types = None
    if loc[-1] == "type" and len(loc) == 3:
        types = "one of `type: int`, `real`, `bool` and `choice`"
    return Problem("E203", loc, f"{owner} has no `{loc[-1]}`", types, of_key=True)  # at the owner, or what removes it


def _not_an_option(value: object, expected: str, key: Path) -> Problem:
    options = re.findall(r"'([^']*)'", expected)
    hint = None
    if isinstance(value, str):
        hint = advice(value, [step for step in key if step == "type"]) or suggest(value, options)
    message = f"{values.kind(value)} is not one of {', '.join(options)}"
    return Problem("E218" if value is None else "E206", (), message, hint)


def _wrong_kind(error_type: str, error: dict[str, Any]) -> Problem:
    value = error["input"]
    if error_type in _MAPPINGS:
        problem = values.wrong_kind("named entries (`name: ...`)", value)
        if value is None:
            return problem
        return problem._replace(code="E201")
    if error_type == "greater_than_equal":
        return Problem("E204", (), f"{value} is too small: at least {error['ctx']['ge']}")
    if expected := _EXPECTED.get(error_type):
        is_number = isinstance(value, int | float)
        hint = None
        if expected == "text" and is_number:
            hint = "put it in quotes"
        return values.wrong_kind(expected, value, hint)
    return Problem("E204", (), f"{values.kind(value)} is not allowed here: {error['msg']}")


def _format(data: dict[str, Any]) -> Iterator[Problem]:
    version = data.get("taskspec")
    if isinstance(version, int) and version != FORMAT:
        message = f"format {version} is not known here"
        hint = Advice(f"this version reads `taskspec: {FORMAT}`", str(version), str(FORMAT))
        yield Problem("E207", ("taskspec",), message, hint)


def _too_many_variants(data: dict[str, Any]) -> Iterator[Problem]:
    variants = data.get("variants")
    most = limits().variants
    if isinstance(variants, dict) and len(variants) > most:
        message = f"{len(variants):,} variants are too many; the limit is {most:,}"
        yield Problem("E314", ("variants",), message, how_to_raise("variants", len(variants)), of_key=True)


def _bases(document: Document) -> Iterator[Problem]:
    """Variants whose `base` does not exist, or leads back to themselves."""
    variants = document.data.get("variants")
    entries = {}
    if isinstance(variants, dict):
        entries = {k: v for k, v in variants.items() if isinstance(v, dict)}
    listed: list[tuple[Path, Any]] = [((), document.data), *((("variants", k), v) for k, v in entries.items())]
    for path, entry in listed:
        base = entry.get("base")
        other = document.others.get(str(entry.get(EXTENDS)))
        there = {} if other is None or not isinstance(other.data, dict) else other.data.get("variants")
        if other is not None and isinstance(base, str) and base not in (there or {}):
            yield _unknown_variant(base, list(there or {})).below(*path, "base")
    bases = {}
    for k, v in entries.items():
        if EXTENDS not in v and isinstance(v.get("base"), str):
            bases[k] = str(v["base"])
    for key, base in bases.items():
        path = ("variants", key, "base")
        if base not in entries:
            yield _unknown_variant(base, list(entries)).below(*path)
        circle = [key]
        while bases.get(circle[-1]) not in (None, *circle):
            circle.append(bases[circle[-1]])
        if bases.get(circle[-1]) == key:
            yield Problem("E212", path, f"these variants are based on each other: {' -> '.join([*circle, key])}")


def _unknown_variant(name: str, variants: list[str]) -> Problem:
    hint = suggest(name, variants) or f"there are: {', '.join(variants) or 'none'}"
    return Problem("E211", (), f"there is no variant `{name}`", hint)


def _roles(data: dict[str, Any]) -> Iterator[Problem]:
    roles = data.get("roles")
    known = variant_names(data)
    if isinstance(data.get("variants"), dict):
        variants = data.get("variants")
    else:
        variants = {}
    names = [*known, *(variants or ())]
    for role, variant in roles.items() if isinstance(roles, dict) else ():
        if role in ("expert", "learner") and isinstance(variant, str) and variant not in names:
            yield _unknown_variant(variant, names).below("roles", role)


def _strays(merged: Merged) -> Iterator[Problem]:
    for path in merged.strays:
        section = str(path[0])
        name = str(path[1])
        if section == "claims":
            stated = list(map(statement, merged.data[section]))
            message = f"the base of this variant does not claim `{name}`"
            yield Problem("E219", path, message, suggest(name, stated) or "a claim is dropped as it is written there")
            continue
        known = []
        for key in merged.data.get(section) or {}:
            if (section, key) not in merged.strays:
                known.append(key)
        if known:
            listed = f"its entries are {', '.join(known)}"
        else:
            listed = f"it has no `{section}:` section"
        message = f"the base of this variant has no `{name}` in `{section}`"
        yield Problem("E219", path, message, suggest(name, known) or listed, of_key=True)


def _add_missing(collector: Collector, merged: Merged, section: str) -> None:
    """Report a missing section without which there is no task: where it is removed, else at the name of the variant or spec."""
    message = f"{merged.name} has no `{section}:` section"
    variants = merged.document.data.get("variants")
    if (section,) in merged.moved:
        collector.add("E210", merged.key_span((section,)), message, "`null`, or nothing after the colon, removes it")
    elif merged.variant is not None:
        place = merged.document.key_span(("variants", merged.variant))
        collector.add("E210", place, message, "the base of this variant has none either")
    elif EXTENDS in merged.document.data:
        collector.add("E210", merged.document.span((EXTENDS,)), message, "the spec that it extends has none either")
    else:
        hint = None
        if variants:
            hint = f"only its variants are tasks: {', '.join(variants)}"
        collector.add("E210", merged.document.span(("name",)), message, hint)


def shape_problem(data: Any, kind: Any) -> Problem | None:
    """First problem of JSON data that is to be of a type, such as a `TypedDict`; None without one.

    Numbers are finite, and nothing is taken for something else.
    """
    # A list of them is read: settings cannot be given for a `TypedDict` itself.
    adapter = TypeAdapter(list[kind], config=ConfigDict(strict=True, allow_inf_nan=False))
    try:
        adapter.validate_python([data])
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
        return next(problems_of({**details, "loc": details["loc"][1:]}, BaseModel))
    return None
