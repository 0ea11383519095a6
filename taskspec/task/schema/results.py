"""The shape of results that were written as JSON, by the types of their fields."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from taskspec.task.schema.check import problems_of
from taskspec.task.schema.problems import Problem


def shape_problem(data: Any, kind: Any) -> Problem | None:
    """Return the first problem of JSON data that is to be of a type, such as a `TypedDict`; None where there is none.

    Numbers are finite, and nothing is taken for something else.
    """
    try:
        _adapter(kind).validate_python([data])
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
        return next(problems_of({**details, "loc": details["loc"][1:]}, BaseModel))
    return None


@lru_cache(maxsize=8)
def _adapter(kind: Any) -> TypeAdapter[Any]:
    """Read a list of them: settings cannot be given for a `TypedDict` itself."""
    return TypeAdapter(list[kind], config=ConfigDict(strict=True, allow_inf_nan=False))
