"""Warnings about what a spec says of itself: the capability that it isolates, and its sources."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.base.bibliography import NAME, beside
from taskspec.base.diagnostics import suggest
from taskspec.exact.check.warning_context import Doubt, LintContext
from taskspec.language.task.schema.capabilities import CAPABILITIES


def unknown_capability(context: LintContext) -> Iterator[Doubt]:
    """Yield a capability that is not in the closed list."""
    written = context.task.capability
    if written is None or written in CAPABILITIES:
        return
    hint = suggest(written, CAPABILITIES) or f"choose one of {', '.join(CAPABILITIES)}; other words go to `keywords`"
    yield Doubt(context.merged.span(("capability",)), f"'{written}' is not in the list of capabilities", hint)


def unknown_sources(context: LintContext) -> Iterator[Doubt]:
    """Yield sources whose keys no bibliography beside the spec has."""
    known = beside([context.task.source.document.origin.name])
    for i, source in enumerate(context.task.spec.sources):
        if source.key not in known:
            message = f"no {NAME} has the source '{source.key}', and pages print the key"
            hint = suggest(source.key, known) or f"add an entry to {NAME} beside the spec, or in the folder above"
            yield Doubt(context.merged.span(("sources", i)), message, hint)
