"""Warnings that a spec accepts: set aside with their reasons, in `--strict` too; a reason for nothing is a warning."""

import pytest

from taskspec import exact
from taskspec.base.diagnostics import SpecError
from tests.shared.sections import build_text

PATH = """
parameters: {n: {type: int, default: 3, low: 1, high: 9}}
state: {s: {type: int, low: 0, high: n}}
action: {a: {type: choice, values: [stay, go]}}
horizon: 2 * n
initial: {s: 0}
dynamics: {s': 'min(s + (a == go), n)'}
reward: s' == n and s < n
expert: {a: stay}
"""


def test_errors_are_not_accepted_and_come_first() -> None:
    with pytest.raises(SpecError, match="E206"):
        build_text(PATH + "accept: {E403: it is meant}\n")
    unsound = PATH.replace("min(s + (a == go), n)", "s + (a == go)") + "accept: {W505: it is meant}\n"
    assert set(exact.check(build_text(unsound)).codes) <= {"E403", "W507"}
