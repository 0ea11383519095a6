"""Shared by all tests: the flag that rewrites golden files, where the specs are, and the invariants of tasks, always on."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

os.environ["TASKSPEC_INVARIANTS"] = "1"  # every task that any test builds, subprocesses included
ROOT = Path(__file__).parent.parent


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="rewrite the golden files")


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-golden"))
