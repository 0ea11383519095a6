"""The shape of experiments, and of the diagnoses and findings that come with a suite."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, TypeAlias, TypeVar

from pydantic import BaseModel, Field, TypeAdapter, WithJsonSchema, model_validator

from taskspec.base.diagnostics import Advice, Collector, Diagnostic
from taskspec.language.source import Document
from taskspec.language.task.schema import values
from taskspec.language.task.schema.check import OTHER_FORMATS, add_problem, fitted, without
from taskspec.language.task.schema.models import Source
from taskspec.language.task.schema.typed import Name, Strict, checked, fail, listed, named, optional
from taskspec.language.task.schema.values import Problem, wrong_kind

FORMAT = 1
"""The version of the format that is read here."""
SPANS = {
    "range": "from the first to below the second, in steps of the third (1 unless given), as Python's `range`",
    "logrange": "from the first to the second, evenly spaced on a logarithmic scale; the third is the number of values",
    "uniform": "drawn between the two, for `sample`",
    "loguniform": "drawn log-uniformly between the two, for `sample`",
}
"""Values that are not listed one by one, by name, with what their numbers mean."""
LENGTHS = {"range": (2, 3), "logrange": (3, 3), "uniform": (2, 2), "loguniform": (2, 2)}


def _values(value: Any) -> Iterator[Problem]:
    match value:
        case dict():
            yield from _span(value)
        case []:
            yield wrong_kind("a value, or a list of some", None)
        case list():
            for i, each in enumerate(value):
                yield from values.below(values.setting(each), i)
        case _:
            yield from values.setting(value)


def _span(value: dict[str, Any]) -> Iterator[Problem]:
    key = next(iter(value), "")
    if key not in SPANS or len(value) > 1:
        for name in value:
            if name not in SPANS:
                yield values.unknown_key(name, tuple(SPANS)).below(name)
                return
        yield wrong_kind("one of `range`, `logrange`, `uniform`, `loguniform`", value)
        return
    numbers, (least, most) = value[key], LENGTHS[key]
    if not isinstance(numbers, list) or not least <= len(numbers) <= most:
        wanted = f"{least} numbers" if least == most else f"{least} or {most} numbers"
        yield wrong_kind(f"{wanted}: {SPANS[key]}", numbers).below(key)
        return
    for i, each in enumerate(numbers):
        if isinstance(each, bool) or not isinstance(each, int | float):
            yield wrong_kind("a number", each).below(key, i)


def _list(value: Any) -> Iterator[Problem]:
    if not isinstance(value, list) or not value:
        yield wrong_kind("a list of values", value)
        return
    yield from _values(value)


def _modifier(value: Any) -> Iterator[Problem]:
    if isinstance(value, str) or (isinstance(value, dict) and len(value) == 1):
        return
    yield wrong_kind("one modifier, such as `sticky: 0.25`", value)


def _file_name(value: Any) -> Iterator[Problem]:
    if isinstance(value, str) and not value.strip():
        yield Problem("E205", (), "an experiment needs a name", "files of results are called by it")


_VALUE = {"type": ["string", "number", "boolean"]}
_NUMBERS: dict[str, Any] = {"type": "array", "items": {"type": "number"}}
_SPANS: dict[str, Any] = {
    "type": "object",
    "properties": {
        name: {**_NUMBERS, "description": doc, "minItems": LENGTHS[name][0], "maxItems": LENGTHS[name][1]}
        for name, doc in SPANS.items()
    },
    "additionalProperties": False,
    "minProperties": 1,
    "maxProperties": 1,
}
_LISTED = {"type": "array", "items": _VALUE, "minItems": 1}
_MODIFIER = {"anyOf": [{"type": "string"}, {"type": "object", "minProperties": 1, "maxProperties": 1}]}
Values: TypeAlias = Annotated[Any, checked(_values), WithJsonSchema({"anyOf": [_VALUE, _LISTED, _SPANS]})]
Listed: TypeAlias = Annotated[Any, checked(_list), WithJsonSchema(_LISTED)]
ModifierEntry: TypeAlias = Annotated[Any, checked(_modifier), WithJsonSchema(_MODIFIER)]


class Sample(Strict):
    """Some of the settings, drawn at random."""

    count: int = Field(ge=1, description="How many settings.")
    seed: int = Field(0, ge=0, description="Of the drawing.")


class TaskEntry(Strict):
    """A task, at every combination of the values of its parameters."""

    task: str = Field(description="An id, or the path of a spec, from the folder of this file.")
    variant: str | None = optional("A variant of the spec.")
    parameters: dict[Name, Values] = named(
        "Values of parameters: one, a list, `{range: [2, 10, 2]}`, `{logrange: [1, 1000, 4]}`, or an expression over the "
        "others, `L // 2`."
    )
    zip: dict[Name, Listed] = named("Lists of values that go together, the first with the first, and so on.")
    modifiers: list[ModifierEntry] = listed("Modifiers of the task, in order.")
    sample: int | Sample | None = optional("How many of the settings, drawn at random.")

    @model_validator(mode="after")
    def _check(self) -> TaskEntry:
        fail(list(_together(self)))
        return self


def _together(entry: TaskEntry) -> Iterator[Problem]:
    lengths = {name: len(each) for name, each in entry.zip.items()}
    for name, length in lengths.items():
        if name in entry.parameters:
            yield Problem("E205", ("zip", name), f"`{name}` has values under `parameters`, too", None, of_key=True)
        if length != next(iter(lengths.values())):
            lengths_in_words = ", ".join(f"{key} has {n}" for key, n in lengths.items())
            yield Problem(
                "E214", ("zip", name), f"the lists are not of one length: {lengths_in_words}", None, of_key=True
            )
    for name, each in entry.parameters.items():
        if entry.sample is None and isinstance(each, dict) and {"uniform", "loguniform"} & set(each):
            hint = "for example `sample: 20`"
            yield Problem("E214", ("parameters", name), "values are drawn for a `sample` only", hint, of_key=True)


class Plot(Strict):
    """The content of the picture."""

    x: Name | None = optional("The parameter along the axis; the first that varies unless given.")
    y: Name | None = optional("The parameter along the other axis of a heat map.")
    show: list[str] = listed("Columns of the table of results to draw.")
    log: list[str] = listed("Which axes are logarithmic: names of parameters, or `value`.")


class Experiment(Strict):
    """An experiment: instances of tasks that are measured, or that learners are examined on, and settings."""

    experiment: int = Field(description="The version of the format: 1.")
    name: Annotated[
        str, checked(_file_name), Field(min_length=1, description="A short name; files of results are called by it.")
    ]
    title: str | None = optional("Its heading.")
    doc: str | None = optional("Its subject.")
    tasks: Annotated[list[TaskEntry], Field(min_length=1, description="The tasks, each at some settings.")]
    measures: list[str] | None = optional("Measures of difficulty, by name; all of them unless given.")
    policies: list[str] = listed("Policies that are rolled out: random, expert, optimal, soft(1), epsilon(0.1).")
    learners: list[str] = listed(
        "Learners that `taskspec exam` trains: `bc`, `paper/gail_im`, `FILE.py:train`, or a file of settings."
    )
    steps: int | None = optional("Environment steps of each training run; 500,000 unless given.", ge=1)
    transitions: int | None = optional("Transitions of expert demonstrations; 10,000 unless given.", ge=1)
    twins: int | None = optional("Twins of each task that learners are examined on; 2 unless given.", ge=0)
    peeks: bool = Field(True, description="Whether it is tried if learners look at rewards that are withheld.")
    seeds: int | None = optional(
        "How often each policy is rolled out (1 unless given), and each learner trained (15), with another seed.", ge=1
    )
    episodes: int = Field(
        1000, ge=2, description="Episodes of each roll-out, and for what cannot be worked out exactly."
    )
    speed: bool = Field(False, description="Whether steps per second are measured.")
    plot: Plot = Field(default_factory=Plot, description="The contents of the picture.")


# The shape of what comes with a suite beside its specs: the diagnoses of its exam, and findings about several learners.

_TASKS = "Tasks of the exam, by name, in the order of reports; all of the suite unless given."
Described = TypeVar("Described", bound=BaseModel)


class DiagnosisEntry(Strict):
    """The usual meaning of a pattern of scores."""

    when: str = Field(description="A condition over scores: `score(EarlyTermPos) > 0.9 and score(EarlyTermNeg) < 0`.")
    message: str = Field(description="Statement about the learner, in one sentence.")
    cause: str = Field(description="The usual cause.")
    try_: str = Field(alias="try", description="Advice.")
    source: Source = Field(description="Where this is known from.")
    unless: list[str] = listed("Diagnoses that say more: where one of them holds, this one is not told.")
    alone: bool = Field(False, description="If it holds, no other diagnosis is given.")
    place: bool = Field(
        False,
        description="It says where to look: it is told where no mistake is named, and no diagnosis but such ones holds.",
    )
    mistakes: list[str] = listed(
        "Mistakes that it stands for: where learned values are known, and none of these explains them, it is not told."
    )


class Evaluation(Strict):
    """A longer horizon, on which policies are scored as well."""

    horizon: Annotated[str, Field(pattern=r"^[1-9][0-9]* \* h$")] | Annotated[int, Field(ge=1)] = Field(
        description="A longer horizon: a number of steps, or a multiple of the task's own: `3 * h`."
    )

    def longer_than(self, horizon: int | None) -> int | None:
        """Horizon of this evaluation; None where it is not longer than the task's."""
        if horizon is None:
            return None
        if isinstance(self.horizon, int):
            steps = self.horizon
        else:
            steps = int(self.horizon.split()[0]) * horizon
        if steps <= horizon:
            return None
        return steps


