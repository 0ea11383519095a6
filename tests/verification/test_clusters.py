"""Sweeps and exams on a Dask cluster: whatever is killed, they go on, and come to what they come to on one machine."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from taskspec.base.extras import is_installed
from tests.verification.clusters import killed

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="processes are killed by signals"),
    pytest.mark.skipif(not is_installed("distributed"), reason="Dask is not installed"),
]


def test_a_cluster_that_is_killed_changes_no_result(tmp_path: Path) -> None:
    """60 instances and 60 trials here; `python -m tests.verification.clusters` does the same with 2,000 of each."""
    killed(tmp_path, 60, say=print)
