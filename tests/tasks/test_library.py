"""The library: every spec says what a reader looks for, cites what the bibliography has, and has a figure."""

from pathlib import Path

from docs.tools.library import COMPARED, EVIDENCE
from taskspec.language import registry, source
from taskspec.language.registry import CAPABILITIES
from taskspec.show.bibliography import beside
from taskspec.show.figures import scene
from tests.shared.for_each import for_each
from tests.shared.specs import ROOT, specs

FILES = specs(*(f"tasks/{suite}/*.yaml" for suite in COMPARED))
LIBRARY = [name for name in registry.task_ids() if name.partition("/")[0] in COMPARED]


def test_there_are_sixty_tasks() -> None:
    assert len(FILES) >= 60
    assert len(LIBRARY) >= 60


@for_each("path", FILES)
def test_a_spec_says_what_a_reader_looks_for(path: Path) -> None:
    data = source.read_file(path).data
    assert {"summary", "capability", "figure"} <= set(data)
    known = beside([path])
    assert [s["key"] for s in data.get("sources", []) if s["key"] not in known] == []


def test_capabilities_are_those_of_the_list_and_each_has_a_task() -> None:
    used = {registry.load(name).capability for name in registry.task_ids()}
    assert used == set(CAPABILITIES)


@for_each("name", LIBRARY)
def test_a_task_has_a_figure(name: str) -> None:
    assert scene(registry.load(name)) is not None


def test_every_task_is_compared_or_argued_for_once() -> None:
    bases = [name for name in LIBRARY if registry.load(name).source.merged.variant is None]
    compared = [f"{name}-v0" for found in EVIDENCE for name in found.tasks]
    assert sorted(compared) == sorted(bases)


def test_comparisons_name_tests() -> None:
    for found in EVIDENCE:
        if found.test is not None:
            name = found.test if found.test.endswith(".py") else f"tests/verification/originals/test_{found.test}.py"
            text = (ROOT / name).read_text()
            assert all(task in text or spec_name(task) in text for task in found.tasks)
        else:
            assert found.how.startswith("argued")


def spec_name(task: str) -> str:
    """How a test may name a task by its file."""
    return Path(registry.load(task).source.document.origin.name).stem
