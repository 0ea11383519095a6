"""Printed pages of specs that the pages were not written for: nothing runs off them, and none is left empty."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from taskspec.show.pages.write import write
from tests.shared import paper
from tests.shared.paper import TEX
from tests.shared.specs import spec_file

ROOT = Path(__file__).parents[3]
NAMES = (
    "rock_sample", "shuttle", "tiger", "taxi", "blackjack", "frozen_lake", "battleship", "higher_lower", "minesweeper",
    "hanoi", "key_door", "river_crossing", "tic_tac_toe", "epidemic", "inventory", "two_goals", "random_walk", "off_switch",
    "umbrella",
)  # fmt: skip
FOREIGN = [*sorted((ROOT / "tests" / "specs").rglob("*.yaml")), *map(spec_file, NAMES)]
LEAST = 0.45
"""The share of its height to which every page but the last is filled."""


@pytest.mark.slow
@TEX
@pytest.mark.usefixtures("kept_log")
def test_pages_of_foreign_specs_are_full_and_nothing_runs_off_them(tmp_path: Path) -> None:
    assert len(FOREIGN) >= 30
    path = write(FOREIGN, ["pdf"], tmp_path)[-1]
    assert "Overfull" not in (tmp_path / "document.log").read_text(encoding="latin-1")
    pages = paper.pages(path)
    for number, page in enumerate(pages, start=1):
        ends = page.bottom / page.height
        last = ends[ends < ends.max() - 0.01].max()  # above the number of the page
        assert last < 0.95, number
        assert last >= LEAST or number > len(pages) - 2, number


def test_wide_formulas_can_break_into_lines_on_small_screens(tmp_path: Path) -> None:
    """A formula that is decided case by case is a grid of cells, and one in brackets is cut at its signs."""
    write([spec_file("tiger"), spec_file("taxi")], ["html"], tmp_path)
    tiger = (tmp_path / "tiger.html").read_text(encoding="utf-8")
    reward = tiger.partition('id="rewards"')[2].partition("</dd>")[0]
    grid = re.findall(r'<span class="split" role="math" aria-label="R\(tiger, a\) = \{ −1 if a = listen;[^"]*"', reward)
    assert len(grid) == 1 and reward.count("<math") > 2 * 4  # four cases, each a value and a condition in pieces
    taxi = (tmp_path / "taxi.html").read_text(encoding="utf-8")
    assert 'class="rigid"' not in taxi.partition('id="dynamics"')[2].partition("</dd>")[0]


PHONE = 390
"""The width of a telephone's screen in pixels."""
MEASURE = """
async function measure() {
  const found = [];
  for (const name of PAGES) {
    const frame = document.createElement("iframe");
    frame.style.width = WIDTH + "px";
    frame.src = name;
    document.body.append(frame);
    await new Promise(resolve => frame.onload = resolve);
    const page = frame.contentDocument;
    if (page.documentElement.scrollWidth > WIDTH) found.push([name, "page"]);
    for (const e of page.querySelectorAll(".section *, .make"))
      if (e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX === "auto")
        found.push([name, e.textContent]);
    frame.remove();
  }
  document.body.textContent = "MEASURED" + JSON.stringify(found);
}
measure();
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no browser")
def test_nothing_scrolls_sideways_on_small_screens(tmp_path: Path) -> None:
    """Formulas and tables of examples; the text of the spec may."""
    pages = [path.name for path in write(FOREIGN, ["html"], tmp_path) if path.suffix == ".html"]
    script = f"const WIDTH = {PHONE}; const PAGES = {json.dumps(pages)};{MEASURE}"
    (tmp_path / "measure.html").write_text(f"<body><script>{script}</script>", encoding="utf-8")
    command = ["chromium", "--headless=new", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"]
    command += ["--virtual-time-budget=100000", "--dump-dom", f"file://{tmp_path}/measure.html"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    found = html.unescape(done.stdout.partition("MEASURED")[2].partition("</body>")[0])
    assert [name for name, _ in json.loads(found)] in ([], ["blackjack.html"])  # which has a line of 120 letters
