"""The shape of a spec, before any expression is read: the one package that imports pydantic."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taskspec.lazily import on_demand

if TYPE_CHECKING:
    from taskspec.task.schema.check import check_shape as check_shape
    from taskspec.task.schema.check import remainder as remainder
    from taskspec.task.schema.check import validated as validated
    from taskspec.task.schema.exams import DiagnosisEntry as DiagnosisEntry
    from taskspec.task.schema.exams import ExamDocument as ExamDocument
    from taskspec.task.schema.exams import FindingEntry as FindingEntry
    from taskspec.task.schema.exams import FindingsDocument as FindingsDocument
    from taskspec.task.schema.exams import check_exam as check_exam
    from taskspec.task.schema.exams import check_findings as check_findings
    from taskspec.task.schema.exams import exam_schema as exam_schema
    from taskspec.task.schema.exams import findings_schema as findings_schema
    from taskspec.task.schema.experiments import SPANS as SPANS
    from taskspec.task.schema.experiments import Experiment as Experiment
    from taskspec.task.schema.experiments import TaskEntry as TaskEntry
    from taskspec.task.schema.experiments import check_experiment as check_experiment
    from taskspec.task.schema.experiments import experiment_schema as experiment_schema
    from taskspec.task.schema.export import json_schema as json_schema
    from taskspec.task.schema.models import AbstractionEntry as AbstractionEntry
    from taskspec.task.schema.models import ClaimEntry as ClaimEntry
    from taskspec.task.schema.models import Erratum as Erratum
    from taskspec.task.schema.models import FigureEntry as FigureEntry
    from taskspec.task.schema.models import Roles as Roles
    from taskspec.task.schema.models import Source as Source
    from taskspec.task.schema.results import shape_problem as shape_problem
    from taskspec.task.schema.typed import ComponentEntry as ComponentEntry
    from taskspec.task.schema.typed import MemoryEntry as MemoryEntry
    from taskspec.task.schema.typed import ParameterEntry as ParameterEntry
    from taskspec.task.schema.typed import Parameters as Parameters
    from taskspec.task.schema.typed import Requirement as Requirement
    from taskspec.task.schema.variants import Spec as Spec

__getattr__ = on_demand(__name__, {
    "check_shape": "taskspec.task.schema.check",
    "remainder": "taskspec.task.schema.check",
    "validated": "taskspec.task.schema.check",
    "shape_problem": "taskspec.task.schema.results",
    "DiagnosisEntry": "taskspec.task.schema.exams",
    "ExamDocument": "taskspec.task.schema.exams",
    "FindingEntry": "taskspec.task.schema.exams",
    "FindingsDocument": "taskspec.task.schema.exams",
    "check_exam": "taskspec.task.schema.exams",
    "check_findings": "taskspec.task.schema.exams",
    "exam_schema": "taskspec.task.schema.exams",
    "findings_schema": "taskspec.task.schema.exams",
    "SPANS": "taskspec.task.schema.experiments",
    "Experiment": "taskspec.task.schema.experiments",
    "TaskEntry": "taskspec.task.schema.experiments",
    "check_experiment": "taskspec.task.schema.experiments",
    "experiment_schema": "taskspec.task.schema.experiments",
    "json_schema": "taskspec.task.schema.export",
    "AbstractionEntry": "taskspec.task.schema.models",
    "ClaimEntry": "taskspec.task.schema.models",
    "Erratum": "taskspec.task.schema.models",
    "FigureEntry": "taskspec.task.schema.models",
    "Roles": "taskspec.task.schema.models",
    "Source": "taskspec.task.schema.models",
    "ComponentEntry": "taskspec.task.schema.typed",
    "MemoryEntry": "taskspec.task.schema.typed",
    "ParameterEntry": "taskspec.task.schema.typed",
    "Parameters": "taskspec.task.schema.typed",
    "Requirement": "taskspec.task.schema.typed",
    "Spec": "taskspec.task.schema.variants",
})  # fmt: skip
