"""Scores, policies, experts as objects, abstractions, reports, compiled sweeps, and the benchmark on a small grid."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from taskspec import exact
from taskspec.exact.model import extract as extraction
from taskspec.exact.solve import solve
from taskspec.exact.solve.bounded import Bounded
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.language.task.legal import with_all_actions
from tests.benchmarks import exact as benchmark
from tests.shared.solved import worst
from tests.shared.specs import spec_file
from tests.shared.tasks import shipped


@pytest.mark.parametrize("tidy", [0, 10**9])
@pytest.mark.parametrize("largest", [True, False])
def test_compiled_sweeps_equal_the_plain_ones(monkeypatch: pytest.MonkeyPatch, tidy: int, largest: bool) -> None:
    kernels = pytest.importorskip("taskspec.exact.solve.kernels_numba")
    monkeypatch.setattr(extraction, "TIDY", tidy)
    for task in (
        benchmark.grid(70, 100),
        with_all_actions(build(source.read_file(spec_file("taxi")))),  # compiled sweeps know no masks
        shipped("risky_path"),
    ):
        model = exact.extract(task)
        found = kernels.extreme_values(Bounded(model), largest)
        plain = (solve.best if largest else worst)(model)
        assert (np.abs(found.value - plain.value) <= found.error + plain.error).all()
        np.testing.assert_allclose(found.value, plain.value, atol=1e-12)
        np.testing.assert_allclose(plain.error, found.error, rtol=1e-6)
        assert (found.error <= 1e-9).all()


def test_the_benchmark_agrees_with_plain_loops() -> None:
    found = [benchmark.ours(45, 60), benchmark.loops(45, 60)]
    assert found[0].value == pytest.approx(found[1].value, abs=1e-12)
    assert "plain Python" in benchmark.table(found)
    other = benchmark.storm(45, 60)
    assert other is None or other.value == pytest.approx(found[0].value, abs=1e-9)
    assert benchmark.memory(exact.extract(benchmark.grid(45))) < 2**20
    assert benchmark.record(found)[0]["total"] == found[0].total


def test_the_benchmark_reads_memory_as_each_system_tells_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    here = benchmark.ours(3, 1).peak_mb
    monkeypatch.setattr("sys.platform", "darwin")
    assert benchmark.ours(3, 1).peak_mb == pytest.approx(here / 1024, rel=0.1)
    monkeypatch.setitem(sys.modules, "resource", None)  # as on Windows
    assert math.isnan(benchmark.ours(3, 1).peak_mb)
