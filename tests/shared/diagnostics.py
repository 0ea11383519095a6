"""Codes of diagnostics, and statuses of verdicts."""

from collections.abc import Iterable

from taskspec.base.diagnostics import Diagnostic
from taskspec.exact.rules.claim_verdicts import Verdict


def codes(diagnostics: Iterable[Diagnostic]) -> list[str]:
    return [each.code for each in diagnostics]


def with_code(diagnostics: Iterable[Diagnostic], code: str) -> list[Diagnostic]:
    return [each for each in diagnostics if each.code == code]


def statuses(verdicts: Iterable[Verdict]) -> list[str]:
    return [each.status for each in verdicts]
