"""The JSON Schema of specs, for editors: completion, descriptions, and marks while typing."""

from __future__ import annotations

from typing import Any

from taskspec.spec.schema.fields import FORM
from taskspec.spec.schema.values import SPACES
from taskspec.spec.schema.variants import Spec

_EXPRESSION = {"$ref": "#/$defs/Expression"}
_TEXT = {"type": ["string", "number", "boolean"]}


_BOUNDED = {
    "type": "object",
    "description": "An expression with declared bounds of its space.",
    "properties": {
        "value": {**_EXPRESSION, "description": "What is observed."},
        "low": {**_EXPRESSION, "description": "Lowest value, inclusive; -inf for none."},
        "high": {**_EXPRESSION, "description": "Highest value, inclusive; inf for none."},
    },
    "required": ["value"],
    "additionalProperties": False,
}


def _observation(form: str) -> dict[str, Any]:
    return {
        "title": "Observation",
        "description": "What the agent sees, as `name: expression`.",
        "type": "object",
        "properties": {
            "space": {
                "description": "The kind of space: one box unless given, or Discrete for a single finite value.",
                "enum": list(SPACES),
            }
        },
        "additionalProperties": {"anyOf": [{"$ref": f"#/$defs/{form}"}, _BOUNDED]},
    }


# The forms that `fields` refers to.
_FORMS: dict[str, Any] = {
    "Expression": {
        "title": "Expression",
        "description": "A formula, a number, true or false; a list for a vector; a list of cases "
        "(`if`, `then`, and a last `else`); a table (`by`, `rows`); or `{value: probability}`.",
        "anyOf": [
            {"type": ["string", "number", "boolean"], "description": "A formula or a number."},
            {"$ref": "#/$defs/Cases"},
            {"type": "array", "items": _EXPRESSION, "description": "A vector of expressions."},
            {"$ref": "#/$defs/Table"},
            {"$ref": "#/$defs/Probabilities"},
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
            "oneOf": [{"required": ["if", "then"]}, {"required": ["else"]}],
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
                "additionalProperties": {"$ref": "#/$defs/Cell"},
            },
        },
    },
    "Cell": {
        "title": "Cell",
        "description": "An expression, `{value: probability}`, or deeper rows.",
        "anyOf": [
            _EXPRESSION,
            {"type": "object", "additionalProperties": {"$ref": "#/$defs/Cell"}},
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
        "anyOf": [{"$ref": "#/$defs/LetterGrid"}, _EXPRESSION],
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
                "additionalProperties": _EXPRESSION,
            },
        },
    },
    "Bound": {
        "title": "Bound",
        "description": "A number, an expression, or a list of them for a vector.",
        "type": ["string", "number", "array"],
    },
    "Shape": {
        "title": "Shape",
        "description": "Lengths, outermost first; `[]` is a single number.",
        "type": ["array", "integer", "string"],
        "items": {"type": ["integer", "string"]},
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
    "Setting": {
        "title": "Setting",
        "description": "A value of a parameter.",
        "type": ["string", "number", "boolean"],
    },
}


def json_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a spec. Every key has a description, for editors to show."""
    schema: dict[str, Any] = _linked(Spec.model_json_schema(by_alias=True))
    definitions = {**_FORMS, **schema.pop("$defs")}
    for key in ("Parameters", "PartialParameters"):
        _type_extra_keys(definitions[key])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "taskspec",
        "$defs": dict(sorted(definitions.items())),
    }


def _linked(node: Any) -> Any:
    """The same schema with every mark of a form replaced by a reference to it."""
    if isinstance(node, list):
        return [_linked(item) for item in node]
    if not isinstance(node, dict):
        return node
    linked = {key: _linked(value) for key, value in node.items() if key != FORM}
    return linked | {"$ref": f"#/$defs/{node[FORM]}"} if FORM in node else linked


def _type_extra_keys(schema: dict[str, Any]) -> None:
    """Names with typed values: older versions of pydantic leave the type of extra keys out."""
    part = "Parameter" if schema["title"] == "Parameters" else "PartialParameter"
    value: dict[str, Any] = {"$ref": f"#/$defs/{part}"}
    if part == "PartialParameter":
        value = {"anyOf": [value, {"type": "null"}]}
    schema["additionalProperties"] = value
