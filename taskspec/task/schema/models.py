"""The sections of a spec and the keys of their entries. Descriptions show up in editors.

Expressions stay plain data: what they say is the business of the expression language.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from taskspec.task.schema import values
from taskspec.task.schema.fields import (
    Bound,
    Constant,
    Defined,
    Expert,
    Expression,
    Horizon,
    Labels,
    Name,
    Observation,
    Primed,
    Reason,
    Setting,
    Shape,
    Shorthand,
    Warned,
    fail,
)
from taskspec.task.schema.values import Problem

FORMAT = 1
"""The version of the format that is read here."""
Kind = Literal["int", "real", "bool", "choice"]
Changeable = Literal[
    "parameters", "constants", "definitions", "noise", "state", "action", "observation", "horizon", "terminal", "discount",
    "initial", "dynamics", "reward", "absorbing_reward", "expert",
]  # fmt: skip
"""Sections that decide what a task does, as far as a source may be wrong about them."""


class Strict(BaseModel):
    """No unknown keys, no silent conversions, no changes afterwards."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class Typed(Strict):
    """What parameters and components share."""

    low: Bound = Field(None, description="Smallest value, included. Without it: no bound.")
    high: Bound = Field(None, description="Largest value, included. Without it: no bound.")
    values: Labels = Field(
        None,
        description="For a choice: its labels, or a mapping from each label to the number or "
        "vector it stands for in arithmetic.",
    )
    symbol: str | None = Field(None, description="How to print it, in LaTeX: `c_0`, `\\beta`.")
    doc: str | None = Field(None, description="What it is, in a few words.")


EXCLUDED = {
    "int": ("values", "symbols"),
    "real": ("values", "symbols"),
    "bool": ("low", "high", "values", "symbols"),
    "choice": ("low", "high"),
}
"""The keys that an entry of each type does not have."""
DEFAULTS = {"int": ["integer", "string"], "real": ["number", "string"], "bool": ["boolean"], "choice": ["string"]}
"""What the default of each type is written as, in JSON Schema's words; a text is a formula, or a label."""


