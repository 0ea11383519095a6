"""Pages say what the paper's appendix says, repaired; the files are those recorded; nothing drifts."""

import math
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskspec.base.diagnostics import SpecError
from taskspec.exact import Return
from taskspec.language import registry
from taskspec.language.expressions.parse import parse
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.parts import Claim
from taskspec.show.pages import claims
from taskspec.show.pages.equations import Writing
from taskspec.show.pages.facts import Facts, gather, number
from taskspec.show.pages.page import Page, page
from taskspec.show.pages.prose import Formula, Inlines, Mark, Text
from taskspec.show.pages.sections import Section
from taskspec.show.pages.write import write
from taskspec.show.printers import plain
from taskspec.show.printers.names import nowhere
from tests.shared.commands import Done
from tests.shared.for_each import for_each
from tests.shared.walks import BASE

ROOT = Path(__file__).parents[3]


def words(content: Inlines) -> str:
    told = ""
    for part in content:
        match part:
            case Formula(math=math):
                told += plain(math)
            case Text(text=text) | Mark(text=text):
                told += text
    return told


def section(found: Page, key: str) -> Section:
    chosen = found.section(key)
    assert chosen is not None
    return chosen


def lines(found: Page, key: str) -> list[str]:
    return [words(line.content) for line in section(found, key).lines]


def values(found: Page, key: str) -> list[str]:
    """What stands beside the first line of a section."""
    return list(map(words, section(found, key).lines[0].values))


def rows(found: Page) -> list[list[str]]:
    """The table of scores and claims."""
    table = section(found, "scores").table
    assert table is not None
    return [list(map(words, row)) for row in table.rows]


@for_each(
    ("name", "key", "expected"),
    [
        ("RiskyPath", "state", "𝒮"),
        ("RiskyPath", "dynamics", "s₀ —safe→ s₁,  s₀ —risky→ { s₂ with probability 1/2; s₃ with probability 1/2 }"),
        ("RiskyPath", "dynamics", "s₂ —a→ s₂ for all a ∈ 𝒜"),
        ("RiskyPath", "rewards", "R(s′) = { 1 if s′ = s₂; −100 if s′ = s₃; 0 otherwise }"),
        ("RiskyPath", "horizon", "5"),
        ("RiskyPath", "initial", "s = s₀"),
        ("EarlyTermPos", "rewards", "R = 1"),
        ("EarlyTermNeg", "rewards", "R = −1"),
        ("EarlyTermPos", "termination", "when s′ = s₂"),
        ("NoisyObs", "parameters", "M = 5, number of rows and of columns of the grid (2 to 100)"),
        ("NoisyObs", "state", "𝒮 = {0, … , M − 1}²"),
        ("NoisyObs", "observations", "z ∼ (𝒩(0, 1))^L"),
        ("NoisyObs", "rewards", "R(x′, y′) = 𝟙[x′ = ⌊M / 2⌋ ∧ y′ = ⌊M / 2⌋]"),
        ("NoisyObs", "initial", "x, y ∼ Unif{0, M − 1}, independently"),
        ("Branching", "state", "𝒮 = {0, … , LB}"),
        ("Branching", "dynamics", "s′ = s + (a + 1) ⋅ 𝟙[s ≡ 0 (mod B) ∧ s < LB]"),
        ("Branching", "rewards", "R(s′) = 𝟙[s′ = LB]"),
        ("Parabola", "state", "𝒮 = ℝ² × [−1, 1]³"),
        ("Parabola", "dynamics", "c₂, c₁ and c₀ keep their values"),
        ("Parabola", "rewards", "R(c₂, c₁, c₀, x′, y′) = −(y′ − p(x′))²"),
        ("Parabola", "initial", "c₂, c₁, c₀ ∼ Unif(−1, 1), independently"),
        ("LargestSum", "state", "𝒮 = [0, 1]^(2L)"),
        ("LargestSum", "definitions", "label = 𝟙[∑_(i = 0)^(L − 1) sᵢ > ∑_(i = L)^(2L − 1) sᵢ]"),
        ("LargestSum", "rewards", "R(s, a) = 𝟙[a = label]"),
        ("InitShiftExpert", "rewards", "R(s′) = { 1 if s′ = 3; −1 if s′ ∈ {4, 5}; 2 if s′ = 6; 0 otherwise }"),
        ("InitShiftLearner", "initial", "s = 1"),
        ("ProcGoal", "state", "𝒮 = (ℤ²)²"),
        ("ProcGoal", "rewards", "R(g, p′) = −‖p′ − g‖₁"),
        ("ProcGoal", "initial", "p ∼ Unif{p ∈ {−B, … , B}²: ‖p‖₁ ≤ B}"),
        ("ProcGoal", "initial", "g = p + ξ,  ξ ∼ Unif{d ∈ {−D, … , D}²: ‖d‖₁ = D}"),
        ("Sort", "actions", "𝒜 = {0, … , L − 1}²"),
        ("Sort", "rewards", "R(s, s′) = 𝟙[c(s′) = L] + c(s′) − c(s)"),
        ("Sort", "dynamics", "s′ = swap_(i, j)(s)"),
    ],
)  # fmt: skip
def test_what_the_paper_states_is_stated(name: str, key: str, expected: str) -> None:
    found = lines(page(registry.load(f"derail/{name}-v0")), key)
    assert expected in "\n".join(found), found


