"""The page of the ten tasks beside the paper: it names what the paper prints, row by row, and everything that is corrected."""

import re
from functools import cache

import yaml

from docs.tools import beside
from docs.tools.beside import DOCS
from taskspec.language import registry

PRINTED = yaml.safe_load((DOCS / "tools" / "printed.yaml").read_text(encoding="utf-8"))


@cache
def sections() -> dict[str, str]:
    found = re.split(r"^## (\w+)$", beside.beside(), flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def test_all_tasks_of_the_paper_are_there_but_those_that_agree() -> None:
    ids = [i.partition("/")[2].partition("-v")[0] for i in registry.task_ids() if i.startswith("derail/")]
    own = {i for i in ids if not i.endswith("Seals")}
    assert {*PRINTED, "InitShiftLearner"} == own  # which shares a section of the appendix with InitShiftExpert
    assert set(PRINTED) - set(sections()) == {"ProcGoal"}  # its text leaves one thing open, and is right otherwise


def test_rows_quote_the_appendix_word_for_word() -> None:
    for name, text in sections().items():
        rows = [line.strip("|").split(" | ") for line in text.splitlines() if line.startswith("| ")]
        assert len(rows) > 1 and all(len(row) == 3 for row in rows)
        assert all(printed == "<br>".join(PRINTED[name][title.strip()]) for title, printed, _ in rows[1:])


def test_rows_that_contradict_are_there_with_the_reason() -> None:
    contradictions = {"RiskyPath": "Dynamics", "NoisyObs": "Initial state", "Sort": "Rewards"}
    for name, title in contradictions.items():
        assert re.findall(r"^\| ([A-Z][\w ]+) \|", sections()[name], flags=re.MULTILINE) == [title]
        assert f"- *{title}*: in the appendix, " in sections()[name]
    wrong = {erratum for i in registry.task_ids() if i.startswith("derail/") and "Seals" not in i
             for erratum in (e.here for e in registry.load(i).spec.errata if e.about)}  # fmt: skip
    assert all(any(here in section for section in sections().values()) for here in wrong)
