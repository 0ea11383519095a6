"""Abstractions that solve nothing."""

from __future__ import annotations

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted


def endless(case: Linted, collector: Collector) -> None:
    """W522: a component of the stand-in that has infinitely many values, so that there is no exact model of it."""
    found = case.results.abstraction
    for c in () if found is None else found.stand_in.state:
        if not c.is_finite:
            message = f"'{c.name}' has infinitely many values, so the abstraction gives no exact results"
            collector.add(
                "W522", case.key("abstraction", "state", c.name), message, "declare an int with `low` and `high`"
            )