def test_a_bound_for_each_element_is_a_set_for_each() -> None:
    text = (ROOT / "docs" / "howto" / "grids.md").read_text(encoding="utf-8")
    spec = text[text.index("taskspec: 1") :].partition("```")[0]
    found = lines(page(build(read_text(spec, "<test>"))), "state")
    assert found[0] == "𝒮 = {0, … , rows − 1} × {0, … , columns − 1}"


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(-1, 1, "{−1, 0, 1}"), (-3, 0, "{−3, −2, −1, 0}"), (0, 4, "{0, … , 4}"), (-2, 2, "{−2, … , 2}")],
)
def test_sets_of_at_most_four_numbers_are_written_out(low: int, high: int, expected: str) -> None:
    spec = f"""{{taskspec: 1, name: Few, state: {{s: {{type: int, low: {low}, high: {high}}}}},
    action: {{a: {{type: bool}}}}, horizon: 3, initial: {{s: 0}}, dynamics: {{"s'": 0}}, reward: a}}"""
    assert lines(page(build(read_text(spec, "<test>"))), "state")[0] == f"s ∈ 𝒮 = {expected}"


def test_pages_do_not_take_each_others_files(tmp_path: Path) -> None:
    anchors = {"Ä": "task", "Ö": "task-2", "Index": "index-2", "deepSea": "deep-sea", "DeepSea": "deep-sea-2"}
    tasks = [build(read_text(BASE.replace("Walk", name), "<test>")) for name in anchors]
    files = {path.name: path.read_text(encoding="utf-8") for path in write(tasks, ["html"], tmp_path)}
    for name, anchor in anchors.items():
        assert name in files[f"{anchor}.html"]
        assert f'href="{anchor}.html"' in files["index.html"]
    assert len(files) == len(anchors) + 1


def test_sections_are_in_the_order_of_the_paper() -> None:
    keys = [s.key for s in page(registry.load("derail/Branching-v0")).sections]
    assert keys == ["parameters", "state", "observations", "actions", "horizon", "dynamics", "rewards", "initial", "expert",
                    "claims", "examples", "errata", "sources"]  # fmt: skip


def test_values_stand_beside_the_symbols() -> None:
    found = page(registry.load("derail/Branching-v0"), columns=[{"L": 5, "B": 3}, {"L": 2}])
    assert [s.title for s in found.settings] == ["L = 5, B = 3", "L = 2"]
    assert values(found, "state") == ["𝒮 = {0, … , 15}", "𝒮 = {0, … , 4}"]
    assert values(found, "horizon") == ["5", "2"]


