"""What pages tell beyond the task itself: scores and verdicts, worked out for them or by `check`."""

from pathlib import Path

import pytest

from taskspec.exact import check
from taskspec.language import registry
from taskspec.show.pages.facts import gather
from taskspec.show.pages.page import page
from taskspec.show.pages.render.html import scores
from taskspec.show.pages.write import write
from tests.shared.sparse import sparse
from tests.shared.specs import paper_ids, varied_files

ROOT = Path(__file__).parents[3]
SPECS = [*paper_ids(), *map(str, varied_files())]


@pytest.mark.parametrize("name", sparse(SPECS, 16), ids=lambda name: Path(name).stem)
def test_a_report_gives_the_facts_that_are_worked_out_without_it(name: str) -> None:
    task = registry.load(name)
    report = check(task, ranges=False)
    assert not report.errors
    assert gather(report) == gather(task)


def test_returns_that_are_not_known_are_said_to_be_unknown(tmp_path: Path) -> None:
    """They were left out, as if nobody had asked."""
    write(["derail/Parabola-v0"], ["markdown"], tmp_path, facts={"derail/Parabola-v0": gather("derail/Parabola-v0")})
    text = (tmp_path / "parabola.md").read_text(encoding="utf-8")
    assert "| optimal return | unknown |" in text and "| worst return | unknown |" in text
    assert gather("derail/RiskyPath-v0").unknown == ()


def test_a_tile_has_the_best_return_that_observations_allow() -> None:
    """In three rooms of four the left door is right, and nobody can see which one it is."""
    assert (
        scores(page("probes/LookAlikes", gather("probes/LookAlikes")))
        == "random 0.5, expert 0.75, best with memory 0.75"
    )
