"""The whole spec, with its variants: the same sections and keys, with nothing required.

The models of variants are made from the models of the sections, so that a key exists once.
"""

from __future__ import annotations

from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, create_model, model_validator
from pydantic.fields import FieldInfo

from taskspec.task.schema import problems
from taskspec.task.schema.fields import Name, PartialObservation, Shorthand, fail
from taskspec.task.schema.models import FORMAT, ChangedClaims, ClaimEntry, Sections
from taskspec.task.schema.typed import ComponentEntry, MemoryEntry, ParameterEntry, Parameters, Requirement, Strict


def _partial_type(annotation: Any) -> Any:
    """The same type with nothing required inside, and `null` allowed to remove entries."""
    if isinstance(annotation, type) and issubclass(annotation, Parameters):
        return PartialParameters
    if annotation is ComponentEntry:
        return PartialComponent
    if annotation is MemoryEntry:
        return PartialMemory
    if get_origin(annotation) is dict and get_args(annotation)[1] is not Any:
        key, value = get_args(annotation)
        return dict[key, _partial_type(value) | None]  # type: ignore[misc, valid-type]
    return annotation


def _partial(model: type[Strict], name: str, **more: Any) -> type[Strict]:
    """A model with the keys of another, none of them required."""
    fields: dict[str, Any] = {}
    for key, field in model.model_fields.items():
        annotation = _partial_type(field.annotation)
        for extra in field.metadata:
            annotation = Annotated[annotation, extra]
        info = FieldInfo(default=None, description=field.description, alias=field.alias)
        fields[key] = (annotation | None, info)
    return create_model(name, __base__=Strict, __doc__=model.__doc__, **(fields | more))


PartialParameter = _partial(ParameterEntry, "PartialParameter")
PartialComponent = _partial(ComponentEntry, "PartialComponent")
PartialMemory = _partial(MemoryEntry, "PartialMemory")


class PartialParameters(BaseModel):
    """Parameters that a variant adds, changes or (with `null`) removes."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True, defer_build=True)
    __pydantic_extra__: dict[str, PartialParameter | None]  # type: ignore[valid-type]

    require: list[Requirement] | None = Field(None, description="Conditions across parameters, each with its message.")

    @model_validator(mode="after")
    def _check(self) -> PartialParameters:
        fail([problem for key in self.__pydantic_extra__ for problem in problems.name(key, (key,))])
        return self


LIST, CHANGES = "[list]", "[changes]"
"""Steps of pydantic's paths that no file has."""
Claims = Annotated[
    Annotated[list[Annotated[ClaimEntry, Shorthand("claim")]], Tag(LIST)] | Annotated[ChangedClaims, Tag(CHANGES)],
    Discriminator(lambda value: CHANGES if isinstance(value, dict) else LIST),
]
Variant = _partial(
    Sections,
    "Variant",
    observation=(
        PartialObservation | None,
        Field(None, description=Sections.model_fields["observation"].description),
    ),
    claims=(
        Claims | None,
        Field(None, description="Other claims; or those of what it is based on, `{drop: [...], add: [...]}`."),
    ),
    extends=(
        str | None,
        Field(None, description="The file of another spec to start from, relative to this one: `../grid.yaml`."),
    ),
    base=(
        str | None,
        Field(None, description="The variant to start from. Without it: the spec itself."),
    ),
)


class Head(Strict):
    """What every file begins with, and the variants."""

    taskspec: int = Field(description="Version of the format of this file: 1.", json_schema_extra={"const": FORMAT})
    name: Name = Field(description="Name of the task, and of its environments.")
    variants: dict[Name, Variant] = Field(  # type: ignore[valid-type]
        default_factory=dict,
        description="Named overrides of any section; each is a task of its own.",
    )


class Spec(Head, Sections):
    """A task: one YAML file from which environments, exact models and documentation follow."""


class Extension(Head, Variant):  # type: ignore[valid-type, misc]
    """A spec that says how it differs from that of another file."""

    extends: str = Field(description="The file of another spec to start from, relative to this one.")
