"""Experiments: instances of tasks, listed in a YAML file; sweeps, which measure them; and exams of learners on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taskspec.base.extras import on_demand

if TYPE_CHECKING:
    from taskspec.experiments.exams import LearnersExamined as LearnersExamined
    from taskspec.experiments.exams import examine_all as examine_all
    from taskspec.experiments.experiment_file import ExperimentFile as ExperimentFile
    from taskspec.experiments.experiment_file import read as read
    from taskspec.experiments.instances import Expanded as Expanded
    from taskspec.experiments.instances import Instance as Instance
    from taskspec.experiments.instances import expand as expand
    from taskspec.experiments.sweeping import Measured as Measured
    from taskspec.experiments.sweeping import Swept as Swept
    from taskspec.experiments.sweeping import sweep as sweep

__getattr__ = on_demand(__name__, {
    "LearnersExamined": "taskspec.experiments.exams",
    "examine_all": "taskspec.experiments.exams",
    "ExperimentFile": "taskspec.experiments.experiment_file",
    "read": "taskspec.experiments.experiment_file",
    "Expanded": "taskspec.experiments.instances",
    "Instance": "taskspec.experiments.instances",
    "expand": "taskspec.experiments.instances",
    "Measured": "taskspec.experiments.sweeping",
    "Swept": "taskspec.experiments.sweeping",
    "sweep": "taskspec.experiments.sweeping",
})  # fmt: skip

__all__ = [
    "Expanded", "ExperimentFile", "Instance", "LearnersExamined", "Measured", "Swept", "examine_all", "expand", "read", "sweep",
]  # fmt: skip
