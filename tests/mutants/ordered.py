"""A plugin of pytest: of the tests that are collected only those in `chosen.txt` are run, in its order."""

from __future__ import annotations

from pathlib import Path

import pytest


def name_of(item: pytest.Item) -> str:
    """The name of a test, the same in every copy of the repository: paths in it are relative."""
    return item.nodeid.replace(f"{item.config.rootpath}/", "")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    order = {name: k for k, name in enumerate(Path("chosen.txt").read_text().splitlines())}
    config.hook.pytest_deselected(items=[item for item in items if name_of(item) not in order])
    items[:] = sorted((item for item in items if name_of(item) in order), key=lambda item: order[name_of(item)])
