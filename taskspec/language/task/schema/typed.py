"""Annotations of fields, and parameters and components: entries with a type and the keys of that type."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from taskspec.language.task.schema import values
from taskspec.language.task.schema.values import Kind, Problem

PROBLEMS = "taskspec_problems"
FORM = "x-form"  # pydantic follows every `$ref` it meets, so forms are linked afterwards


def optional(description: str, **rules: Any) -> Any:
    """Field that may be left out, with its description and further rules of pydantic."""
    return Field(None, description=description, **rules)


def listed(description: str) -> Any:
    """Field with a list, empty where it is left out."""
    return Field(default_factory=list, description=description)


def named(description: str) -> Any:
    """Field with named entries, none where it is left out."""
    return Field(default_factory=dict, description=description)


def fail(problems: list[Problem]) -> None:
    """Report problems, if there are any, through pydantic: it adds where in the spec they are."""
    if problems:
        raise PydanticCustomError(PROBLEMS, "see the context", {"problems": problems})


def _checked(check: Callable[[Any], Iterator[Problem]]) -> Callable[[Any], Any]:
    def validate(value: Any) -> Any:
        fail(list(check(value)))
        return value

    return validate


def _refer(form: str) -> WithJsonSchema:
    """Stands in the JSON Schema for a form that `export` writes out once."""
    return WithJsonSchema({FORM: form})


@dataclass(frozen=True)
class Shorthand:
    """An annotation by which a text is read as an entry with that one key."""

    key: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.entry, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"anyOf": [{"type": "string"}, handler(schema)]}

    def entry(self, value: Any) -> Any:
        if isinstance(value, str):
            return {self.key: value}
        return value


def checked(check: Callable[[Any], Iterator[Problem]]) -> BeforeValidator:
    return BeforeValidator(_checked(check))


Expression: TypeAlias = Annotated[Any, _refer("Expression")]
Constant: TypeAlias = Annotated[Any, checked(values.constant), _refer("Constant")]
Bound: TypeAlias = Annotated[Any, checked(values.bound), _refer("Bound")]
Shape: TypeAlias = Annotated[Any, checked(values.shape), _refer("Shape")]
Labels: TypeAlias = Annotated[Any, checked(values.labels), _refer("Labels")]
Horizon: TypeAlias = Annotated[Any, checked(values.horizon), _refer("Horizon")]
Expert: TypeAlias = Annotated[Any, _refer("Expert")]
Measure: TypeAlias = Annotated[Any, checked(values.measure), _refer("Measure")]
Setting: TypeAlias = Annotated[Any, checked(values.setting), _refer("Setting")]
Grid: TypeAlias = Annotated[Any, checked(values.grid), _refer("Grid")]
Observation: TypeAlias = Annotated[Any, checked(values.observation), _refer("Observation")]
PartialObservation: TypeAlias = Annotated[
    Any, checked(partial(values.observation, nullable=True)), _refer("PartialObservation")
]

LETTER = r"A-Za-z\u0080-\uffff"
MORE = "0-9_"
"""The characters of a name, for patterns: `\\w` is ASCII to an editor, so there every other character passes."""
NAME = rf"(?!(?:{'|'.join(values.WORDS)})(?![{LETTER}{MORE}]))[{LETTER}][{LETTER}{MORE}]*"
NAMES: dict[str, dict[str, Any]] = {
    title: {"type": "string", "pattern": f"^{pattern}$", "patternErrorMessage": f"Not {what}."}
    for title, pattern, what in (
        ("Name", NAME, "a name: a letter, then letters, digits and `_`; no word of the language"),
        ("PrimedName", f"{NAME}'", "the next value of a component: its name with a prime, `s'`"),
        ("Definition", rf"{NAME}(\([{LETTER}{MORE}, ]+\))?", "a name, nor a function with the names of its arguments"),
        ("Warning", f"({'|'.join(values.WARNINGS)})", "the code of a warning"),
    )
}
"""Patterns of keys, by title; the messages are for editors."""

Name: TypeAlias = Annotated[str, AfterValidator(_checked(values.name)), WithJsonSchema(NAMES["Name"])]
Primed: TypeAlias = Annotated[str, AfterValidator(_checked(values.primed)), WithJsonSchema(NAMES["PrimedName"])]
Warned: TypeAlias = Annotated[str, AfterValidator(_checked(values.warning)), WithJsonSchema(NAMES["Warning"])]
Reason: TypeAlias = Annotated[
    str, AfterValidator(_checked(values.reason)), WithJsonSchema({"type": "string", "pattern": r"\S"})
]
Defined: TypeAlias = Annotated[str, AfterValidator(_checked(values.definition)), WithJsonSchema(NAMES["Definition"])]


# Parameters and components: entries with a type, and the keys that each type has.


class Strict(BaseModel):
    """No unknown keys, no silent conversions, no changes afterwards; a validator is built when it is first needed."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, defer_build=True)


