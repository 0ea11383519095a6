"""Annotations for the models: what a field holds, how it is checked, and how an editor sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, BeforeValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from taskspec.spec.schema import values
from taskspec.spec.schema.values import Problem

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


def _check(check: Callable[[Any], Iterator[Problem]]) -> BeforeValidator:
    return BeforeValidator(_checked(check))


Expression: TypeAlias = Annotated[Any, _check(values.expression), _refer("Expression")]
Constant: TypeAlias = Annotated[Any, _check(values.constant), _refer("Constant")]
Bound: TypeAlias = Annotated[Any, _check(values.bound), _refer("Bound")]
Shape: TypeAlias = Annotated[Any, _check(values.shape), _refer("Shape")]
Labels: TypeAlias = Annotated[Any, _check(values.labels), _refer("Labels")]
Horizon: TypeAlias = Annotated[Any, _check(values.horizon), _refer("Horizon")]
Expert: TypeAlias = Annotated[Any, _check(values.expert), _refer("Expert")]
Setting: TypeAlias = Annotated[Any, _check(values.setting), _refer("Setting")]
Observation: TypeAlias = Annotated[Any, _check(values.observation), _refer("Observation")]
PartialObservation: TypeAlias = Annotated[Any, _check(values.partial_observation), _refer("PartialObservation")]

Name: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.name)),
    WithJsonSchema({"type": "string", "pattern": r"^[^\W\d_]\w*$"}),
]
Primed: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.primed)),
    WithJsonSchema({"type": "string", "pattern": r"^[^\W\d_]\w*'$"}),
]
Warned: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.warning)),
    WithJsonSchema({"type": "string", "pattern": f"^({'|'.join(values.WARNINGS)})$"}),
]
Reason: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.reason)),
    WithJsonSchema({"type": "string", "pattern": r"\S"}),
]
Defined: TypeAlias = Annotated[
    str,
    AfterValidator(_checked(values.definition)),
    WithJsonSchema({"type": "string", "pattern": r"^[^\W\d_]\w*(\([\w, ]+\))?$"}),
]
