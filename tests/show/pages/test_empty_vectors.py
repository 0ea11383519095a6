"""Vectors without elements: a parameter that counts something may be 0."""

from pathlib import Path

from taskspec.exact import check
from taskspec.show.pages.facts import gather
from taskspec.show.pages.write import write
from tests.language.expressions.test_empty_vectors import DISTRACTED, nothing


def test_nothing_is_checked_and_printed(tmp_path: Path) -> None:
    task = nothing(DISTRACTED, M=0)
    report = check(task)
    assert report.codes == []
    assert [v.status for v in report.verdicts] == ["proved"]
    for path in write([task], ["latex", "html", "markdown"], tmp_path, facts={task.id: gather(task)}):
        if path.name == "distracted.md":
            assert r"$\mathrm{noise} \in \mathbb{R}^M$ (M = 0: $\mathrm{noise} \in \mathbb{R}^0$)" in path.read_text(
                encoding="utf-8"
            )