def test_only_lines_whose_value_changes_have_values_beside_them() -> None:
    found = page(registry.load("derail/NoisyObs-v0"), columns=[{"L": 5}])
    changed: dict[str, list[str]] = {}
    for each in found.sections:
        for line in each.lines:
            changed.setdefault(each.key, []).extend(map(words, line.values))
    assert "z ∼ (𝒩(0, 1))⁵" in changed["observations"]
    for key in ("state", "dynamics", "rewards", "initial", "expert"):  # these depend on M alone
        assert not any(changed[key])


def test_a_setting_that_is_the_tasks_own_is_not_shown_twice(tmp_path: Path) -> None:
    done = Done("docs", "derail/Branching", "-p", "L=5,10", "-f", "latex", "-f", "markdown", "-o", tmp_path)
    assert done.status == 0, done.err
    text = (tmp_path / "branching.tex").read_text(encoding="utf-8")
    assert text.count(r"\begin{tikzpicture}") == 2
    assert r"\taskspechead{L = 10, B = 2} & \taskspechead{L = 5} \\" in text
    assert "L = 10:" not in (tmp_path / "branching.md").read_text(encoding="utf-8")
    found = page(registry.load("derail/Branching-v0"), columns=[{"L": 5}, {"L": 5, "B": 2}, {}])
    assert [s.title for s in found.settings] == ["L = 5"]


def test_scores_claims_and_figure_are_those_of_the_values(tmp_path: Path) -> None:
    task = registry.load("derail/Branching-v0")
    found = page(task, gather(task), [{"L": 3, "B": 3}, {"L": 4, "Q": 1}])
    scores = section(found, "scores")
    assert scores.table is not None and scores.title == "Exact scores and claims"
    assert scores.table.header == ("", "L = 10, B = 2", "L = 3, B = 3", "L = 4")
    assert ["random return", f"{2**-10}", "1/27", f"{2**-4}"] in rows(found)
    assert ["reachable states", "21", "10", "9"] in rows(found)
    assert ["random return = B^(−L)", "proved", "proved", "proved"] in rows(found)
    write([task], ["svg", "markdown"], tmp_path, columns=[{"L": 3, "B": 3}])
    assert ">9<" in (tmp_path / "figures" / "branching-l-3-b-3.svg").read_text()
    assert "figures/branching-l-3-b-3.svg" in (tmp_path / "branching.md").read_text()


def test_values_may_be_given_by_their_alias() -> None:
    (setting,) = page(registry.load("derail/NoisyObsSeals-v0"), columns=[{"noise_length": 5}]).settings
    assert (setting.title, setting.task.values["L"]) == ("L = 5", 5)


def test_a_claim_about_the_defaults_is_not_called_false_elsewhere() -> None:
    task = registry.load("derail/NoisyObs-v0")
    assert ["optimal return = 12", "proved", "not for these values"] in rows(page(task, gather(task), [{"M": 3}]))


def test_a_name_that_no_task_has_a_parameter_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="E702"):
        write([registry.load("derail/Branching-v0")], ["markdown"], tmp_path, columns=[{"Q": 3}])


def test_the_abstraction_is_printed_and_its_states_are_called_abstract() -> None:
    task = registry.load("derail/Sort-v0")
    found = page(task, gather(task))
    assert lines(found, "abstraction")[:2] == [
        "s\u0302 = argsort(argsort(s)) ∈ {0, … , L − 1}^L: rank of every element",
        "initial state: s\u0302 ∼ Perm(L)",
    ]
    assert ["reachable abstract states", "24"] in rows(found)
    assert ["number of abstract states = 24", "proved"] in rows(found)


