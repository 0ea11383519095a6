"""The page of the ten tasks beside the paper: it names what the paper prints, row by row, and everything that is corrected."""

import re
from functools import cache

import yaml

from docs.tools import beside
from docs.tools.beside import DOCS
from taskspec.language import registry
from taskspec.language.task.task import Task
from tests.shared.specs import suite_ids

PRINTED = yaml.safe_load((DOCS / "tools" / "printed.yaml").read_text(encoding="utf-8"))


@cache
def sections() -> dict[str, str]:
    found = re.split(r"^## (\w+)$", beside.beside(), flags=re.MULTILINE)
    return dict(zip(found[1::2], found[2::2], strict=True))


def paper_tasks() -> list[Task]:
    return [registry.load(name) for name in suite_ids("derail") if "Seals" not in name]


def test_all_tasks_of_the_paper_are_there_but_those_that_agree() -> None:
    names = {task.name for task in paper_tasks()}
    assert {*PRINTED, "InitShiftLearner"} == names  # which shares a section of the appendix with InitShiftExpert
    assert set(PRINTED) - set(sections()) == {"ProcGoal"}  # its text leaves one thing open, and is right otherwise


def test_rows_quote_the_appendix_word_for_word() -> None:
    for name, text in sections().items():
        _, *rows = re.findall(r"^\|(.* \| .*)\|$", text, re.MULTILINE)
        assert rows
        for row in rows:
            title, printed, _ = row.split(" | ")
            assert printed == "<br>".join(PRINTED[name][title.strip()])


def test_rows_that_contradict_are_there_with_the_reason() -> None:
    contradictions = {"RiskyPath": "Dynamics", "NoisyObs": "Initial state", "Sort": "Rewards"}
    for name, title in contradictions.items():
        assert re.findall(r"^\| ([A-Z][\w ]+) \|", sections()[name], flags=re.MULTILINE) == [title]
        assert f"- *{title}*: in the appendix, " in sections()[name]
    page = "\n".join(sections().values())
    for task in paper_tasks():
        for erratum in task.spec.errata:
            assert not erratum.about or erratum.here in page
