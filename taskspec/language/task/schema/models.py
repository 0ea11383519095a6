"""The sections of a spec and the keys of their entries, for whole specs and for variants.

Expressions stay plain data: what they say is the business of the expression language.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, create_model, model_validator
from pydantic.fields import FieldInfo

from taskspec.language.task.parts import FIGURE_KINDS
from taskspec.language.task.schema import values
from taskspec.language.task.schema.typed import (
    ComponentEntry,
    Constant,
    Defined,
    Expert,
    Expression,
    Grid,
    Horizon,
    Measure,
    MemoryEntry,
    Name,
    Observation,
    ParameterEntry,
    Parameters,
    PartialObservation,
    Primed,
    Reason,
    Requirement,
    Shorthand,
    Strict,
    Warned,
    fail,
    listed,
    named,
    optional,
)
from taskspec.language.task.schema.values import Problem

FORMAT = 1
"""The version of the format that is read here."""
Changeable = Literal[
    "parameters", "constants", "definitions", "noise", "state", "action", "legal", "observation", "horizon", "terminal",
    "discount", "initial", "dynamics", "reward", "absorbing_reward", "measures", "memory", "expert",
]  # fmt: skip
"""Sections that decide what a task does, as far as a source may be wrong about them."""


class Source(Strict):
    """A source of the task."""

    key: str = Field(description="Key of the bibliography entry.")
    where: str | None = optional("Sections, pages or names in the source.")


class Erratum(Strict):
    """A place where the source contradicts itself or is wrong, and what this spec does."""

    source: str = Field(description="The statement of the source, with its place.")
    here: str = Field(description="The choice of this spec.")
    because: str | None = optional("Why.")
    about: list[Changeable] | None = optional(
        "The section, or sections, in which this spec differs: `[reward, horizon]`."
    )


class ClaimEntry(Strict):
    """A statement about exact results that must hold."""

    claim: str = Field(description="A condition over exact results: `optimal_return == 1`.")
    for_: Grid = optional(
        "Parameter values to check it for: `[{L: 3}, {L: 5}]`, or a grid, `{L: [1, 2, 5]}`. Without it: defaults.",
        alias="for",
    )
    under: str | None = optional("The decision model of its `probability`, `measure` or `prefers`: `soft(1)`.")
    where: str | None = optional("Where the source states it.")
    tolerance: float | None = optional("How far apart two equal numbers may be.", ge=0, allow_inf_nan=False)
    episodes: int | None = optional("How many episodes to simulate, when there is no exact model.", ge=1)


class ChangedClaims(Strict):
    """The claims of what a variant is based on, without some, and with others."""

    drop: list[str] | None = optional("Claims that do not hold any more, as they are written there.")
    add: list[Annotated[ClaimEntry, Shorthand("claim")]] | None = optional("Claims that hold besides.")


FOLLOWS = ("initial", "next", "reward", "terminal", "truncated", "observation", "expert")
"""Keys of an example that say what follows."""


class ExampleEntry(Strict):
    """A worked example: a state, an action, and what follows."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": [key]} for key in FOLLOWS]})

    doc: str | None = optional("Its point, in a few words.")
    for_: Grid = optional(
        "Parameter values that it is about: `[{L: 2}]`, or a grid. Without it: defaults.", alias="for"
    )
    state: dict[Name, Expression] | None = optional("The state, as far as what follows depends on it.")
    action: dict[Name, Expression] | None = optional("The action, as far as what follows depends on it.")
    t: int | None = optional("How many steps were taken before; 0 unless given.", ge=0)
    initial: dict[Name, Expression] | None = optional(
        "The first state, or some of it; state and action are left out then."
    )
    next: dict[Name, Expression] | None = optional("The next state, or some of it.")
    reward: Expression | None = optional("The reward of the step.")
    terminal: Expression | None = optional("Whether the step ends the episode.")
    truncated: bool | None = optional("Whether the horizon is reached with it.")
    observation: dict[Name, Expression] | None = optional(
        "The agent's observation: in the next state where there is an action, else in the state."
    )
    expert: dict[Name, Expression] | None = optional("The expert's action in the state.")
    probability: Expression | None = optional(
        "The joint probability of all this. Without it: 1, or as the distributions say."
    )

    @model_validator(mode="after")
    def _check(self) -> ExampleEntry:
        fail(list(_example_problems(self)))
        return self


