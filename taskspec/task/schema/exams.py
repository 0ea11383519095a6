"""The shape of what comes with a suite beside its specs: the diagnoses of its exam, and findings about several learners."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import Field, TypeAdapter

from taskspec.diagnostics import Collector, Diagnostic
from taskspec.source import Document
from taskspec.task.schema import problems
from taskspec.task.schema.check import add_problem, validate
from taskspec.task.schema.fields import Name
from taskspec.task.schema.models import Source
from taskspec.task.schema.problems import Problem
from taskspec.task.schema.typed import Strict

FORMAT = 1
"""The version of both formats that is read here."""
_TASKS = "Tasks of the exam, by name, in the order of reports; all of the suite unless given."
Described = TypeVar("Described", "ExamDocument", "FindingsDocument")


class DiagnosisEntry(Strict):
    """What a pattern of scores usually means."""

    when: str = Field(description="A condition over scores: `score(EarlyTermPos) > 0.9 and score(EarlyTermNeg) < 0`.")
    message: str = Field(description="What it says about the learner, in one sentence.")
    cause: str = Field(description="What usually causes it.")
    try_: str = Field(alias="try", description="What to try.")
    source: Source = Field(description="Where this is known from.")
    unless: list[str] = Field(
        default_factory=list, description="Diagnoses that say more: where one of them holds, this one is not told."
    )


class ExamDocument(Strict):
    """What the exam of a suite asks, and what its results mean."""

    exam: int = Field(description="The version of the format: 1.")
    title: str | None = Field(None, description="Its heading.")
    doc: str | None = Field(None, description="What it is about.")
    tasks: list[str] = Field(default_factory=list, description=_TASKS)
    groups: dict[Name, list[str]] = Field(
        default_factory=dict, description="Names for several tasks, for `all(... for t in group)`."
    )
    diagnoses: dict[Name, DiagnosisEntry] = Field(
        default_factory=dict, description="Rules over the scores of one learner, by name."
    )


class FindingEntry(Strict):
    """A statement of a source about the results of several learners."""

    where: str = Field(description="Where the source says it.")
    says: str = Field(description="What it says, in one sentence.")
    holds: str = Field(description="A condition over scores: `score(GAIL_IM, EarlyTermNeg) < 0`.")
    note: str | None = Field(None, description="Why it is so, or is expected not to be.")


class FindingsDocument(Strict):
    """What a source says about learners, as conditions over their scores."""

    findings: int = Field(description="The version of the format: 1.")
    title: str | None = Field(None, description="Its heading.")
    doc: str | None = Field(None, description="What it is about.")
    source: Source = Field(description="Whose findings they are.")
    tasks: list[str] = Field(default_factory=list, description=_TASKS)
    learners: dict[Name, str] = Field(description="The learners, by the names that conditions use, with what they are.")
    groups: dict[Name, list[str]] = Field(
        default_factory=dict, description="Names for several learners, or for several tasks."
    )
    same: dict[str, str] = Field(
        default_factory=dict, description="Tasks whose results count as those of another, where that was not run."
    )
    instances: dict[Name, str] = Field(
        default_factory=dict, description="Names for tasks at other values of their parameters: `NoisyObs?L=50&M=7`."
    )
    floor: float | None = Field(None, description="Scores below it count as it.")
    drawn: bool = Field(
        False,
        description="Whether `score`, `sd`, `median`, `highest` and `lowest` are of policies that draw their actions.",
    )
    unable: dict[Name, list[str]] = Field(
        default_factory=dict,
        description="Tasks that a learner cannot be run on: `all`, `any` and `most` pass them over.",
    )
    entries: dict[Name, FindingEntry] = Field(description="The findings, by name.")


def check_exam(document: Document) -> tuple[ExamDocument | None, tuple[Diagnostic, ...]]:
    """The exam that a document describes (None where it is not well-formed), and all that is wrong with its shape."""
    return _checked(document, ExamDocument, "exam", "an exam")


def check_findings(document: Document) -> tuple[FindingsDocument | None, tuple[Diagnostic, ...]]:
    """The findings that a document lists (None where it is not well-formed), and all that is wrong with its shape."""
    return _checked(document, FindingsDocument, "findings", "a list of findings")


def _checked(
    document: Document, model: type[Described], key: str, what: str
) -> tuple[Described | None, tuple[Diagnostic, ...]]:
    collector = Collector()
    if not isinstance(document.data, dict):
        message = f"{what} is a mapping of sections, not {problems.kind(document.data)}"
        collector.add("E201", document.span(()), message, f"start it with `{key}: {FORMAT}`")
        return None, collector.diagnostics
    found = validate(document, collector, model)
    version = document.data.get(key)
    if isinstance(version, int) and version != FORMAT:
        hint = f"write `{key}: {FORMAT}`"
        add_problem(collector, document, Problem("E207", (key,), f"format {version} is not known here", hint))
        found = None
    return found, collector.diagnostics


def exam_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of an exam."""
    return _schema(ExamDocument, "taskspec exam")


def findings_schema() -> dict[str, Any]:
    """The JSON Schema (2020-12) of a list of findings."""
    return _schema(FindingsDocument, "taskspec findings")


def _schema(model: type[ExamDocument | FindingsDocument], title: str) -> dict[str, Any]:
    found = TypeAdapter(model).json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found, "title": title}
