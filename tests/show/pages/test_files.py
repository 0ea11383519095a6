"""The printed files are those recorded, well formed, and written fast."""

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.base.extras import need
from taskspec.language import registry
from taskspec.language.task.task import Task
from taskspec.show.pages.facts import gather
from taskspec.show.pages.write import gather_pages, write
from taskspec.show.printers import tex
from taskspec.show.printers.markup import mathml
from tests.shared import paper
from tests.shared.paper import TEX, compiled
from tests.shared.specs import suite_ids, varied_files
from tests.shared.work import calls

ROOT = Path(__file__).parents[3]
GOLDEN = ROOT / "tests" / "golden" / "appendix"
RECORDED = ["derail/RiskyPath-v0", "derail/Parabola-v0", "derail/Sort-v0"]
"""Tasks whose pages are recorded in three formats."""
FIGURES = ROOT / "docs" / "reference" / "derail" / "figures"


def tasks() -> list[Task]:
    return list(map(registry.load, suite_ids("derail")))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    write(tasks(), ["latex", "html", "markdown"], out)
    return out


def recorded(path: Path) -> str:
    """A file as it is recorded: without the style sheet and the spec's own source."""
    text = re.sub(r"<style>.*?</style>", "<style></style>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r'(<pre class="yaml".*?>).*?</pre>', r"\1</pre>", text, flags=re.DOTALL)


def files(folder: Path) -> list[Path]:
    """The files in a folder and its folders, as paths from there."""
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def test_golden_files(tmp_path: Path, update_golden: bool) -> None:
    write(RECORDED, ["latex", "html", "markdown"], tmp_path)
    if update_golden:
        shutil.rmtree(GOLDEN)
        for path in files(tmp_path):
            (GOLDEN / path).parent.mkdir(parents=True, exist_ok=True)
            (GOLDEN / path).write_text(recorded(tmp_path / path), encoding="utf-8", newline="\n")
    assert files(tmp_path) == files(GOLDEN)
    for path in files(tmp_path):
        told = (GOLDEN / path).read_text(encoding="utf-8")
        assert recorded(tmp_path / path) == told, f"{path}: pytest --update-golden, then read the diff"


def test_every_task_has_a_page_in_every_format(written: Path) -> None:
    latex = "".join(map(Path.read_text, written.glob("*.tex")))
    for page in gather_pages(tasks()).pages:
        html = (written / f"{page.anchor}.html").read_text(encoding="utf-8")
        markdown = (written / f"{page.anchor}.md").read_text(encoding="utf-8")
        assert rf"\label{{task:{page.anchor}}}" in latex
        for section in page.sections:
            assert f">{section.title}<" in html, (page.id, section.key)
            assert f"**{section.title}**" in markdown, (page.id, section.key)


def test_the_figures_of_the_documentation_are_those_of_the_specs(written: Path, update_golden: bool) -> None:
    for path in sorted((written / "figures").glob("*.svg")):
        if path.stem.endswith("-seals"):
            continue
        if update_golden:
            shutil.copy(path, FIGURES)
        assert (FIGURES / path.name).read_text(encoding="utf-8") == path.read_text(encoding="utf-8"), "--update-golden"


def test_mathematics_of_the_site_is_read_to_the_end(written: Path) -> None:
    """The site makes MathML of TeX between dollars; what our reader does not know would remain as a command."""
    for page in (*sorted((ROOT / "docs").rglob("*.md")), *sorted(written.glob("*.md"))):
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for formula in re.findall(r"(?<!\\)\$([^$]+)\$", text):
            assert "\\" not in mathml(tex.read(formula)), (page.name, formula)


def check_markup(folder: Path) -> None:
    """Mathematics and pictures of pages are well-formed XML."""
    for path in folder.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        for markup in re.findall(r"<math.*?</math>|<svg.*?</svg>", text, re.DOTALL):
            ElementTree.fromstring(markup)


def test_mathml_is_well_formed(written: Path) -> None:
    check_markup(written)


def test_pages_need_no_network_and_but_the_gallery_no_script(written: Path) -> None:
    for path in written.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert text.count("<script") == (path.name == "index.html") and "src=" not in text
        assert not re.search(r'(?:src|url\()\s*=?\s*["\']?https?:', text)


def test_links_between_pages_lead_somewhere(written: Path) -> None:
    for path in written.glob("*.html"):
        for address in re.findall(r'href="([^":#]+)"', path.read_text(encoding="utf-8")):
            assert (written / address).is_file(), (path.name, address)


def test_every_cited_source_of_the_suite_is_known() -> None:
    suite = gather_pages(tasks())
    keys = set()
    for page in suite.pages:
        keys |= {cite.key for cite in page.sources}
    assert keys == set(suite.cited)


def test_the_suite_is_written_fast(tmp_path: Path) -> None:
    every = tasks()
    assert calls(lambda: write(every, ["latex", "html", "markdown"], tmp_path)) < 10_000_000


@pytest.mark.slow
@TEX
@pytest.mark.usefixtures("kept_log")
def test_the_suite_as_pdf(tmp_path: Path) -> None:
    """It compiles without an overfull box, and its text says what it should."""
    every = tasks()
    path = write(every, ["pdf"], tmp_path, facts={t.id: gather(t) for t in every}, columns=[{}])[-1]
    log = (tmp_path / "document.log").read_text(encoding="latin-1")
    assert "Overfull" not in log
    assert "undefined" not in log
    text = paper.text(path, "-layout")
    for task in every:
        assert re.search(rf"\b{task.name}[:,] ", text)
    for found in ("Exact scores and claims:", "Configurable parameters", "Horizon: 3M", "References", "DERAIL"):
        assert found in text
    assert "[U+" not in text


@pytest.mark.slow
@TEX
def test_the_appendix_goes_into_a_paper_of_another_folder(tmp_path: Path) -> None:
    write(["derail/RiskyPath-v0", "derail/Sort-v0"], ["latex"], tmp_path / "build")
    source = (
        r"\documentclass[twocolumn]{article}\newcommand{\taskspecpath}{build/}\input{build/preamble}"
        r"\begin{document}Text.\onecolumn\appendix\input{build/appendix}\end{document}"
    )
    assert "Overfull" not in compiled(tmp_path, source)


def test_a_missing_extra_says_how_to_install_it() -> None:
    with pytest.raises(SpecError, match=r"pip install .*\[docs\]") as caught:
        need("taskspec_has_no_such_module", "docs")
    assert caught.value.diagnostics[0].code == "E705"


def test_unknown_format(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="E726"):
        write([registry.load("derail/Sort-v0")], ["docx"], tmp_path)


def test_every_spec_of_the_tests_has_a_page(tmp_path: Path) -> None:
    """Other tasks than the suite's: maps, constants, noise, one-hot observations, time."""
    write(varied_files(), ["latex", "html", "markdown"], tmp_path)
    check_markup(tmp_path)
