"""Random specs whose states keep to no range: nothing is read outside, nothing crashes, and all backends agree.

Thousands of them: `python -m tests.verification.fuzz.hostile --seconds 600`.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.verification.fuzz.hostile import faults, task_of, walk
from tests.verification.fuzz.kernels import OutsideError, Table

BUILT = [seed for seed in range(40) if task_of(seed) is not None]


def test_most_of_them_are_taken() -> None:
    assert len(BUILT) > 15


@pytest.mark.parametrize("seed", [*BUILT[:10], *(pytest.param(s, marks=pytest.mark.slow) for s in BUILT[10:])])
def test_nothing_is_read_outside(seed: int) -> None:
    assert faults(seed) == []


@pytest.mark.parametrize("seed", [BUILT[0], *(pytest.param(s, marks=pytest.mark.slow) for s in BUILT[1:])])
def test_nothing_is_read_outside_by_compiled_code(seed: int) -> None:
    """By Numba with its own check of bounds, and by kernels and XLA as they are used."""
    pytest.importorskip("numba")
    pytest.importorskip("jax")
    task = task_of(seed)
    assert task is not None
    assert walk(task, compiled=True) == []
    assert faults(seed, ("numba", "jax")) == []


@pytest.mark.parametrize("i", [-1, 3, 10**9])
def test_a_look_up_outside_is_noticed(i: int) -> None:
    with pytest.raises(OutsideError):
        Table("C0", np.zeros(3))[i]