def _example_problems(entry: ExampleEntry) -> Iterator[Problem]:
    if all(getattr(entry, key) in (None, {}) for key in FOLLOWS):
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

    good: Expression | None = optional("States that are aimed at.")
    bad: Expression | None = optional("States that are to be avoided.")
    end: Expression | None = optional("States in which episodes end.")
    first: Expression | None = optional("A part of the vector.")
    second: Expression | None = optional("Another part of the vector.")


if TYPE_CHECKING:
    FigureKindName = str
else:
    FigureKindName = Literal[tuple(FIGURE_KINDS)]


class FigureEntry(Strict):
    """The figure of the task; the other keys depend on the kind."""

    kind: FigureKindName = Field(description="Kind of figure.")
    at: Expression | None = optional(
        "Column and row on a grid, a point beside a curve, or the two numbers of a portrait."
    )
    map: str | None = optional("The constant that is a grid's map.")
    objects: dict[str, Expression] | None = optional(
        "Other things on a grid, as `word: place`; places outside are not drawn."
    )
    curve: Expression | None = optional("A function of the first of `at`.")
    values: Expression | None = optional("The vector that bars show, the angles of an arm, or what a series shows.")
    highlight: Highlight | None = optional("Colours of states for which a condition holds, or of parts of a vector.")


class AbstractionEntry(Strict):
    """A finite stand-in for a continuous state, with the same rewards and dynamics."""

    state: dict[Name, ComponentEntry] = Field(description="Components of the abstract state.")
    map: dict[Name, Expression] = Field(description="Each of them as a function of the state.")
    initial: dict[Name, Expression] | None = optional("Their initial values.")
    dynamics: dict[Primed, Expression] | None = optional(
        "Their next values, where the task's own dynamics do not apply to them."
    )
    reward: Expression | None = optional("The reward in terms of them.")
    terminal: Expression | None = optional("The end in terms of them.")
    expert: Expert = optional("The expert in terms of them.")


class SymmetryEntry(Strict):
    """Another way to see and to steer the task, in which every policy has one that earns the same."""

    doc: str | None = optional("The exchange or turn, in a few words.")
    observation: dict[Name, Expression] | None = optional(
        "The observation after it, as a function of the task's observation. Components neither named nor used stay."
    )
    action: dict[Name, Expression] | None = optional(
        "The action that then has the effect of the task's action. Components that are not named stay."
    )

    @model_validator(mode="after")
    def _check(self) -> SymmetryEntry:
        if self.observation is None and self.action is None:
            fail([Problem("E203", (), "this symmetry maps nothing", "`observation`, `action`, or both")])
        return self


