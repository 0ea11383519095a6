"""The page of the ten tasks beside the paper: it names what the paper prints, row by row, and everything that is corrected."""

from __future__ import annotations

import re
from functools import cache

import yaml

from taskspec import registry
from tests.shared.scripts import DOCS, script

PRINTED = yaml.safe_load((DOCS / "printed.yaml").read_text(encoding="utf-8"))


@cache
def sections() -> dict[str, str]:
    found = re.split(r"^## (\w+)$", script("beside").beside(), flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def test_all_tasks_of_the_paper_are_there() -> None:
    ids = [i.partition("/")[2].partition("-v")[0] for i in registry.task_ids() if i.startswith("derail/")]
    own = {i for i in ids if not i.endswith("Seals")}
    assert {*sections(), "InitShiftLearner"} == own  # which shares a section of the appendix with InitShiftExpert


def test_every_printed_row_stands_beside_one_of_ours_or_a_gap() -> None:
    for name, rows in PRINTED.items():
        cells = [line.strip("|").split(" | ") for line in sections()[name].splitlines() if line.startswith("| ")]
        left = {re.sub(" <span.*", "", row[0].strip()): row[1] for row in cells[1:]}
        for title, lines in rows.items():
            assert left[title] == "<br>".join(lines)
        assert all(len(row) == 3 for row in cells)


def test_rows_that_contradict_are_marked_and_told() -> None:
    contradictions = {"RiskyPath": "Dynamics", "NoisyObs": "Initial state", "Sort": "Rewards"}
    for name, title in contradictions.items():
        marked = re.findall(r"^\| ([\w ]+) <span class=\"differs\">≠</span> \|", sections()[name], flags=re.MULTILINE)
        assert marked == [title]
        assert f"- *{title}*: in the appendix, " in sections()[name]
    assert "≠" not in sections()["ProcGoal"]  # whose text leaves one thing open, and is right otherwise
    wrong = {erratum for i in registry.task_ids() if i.startswith("derail/") and "Seals" not in i
             for erratum in (e.here for e in registry.load(i).spec.errata if e.about)}  # fmt: skip
    assert all(any(here in section for section in sections().values()) for here in wrong)
