"""Experiments: instances of tasks, listed in a YAML file; sweeps, which measure them; and exams of learners on them."""

from __future__ import annotations

from taskspec.learn.experiments.exams import LearnersExamined as LearnersExamined
from taskspec.learn.experiments.exams import examine_all as examine_all
from taskspec.learn.experiments.experiment_file import ExperimentFile as ExperimentFile
from taskspec.learn.experiments.experiment_file import read as read
from taskspec.learn.experiments.instances import Expanded as Expanded
from taskspec.learn.experiments.instances import Instance as Instance
from taskspec.learn.experiments.instances import expand as expand
from taskspec.learn.experiments.sweeping import Measured as Measured
from taskspec.learn.experiments.sweeping import Swept as Swept
from taskspec.learn.experiments.sweeping import sweep as sweep

__all__ = [
    "Expanded",
    "ExperimentFile",
    "Instance",
    "LearnersExamined",
    "Measured",
    "Swept",
    "examine_all",
    "expand",
    "read",
    "sweep",
]
