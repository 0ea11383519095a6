"""Pages as LaTeX in the places where people put them: sections of families, two columns, slides, numbered captions, metadata."""

import re
from pathlib import Path

import numpy as np
import pytest

from taskspec.show.pages.write import write
from tests.shared import paper
from tests.shared.commands import Done
from tests.shared.paper import TEX, compiled
from tests.shared.sparse import sparse
from tests.shared.specs import spec_file

FAMILY = ["derail/Branching-v0", "derail/BranchingSeals-v0", "derail/Sort-v0"]
WIDE = """\
taskspec: 1
name: Wide
state:
  x: {type: int, low: 0, high: 4}
  y: {type: int, low: 0, high: 4}
action:
  move: {type: choice, values: {up: [0, -1], down: [0, 1], left: [-1, 0], right: [1, 0]}}
horizon: 10
initial: {x: 0, y: 0}
dynamics:
  x': clip(x + move[0], 0, 4)
  y': clip(y + move[1], 0, 4)
reward: REWARD
expert: {move: right}
figure: {kind: grid, at: [x, y]}
"""
LONG = """[
  {if: "x' == 4 and (y' == 0 or y' == 1 or y' == 2 or y' == x) and not (x == 4 and y == 4)", then: 1},
  {if: "x' == 2", then: -1}, {else: 0}]"""


def test_variants_follow_their_task_with_what_differs(tmp_path: Path) -> None:
    write(FAMILY, ["latex"], tmp_path)
    assert not (tmp_path / "branching-seals.tex").exists()
    text = (tmp_path / "branching.tex").read_text(encoding="utf-8")
    assert text.count(r"\subsection") == 1
    assert r"\label{task:branching}" in text
    assert r"\label{task:branching-seals}" in text
    first, second = text.split("\n\\noindent\\texttt{BranchingSeals}: ")
    assert "State space" in first and "State space" not in second
    assert "Horizon: $L$" in first and "Horizon: $11$" in second
    assert "Transition graph of BranchingSeals" in second  # its notes differ, so it has a figure of its own
    names = (tmp_path / "appendix.tex").read_text(encoding="utf-8")
    assert re.findall(r"\\input\{\\taskspecpath (.*?)\}", names) == ["branching", "sort"]


def test_a_variant_whose_figure_is_the_same_has_none(tmp_path: Path) -> None:
    write(["derail/InitShiftExpert-v0", "derail/InitShiftLearner-v0"], ["latex"], tmp_path)
    assert (tmp_path / "init-shift-expert.tex").read_text(encoding="utf-8").count(r"\begin{tikzpicture}") == 1


@pytest.mark.slow
@TEX
@pytest.mark.parametrize("brief", [False, True], ids=["whole", "brief"])
@pytest.mark.parametrize(
    "opening",
    [
        r"\documentclass[twocolumn]{article}\input{preamble}\usepackage{lmodern,microtype}\begin{document}\input{appendix}",
        r"\documentclass{beamer}\input{preamble}\begin{document}\begin{frame}[allowframebreaks]{Tasks}\input{branching}\end{frame}",
    ],
    ids=["two columns", "slides"],
)
def test_pages_go_into_other_documents(opening: str, brief: bool, tmp_path: Path) -> None:
    write(FAMILY, ["latex"], tmp_path, brief=brief)
    said = compiled(tmp_path, opening + r"\end{document}", times=2)
    for points in re.findall(r"Overfull \\hbox \(([\d.]+)pt", said):
        assert float(points) < 15


@pytest.mark.slow
@TEX
@pytest.mark.parametrize(("width", "is_stacked"), [("19cm", False), ("8cm", True)])
def test_tables_that_would_shrink_too_far_are_stacked(width: str, is_stacked: bool, tmp_path: Path) -> None:
    """A row of a table has its words beside one another; of a stacked one, all rows have the titles."""
    write(["derail/Sort-v0"], ["latex"], tmp_path)
    page = rf"\textwidth={width}\input{{preamble}}"
    compiled(tmp_path, rf"\documentclass{{article}}{page}\begin{{document}}\input{{sort}}\end{{document}}")
    assert (paper.text(tmp_path / "paper.pdf").count("what follows") > 1) == is_stacked


LACKING = r"""\documentclass{article}
\let\found\IfFileExists
\def\IfFileExists#1#2#3{\ifnum\pdfstrcmp{#1}{mathtools.sty}=0 #3\else\found{#1}{#2}{#3}\fi}
\input{preamble}\begin{document}\input{sort}$\begin{dcases} 1 & 2 \end{dcases}$\end{document}"""


@pytest.mark.slow
@TEX
def test_pages_are_set_without_packages_that_a_small_tex_lacks(tmp_path: Path) -> None:
    write(["derail/Sort-v0"], ["latex"], tmp_path)
    compiled(tmp_path, LACKING)
    assert "mathtools" not in (tmp_path / "paper.log").read_text(encoding="latin-1")


@pytest.mark.slow
@TEX
def test_nothing_that_tex_leaves_stays_beside_the_document(tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(WIDE.replace("REWARD", "0"), encoding="utf-8")
    done = Done("docs", tmp_path / "short.yaml", "-f", "pdf", "--no-results", "-o", tmp_path / "out")
    assert done.status == 0, done.err
    beside = sorted((tmp_path / "out").glob("document.*"))
    assert beside == [tmp_path / "out" / "document.pdf", tmp_path / "out" / "document.tex"]


@pytest.mark.slow
@TEX
@pytest.mark.usefixtures("kept_log")
def test_the_document_has_numbered_captions_and_metadata(tmp_path: Path) -> None:
    path = write(FAMILY, ["pdf"], tmp_path, title="Three tasks")[-1]
    said = paper.about(path)
    assert re.search(r"^Title: +Three tasks$", said, re.MULTILINE)
    assert re.search(r"^Author: +taskspec$", said, re.MULTILINE)
    assert re.search(r"^Creator: +taskspec", said, re.MULTILINE)
    assert re.findall(r"Figure (\d+): ", paper.text(path)) == ["1", "2", "3"]
    assert "Overfull" not in (tmp_path / "document.log").read_text(encoding="latin-1")


@pytest.mark.slow
@TEX
@pytest.mark.parametrize(("reward", "is_above"), [("x' == 4", False), (LONG, True)], ids=["short", "long"])
@pytest.mark.usefixtures("kept_log")
def test_figures_make_room_for_formulas_that_would_shrink_too_far(reward: str, is_above: bool, tmp_path: Path) -> None:
    (tmp_path / "wide.yaml").write_text(WIDE.replace("REWARD", reward), encoding="utf-8")
    path = write([tmp_path / "wide.yaml"], ["pdf"], tmp_path)[-1]
    text = paper.text(path)
    assert (text.index("Figure 1") < text.index("State space")) == is_above
    assert "Overfull" not in (tmp_path / "document.log").read_text(encoding="latin-1")


def test_a_variant_shows_the_parameters_alone_that_have_other_values(tmp_path: Path) -> None:
    write(["seals/CliffWorld-v0", "seals/CliffWorldXY-v0"], ["latex"], tmp_path)
    first, second = (
        (tmp_path / "cliff-world.tex").read_text(encoding="utf-8").split(r"\noindent\texttt{CliffWorldXY}: ")
    )
    assert "number of columns" in first and "number of columns" not in second
    assert r"Configurable parameters: $\mathrm{xy} = \mathrm{true}$" in second


def test_blanks_of_a_map_are_named(tmp_path: Path) -> None:
    spec = Path(__file__).parents[2] / "specs" / "figures" / "keys.yaml"
    write([spec], ["html", "markdown", "latex"], tmp_path)
    for ending in ("html", "md", "tex"):
        (page,) = tmp_path.glob(f"keys*.{ending}")
        assert "# = 1, blank = 0)" in page.read_text(encoding="utf-8")
    assert "(# = 1, blank = 0)" in Done("show", spec, columns=100).out


def test_figures_at_settings_say_what_is_seen(tmp_path: Path) -> None:
    write(["derail/Branching-v0"], ["latex", "html", "markdown"], tmp_path, columns=[{"L": 5}])
    said = "L = 5. Transition graph of Branching: 11 states, 2 actions. "
    assert rf"\taskspecother{{{said}" in (tmp_path / "branching.tex").read_text(encoding="utf-8")
    assert f"<figcaption>{said}" in (tmp_path / "branching.html").read_text(encoding="utf-8")
    assert f"*{said}" in (tmp_path / "branching.md").read_text(encoding="utf-8")


@pytest.mark.slow
@TEX
@pytest.mark.parametrize(
    ("task", "first", "second", "stand_beside"),
    [("derail/Branching-v0", 5, 7, False), ("derail/Sort-v0", 2, 3, True)],
)
def test_figures_at_settings_are_stacked_where_they_would_shrink_too_far(
    task: str, first: int, second: int, stand_beside: bool, tmp_path: Path
) -> None:
    path = write([task], ["pdf"], tmp_path, columns=[{"L": first}, {"L": second}])[-1]
    (indent,) = re.findall(r"^(.*)Figure 3:", paper.text(path, "-layout"), re.MULTILINE)
    assert (len(indent) > 40) == stand_beside


@pytest.mark.slow
@TEX
def test_figures_of_short_pages_keep_most_of_their_size_on_slides(tmp_path: Path) -> None:
    write(FAMILY, ["latex"], tmp_path, brief=True)
    figure = r"\sbox{\taskspecfigure}{\rule{1cm}{100pt}}"
    fitted = r"\sbox0{\taskspecfitbrief{\usebox{\taskspecfigure}}}"
    frame = rf"\begin{{frame}}{figure}{fitted}\typeout{{TALL \the\ht0}}\end{{frame}}"
    document = rf"\documentclass{{beamer}}\input{{preamble}}\begin{{document}}{frame}\end{{document}}"
    said = compiled(tmp_path, document, times=2)
    assert float(re.findall(r"TALL ([\d.]+)pt", said)[0]) == pytest.approx(80, abs=0.1)


def test_cells_of_tables_are_not_broken_within_words(tmp_path: Path) -> None:
    """What is wider than the page scrolls in the box of the table."""
    write(["derail/Branching-v0"], ["html"], tmp_path)
    text = (tmp_path / "branching.html").read_text(encoding="utf-8")
    assert ".section dd :is(th, td) { overflow-wrap: normal; }" in text
    assert ".wide { overflow-x: auto; }" in text and '<div class="wide"' in text


@TEX
@pytest.mark.parametrize(("brief", "least"), [(False, 0.9), (True, 0.8)], ids=["whole", "brief"])
def test_the_text_of_figures_is_about_as_large_as_that_around_them(brief: bool, least: float, tmp_path: Path) -> None:
    """By the widths of a word that stands in both."""
    path = write(["derail/InitShiftExpert-v0"], ["pdf"], tmp_path, brief=brief)[-1]
    widths = np.concatenate([(page.right - page.left)[page.words == "right"] for page in paper.pages(path)])
    assert len(widths) > 3  # three arrows of the figure, and what is said of the action
    assert widths.min() >= least * widths.max(), widths


@TEX
@pytest.mark.usefixtures("kept_log")
@pytest.mark.parametrize("brief", sparse([True, False], 2))
def test_pages_of_other_tasks_are_filled_and_end_above_their_number(brief: bool, tmp_path: Path) -> None:
    """Long tasks with figures beside their text: by the last line of each page."""
    specs = map(spec_file, ("taxi", "tiger", "frozen_lake", "key_door", "blackjack"))
    path = write(list(specs), ["pdf"], tmp_path, brief=brief)[-1]
    assert r"Overfull \vbox" not in (tmp_path / "document.log").read_text(errors="replace")
    pages = paper.pages(path)
    assert len(pages) > 1
    for number, page in enumerate(pages, 1):
        foot = page.bottom[page.words == str(number)].max()
        last = page.bottom[page.bottom < foot].max()
        assert page.bottom.max() == foot and last < foot - 12
        assert number == len(pages) or last > 0.5 * page.height, (number, last / page.height)
