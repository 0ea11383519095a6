"""What is called proved is true: claims that rounding, slow chains or rare outcomes used to get wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from taskspec.cli.app import app
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.show.pages.facts import gather
from tests.exact.check.test_proofs import LADDER, RARE

STATUSES = {
    "exact and proved": (LADDER, "random_return == 2**-L", "proved", "exact", "proved"),
    "tested on episodes": (RARE, "random_return < 1e6", "tested", "estimated", "tested in 1000 episodes"),
    "undecided": (LADDER, "random_return < 0.1 * 10 * 2**-L", "undecided", "exact", "not decided"),
    "false": (LADDER, "random_return == 1", "false", "exact", "does not hold"),
    "contradicted": (RARE, "random_return > 1e6", "contradicted", "estimated", "does not hold"),
}


@pytest.mark.parametrize("name", STATUSES)
def test_statuses_are_the_same_wherever_they_are_told(name: str, tmp_path: Path) -> None:
    text, claim, of_claim, of_number, on_page = STATUSES[name]
    path = tmp_path / "spec.yaml"
    path.write_text(f"{text}claims:\n  - {claim}\n", encoding="utf-8")
    (told,) = json.loads(printed("check", str(path), "--json"))["tasks"][0]["claims"]
    assert (told["status"], told["claim"]) == (of_claim, claim)
    assert json.loads(printed("solve", str(path), "--json"))["random"]["status"] == of_number
    assert re.search(
        "exact" if of_number == "exact" else "(95 % CI,|in all of) 1,000 episodes", printed("solve", str(path))
    )
    (verdict_,) = gather(build(source.read_file(path))).verdicts
    assert verdict_.text == on_page


def printed(*arguments: str) -> str:
    return CliRunner().invoke(app, list(arguments)).stdout