class Sections(Strict):
    """The sections that a variant may override."""

    title: str | None = optional("A heading for the task.")
    summary: str | None = optional("One sentence on the task.")
    description: str | None = optional("Markdown with $math$.")
    capability: str | None = optional("The one skill that the task isolates: one of the list below.")
    keywords: list[str] = listed("Further words by which the task is found.")
    sources: list[Annotated[Source, Shorthand("key")]] = listed("Where the task comes from.")
    errata: list[Erratum] = listed("Where the source is wrong, and what this spec does.")
    version: int = Field(0, ge=0, description="Version in the environment's id: `-v0`.")
    parameters: Parameters = Field(
        default_factory=Parameters, description="Parameters with defaults, bounds and descriptions."
    )
    constants: dict[Name, Constant] = named(
        "Fixed values and arrays, which may depend on parameters, or be drawn once per instance."
    )
    definitions: dict[Defined, Expression] = named(
        'Named expressions, and functions such as `"p(x)"`. No draws inside.'
    )
    noise: dict[Name, Expression] = named("Named draws, made once per step, or reset, and shared by all uses.")
    state: dict[Name, ComponentEntry] = named("The components of the state.")
    action: dict[Name, ComponentEntry] = named("The components of the action.")
    legal: Expression = optional(
        "Condition over state and action that says which actions may be taken; all, without it."
    )
    observation: Observation = named(
        "The agent's observation, as `name: expression`, which may draw. Without it: the state. "
        "The key `space` chooses the kind of space."
    )
    horizon: Horizon = optional("Steps until an episode is truncated, or `none`.")
    terminal: Expression = optional("Condition that ends the episode, over state, action and next state.")
    discount: Expression = Field(1, description="Discount factor; 1 unless given.")
    initial: dict[Name, Expression] = named("Initial value of each state component; later lines may use earlier ones.")
    dynamics: dict[Primed, Expression] = named(
        "Next value of each state component: `s': s + 1`. Those not named do not change."
    )
    reward: Expression = optional("Reward of a step; `s` is the state left, `s'` the state reached.")
    absorbing_reward: Expression = Field(0, description="Reward per step after the end, when terminal states absorb.")
    measures: dict[Name, Measure] = named(
        "Named quantities beside the reward, written like it: costs, hidden performance."
    )
    expert: Expert = optional("Action of the expert, per component; or `optimal`; or `soft(beta)`.")
    memory: dict[Name, MemoryEntry] = named("The expert's memory of observations and actions, apart from the state.")
    info: list[Literal["old_state", "new_state"]] = listed(
        "Entries of a step's info: `old_state`, the state left, and `new_state`, the state reached."
    )
    roles: Roles | None = optional("Which variants expert and learner act in.")
    claims: list[Annotated[ClaimEntry, Shorthand("claim")]] = listed("Statements about exact results that must hold.")
    examples: list[ExampleEntry] = listed("Worked examples: a state, an action, what follows.")
    accept: dict[Warned, Reason] = named("Warnings that are meant to be, by code, each with the reason.")
    abstraction: AbstractionEntry | None = optional(
        "A finite substitute for a continuous state, to solve the task exactly."
    )
    symmetries: dict[Name, SymmetryEntry] = named(
        "Other ways to see and to steer the task, by name, for the modifier `symmetry`."
    )
    figure: FigureEntry | None = optional("How to draw the task.")


# The whole spec, with its variants: the same sections and keys, with nothing required.
#
# The models of variants are made from the models of the sections, so that a key exists once.


def _partial_type(annotation: Any) -> Any:
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

    require: list[Requirement] | None = optional("Conditions across parameters, each with its message.")

    @model_validator(mode="after")
    def _check(self) -> PartialParameters:
        fail(list(values.names(self.__pydantic_extra__)))
        return self


LIST = "[list]"
CHANGES = "[changes]"
"""Steps of pydantic's paths that no file has."""
Claims = Annotated[
    Annotated[list[Annotated[ClaimEntry, Shorthand("claim")]], Tag(LIST)] | Annotated[ChangedClaims, Tag(CHANGES)],
    Discriminator(lambda value: CHANGES if isinstance(value, dict) else LIST),
]
Variant = _partial(
    Sections,
    "Variant",
    observation=(PartialObservation | None, optional(str(Sections.model_fields["observation"].description))),
    claims=(Claims | None, optional("Other claims; or those of what it is based on, `{drop: [...], add: [...]}`.")),
    extends=(str | None, optional("The file of another spec to start from, relative to this one: `../grid.yaml`.")),
    base=(str | None, optional("The variant to start from. Without it: the spec itself.")),
)


class Head(Strict):
    """The keys that every file begins with, and the variants."""

    taskspec: int = Field(description="Version of the format of this file: 1.", json_schema_extra={"const": FORMAT})
    name: Name = Field(description="Name of the task, and of its environments.")
    variants: dict[Name, Variant] = Field(  # type: ignore[valid-type]
        default_factory=dict, description="Named overrides of any section; each is a task of its own."
    )


class Spec(Head, Sections):
    """A task: one YAML file from which environments, exact models and documentation follow."""


class Extension(Head, Variant):  # type: ignore[valid-type, misc]
    """A spec that says how it differs from a spec in another file."""

    extends: str = Field(description="The file of another spec to start from, relative to this one.")