class ExamDocument(Strict):
    """The tasks of a suite's exam, and the meaning of its results."""

    exam: int = Field(description="The version of the format: 1.")
    title: str | None = optional("Its heading.")
    doc: str | None = optional("Its subject.")
    tasks: list[str] = listed(_TASKS)
    steps: int | None = optional("Environment steps of each training run; 500,000 unless given.", ge=1)
    groups: dict[Name, list[str]] = named("Names for several tasks, for `all(... for t in group)`.")
    same: dict[str, str] = named("Tasks whose results stand in for another task that was not run; for findings, too.")
    evaluate: Evaluation | None = optional("A longer horizon, on which policies are scored as well.")
    diagnoses: dict[Name, DiagnosisEntry] = named("Rules over the scores of one learner, by name.")


class FindingEntry(Strict):
    """A statement of a source about the results of several learners."""

    about: str | None = optional("The learners that it is about, by which a picture groups findings.")
    where: str = Field(description="Where the source says it.")
    says: str = Field(description="The statement, in one sentence.")
    holds: str = Field(description="A condition over scores: `score(GAIL_IM, EarlyTermNeg) < 0`.")
    note: str | None = optional("Why it is so, or is expected not to be.")


class FindingsDocument(Strict):
    """Statements of a source about learners, as conditions over their scores."""

    findings: int = Field(description="The version of the format: 1.")
    title: str | None = optional("Its heading.")
    doc: str | None = optional("Its subject.")
    source: Source = Field(description="Whose findings they are.")
    tasks: list[str] = listed(_TASKS)
    learners: dict[Name, str] = Field(description="The learners, by the names that conditions use, with what they are.")
    groups: dict[Name, list[str]] = named("Names for several learners, or for several tasks.")
    instances: dict[Name, str] = named("Names for tasks at other values of their parameters: `NoisyObs?L=50&M=7`.")
    floor: float | None = optional("Scores below it count as it.")
    drawn: bool = Field(
        False,
        description="Whether `score`, `sd`, `median`, `highest` and `lowest` are of policies that draw their actions.",
    )
    unable: dict[Name, list[str]] = named(
        "Tasks that a learner cannot be run on: `all`, `any` and `most` pass them over."
    )
    entries: dict[Name, FindingEntry] = Field(description="The findings, by name.")


