"""Which tests run which lines of the rooms, and how long each takes: one process and one file of JSON for each file of tests.

    python -m tests.verification.mutants.cover tests/language/expressions/test_bounds.py map/test_bounds.json

runs one file under coverage.py, test by test. What a test runs in processes of its own is not seen.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import coverage
import pytest

from tests.verification.mutants.ordered import name_of
from tests.verification.mutants.rooms import ROOMS, ROOT


class ByTest:
    """A plugin of pytest: lines that run are noted under the test that runs them."""

    def __init__(self, watch: coverage.Coverage) -> None:
        self.watch = watch
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[Any]:
        name = name_of(item)
        self.watch.switch_context(name)
        begun = time.perf_counter()
        try:
            return (yield)
        finally:
            self.seconds[name] = round(time.perf_counter() - begun, 4)
            self.watch.switch_context("")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[Any]:
        """What fails under tracing as it is, or is skipped, can tell nothing."""
        report = yield
        if not report.passed:
            self.failed.add(name_of(item))
        return report


def lines(watch: coverage.Coverage, tests: list[str]) -> dict[str, dict[int, list[int]]]:
    """By file and line the numbers of the tests that run it."""
    number = {test: k for k, test in enumerate(tests)}
    data = watch.get_data()
    found = {}
    for path in data.measured_files():
        by_line = data.contexts_by_lineno(path)
        known = {line: [number[t] for t in ran if t in number] for line, ran in by_line.items()}
        found[str(Path(path).relative_to(ROOT))] = {line: ran for line, ran in known.items() if ran}
    return found


def main(tests: str, out: Path) -> int:
    folders = [str(ROOT / room.folder / "*") for room in ROOMS.values()]
    watch = coverage.Coverage(data_file=None, config_file=False, include=folders)
    by_test = ByTest(watch)
    watch.start()
    status = pytest.main([tests, "-q", "-p", "no:cacheprovider"], plugins=[by_test])
    watch.stop()
    ran = [test for test in by_test.seconds if test not in by_test.failed]
    record = {"seconds": [by_test.seconds[t] for t in ran], "tests": ran, "lines": lines(watch, ran)}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(record))
    return int(status)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2]).absolute()))
