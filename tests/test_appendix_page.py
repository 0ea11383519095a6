"""Pages say what the paper's appendix says, repaired; the files are those recorded; nothing drifts."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

from taskspec import registry
from taskspec.appendix import Facts, claims, gather, page, write
from taskspec.appendix.facts import ScoreFact, VerdictFact
from taskspec.appendix.prose import Formula, Inlines, Mark, Text
from taskspec.appendix.write import gather_pages
from taskspec.appendix.writing import Writing
from taskspec.diagnostics import SpecError
from taskspec.extras import need
from taskspec.lang.parse import parse
from taskspec.printers import plain
from taskspec.printers.names import nowhere
from taskspec.source import read_text
from taskspec.task.build import build
from taskspec.task.task import Claim, Task

ROOT = Path(__file__).parent.parent
GOLDEN = ROOT / "tests" / "golden" / "appendix"
REFERENCE = ROOT / "docs" / "suite"
IDS = [i for i in registry.task_ids() if i.startswith("derail/")]


def tasks() -> list[Task]:
    return [registry.load(i) for i in IDS]


def words(content: Inlines) -> str:
    return "".join(
        plain(p.math) if isinstance(p, Formula) else p.text if isinstance(p, Text | Mark) else "" for p in content
    )


def lines(name: str, key: str, **parameters: object) -> list[str]:
    section = page(registry.load(f"derail/{name}-v0", **parameters)).section(key)
    assert section is not None
    return [words(line.content) for line in section.lines]


@pytest.mark.parametrize(
    ("name", "key", "expected"),
    [
        ("RiskyPath", "state", "𝒮"),
        ("RiskyPath", "dynamics", "s₀ —safe→ s₁,  s₀ —risky→ { s₂ with probability 1/2; s₃ with probability 1/2 }"),
        ("RiskyPath", "dynamics", "s₂ —a→ s₂ for all a ∈ A"),
        ("RiskyPath", "rewards", "R(s′) = { 1 if s′ = s₂; −100 if s′ = s₃; 0 otherwise }"),
        ("RiskyPath", "horizon", "5"),
        ("RiskyPath", "initial", "s = s₀"),
        ("EarlyTermPos", "rewards", "R = 1"),
        ("EarlyTermNeg", "rewards", "R = −1"),
        ("EarlyTermPos", "termination", "when s′ = s₂"),
        ("NoisyObs", "parameters", "M = 5, number of rows and of columns of the grid (2 to 100)"),
        ("NoisyObs", "state", "S = {0, … , M − 1}²"),
        ("NoisyObs", "observations", "z ∼ (N(0, 1))^L"),
        ("NoisyObs", "rewards", "R(x′, y′) = 𝟙[x′ = ⌊M / 2⌋ ∧ y′ = ⌊M / 2⌋]"),
        ("NoisyObs", "initial", "x, y ∼ Unif{0, M − 1}, independently"),
        ("Branching", "state", "S = {0, … , LB}"),
        ("Branching", "dynamics", "s′ = s + (a + 1) ⋅ 𝟙[s ≡ 0 (mod B) ∧ s < LB]"),
        ("Branching", "rewards", "R(s′) = 𝟙[s′ = LB]"),
        ("Parabola", "state", "S = ℝ² × [−1, 1]³"),
        ("Parabola", "dynamics", "c₂, c₁ and c₀ keep their values"),
        ("Parabola", "rewards", "R(c₂, c₁, c₀, x′, y′) = −(y′ − p(x′))²"),
        ("Parabola", "initial", "c₂, c₁, c₀ ∼ Unif(−1, 1), independently"),
        ("LargestSum", "state", "S = [0, 1]^(2L)"),
        ("LargestSum", "definitions", "label = 𝟙[∑_(i = 0)^(L − 1) sᵢ > ∑_(i = L)^(2L − 1) sᵢ]"),
        ("LargestSum", "rewards", "R(s, a) = 𝟙[a = label]"),
        ("InitShiftExpert", "rewards", "R(s′) = { 1 if s′ = 3; −1 if s′ ∈ {4, 5}; 2 if s′ = 6; 0 otherwise }"),
        ("InitShiftLearner", "initial", "s = 1"),
        ("ProcGoal", "state", "S = (ℤ²)²"),
        ("ProcGoal", "rewards", "R(g, p′) = −‖p′ − g‖₁"),
        ("ProcGoal", "initial", "p ∼ Unif{p ∈ {−B, … , B}²: ‖p‖₁ ≤ B}"),
        ("ProcGoal", "initial", "g = p + ξ,  ξ ∼ Unif{d ∈ {−D, … , D}²: ‖d‖₁ = D}"),
        ("Sort", "actions", "A = {0, … , L − 1}²"),
        ("Sort", "rewards", "R(s, s′) = 𝟙[c(s′) = L] + c(s′) − c(s)"),
        ("Sort", "dynamics", "s′ = swap_(i, j)(s)"),
    ],
)  # fmt: skip
def test_what_the_paper_states_is_stated(name: str, key: str, expected: str) -> None:
    found = lines(name, key)
    assert any(expected.replace("𝒮", "S") in line for line in found), found


def test_a_bound_for_each_element_is_a_set_for_each() -> None:
    text = (ROOT / "docs" / "howto" / "grids.md").read_text(encoding="utf-8")
    spec = text[text.index("taskspec: 1") :].partition("```")[0]
    section = page(build(read_text(spec, "<test>"))).section("state")
    assert section is not None
    assert words(section.lines[0].content) == "S = {0, … , rows − 1} × {0, … , columns − 1}"


def test_pages_do_not_take_each_others_files(tmp_path: Path) -> None:
    text = "taskspec: 1\nname: NAME\nstate: {s: {type: bool}}\naction: {a: {type: bool}}\nhorizon: 3\ninitial: {s: false}\n"
    names = ["Ä", "Ö", "Index", "deepSea", "DeepSea"]
    built = [build(read_text(text.replace("NAME", n) + "dynamics: {s': a}\nreward: s\n", "<test>")) for n in names]
    files = {path.name: path.read_text(encoding="utf-8") for path in write(built, ["html"], tmp_path)}
    for name, anchor in zip(names, ["task", "task-2", "index-2", "deep-sea", "deep-sea-2"], strict=True):
        assert name in files[f"{anchor}.html"]
        assert f'href="{anchor}.html"' in files["index.html"]
    assert len(files) == len(names) + 1


def test_sections_are_in_the_order_of_the_paper() -> None:
    keys = [s.key for s in page(registry.load("derail/Branching-v0")).sections]
    assert keys == ["parameters", "state", "observations", "actions", "horizon", "dynamics", "rewards", "initial", "expert",
                    "claims", "examples", "errata", "sources"]  # fmt: skip


def test_values_stand_beside_the_symbols() -> None:
    found = page(registry.load("derail/Branching-v0"), columns=[{"L": 5, "B": 3}, {"L": 2}])
    state = found.section("state")
    assert state is not None
    assert found.columns == ("L = 5, B = 3", "L = 2")
    assert [words(v) for v in state.lines[0].values] == ["S = {0, … , 15}", "S = {0, … , 4}"]
    horizon = found.section("horizon")
    assert horizon is not None
    assert [words(v) for v in horizon.lines[0].values] == ["5", "2"]


def test_values_are_printed_in_every_format(tmp_path: Path) -> None:
    write([registry.load("derail/Branching-v0")], ["latex", "html", "markdown"], tmp_path, columns=[{"L": 5, "B": 3}])
    assert (
        r"\taskspecvalues{L = 5, B = 3}{$\mathcal{S} = \{0, \ldots , 15\}$}" in (tmp_path / "branching.tex").read_text()
    )
    assert 'alttext="S = {0, … , 15}"' in (tmp_path / "branching.html").read_text()
    assert r"\ldots , 15\rbrace" in (tmp_path / "branching.md").read_text()


def test_links_in_the_head_of_a_site(tmp_path: Path) -> None:
    links = {"Language <reference>": "../language.html", "Trap": "javascript:alert(1)"}
    write([registry.load("derail/Sort-v0")], ["html"], tmp_path, links=links)
    text = (tmp_path / "sort.html").read_text()
    assert '<a href="../language.html">Language &lt;reference&gt;</a>' in text
    assert "javascript:" not in text


def test_make_line_names_what_differs_from_the_defaults() -> None:
    assert page(registry.load("derail/Branching-v0", L=4)).make == 'gymnasium.make("derail/Branching-v0", L=4)'


def test_facts_are_shown_where_there_are_some() -> None:
    task = registry.load("derail/RiskyPath-v0")
    returns = {"optimal return": ScoreFact(4), "random return": ScoreFact(-1.234567, 0.02, 100)}
    found = page(task, Facts(returns, [VerdictFact(False, "fails")]))
    scores, stated = found.section("scores"), found.section("claims")
    assert scores is not None
    assert stated is not None
    told = [words(line.content) for line in scores.lines]
    assert told == ["optimal return 4", "random return −1.235 ± 0.020 (from 100 episodes)"]
    assert words(stated.lines[0].content).endswith("fails")
    assert page(task).section("scores") is None


@pytest.mark.parametrize(
    ("claim", "options", "expected"),
    [
        ("probability(s == goal, under=optimal) == 1", {}, "ℙₒₚₜᵢₘₐₗ(s = s₂) = 1"),
        ("probability(s == goal) == 1/4", {}, "ℙ_(random)(s = s₂) = 1/4"),
        ("probability(s == goal) == 1", {"under": "expert"}, "ℙₑₓₚₑᵣₜ(s = s₂) = 1"),
        ("prefers(a == safe)", {"under": "soft(2)"}, "a causal maximum-entropy agent (β = 2) prefers a = safe"),
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
    found = claims.claim(w, Claim(parse(nowhere(claim)), claim, (), options))
    assert words(found) == expected


def test_exact_facts() -> None:
    found = gather(registry.load("derail/RiskyPath-v0"))
    assert found.scores["optimal return"].value == 4
    assert found.states == 4
    assert {v.words for v in found.verdicts} == {"proved"}


# -- files ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    write(tasks(), ["latex", "html", "markdown"], out)
    return out


def recorded(path: Path) -> str:
    """A file as it is recorded: without the style sheet and the spec's own source."""
    text = re.sub(r"<style>.*?</style>", "<style></style>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r'(<pre class="yaml".*?>).*?</pre>', r"\1</pre>", text, flags=re.DOTALL)


def compare(found: dict[str, str], folder: Path, update: bool) -> None:
    """Files against those recorded in a folder, which the update flag rewrites."""
    if update:
        for old in folder.rglob("*") if folder.is_dir() else ():
            if old.is_file() and str(old.relative_to(folder)) not in found:
                old.unlink()
        for name, text in found.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
    assert {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()} == set(found)
    for name, text in found.items():
        assert text == (folder / name).read_text(encoding="utf-8"), (
            f"{name}: pytest --update-golden, then read the diff"
        )


def test_golden_files(written: Path, update_golden: bool) -> None:
    found = {str(p.relative_to(written)): recorded(p) for p in sorted(written.rglob("*")) if p.is_file()}
    compare({name: text for name, text in found.items() if not name.endswith(".md")}, GOLDEN, update_golden)


def test_the_suite_reference_is_what_the_specs_give(tmp_path: Path, update_golden: bool) -> None:
    every = tasks()
    write(every, ["markdown"], tmp_path, title="The DERAIL suite", facts={t.id: gather(t) for t in every})
    found = {str(p.relative_to(tmp_path)): recorded(p) for p in sorted(tmp_path.rglob("*")) if p.is_file()}
    compare(found, REFERENCE, update_golden)


def test_mathml_is_well_formed(written: Path) -> None:
    for path in written.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        for block in re.findall(r"<math.*?</math>", text, re.DOTALL):
            ElementTree.fromstring(block)
        for picture in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
            ElementTree.fromstring(picture)


def test_pages_need_no_network_and_no_script(written: Path) -> None:
    for path in written.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert "<script" not in text
        assert not re.search(r'(?:src|url\()\s*=?\s*["\']?https?:', text)


def test_links_between_pages_lead_somewhere(written: Path) -> None:
    for path in written.glob("*.html"):
        for address in re.findall(r'href="([^":#]+)"', path.read_text(encoding="utf-8")):
            assert (written / address).is_file(), (path.name, address)


def test_every_cited_source_of_the_suite_is_known() -> None:
    suite = gather_pages(tasks())
    keys = {cite.key for p in suite.pages for cite in p.sources}
    assert keys == set(suite.cited)


def test_the_suite_is_written_fast(tmp_path: Path) -> None:
    every = tasks()
    start = time.perf_counter()
    write(every, ["latex", "html", "markdown"], tmp_path)
    assert time.perf_counter() - start < 3


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("pdflatex") is None or shutil.which("pdftotext") is None, reason="no TeX or no poppler"
)
def test_the_suite_as_pdf(tmp_path: Path) -> None:
    """It compiles without an overfull box, and its text says what it should."""
    every = tasks()
    path = write(every, ["pdf"], tmp_path, facts={t.id: gather(t) for t in every}, columns=[{}])[-1]
    log = (tmp_path / "document.log").read_text(encoding="latin-1")
    assert "Overfull" not in log
    assert "undefined" not in log
    text = subprocess.run(["pdftotext", "-layout", path, "-"], capture_output=True, text=True, check=True).stdout
    for task in every:
        assert f"{task.name}: " in text
    for found in ("Exact scores: optimal return 4", "Configurable parameters", "Horizon: 3M", "References", "DERAIL"):
        assert found in text
    assert "[U+" not in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no TeX")
