"""Annotations for the models: what a field holds, how it is checked, and how an editor sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, BeforeValidator, GetCoreSchemaHandler, GetJsonSchemaHandler, WithJsonSchema
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from taskspec.task.schema import problems, values
from taskspec.task.schema.problems import Problem

PROBLEMS = "taskspec_problems"
FORM = "x-form"  # pydantic follows every `$ref` it meets, so forms are linked afterwards


def fail(problems: list[Problem]) -> None:
    """Report problems, if there are any, through pydantic: it adds where in the spec they are."""
    if problems:
        raise PydanticCustomError(PROBLEMS, "see the context", {"problems": problems})


def _checked(check: Callable[[Any], Iterator[Problem]]) -> Callable[[Any], Any]:
    """A validator that leaves a value as it is, or reports what a check finds."""

    def validate(value: Any) -> Any:
        fail(list(check(value)))
        return value

    return validate


def _refer(form: str) -> WithJsonSchema:
    """Stands in the JSON Schema for a form that `export` writes out once."""
    return WithJsonSchema({FORM: form})


@dataclass(frozen=True)
class Shorthand:
    """An annotation that lets a text stand for an entry with that one key."""

    key: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.entry, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [{"type": "string"}, handler(schema)]}

    def entry(self, value: Any) -> Any:
        return {self.key: value} if isinstance(value, str) else value


def checked(check: Callable[[Any], Iterator[Problem]]) -> BeforeValidator:
    """An annotation that checks a value by hand."""
    return BeforeValidator(_checked(check))


Expression: TypeAlias = Annotated[Any, checked(values.expression), _refer("Expression")]
Constant: TypeAlias = Annotated[Any, checked(values.constant), _refer("Constant")]
Bound: TypeAlias = Annotated[Any, checked(values.bound), _refer("Bound")]
Shape: TypeAlias = Annotated[Any, checked(values.shape), _refer("Shape")]
Labels: TypeAlias = Annotated[Any, checked(values.labels), _refer("Labels")]
Horizon: TypeAlias = Annotated[Any, checked(values.horizon), _refer("Horizon")]
Expert: TypeAlias = Annotated[Any, checked(values.expert), _refer("Expert")]
Setting: TypeAlias = Annotated[Any, checked(values.setting), _refer("Setting")]
Grid: TypeAlias = Annotated[Any, checked(values.grid), _refer("Grid")]
Observation: TypeAlias = Annotated[Any, checked(values.observation), _refer("Observation")]
PartialObservation: TypeAlias = Annotated[Any, checked(values.partial_observation), _refer("PartialObservation")]

LETTER, MORE = r"A-Za-z\u0080-\uffff", "0-9_"
"""The characters of a name, for patterns: `\\w` is ASCII to an editor, so there every other character passes."""
NAME = rf"(?!(?:{'|'.join(problems.WORDS)})(?![{LETTER}{MORE}]))[{LETTER}][{LETTER}{MORE}]*"
NAMES: dict[str, dict[str, Any]] = {
    title: {"type": "string", "pattern": f"^{pattern}$", "patternErrorMessage": f"Not {what}."}
    for title, pattern, what in (
        ("Name", NAME, "a name: a letter, then letters, digits and `_`; no word of the language"),
        ("PrimedName", f"{NAME}'", "the next value of a component: its name with a prime, `s'`"),
        ("Definition", rf"{NAME}(\([{LETTER}{MORE}, ]+\))?", "a name, nor a function with the names of its arguments"),
        ("Warning", f"({'|'.join(values.WARNINGS)})", "the code of a warning"),
    )
}
"""What keys may be, by title; the message is an editor's."""

Name: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(problems.name)),
    WithJsonSchema(NAMES["Name"]),
]
Primed: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.primed)),
    WithJsonSchema(NAMES["PrimedName"]),
]
Warned: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.warning)),
    WithJsonSchema(NAMES["Warning"]),
]
Reason: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.reason)),
    WithJsonSchema({"type": "string", "pattern": r"\S"}),
]
Defined: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.definition)),
    WithJsonSchema(NAMES["Definition"]),
]
