"""Experiments: which instances of which tasks are measured, as a YAML file; and sweeps, which measure them."""

from __future__ import annotations

from taskspec.experiments.instances import Expanded as Expanded
from taskspec.experiments.instances import Instance as Instance
from taskspec.experiments.instances import expand as expand
from taskspec.experiments.reading import Written as Written
from taskspec.experiments.reading import read as read

__all__ = ["Expanded", "Instance", "Written", "expand", "read"]