def test_the_appendix_goes_into_a_paper_of_another_folder(tmp_path: Path) -> None:
    write([registry.load("derail/RiskyPath-v0"), registry.load("derail/Sort-v0")], ["latex"], tmp_path / "build")
    paper = (
        r"\documentclass[twocolumn]{article}\newcommand{\taskspecpath}{build/}\input{build/preamble}"
        r"\begin{document}Text.\onecolumn\appendix\input{build/appendix}\end{document}"
    )
    (tmp_path / "paper.tex").write_text(paper, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, errors="replace", check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout


def test_a_missing_extra_says_how_to_install_it() -> None:
    with pytest.raises(SpecError, match=r"pip install .*\[docs\]") as caught:
        need("taskspec_has_no_such_module", "docs")
    assert caught.value.diagnostics[0].code == "E705"


def test_unknown_format(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="E713"):
        write([registry.load("derail/Sort-v0")], ["docx"], tmp_path)


def test_every_spec_of_the_tests_has_a_page(tmp_path: Path) -> None:
    """Other tasks than the suite's: maps, constants, noise, one-hot observations, time."""
    every = [registry.load(str(p)) for p in sorted((ROOT / "tests" / "specs").glob("*.yaml"))]
    write(every, ["latex", "html", "markdown"], tmp_path)
    for path in tmp_path.glob("*.html"):
        for block in re.findall(r"<math.*?</math>", path.read_text(encoding="utf-8"), re.DOTALL):
            ElementTree.fromstring(block)
