"""A plugin of pytest that runs some of the tests that are collected, in a given order."""

from __future__ import annotations

from collections.abc import Sequence

import pytest


def name_of(item: pytest.Item) -> str:
    """The name of a test, the same in every copy of the repository: paths in it are relative."""
    return item.nodeid.replace(f"{item.config.rootpath}/", "")


class Only:
    """Runs the tests with these names, in this order; `failed` is the first that fails."""

    def __init__(self, names: Sequence[str]) -> None:
        self.order = {name: k for k, name in enumerate(names)}
        self.failed = ""

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        wanted = (item for item in items if name_of(item) in self.order)
        items[:] = sorted(wanted, key=lambda item: self.order[name_of(item)])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid
