"""Displays and a widget for notebooks."""

from __future__ import annotations

from taskspec.tools.notebook import explore as explore

__all__ = ["explore"]
