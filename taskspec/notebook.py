"""Displays and a widget for notebooks."""

from __future__ import annotations

from taskspec.tools.notebook import explore as explore
from taskspec.tools.notebook import html as html

__all__ = ["explore"]
