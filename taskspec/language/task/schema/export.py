"""The JSON Schema of specs, for editors: completion, descriptions, and marks while typing."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Iterator
from functools import cache
from typing import Any

from pydantic import BaseModel, TypeAdapter

from taskspec.language.source.document import EXTENDS, Path
from taskspec.language.task.merge import REQUIRED
from taskspec.language.task.schema.models import Extension, Spec
from taskspec.language.task.schema.typed import FORM, NAMES
from taskspec.language.task.schema.values import SPACES

FORMS = pathlib.Path(__file__).with_name("forms.json")
"""The JSON Schema of values that take several forms, which `values` checks by hand."""


def _ref(title: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{title}"}


@cache
def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a spec, the same each time. Every key has a description, for editors to show."""
    models: dict[str, Any] = _linked(TypeAdapter(Spec | Extension).json_schema(by_alias=True)["$defs"])
    forms = json.loads(FORMS.read_text(encoding="utf-8"))
    for title in ("Observation", "PartialObservation"):
        forms[title]["properties"]["space"]["enum"] = list(SPACES)
    definitions = {**forms, **{title: {"title": title, **form} for title, form in NAMES.items()}, **models}
    nullable = {"anyOf": [_ref("PartialParameter"), {"type": "null"}]}
    for key, value in {"Parameters": _ref("Parameter"), "PartialParameters": nullable}.items():
        # Older versions of pydantic leave the type of extra keys out.
        definitions[key] |= {"propertyNames": _ref("Name"), "additionalProperties": value}
    complete = {"anyOf": [{"required": list(REQUIRED)}, {"required": ["variants"]}]}  # or a variant may be
    definitions["Spec"] |= complete
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "taskspec",
        "description": definitions["Spec"]["description"],
        "type": "object",
        "if": {"required": [EXTENDS]},
        "then": _ref("Extension"),
        "else": _ref("Spec"),
        "$defs": dict(sorted(definitions.items())),
    }


def keys_at(model: type[BaseModel], path: Path) -> tuple[str, ...]:
    """List the keys that an entry at a path of a document can have, in the order of the models."""
    keys: dict[str, Any] = {}
    for schema in schemas_at(_schema_with(model), model.__name__, path):
        keys |= schema.get("properties", {})
    return tuple(keys)


@cache
def _schema_with(model: type[BaseModel]) -> dict[str, Any]:
    root = json_schema()
    if model.__name__ not in root["$defs"]:
        root = {"$defs": {}, **TypeAdapter(model).json_schema(by_alias=True)}
        root["$defs"][model.__name__] = root
    return root


def schemas_at(root: dict[str, Any], title: str, path: Path) -> list[dict[str, Any]]:
    """List the forms of the value at a path below a definition of a JSON Schema, each once."""
    forms = list(forms_of(root, root["$defs"][title]))
    for step in path:
        below = [_below(schema, step) for schema in forms]
        forms = []
        for each in below:
            forms += forms_of(root, each)
    return list({id(each): each for each in forms}.values())


def _below(schema: dict[str, Any], step: str | int) -> Any:
    if isinstance(step, int):
        return schema.get("items")
    more = schema.get("additionalProperties") or next(iter(schema.get("patternProperties", {}).values()), None)
    return schema.get("properties", {}).get(step, more)


def forms_of(root: dict[str, Any], schema: Any) -> Iterator[dict[str, Any]]:
    """Yield a schema and all that it refers to, each a form of the value."""
    if not isinstance(schema, dict):
        return
    yield schema
    reference = schema.get("$ref")
    if reference is not None:
        yield from forms_of(root, root["$defs"][reference.rpartition("/")[2]])
    for word in ("then", "else"):
        yield from forms_of(root, schema.get(word))
    for word in ("anyOf", "oneOf", "allOf"):
        for each in schema.get(word, ()):
            yield from forms_of(root, each)


def _linked(node: Any) -> Any:
    """Replace marks of forms, and patterns of keys, by references; a definition is called `Claim`, not `ClaimEntry`."""
    if isinstance(node, list):
        return list(map(_linked, node))
    if not isinstance(node, dict):
        if isinstance(node, str):
            return node.removesuffix("Entry")
        return node
    linked = {}
    for key, value in node.items():
        if key not in (FORM, "patternProperties"):
            linked[key.removesuffix("Entry")] = _linked(value)
    if FORM in node:
        linked |= _ref(node[FORM])
    for pattern, value in node.get("patternProperties", {}).items():
        title = next(title for title, form in NAMES.items() if form["pattern"] == pattern)
        linked |= {"propertyNames": _ref(title), "additionalProperties": _linked(value)}
    return linked
