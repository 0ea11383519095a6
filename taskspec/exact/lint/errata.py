"""Errata that nothing in the spec bears out."""

from __future__ import annotations

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.task.merge import before


def idle_errata(case: Linted, collector: Collector) -> None:
    """W521: an erratum of a variant about a section that is as it is without the variant."""
    task, merged = case.task, case.merged
    based = before(task.document, task.variant)
    if based is None or not merged.data.get("errata") or not merged.is_own(("errata",)):
        return
    for i, entry in enumerate(merged.data["errata"]):
        for j, section in enumerate(entry.get("about") or ()):
            if merged.data.get(section) == based.data.get(section):
                message = f"this erratum is about `{section}`, which this variant does not change"
                collector.add("W521", merged.span(("errata", i, "about", j)), message)