def check_document(document: Document, model: type[Described]) -> tuple[Described | None, tuple[Diagnostic, ...]]:
    """Return a document as an experiment, an exam or findings, and what is wrong with its shape.

    Entries that are wrong are left out, so that the rest can be checked, too; None where it needs them.
    """
    key = next(iter(model.model_fields))
    collector = Collector()
    if not isinstance(document.data, dict):
        message = f"{OTHER_FORMATS[key][0]} is a mapping of sections, not {values.kind(document.data)}"
        collector.add("E201", document.span(()), message, f"start it with `{key}: {FORMAT}`")
        return None, collector.diagnostics
    value, problems = fitted(document.data, model)
    for problem in problems:
        add_problem(collector, document, problem)
    if value is None:
        rest, _ = without(document.data, [problem.path for problem in problems])
        value, _ = fitted(rest, model)
    version = document.data.get(key)
    if isinstance(version, int) and version != FORMAT:
        message = f"format {version} is not known here"
        hint = Advice(f"write `{key}: {FORMAT}`", str(version), str(FORMAT))
        add_problem(collector, document, Problem("E207", (key,), message, hint))
        value = None
    return value, collector.diagnostics


def document_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of experiments, exams or findings."""
    schema = TypeAdapter(model).json_schema(by_alias=True)
    title = f"taskspec {next(iter(model.model_fields))}"
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": title}
