"""Errors of wrong specs and calls, codes of diagnostics, and statuses of verdicts."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact.rules.claim_verdicts import Verdict, verdicts
from tests.shared.sections import build_text


def refusal(call: Callable[..., Any], *args: Any, **options: Any) -> SpecError:
    """The error with which a call refuses its arguments."""
    with pytest.raises(SpecError) as caught:
        call(*args, **options)
    return caught.value


def codes(diagnostics: Iterable[Diagnostic]) -> list[str]:
    return [each.code for each in diagnostics]


def with_code(diagnostics: Iterable[Diagnostic], code: str) -> list[Diagnostic]:
    return [each for each in diagnostics if each.code == code]


def statuses(verdicts: Iterable[Verdict]) -> list[str]:
    return [each.status for each in verdicts]


def status(text: str, claim: str, **parameters: Any) -> str:
    """The status of a claim about the task of a spec."""
    (verdict,) = verdicts(build_text(f"{text}claims:\n  - {claim}\n", **parameters))
    return verdict.status
