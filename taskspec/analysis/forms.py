"""The JSON Schema of specs, by path: the keys, the options and the kinds of the value at a place."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from taskspec.source import Path
from taskspec.task.schema.export import json_schema


@lru_cache(maxsize=512)
def schemas(path: Path) -> tuple[dict[str, Any], ...]:
    """Return what the JSON Schema of specs says of the value at a path, one entry for each form that it may have."""
    root = _root()
    if not path:
        return tuple(_forms(root["$defs"]["Spec"]))
    found: list[dict[str, Any]] = []
    for outer in schemas(path[:-1]):
        found += _forms(_below(outer, path[-1]))
    return tuple({id(each): each for each in found}.values())


def _below(schema: dict[str, Any], step: str | int) -> Any:
    if isinstance(step, int):
        return schema.get("items")
    properties = schema.get("properties", {})
    return properties.get(step, schema.get("additionalProperties"))


def _forms(schema: Any) -> Iterator[dict[str, Any]]:
    """Yield a schema and those that it refers to, each a form of the value."""
    if not isinstance(schema, dict):
        return
    yield schema
    reference = schema.get("$ref")
    if reference is not None:
        yield from _forms(_root()["$defs"][reference.rpartition("/")[2]])
    for word in ("then", "else"):
        yield from _forms(schema.get(word))
    for word in ("anyOf", "oneOf", "allOf"):
        for each in schema.get(word, ()):
            yield from _forms(each)


@lru_cache
def _root() -> dict[str, Any]:
    return json_schema()


def type_of(schema: dict[str, Any]) -> str:
    kinds = [each.get("title") or each.get("type") for each in _forms(schema)]
    return next((str(kind) for kind in kinds[::-1] if isinstance(kind, str) and kind != "null"), "")
