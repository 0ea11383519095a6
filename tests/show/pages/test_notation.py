"""The paragraph on notation: signs are explained in the documents that they occur in, the same in every format."""

import re
from pathlib import Path

import pytest

from tests.shared.commands import Done, spec

PUT = """\
taskspec: 1
name: Put
state: {x: {type: int, low: 0, high: 3, shape: 3}}
action: {q: {type: int, low: 0, high: 2}}
horizon: 3
initial: {x: "[0, 0, 0]"}
dynamics: {x': "put(x, q, 1)"}
reward: "count(x'[i] == 1 for i in range(3))"
"""
SIGNS = {
    r"\taskspecone ",
    r"\mathrm{clip}",
    r"\mathrm{swap}",
    r"\leftarrow ",
    r"\#",
    r"\xi",
    r"\mathrm{Unif}",
    r"\mathbb{P}",
    r"\mathbb{E}",
}

DRAWN = """\
taskspec: 1
name: Drawn
state: {x: {type: int, low: 0, high: 3}}
action: {q: {type: int, low: 0, high: 2}}
noise: {xi: Bernoulli(1/2)}
horizon: 3
initial: {x: 0}
dynamics: {x': "x if xi and Bernoulli(1/3) else 0"}
reward: "q"
"""
CASES = """\
taskspec: 1
name: Cases
state: {x: {type: int, low: 0, high: 3}}
action: {q: {type: int, low: 0, high: 2}}
horizon: 3
initial: {x: 0}
dynamics: {x': "3 if x > 2 else 2 if x > 1 else q"}
reward: "1 if x > 1 else 0"
"""


def paragraphs(folder: Path, *arguments: object) -> tuple[str, str]:
    """In LaTeX, and the words of it on the index of a site."""
    done = Done("docs", *arguments, "-f", "latex", "-f", "html", "-o", folder)
    assert done.status == 0, done.err
    tex = (folder / "appendix.tex").read_text(encoding="utf-8")
    site = (folder / "index.html").read_text(encoding="utf-8")
    return (
        tex.split(r"\noindent\textbf{Notation.}")[1].split(r"\input")[0],
        re.sub(r"<[^>]+>", "", re.findall(r'id="notation">Notation</h2>\s*<p>(.*?)</p>', site, re.DOTALL)[0]),
    )


@pytest.mark.parametrize(
    ("task", "signs"),
    [
        ("derail/Branching", {r"\taskspecone ", r"\mathbb{P}"}),
        ("derail/Sort", {r"\taskspecone ", r"\#", r"\mathrm{swap}", r"\mathrm{Unif}"}),
        ("derail/ProcGoal", {r"\xi", r"\mathrm{Unif}"}),
        ("safety/Vases", {r"\taskspecone ", r"\mathbb{E}"}),
        ("put", {r"\leftarrow ", r"\#"}),
    ],
)
def test_signs_are_explained_where_they_occur(task: str, signs: set[str], tmp_path: Path) -> None:
    target = spec(tmp_path, PUT) if task == "put" else task
    tex, site = paragraphs(tmp_path / "out", target, "--no-results")
    assert {sign for sign in SIGNS if sign in tex} == signs
    assert "return" not in tex
    assert ("uniform distribution" in site) == (r"\mathrm{Unif}" in signs)


def test_what_is_proved_without_an_exact_model_is_not_said_to_follow_from_one(tmp_path: Path) -> None:
    for said in paragraphs(tmp_path, "derail/LargestSum"):
        assert "exact model" not in said
        assert "marked as proved follows from the form of the equations, or from exact results" in said
        assert "actions drawn uniformly" in said


def test_the_letter_for_draws_is_the_one_on_the_page(tmp_path: Path) -> None:
    own = spec(tmp_path, DRAWN)
    (alone, site) = paragraphs(tmp_path / "own", own, "--no-results")
    (usual, _) = paragraphs(tmp_path / "u", "derail/ProcGoal")
    assert r"$\zeta$, with an index" in alone
    assert r"\xi" not in alone
    assert "ζ" in site
    assert r"$\xi$, with an index" in usual
    both, _ = paragraphs(tmp_path / "both", own, "derail/ProcGoal", "--no-results")
    assert r"$\xi$ ($\zeta$ where the task has such a name), with an index" in both


def test_of_several_cases_the_first_counts(tmp_path: Path) -> None:
    told = "Of several cases the first counts whose condition holds."
    assert all(told in said for said in paragraphs(tmp_path / "cases", spec(tmp_path, CASES), "--no-results"))
    one = spec(tmp_path, CASES.replace("2 if x > 1 else q", "q").replace("name: Cases", "name: One"), "one.yaml")
    assert not any(told in said for said in paragraphs(tmp_path / "one", one, "--no-results"))