def _rules(then: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    """What follows from an entry's type, for the JSON Schema."""
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

    type: Kind = Field(description="What kind of value: int, real, bool, or choice (a label).")
    default: Setting = Field(description="The value when none is given.")

    @model_validator(mode="after")
    def _check(self) -> ParameterEntry:
        fail([*_typed_problems(self, self.type), *_default_problems(self)])
        return self


class ComponentEntry(Typed):
    """A part of the state or of the action."""

    model_config = ConfigDict(json_schema_extra=_rules(_component_rule))

    type: Kind = Field(description="What kind of value: int, real, bool, or choice (a label).")
    shape: Shape = Field(None, description="Lengths of a vector or matrix: `[L]`, `[2, 2]`. Without it: one number.")
    symbols: list[str] | None = Field(
        None, description="For a choice: how to print its labels in LaTeX, in the same order."
    )

    @model_validator(mode="after")
    def _check(self) -> ComponentEntry:
        fail([*_typed_problems(self, self.type), *_symbol_problems(self)])
        return self


def _typed_problems(entry: Typed, kind: Kind) -> Iterator[Problem]:
    if kind == "choice" and entry.values is None:
        hint = "list the labels: `values: [left, right]`"
        yield Problem("E203", (), "a choice needs `values`", hint, of_key=True)
    for key in (key for key in EXCLUDED[kind] if getattr(entry, key, None) is not None):
        what = {"choice": "a choice", "bool": "a bool"}.get(kind, f"`type: {kind}`")
        yield Problem("E214", (key,), f"{what} has no `{key}`", None, of_key=True)
    low, high = entry.low, entry.high
    if _is_number(low) and _is_number(high) and low > high:
        yield Problem("E214", ("low",), f"the low end {low} is above the high end {high}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _symbol_problems(entry: ComponentEntry) -> Iterator[Problem]:
    if entry.symbols is None or entry.values is None or len(entry.symbols) == len(entry.values):
        return
    message = f"{len(entry.symbols)} symbols for {len(entry.values)} labels"
    yield Problem("E214", ("symbols",), message)


def _default_problems(entry: ParameterEntry) -> Iterator[Problem]:
    value = entry.default
    wanted = {"int": int, "real": int | float, "bool": bool, "choice": str}[entry.type]
    is_odd_bool = isinstance(value, bool) and entry.type != "bool"
    is_formula = isinstance(value, str) and entry.type in ("int", "real")
    if is_odd_bool or not (isinstance(value, wanted) or is_formula):
        yield Problem("E213", ("default",), f"{values.kind(value)} is not of type {entry.type}")
    elif entry.type == "choice" and value not in (entry.values or ()):
        yield Problem("E213", ("default",), f"`{value}` is not one of the values")
    elif _is_number(value):
        if _is_number(entry.low) and value < entry.low:
            yield Problem("E213", ("default",), f"{value} is below the low end {entry.low}")
        if _is_number(entry.high) and value > entry.high:
            yield Problem("E213", ("default",), f"{value} is above the high end {entry.high}")


class Requirement(Strict):
    """A condition that parameters must meet together."""

    condition: str = Field(description="A condition over the parameters: `L >= B`.")
    message: str = Field(description="What to say when it does not hold.")


class Parameters(BaseModel):
    """Parameters, and conditions across them."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True)
    __pydantic_extra__: dict[str, ParameterEntry]

    require: list[Requirement] = Field(
        default_factory=list, description="Conditions across parameters, each with its message."
    )

    @property
    def entries(self) -> Mapping[str, ParameterEntry]:
        """The parameters by name, in the order written."""
        return self.__pydantic_extra__

    @model_validator(mode="after")
    def _check(self) -> Parameters:
        fail([problem for key in self.entries for problem in values.name(key, (key,))])
        return self


class Source(Strict):
    """Where the task comes from."""

    key: str = Field(description="Key of the bibliography entry.")
    where: str | None = Field(None, description="Sections, pages or names in the source.")


class Erratum(Strict):
    """A place where the source contradicts itself or is wrong, and what this spec does."""

    source: str = Field(description="What the source says, and where.")
    here: str = Field(description="What this spec does instead.")
    because: str | None = Field(None, description="Why.")
    about: list[Changeable] | None = Field(
        None, description="The section, or sections, in which this spec differs: `[reward, horizon]`."
    )


class ClaimEntry(Strict):
    """A statement about exact results that must hold."""

    claim: str = Field(description="A condition over exact results: `optimal_return == 1`.")
    for_: list[dict[str, Any]] | None = Field(
        None,
        alias="for",
        description="Parameter values to check it for: `[{L: 3}, {L: 5}]`. Without it: defaults.",
    )
    under: str | None = Field(None, description="The decision model it is about: `soft(1)`.")
    where: str | None = Field(None, description="Where the source states it.")
    tolerance: float | None = Field(
        None, ge=0, allow_inf_nan=False, description="How far apart two equal numbers may be."
    )
    episodes: int | None = Field(None, ge=1, description="How many episodes to simulate, when there is no exact model.")


class ExampleEntry(Strict):
    """A worked example: a state, an action, and what follows."""

    doc: str | None = Field(None, description="What it shows, in a few words.")
    for_: list[dict[str, Any]] | None = Field(
        None, alias="for", description="Parameter values that it is about: `[{L: 2}]`. Without it: defaults."
    )
    state: dict[Name, Expression] | None = Field(None, description="The state, as far as what follows depends on it.")
    action: dict[Name, Expression] | None = Field(None, description="The action, as far as what follows depends on it.")
    t: int | None = Field(None, ge=0, description="How many steps were taken before; 0 unless given.")
    initial: dict[Name, Expression] | None = Field(
        None, description="The first state, or some of it; state and action are left out then."
    )
    next: dict[Name, Expression] | None = Field(None, description="The next state, or some of it.")
    reward: Expression | None = Field(None, description="What the step pays.")
    terminal: Expression | None = Field(None, description="Whether the step ends the episode.")
    truncated: bool | None = Field(None, description="Whether the horizon is reached with it.")
    observation: dict[Name, Expression] | None = Field(
        None, description="What the agent then sees: of the next state where there is an action, else of the state."
    )
    expert: dict[Name, Expression] | None = Field(None, description="What the expert does in the state.")
    probability: Expression | None = Field(
        None, description="How likely all this together is. Without it: certain, or as the distributions say."
    )

    @model_validator(mode="after")
    def _check(self) -> ExampleEntry:
        fail(list(_example_problems(self)))
        return self


FOLLOWS = ("initial", "next", "reward", "terminal", "truncated", "observation", "expert")
"""Keys of an example that say what follows."""


def _example_problems(entry: ExampleEntry) -> Iterator[Problem]:
    if not any(getattr(entry, key) is not None for key in FOLLOWS):
        yield Problem("E203", (), "this example does not say what follows", f"one of {', '.join(FOLLOWS)}")
    at_start = ("initial", "observation", "probability", "for_", "doc")
    for key in type(entry).model_fields if entry.initial is not None else ():
        if key not in at_start and getattr(entry, key) is not None:
            yield Problem("E214", (key,), f"an example of the first state has no `{key}`", None, of_key=True)


class Roles(Strict):
    """The variants in which the expert demonstrates and the learner acts."""

    expert: str = Field(description="Variant in which the expert demonstrates.")
    learner: str = Field(description="Variant in which the learner acts.")


class Highlight(Strict):
    """Colours by what they are for."""

    good: Expression | None = Field(None, description="States that are aimed at.")
    bad: Expression | None = Field(None, description="States that are to be avoided.")
    end: Expression | None = Field(None, description="States in which episodes end.")
    first: Expression | None = Field(None, description="A part of the vector.")
    second: Expression | None = Field(None, description="Another part of the vector.")


class FigureEntry(Strict):
    """How to draw the task; what is needed besides depends on the kind."""

    kind: Literal["graph", "grid", "curve", "bars", "swaps", "vector"] = Field(description="Kind of figure.")
    at: Expression | None = Field(None, description="Column and row on a grid, or a point beside a curve.")
    map: str | None = Field(None, description="The constant that is a grid's map.")
    curve: Expression | None = Field(None, description="A function of the first of `at`.")
    values: Expression | None = Field(None, description="The vector that bars show.")
    highlight: Highlight | None = Field(
        None, description="Colours of states for which a condition holds, or of parts of a vector."
    )


class AbstractionEntry(Strict):
    """A finite stand-in for a continuous state, with the same rewards and dynamics."""

    state: dict[Name, ComponentEntry] = Field(description="Components of the stand-in state.")
    map: dict[Name, Expression] = Field(description="Each of them as a function of the state.")
    initial: dict[Name, Expression] | None = Field(None, description="Their initial values.")
    dynamics: dict[Primed, Expression] | None = Field(
        None, description="Their next values, where the task's own dynamics do not apply to them."
    )
    reward: Expression | None = Field(None, description="The reward in terms of them.")
    terminal: Expression | None = Field(None, description="The end in terms of them.")
    expert: Expert = Field(None, description="The expert in terms of them.")


class Sections(Strict):
    """The sections that a variant may override."""

    title: str | None = Field(None, description="A heading for the task.")
    summary: str | None = Field(None, description="One sentence on the task.")
    description: str | None = Field(None, description="Markdown with $math$.")
    capability: str | None = Field(None, description="The one skill that the task isolates.")
    sources: list[Annotated[Source, Shorthand("key")]] = Field(
        default_factory=list, description="Where the task comes from."
    )
    errata: list[Erratum] = Field(
        default_factory=list, description="Where the source is wrong, and what this spec does."
    )
    version: int = Field(0, ge=0, description="Version in the environment's id: `-v0`.")
    parameters: Parameters = Field(
        default_factory=Parameters, description="Parameters with defaults, bounds and descriptions."
    )
    constants: dict[Name, Constant] = Field(
        default_factory=dict,
        description="Fixed values and arrays, which may depend on parameters, or be drawn once per instance.",
    )
    definitions: dict[Defined, Expression] = Field(
        default_factory=dict,
        description='Named expressions, and functions such as `"p(x)"`. No draws inside.',
    )
    noise: dict[Name, Expression] = Field(
        default_factory=dict, description="Named draws, made once per step and shared by all uses."
    )
    state: dict[Name, ComponentEntry] = Field(default_factory=dict, description="The components of the state.")
    action: dict[Name, ComponentEntry] = Field(default_factory=dict, description="The components of the action.")
    observation: Observation = Field(
        default_factory=dict,
        description="What the agent sees, as `name: expression`, which may draw. Without it: the "
        "state. The key `space` chooses the kind of space.",
    )
    horizon: Horizon = Field(None, description="Steps until an episode is truncated, or `none`.")
    terminal: Expression = Field(
        None, description="Condition that ends the episode, over state, action and next state."
    )
    discount: Expression = Field(1, description="Discount factor; 1 unless given.")
    initial: dict[Name, Expression] = Field(
        default_factory=dict,
        description="Initial value of each state component; later lines may use earlier ones.",
    )
    dynamics: dict[Primed, Expression] = Field(
        default_factory=dict,
        description="Next value of each state component: `s': s + 1`. Those not named stay.",
    )
    reward: Expression = Field(None, description="Reward of a step; `s` is the state left, `s'` the state reached.")
    absorbing_reward: Expression = Field(0, description="Reward per step after the end, when terminal states absorb.")
    expert: Expert = Field(
        None,
        description="Action of the expert, per component; or `optimal`; or `soft(beta)`.",
    )
    roles: Roles | None = Field(None, description="Which variants expert and learner act in.")
    claims: list[Annotated[ClaimEntry, Shorthand("claim")]] = Field(
        default_factory=list, description="Statements about exact results that must hold."
    )
    examples: list[ExampleEntry] = Field(
        default_factory=list, description="Worked examples: a state, an action, what follows."
    )
    accept: dict[Warned, Reason] = Field(
        default_factory=dict, description="Warnings that are meant to be, by code, each with the reason."
    )
    abstraction: AbstractionEntry | None = Field(
        None, description="A finite stand-in for a continuous state, to solve the task exactly."
    )
    figure: FigureEntry | None = Field(None, description="How to draw the task.")