def test_observations_name_what_is_defined_and_what_is_of_the_state(tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(BEST, encoding="utf-8")
    found = page(registry.load(spec))
    observed = ["q is that of the state", "best is defined below", "observed x = reverse(x)"]
    assert lines(found, "observations")[1:] == observed
    assert lines(found, "state")[1:] == ["x ∈ {0, 1, 2, 3}³", "q ∈ {0, 1, 2}: which"]


BEST = """
taskspec: 1
name: Best
state:
  x: {type: int, shape: [3], low: 0, high: 3}
  q: {type: int, low: 0, high: 2, doc: which}
action:
  a: {type: int, low: 0, high: 2}
horizon: 5
definitions:
  best: argmax(x)
observation: {best: best, q: q, x: reverse(x)}
initial: {x: "UniformInt(0, 3, shape=3)", q: 0}
dynamics:
  q': a
reward: q' == best
"""


DRAWS = """
taskspec: 1
name: Machines
parameters: {n: {type: int, default: 3, low: 2}}
state: {up: {type: bool, shape: [n]}, grid: {type: bool, shape: [2, n]}}
action: {a: {type: int, low: 0, high: n - 1}}
horizon: 9
initial:
  up: "[Bernoulli(1/2) for i in range(n)]"
  grid: "[[Bernoulli(1/4) for j in range(n)] for i in range(2)]"
dynamics:
  up': "[a == i or Bernoulli(1/2 if up[i] else 1/4) for i in range(n)]"
reward: UniformInt(0, 2) + count([Bernoulli(1/3) and k != a for k in range(n)])
observation: {up: up, t: t}
"""


BOUNDS = """
taskspec: 1
name: Bounds
constants: {top: [3, 4, 5]}
state: {s: {type: int, shape: [3], low: LOW, high: top}}
action: {a: {type: bool}}
horizon: 1
initial: {s: [0, 0, 0]}
dynamics: {}
reward: 0
"""


@pytest.mark.parametrize(("low", "expected"), [
    ("0", "s ∈ 𝒮 = ∏_(i) {0, … , topᵢ}"), ("-top", "s ∈ 𝒮 = ∏_(i) {(−top)ᵢ, … , topᵢ}"),
    ("[0, -1, 2]", "s ∈ 𝒮 = {0, … , top₀} × {−1, … , top₁} × {2, … , top₂}"),
])  # fmt: skip
def test_bounds_that_are_vectors_are_those_of_elements(low: str, expected: str) -> None:
    found = page(build(read_text(BOUNDS.replace("LOW", low))))
    assert lines(found, "state")[0] == expected
    assert lines(found, "actions")[0] == "a ∈ 𝒜 = {0, 1}"


@pytest.mark.parametrize(("key", "expected"), [
    ("initial", "up = (ξᵢ)_(i ∈ {0, … , n − 1}),  ξᵢ ∼ Bernoulli(1/2)"),
    ("initial", "grid = ((ξ_(i, j))_(j ∈ {0, … , n − 1}))_(i ∈ {0, 1}),  ξ_(i, j) ∼ Bernoulli(1/4)"),
    ("dynamics", "up′ = (𝟙[a = i ∨ ξᵢ])_(i ∈ {0, … , n − 1}),  ξᵢ ∼ Bernoulli({ 1/2 if upᵢ; 1/4 otherwise })"),
    ("rewards", "R(a) = ξ₁ + #{k ∈ {0, … , n − 1}: ξ_(2, k) ∧ k ≠ a},  ξ₁ ∼ Unif{0, 1, 2},  ξ_(2, k) ∼ Bernoulli(1/3)"),
    ("observations", "t is the time"),
])  # fmt: skip
def test_each_element_of_a_comprehension_has_its_own_draw(key: str, expected: str) -> None:
    assert expected in lines(page(build(read_text(DRAWS))), key)


def test_values_are_printed_in_every_format(tmp_path: Path) -> None:
    write([registry.load("derail/Branching-v0")], ["latex", "html", "markdown"], tmp_path, columns=[{"L": 5, "B": 3}])
    assert (
        r"\taskspecvalues{L = 5, B = 3}{$\mathcal{S} = \{0, \ldots , 15\}$)}"
        in (tmp_path / "branching.tex").read_text()
    )
    assert 'alttext="𝒮 = {0, … , 15}"' in (tmp_path / "branching.html").read_text()
    assert r"\ldots , 15\rbrace" in (tmp_path / "branching.md").read_text()


def test_make_line_names_what_differs_from_the_defaults() -> None:
    assert page(registry.load("derail/Branching-v0", L=4)).make == 'gymnasium.make("taskspec:derail/Branching-v0", L=4)'


def test_make_line_of_a_spec_that_is_not_registered_runs_beside_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "tests/specs/values/coin_walk.yaml").read_text(encoding="utf-8")
    (tmp_path / "walk.yaml").write_text(f"{text}variants:\n  short: {{horizon: 3}}\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    task = registry.load("walk.yaml", "short")
    made: Any = eval(page(task).make, {"gymnasium": gymnasium})
    assert made.unwrapped.task.content_hash == task.content_hash


@given(
    st.fractions(-1000, 1000, max_denominator=1500) | st.floats(-1000, 1000).filter(lambda x: abs(x) > 1e-3 or x == 0)
)
def test_numbers_are_printed_with_their_sign(value: Fraction | float) -> None:
    """A whole number and a fraction have the sign of both: -31/7 is -4 - 3/7."""
    shown = plain(number(value)).replace("−", "-").replace(" ", "")
    read = sum(map(Fraction, re.findall(r"[+-]?[\d./]+", shown)))
    assert math.isclose(read, value, rel_tol=1e-5, abs_tol=1e-12)


@pytest.mark.parametrize(("value", "shown"), [(math.inf, "∞"), (-math.inf, "−∞"), (-31 / 7, "−4 − 3/7"), (-1e-30, "0")])
def test_numbers_at_the_edges(value: float, shown: str) -> None:
    assert plain(number(value)) == shown


def test_facts_are_shown_where_there_are_some() -> None:
    task = registry.load("derail/RiskyPath-v0")
    returns = {"optimal return": Return(4), "random return": Return(-1.234567, 0.0102, 100)}
    optimal, random, claim = rows(page(task, Facts(returns, [Mark(False, "fails")])))[:3]
    assert optimal == ["optimal return", "4"]
    assert random == ["random return", "−1.235 ± 0.020 (95 % CI, 100 episodes)"]
    assert claim[1] == "fails"
    assert page(task).section("scores") is None


@pytest.mark.parametrize(
    ("claim", "options", "expected"),
    [
        ("probability(s == goal, under=optimal) == 1", {}, "ℙₒₚₜᵢₘₐₗ(s = s₂) = 1"),
        ("probability(s == goal) == 1/4", {}, "ℙ_(random)(s = s₂) = 1/4"),
        ("probability(s == goal) == 1", {"under": "expert"}, "ℙₑₓₚₑᵣₜ(s = s₂) = 1"),
        ("prefers(a == safe)", {"under": "soft(2)"},
         "a causal maximum-entropy agent with inverse temperature 2 prefers a = safe"),
        ("prefers(maxent, a == risky, at=s == start)", {},
         "a non-causal maximum-entropy learner prefers a = risky where s = s₀"),
        ("not reachable(s == trap)", {"where": "section 3"}, "s = s₃ cannot be reached (section 3)"),
        ("optimal_return == 4", {"tolerance": 0.5}, "optimal return = 4, to within 0.5"),
        ("not influences(a, s)", {}, "a has no effect on s"),
    ],
)  # fmt: skip
def test_claims_as_sentences(claim: str, options: dict[str, object], expected: str) -> None:
    """Every part of a claim is told: the policy that a probability is under, above all."""
    w = Writing(registry.load("derail/RiskyPath-v0"), {})
    found = claims.claim_text(w, Claim(parse(nowhere(claim)), claim, (), options))
    assert words(found) == expected


def test_exact_facts() -> None:
    found = gather(registry.load("derail/RiskyPath-v0"))
    assert found.scores["optimal return"].value == 4
    assert found.states == 4
    assert {v.text for v in found.verdicts} == {"proved"}
