"""Sections and keys of a spec, from the JSON Schema that checks and completes them."""

from __future__ import annotations

from typing import Any

from taskspec.cli.manual.markdown import code, table
from taskspec.source.scan import EXTENDS, REQUIRED
from taskspec.task.schema.export import json_schema

FIRST, LAST = ("taskspec", "name"), ("variants", EXTENDS)
NEEDED = "required"


def sections() -> str:
    """What stands at the top of a spec, in canonical order."""
    spec, extension = (json_schema()["$defs"][kind] for kind in ("Spec", "Extension"))
    properties: dict[str, Any] = {**spec["properties"], EXTENDS: extension["properties"][EXTENDS]}
    middle = [key for key in properties if key not in FIRST + LAST]
    needed = {*spec["required"], *REQUIRED}
    rows = ((key, properties[key]) for key in (*FIRST, *middle, *LAST))
    return table(
        ("section", "", "what it holds"),
        ((code(key), NEEDED if key in needed else "", about["description"]) for key, about in rows),
    )


def keys(definition: str) -> str:
    """The keys of one kind of entry; those that are needed come first."""
    schema = json_schema()["$defs"][definition]
    needed = schema.get("required", ())
    properties: dict[str, Any] = schema["properties"]
    ordered = sorted(properties, key=lambda key: key not in needed)
    return table(
        ("key", "", "what it is"),
        ((code(key), NEEDED if key in needed else "", properties[key]["description"]) for key in ordered),
    )
