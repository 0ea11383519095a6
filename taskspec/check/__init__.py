"""Warnings about sound tasks that can hardly be what their authors meant: one function for each, in one table."""

from __future__ import annotations

from taskspec.check.case import Linted as Linted
from taskspec.check.table import sense as sense
