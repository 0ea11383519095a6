"""Shared by all tests: the flag that rewrites golden files, where the specs are, and the invariants of tasks, always on."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium.vector
import pytest
from hypothesis import settings

from taskspec.language import modifiers
from taskspec.language.task import pipeline
from tests.shared.invariants import checked

if TYPE_CHECKING:
    from taskspec.learn.jobs.engines import Workers

pipeline._pipeline = checked(pipeline._pipeline)  # every task that any test builds
modifiers._modified = checked(modifiers._modified)
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")  # tests run in as many processes as there are cores
CACHE = Path(os.environ.get("TASKSPEC_CACHE", Path.home() / ".cache" / "taskspec"))
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(CACHE / "jax"))  # a program is compiled once for all processes
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
settings.register_profile("everyday", max_examples=25, deadline=None)
settings.register_profile("thorough", max_examples=10_000, deadline=None)  # --hypothesis-profile=thorough
settings.load_profile("everyday")
ROOT = Path(__file__).parent.parent
VECTORS = hasattr(gymnasium.vector, "AutoresetMode")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="rewrite the golden files")
    parser.addoption("--first-cases", action="store_true", help="run one case of each test function")
    parser.addoption("--one-in", type=int, default=1, help="with --first-cases, of every so many-th test function")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave a sample, where that is asked: all modules are imported, and a part of their tests runs."""
    if not config.getoption("--first-cases"):
        return
    first: dict[str, pytest.Item] = {}
    for item in items:
        first.setdefault(item.nodeid.partition("[")[0], item)
    items[:] = list(first.values())[:: config.getoption("--one-in")]


def pytest_collection_finish() -> None:
    """Look for garbage seldom, and not in what lasts as long as the run, which is most of what there is."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-golden"))


@pytest.fixture
def kept_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """What TeX logs stays beside the documents that compile."""
    module = import_module("taskspec.show.pages.write")
    monkeypatch.setattr(module, "_SCRATCH", tuple(ending for ending in module._SCRATCH if ending != "log"))


@pytest.fixture
def set_limits(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Sets limits by their names, for one test."""
    from taskspec.base import limits

    def set_them(**values: int) -> None:
        monkeypatch.setenv(limits.VARIABLE, ",".join(f"{k}={v}" for k, v in values.items()))
        limits.limits.cache_clear()

    yield set_them
    monkeypatch.undo()
    limits.limits.cache_clear()


@pytest.fixture(scope="session")
def kept_workers() -> Iterator[Workers]:
    """One process that does the jobs of many tests."""
    from taskspec.learn.jobs.engines import Workers

    with Workers(1) as workers:
        yield workers


WITH_WORKERS = ("taskspec.learn.jobs.running", "taskspec.learn.exam.examining", "taskspec.tools.separation.separate")


@pytest.fixture
def warm(kept_workers: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs are done in the process that is kept, for tests of what comes of them; a new one takes seconds to start."""
    for name in WITH_WORKERS:
        monkeypatch.setattr(f"{name}.Workers", lambda *_: nullcontext(kept_workers))


# -- Gymnasium before 1.1 has no `AutoresetMode`, and we no vector environments ----------------------------------------


def needs_vectors(what: str = "vector environments need Gymnasium 1.1") -> pytest.MarkDecorator:
    """Marks tests that are skipped on an older Gymnasium."""
    return pytest.mark.skipif(not VECTORS, reason=what)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[Any]:
    """Modules that import vector environments are skipped where there are none."""
    return _skipped((yield), collector.path, "E705", "AutoresetMode")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[Any]:
    """So are tests that end in the message which says that there are none."""
    return _skipped((yield), item.path, "E705 missing-extra]: vector environments need")


def _skipped(report: Any, path: Path, *words: str) -> Any:
    if not VECTORS and report.failed and any(word in str(report.longrepr) for word in words):
        report.outcome = "skipped"
        report.longrepr = (str(path), 0, "vector environments need Gymnasium 1.1")
    return report
