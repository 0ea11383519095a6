"""The JSON Schema of specs, for editors: completion, descriptions, and marks while typing."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from taskspec.source.scan import EXTENDS, REQUIRED
from taskspec.task.schema.models import Extension, Spec
from taskspec.task.schema.typed import FORM, NAMES
from taskspec.task.schema.values import SPACES


def _ref(title: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{title}"}


_EXPRESSION = _ref("Expression")
_TEXT = {"type": ["string", "number", "boolean"]}


_GRID: dict[str, Any] = {
    "type": "object",
    "additionalProperties": {
        "anyOf": [_ref("Setting"), {"type": "array", "items": _ref("Setting"), "minItems": 1}],
    },
}
_BOUNDED: dict[str, Any] = {
    "type": "object",
    "description": "An expression with declared bounds of its space.",
    "properties": {
        "value": {**_EXPRESSION, "description": "What is observed."},
        "low": {**_ref("Bound"), "description": "Lowest value, inclusive; -inf for none."},
        "high": {**_ref("Bound"), "description": "Highest value, inclusive; inf for none."},
    },
    "required": ["value"],
    "additionalProperties": False,
}


def _observation(form: str) -> dict[str, Any]:
    return {
        "title": "Observation",
        "description": "What the agent sees, as `name: expression`.",
        "type": "object",
        "propertyNames": _ref("Name"),
        "properties": {
            "space": {
                "description": "The kind of space: one box unless given, or Discrete for a single finite value.",
                "enum": list(SPACES),
            }
        },
        "additionalProperties": {
            "if": {"type": "object", "required": ["value"], "propertyNames": {"enum": list(_BOUNDED["properties"])}},
            "then": _BOUNDED,
            "else": _ref(form),
        },
    }


# The forms that `fields` refers to.
_FORMS: dict[str, Any] = {
    "Expression": {
        "title": "Expression",
        "description": "A formula, a number, true or false; a list for a vector; a list of cases "
        "(`if`, `then`, and a last `else`); a table (`by`, `rows`); or `{value: probability}`.",
        "anyOf": [
            {"type": ["string", "number", "boolean"], "description": "A formula or a number."},
            _ref("Cases"),
            {"type": "array", "items": _EXPRESSION, "description": "A vector of expressions."},
            _ref("Table"),
            _ref("Probabilities"),
        ],
    },
    "Cases": {
        "title": "Cases",
        "description": "Tried from above; the first whose condition holds gives the value.",
        "type": "array",
        "items": {
            "type": "object",
            "additionalProperties": False,
            "properties": {
                "if": _EXPRESSION | {"description": "The condition of this case."},
                "then": _EXPRESSION | {"description": "The value in this case."},
                "else": _EXPRESSION | {"description": "The value in all other cases; comes last."},
            },
            "oneOf": [{"required": ["if", "then"], "maxProperties": 2}, {"required": ["else"], "maxProperties": 1}],
        },
        "contains": {"required": ["else"]},
    },
    "Table": {
        "title": "Table",
        "description": "A decision table.",
        "type": "object",
        "additionalProperties": False,
        "required": ["by", "rows"],
        "properties": {
            "by": {
                "description": "What the table looks at, outermost first: `[s, a]`.",
                "type": ["array", "string"],
                "items": {"type": "string"},
                "minItems": 1,
            },
            "rows": {
                "description": "A row for each value of the first, holding one cell for everything "
                "deeper or the rows of the next; `else` is for all other values.",
                "type": "object",
                "minProperties": 1,
                "additionalProperties": _ref("Cell"),
            },
        },
    },
    "Cell": {
        "title": "Cell",
        "description": "An expression, `{value: probability}`, or deeper rows.",
        "anyOf": [
            _EXPRESSION,
            {"type": "object", "minProperties": 1, "additionalProperties": _ref("Cell")},
        ],
    },
    "Probabilities": {
        "title": "Probabilities",
        "description": "A distribution: each value with its probability, such as `1/2`.",
        "type": "object",
        "minProperties": 1,
        "not": {"anyOf": [{"required": [key]} for key in ("by", "rows", "if", "then", "else")]},
        "additionalProperties": _TEXT,
    },
    "Constant": {
        "title": "Constant",
        "description": "An expression, or a grid of letters.",
        "if": {"type": "object", "anyOf": [{"required": ["grid"]}, {"required": ["legend"]}]},
        "then": _ref("LetterGrid"),
        "else": _EXPRESSION,
    },
    "LetterGrid": {
        "title": "Grid of letters",
        "description": "A map drawn in letters.",
        "type": "object",
        "additionalProperties": False,
        "required": ["grid", "legend"],
        "properties": {
            "grid": {
                "description": "The lines of the map, all of one length.",
                "anyOf": [{"type": "array", "items": {"type": "string"}, "minItems": 1}, {"type": "string"}],
            },
            "legend": {
                "description": "What each letter stands for.",
                "type": "object",
                "propertyNames": {"minLength": 1, "maxLength": 1},
                "additionalProperties": _EXPRESSION,
            },
        },
    },
    "Bound": {
        "title": "Bound",
        "description": "A number, an expression, or a list of them for a vector.",
        "type": ["string", "number", "array"],
        "items": _EXPRESSION,
    },
    "Shape": {
        "title": "Shape",
        "description": "Lengths, outermost first; `[]` is a single number.",
        "type": ["array", "integer", "string"],
        "minimum": 0,
        "items": {"type": ["integer", "string"], "minimum": 0},
    },
    "Labels": {
        "title": "Labels",
        "description": "The labels of a choice, or a mapping from each to its value.",
        "anyOf": [
            {"type": "array", "items": {"type": "string"}, "minItems": 1},
            {"type": "object", "additionalProperties": _EXPRESSION, "minProperties": 1},
        ],
    },
    "Horizon": {
        "title": "Horizon",
        "description": "A whole number of steps, an expression for it, or `none`.",
        "anyOf": [{"type": "integer", "minimum": 1}, {"type": "string"}],
    },
    "Expert": {
        "title": "Expert",
        "description": "An expression for each action component, or `optimal`, or `soft(beta)`.",
        "anyOf": [{"type": "object", "additionalProperties": _EXPRESSION}, _EXPRESSION],
    },
    "Observation": _observation("Expression"),
    "PartialObservation": _observation("OptionalExpression"),
    "OptionalExpression": {
        "title": "Expression or null",
        "description": "An expression; `null` removes the entry.",
        "anyOf": [_EXPRESSION, {"type": "null"}],
    },
    "Grid": {
        "title": "Parameter values",
        "description": "A list of choices, or a grid of values: `{L: [1, 2, 5]}`.",
        "anyOf": [{"type": "array", "items": _GRID}, _GRID],
    },
    "Setting": {
        "title": "Setting",
        "description": "A value of a parameter.",
        "type": ["string", "number", "boolean"],
    },
}


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a spec. Every key has a description, for editors to show."""
    models: dict[str, Any] = _linked(TypeAdapter(Spec | Extension).json_schema(by_alias=True)["$defs"])
    definitions = {**_FORMS, **{title: {"title": title, **form} for title, form in NAMES.items()}, **models}
    for key in ("Parameters", "PartialParameters"):
        _type_extra_keys(definitions[key])
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


def _linked(node: Any) -> Any:
    """Return the same schema with every mark of a form, and every pattern of keys, replaced by a reference to it.

    A definition is called what authors call it: `Claim`, not `ClaimEntry`.
    """
    if isinstance(node, list):
        return [_linked(item) for item in node]
    if not isinstance(node, dict):
        return node.removesuffix("Entry") if isinstance(node, str) else node
    linked = {
        key.removesuffix("Entry"): _linked(value)
        for key, value in node.items()
        if key not in (FORM, "patternProperties")
    }
    if FORM in node:
        linked |= _ref(node[FORM])
    for pattern, value in node.get("patternProperties", {}).items():
        title = next(title for title, form in NAMES.items() if form["pattern"] == pattern)
        linked |= {"propertyNames": _ref(title), "additionalProperties": _linked(value)}
    return linked


def _type_extra_keys(schema: dict[str, Any]) -> None:
    """Names with typed values: older versions of pydantic leave the type of extra keys out."""
    part = "Parameter" if schema["title"] == "Parameters" else "PartialParameter"
    value: dict[str, Any] = _ref(part)
    if part == "PartialParameter":
        value = {"anyOf": [value, {"type": "null"}]}
    schema |= {"propertyNames": _ref("Name"), "additionalProperties": value}
