"""Matrices too large for every day."""

from collections.abc import Iterable
from typing import Any

import pytest


def sparse(cases: Iterable[Any], every: int) -> list[Any]:
    """Every so many-th case; those between are slow."""
    marked = []
    for k, case in enumerate(cases):
        values = case if isinstance(case, tuple) else (case,)
        marks = [pytest.mark.slow] if k % every else []
        marked.append(pytest.param(*values, marks=marks))
    return marked
