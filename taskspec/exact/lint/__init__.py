"""Warnings about sound tasks that can hardly be what their authors meant: one function for each, in one table."""

from __future__ import annotations

from taskspec.exact.lint.case import Linted as Linted
from taskspec.exact.lint.run import sense as sense
