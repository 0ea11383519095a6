"""The library: every spec says what a reader looks for, cites what the bibliography has, and has a figure."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.tools.library import COMPARED, SUITES
from taskspec import registry, source
from taskspec.base.bibliography import beside
from taskspec.figures import scene
from tests.shared.specs import ROOT, specs

FILES = specs(*(f"tasks/{suite}/*.yaml" for suite in SUITES))
LIBRARY = [name for name in registry.task_ids() if name.partition("/")[0] in SUITES]


def test_there_are_sixty_tasks() -> None:
    assert len(FILES) >= 60
    assert len(LIBRARY) >= 60


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_spec_says_what_a_reader_looks_for(path: Path) -> None:
    data = source.read(path).data
    assert {"summary", "capability", "figure"} <= set(data)
    known = beside([path])
    assert [s["key"] for s in data.get("sources", []) if s["key"] not in known] == []


@pytest.mark.parametrize("name", LIBRARY)
def test_a_task_has_a_figure(name: str) -> None:
    assert scene(registry.load(name)) is not None


def test_comparisons_name_tasks_and_tests() -> None:
    assert {f"{name}-v0" for name in COMPARED} <= set(LIBRARY)
    assert all((ROOT / test).is_file() for _, _, test in COMPARED.values())
