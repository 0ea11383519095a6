"""The printed files are those recorded, well formed, and written fast."""

import re
import shutil
import subprocess
import time
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
from tests.shared.specs import varied_files

ROOT = Path(__file__).parents[3]
GOLDEN = ROOT / "tests" / "golden" / "appendix"
RECORDED = [f"derail/{name}-v0" for name in ("RiskyPath", "Parabola", "Sort")]
"""Tasks whose pages are recorded in three formats."""
FIGURES = ROOT / "docs" / "reference" / "derail" / "figures"
IDS = [i for i in registry.task_ids() if i.startswith("derail/")]


def tasks() -> list[Task]:
    return [registry.load(i) for i in IDS]


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


def test_golden_files(tmp_path: Path, update_golden: bool) -> None:
    write(RECORDED, ["latex", "html", "markdown"], tmp_path)
    found = {str(p.relative_to(tmp_path)): recorded(p) for p in sorted(tmp_path.rglob("*")) if p.is_file()}
    compare(found, GOLDEN, update_golden)


def test_every_task_has_a_page_in_every_format(written: Path) -> None:
    pages = gather_pages(tasks()).pages
    for page in pages:
        html = (written / f"{page.anchor}.html").read_text(encoding="utf-8")
        markdown = (written / f"{page.anchor}.md").read_text(encoding="utf-8")
        latex = "".join(path.read_text(encoding="utf-8") for path in written.glob("*.tex"))
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


def test_mathml_is_well_formed(written: Path) -> None:
    for path in written.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        for block in re.findall(r"<math.*?</math>", text, re.DOTALL):
            ElementTree.fromstring(block)
        for picture in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
            ElementTree.fromstring(picture)


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
    keys = {cite.key for p in suite.pages for cite in p.sources}
    assert keys == set(suite.cited)


def test_the_suite_is_written_fast(tmp_path: Path) -> None:
    every = tasks()
    start = time.process_time()  # of the processor, whatever else runs on it
    write(every, ["latex", "html", "markdown"], tmp_path)
    assert time.process_time() - start < 3


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("pdflatex") is None or shutil.which("pdftotext") is None, reason="no TeX or no poppler"
)
@pytest.mark.usefixtures("kept_log")
def test_the_suite_as_pdf(tmp_path: Path) -> None:
    """It compiles without an overfull box, and its text says what it should."""
    every = tasks()
    path = write(every, ["pdf"], tmp_path, facts={t.id: gather(t) for t in every}, columns=[{}])[-1]
    log = (tmp_path / "document.log").read_text(encoding="latin-1")
    assert "Overfull" not in log
    assert "undefined" not in log
    text = subprocess.run(["pdftotext", "-layout", path, "-"], capture_output=True, text=True, check=True).stdout
    for task in every:
        assert re.search(rf"\b{task.name}[:,] ", text)
    for found in ("Exact scores and claims:", "Configurable parameters", "Horizon: 3M", "References", "DERAIL"):
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
    with pytest.raises(SpecError, match="E726"):
        write([registry.load("derail/Sort-v0")], ["docx"], tmp_path)


def test_every_spec_of_the_tests_has_a_page(tmp_path: Path) -> None:
    """Other tasks than the suite's: maps, constants, noise, one-hot observations, time."""
    every = [registry.load(str(p)) for p in varied_files()]
    write(every, ["latex", "html", "markdown"], tmp_path)
    for path in tmp_path.glob("*.html"):
        for block in re.findall(r"<math.*?</math>", path.read_text(encoding="utf-8"), re.DOTALL):
            ElementTree.fromstring(block)
