"""Experiments: which instances of which tasks are measured, as a YAML file; and sweeps, which measure them."""

from __future__ import annotations

from taskspec.experiments.instances import Expanded as Expanded
from taskspec.experiments.instances import Instance as Instance
from taskspec.experiments.instances import expand as expand
from taskspec.experiments.reading import Written as Written
from taskspec.experiments.reading import read as read
from taskspec.experiments.results import Row as Row
from taskspec.experiments.sweeping import Swept as Swept
from taskspec.experiments.sweeping import sweep as sweep

__all__ = ["Expanded", "Instance", "Row", "Swept", "Written", "expand", "read", "sweep"]
