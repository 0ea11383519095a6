"""Experiments: which instances of which tasks are measured, as a YAML file; and sweeps, which measure them."""

from __future__ import annotations

from taskspec.experiments.instances import Expanded as Expanded
from taskspec.experiments.instances import Instance as Instance
from taskspec.experiments.instances import expand as expand
from taskspec.experiments.reading import ExperimentFile as ExperimentFile
from taskspec.experiments.reading import read as read
from taskspec.experiments.results import Measured as Measured
from taskspec.experiments.sweeping import Swept as Swept
from taskspec.experiments.sweeping import sweep as sweep

__all__ = ["Expanded", "ExperimentFile", "Instance", "Measured", "Swept", "expand", "read", "sweep"]
