"""The library: every spec says what a reader looks for, cites what the bibliography has, and has a figure."""

from collections import Counter
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
    for source_ in data.get("sources", []):
        assert source_["key"] in known


def test_capabilities_are_those_of_the_list_and_each_has_a_task() -> None:
    used = {registry.load(name).capability for name in registry.task_ids()}
    assert used == set(CAPABILITIES)


@for_each("name", LIBRARY)
def test_a_task_has_a_figure(name: str) -> None:
    assert scene(registry.load(name)) is not None


def test_every_task_is_compared_or_argued_for_once() -> None:
    compared: Counter[str] = Counter()
    for found in EVIDENCE:
        compared.update(found.tasks)
    for name in LIBRARY:
        if registry.load(name).source.merged.variant is None:
            assert compared.pop(name.removesuffix("-v0")) == 1
    assert not compared


def test_comparisons_name_tests() -> None:
    for found in EVIDENCE:
        if found.test is None:
            assert found.how.startswith("argued")
            continue
        name = found.test if found.test.endswith(".py") else f"tests/verification/originals/test_{found.test}.py"
        text = (ROOT / name).read_text()
        for task in found.tasks:
            assert task in text or spec_name(task) in text


def spec_name(task: str) -> str:
    """How a test may name a task by its file."""
    return Path(registry.load(task).source.document.origin.name).stem