class Typed(Strict):
    """The keys that parameters and components share."""

    low: Bound = optional("Smallest value, included. Without it: no bound.")
    high: Bound = optional("Largest value, included. Without it: no bound.")
    values: Labels = optional(
        "For a choice: its labels, or a mapping from each label to the number or vector it stands for in arithmetic."
    )
    symbol: str | None = optional("How to print it, in LaTeX: `c_0`, `\\beta`.")
    doc: str | None = optional("Its meaning, in a few words.")


EXCLUDED = {
    "int": ("values", "symbols"),
    "real": ("values", "symbols"),
    "bool": ("low", "high", "values", "symbols"),
    "choice": ("low", "high"),
}
"""The keys that an entry of each type does not have."""
DEFAULTS = {"int": ["integer", "string"], "real": ["number", "string"], "bool": ["boolean"], "choice": ["string"]}
"""Forms of the default of each type, in JSON Schema's words; a text is a formula, or a label."""


def _rules(then: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return {
        "allOf": [
            {"if": {"required": ["type"], "properties": {"type": {"const": kind}}}, "then": then(kind)}
            for kind in EXCLUDED
        ]
    }


def _component_rule(kind: str) -> dict[str, Any]:
    return {"properties": dict.fromkeys(EXCLUDED[kind], False), "required": ["values"] if kind == "choice" else []}


def _parameter_rule(kind: str) -> dict[str, Any]:
    rule = _component_rule(kind)
    return rule | {"properties": {**rule["properties"], "default": {"type": DEFAULTS[kind]}}}


class ParameterEntry(Typed):
    """A parameter of the task."""

    model_config = ConfigDict(json_schema_extra=_rules(_parameter_rule))

    type: Kind = Field(description="The kind of value: int, real, bool, or choice (a label).")
    default: Setting = Field(description="The value when none is given.")
    alias: Name | None = optional("Another name under which callers may give it.")

    @model_validator(mode="after")
    def _check(self) -> ParameterEntry:
        problems = list(_typed_problems(self, self.type))
        wanted = {"int": int | str, "real": int | float | str, "bool": bool, "choice": str}[self.type]
        if not isinstance(self.default, wanted) or (isinstance(self.default, bool) and self.type != "bool"):
            hint = None
            if self.type == "bool":
                hint = "write `true` or `false`, without quotes"
            problems.append(
                Problem("E213", ("default",), f"{values.kind(self.default)} is not of type {self.type}", hint)
            )
        fail(problems)
        return self


class ComponentEntry(Typed):
    """A part of the state or of the action."""

    model_config = ConfigDict(json_schema_extra=_rules(_component_rule))

    type: Kind = Field(description="The kind of value: int, real, bool, or choice (a label).")
    shape: Shape = optional("Lengths of a vector or matrix: `[L]`, `[2, 2]`. Without it: one number.")
    symbols: list[str] | None = optional("For a choice: how to print its labels in LaTeX, in the same order.")

    @model_validator(mode="after")
    def _check(self) -> ComponentEntry:
        problems = list(_typed_problems(self, self.type))
        if self.symbols is not None and self.values is not None and len(self.symbols) != len(self.values):
            message = f"{len(self.symbols)} symbols for {len(self.values)} labels"
            problems.append(Problem("E214", ("symbols",), message))
        fail(problems)
        return self


class MemoryEntry(ComponentEntry):
    """Something that the expert remembers: a component with a first value and a next one."""

    initial: Expression = Field(description="Its initial value, an expression over the first observation.")
    next: Expression = Field(
        description="Its value after a step, over itself, the action and the next observation, written with a prime."
    )


def _typed_problems(entry: Typed, kind: Kind) -> Iterator[Problem]:
    if kind == "choice" and entry.values is None:
        yield Problem("E203", (), "a choice needs `values`", "list the labels: `values: [left, right]`", of_key=True)
    for key in (key for key in EXCLUDED[kind] if getattr(entry, key, None) is not None):
        what = {"choice": "a choice", "bool": "a bool"}.get(kind, f"`type: {kind}`")
        yield Problem("E214", (key,), f"{what} has no `{key}`", None, of_key=True)


class Requirement(Strict):
    """A condition that parameters must meet together."""

    condition: str = Field(description="A condition over the parameters: `L >= B`.")
    message: str = Field(description="The message where it does not hold.")


class Parameters(BaseModel):
    """Parameters, and conditions across them."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True, defer_build=True)
    __pydantic_extra__: dict[str, ParameterEntry]

    require: list[Requirement] = listed("Conditions across parameters, each with its message.")

    @property
    def entries(self) -> Mapping[str, ParameterEntry]:
        """The parameters by name, in the order written."""
        return self.__pydantic_extra__

    @model_validator(mode="after")
    def _check(self) -> Parameters:
        fail(list(values.names(self.entries)))
        return self
