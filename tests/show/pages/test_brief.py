"""`docs --brief`: what defines the tasks of the paper, on about as many pages as the paper took."""

import re
from pathlib import Path

import pytest

from taskspec import load
from taskspec.exact import Return
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.pages.facts import Facts
from taskspec.show.pages.page import families
from taskspec.show.pages.write import gather_pages, write
from tests.shared import paper
from tests.shared.commands import Done
from tests.shared.paper import TEX
from tests.shared.specs import spec_file

PAPER = [
    "derail/RiskyPath-v0", "derail/EarlyTermPos-v0", "derail/EarlyTermNeg-v0", "derail/Parabola-v0",
    "derail/LargestSum-v0", "derail/InitShiftExpert-v0", "derail/InitShiftLearner-v0", "derail/ProcGoal-v0",
    "derail/Sort-v0", "derail/NoisyObs-v0", "derail/Branching-v0",
]  # fmt: skip


def test_tasks_of_one_spec_share_a_section_that_says_what_differs(tmp_path: Path) -> None:
    facts = {name: Facts({"optimal return": Return(i)}) for i, name in enumerate(PAPER)}
    write(PAPER, ["latex"], tmp_path, brief=True, facts=facts)
    assert not (tmp_path / "early-term-neg.tex").exists()
    text = (tmp_path / "early-term-pos.tex").read_text()
    assert r"\texttt{EarlyTermPos}, \texttt{EarlyTermNeg}: Early termination}" in text
    assert r"\label{task:early-term-pos}" in text and r"\label{task:early-term-neg}" in text
    first, second = text.split(r"\par\smallskip\noindent\texttt{EarlyTermNeg}")
    assert re.findall(r"\\item\[(.*?)\] (.*?)\.$", second, re.MULTILINE) == [
        ("Rewards", "$R = - 1$"), ("Returns", "optimal $2$"),
    ]  # fmt: skip
    assert "Dynamics" in first and "optimal $1$" in first


@pytest.mark.parametrize("name", PAPER)
def test_what_defines_a_task_is_there_and_nothing_else(name: str) -> None:
    (long,) = gather_pages([load(name)]).pages
    (brief,) = gather_pages([load(name)], brief=True).pages
    for key in ("state", "actions", "horizon", "dynamics", "rewards", "initial"):
        assert brief.section(key) is not None
    for key in ("claims", "examples", "errata", "sources", "expert", "abstraction"):
        assert brief.section(key) is None
    for section in brief.sections:
        assert long.section(section.key) == section
    assert (brief.section("observations") is not None) == (name == "derail/NoisyObs-v0")
    assert long.description and not brief.description


def test_no_sign_stands_alone_after_a_table_or_a_formula_on_a_line_of_its_own(tmp_path: Path) -> None:
    write(["derail/LargestSumSeals-v0", "derail/Branching-v0"], ["latex"], tmp_path, brief=True,
          columns=[{"L": 5}], facts={"derail/Branching-v0": Facts({"optimal return": Return(1)})})  # fmt: skip
    formulas = (tmp_path / "largest-sum-seals.tex").read_text(encoding="utf-8")
    assert r"\right].}" in formulas and "}.\n" not in formulas
    text = (tmp_path / "branching.tex").read_text(encoding="utf-8")
    assert (
        r"$\mathcal{S} = \{0, \ldots , LB\}$ \taskspecaside{L = 5}{$\mathcal{S} = \{0, \ldots , 10\}$);} $s$: " in text
    )
    assert re.search(r"\\taskspectable\{.*\}$", text, re.MULTILINE)
    assert r"\taskspecvalues" not in text


def test_no_sign_ends_a_map(tmp_path: Path) -> None:
    write([spec_file("frozen_lake")], ["latex"], tmp_path, brief=True)
    text = (tmp_path / "frozen-lake.tex").read_text(encoding="utf-8")
    assert re.search(r"\\par\{\\ttfamily .*\}\\par$", text, re.MULTILINE)


@pytest.mark.slow
@TEX
@pytest.mark.usefixtures("kept_log")
def test_the_tasks_of_the_paper_take_three_pages_at_most(tmp_path: Path) -> None:
    Done("docs", *PAPER, "-f", "pdf", "-o", tmp_path)
    said = paper.about(tmp_path / "document.pdf")
    assert 0 < int(re.findall(r"Pages:\s+(\d+)", said)[0]) <= 3
    assert "Overfull" not in (tmp_path / "document.log").read_text(errors="replace")


FAMILY = """\
taskspec: 1
name: First
state: {s: {type: int, low: 0, high: 4}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 5
initial: {s: 0}
dynamics: {s': "min(s + a, 4)"}
reward: s' == 4
terminal: s' == 4
variants:
  Other: {horizon: 9, terminal: null, reward: s' == 3}
  Third: {base: Other, horizon: 8}
"""


def test_each_task_is_told_by_the_one_that_it_differs_least_from(tmp_path: Path) -> None:
    text = read_text(FAMILY, "family.yaml")
    tasks = [build(text), build(text, variant="Other"), build(text, variant="Third")]
    [family] = families(gather_pages(tasks, brief=True).pages)
    told = {}
    for each in family.others:
        told[each.page.name, each.base.name] = {section.key: len(section.lines) for section in each.page.sections}
    assert told == {
        ("FirstOther", "First"): {"horizon": 1, "rewards": 1, "termination": 1},
        ("FirstThird", "FirstOther"): {"horizon": 1},
    }
    write(tasks, ["latex"], tmp_path, brief=True)
    printed = (tmp_path / "first.tex").read_text()
    assert r"\item[Termination] none." in printed and r"\texttt{FirstThird}, as \texttt{FirstOther}:" in printed


@pytest.mark.parametrize(
    ("tasks", "options", "brief"),
    [(4, (), True), (3, (), False), (4, ("--full",), False), (1, ("--brief",), True), (4, ("-f", "md"), False)],
)
def test_more_than_three_tasks_on_paper_are_brief(
    tasks: int, options: tuple[str, ...], brief: bool, tmp_path: Path
) -> None:
    assert Done("docs", *PAPER[:tasks], "-f", "latex", *options, "--no-results", "-o", tmp_path).status == 0
    text = (tmp_path / "risky-path.tex").read_text(encoding="utf-8")
    assert (r"\item Expert" not in text) is brief
