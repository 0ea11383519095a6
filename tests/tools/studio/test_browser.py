"""The page of `taskspec studio` in Chromium, as people use it: by keyboard and mouse, wide and narrow, light and dark."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.tools.studio.browser import CHROMIUM, TABS, Page, Served, chromium, served

expect = pytest.importorskip("playwright.sync_api").expect
expect.set_options(timeout=60_000)  # it is a busy machine that tests run on
for _package in ("pygls", "starlette", "uvicorn", "websockets"):
    pytest.importorskip(_package)

ROOT = Path(__file__).parents[3]
MODULES = [
    ROOT / "docs/tools/studio/node_modules",
    *map(Path, filter(None, os.environ.get("NODE_PATH", "").split(":"))),
]
AXE = next((path for folder in MODULES if (path := folder / "axe-core/axe.min.js").is_file()), None)
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium"),
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module", name="browser")
def _browser() -> Iterator[Any]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module", name="tasks")
def _tasks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(tmp_path_factory.mktemp("served")) as found:
        yield found


@pytest.fixture
def studio(browser: Any, tasks: Served) -> Iterator[Page]:
    page = Page(browser, tasks)
    yield page
    page.context.close()
    assert page.said == []


def test_scores_mathematics_and_figure_follow_the_text(studio: Page) -> None:
    expect(studio.score("optimal return")).to_have_text("4")  # the detour takes one of 5 steps, and then each pays 1
    studio.replace("rows: {goal: 1, ", "rows: {goal: 2, ")
    expect(studio.score("optimal return")).to_have_text("8")
    expect(studio.page.locator(".printed #rewards")).to_contain_text("2if")
    expect(studio.page.locator("#panel-Spec svg").first).to_contain_text("2")
    expect(studio.page.locator("#unsaved")).to_have_text("edited")
    expect(studio.page.locator(".claims li", has_text="optimal_return == 4").locator(".fails")).to_be_visible()


def test_a_mistake_is_underlined_and_its_fix_applied_by_key_and_by_click(studio: Page) -> None:
    marked = studio.page.locator(".cm-lintRange-error")
    for press in (
        lambda: studio.page.keyboard.press("Control+."),
        lambda: studio.page.locator("#problems .fix").click(),
    ):
        studio.replace("highlight:", "highlihgt:")
        expect(marked).to_have_text("highlihgt")
        expect(studio.page.locator("#problems .error")).to_contain_text("line 66")
        press()
        expect(marked).to_have_count(0)
        assert "  highlight: {good" in studio.text


def test_what_was_shown_stays_while_the_text_has_mistakes(studio: Page) -> None:
    studio.replace("horizon: 5", "horizon: fi")
    expect(studio.page.locator("#stale")).to_contain_text("'fi'")
    expect(studio.score("optimal return")).to_have_text("4")
    studio.replace("horizon: fi", "horizon: 6")
    expect(studio.page.locator("#stale")).to_be_hidden()
    expect(studio.score("optimal return")).to_have_text("5")


def test_a_tab_says_why_it_has_nothing_to_show(studio: Page) -> None:
    studio.open("parabola.yaml")
    panel = studio.show("Values")
    expect(panel.locator(".problem")).to_contain_text("there is no exact model: 'x' has infinitely many values")
    assert panel.evaluate("panel => getComputedStyle(panel, '::before').content") == "none"  # "Working it out…"
    panel = studio.show("Rollouts")
    expect(panel.locator(".problem")).to_contain_text("the policy 'optimal' is planned on the exact model")


def test_names_are_completed_explained_and_renamed(studio: Page) -> None:
    page = studio.page
    studio.replace("horizon: 5", "hori")
    page.keyboard.press("Control+Space")
    option = page.locator(".cm-tooltip-autocomplete li", has_text="horizon")
    expect(option).to_be_visible()
    page.wait_for_timeout(100)  # CodeMirror takes no key in the first moments
    page.keyboard.press("Enter")
    page.keyboard.type(": 5")
    studio.follow()
    page.locator(".cm-line", has_text="reachable(s").locator(".code-enumMember").first.hover()
    expect(page.locator(".cm-lsp-hover-tooltip")).to_contain_text("trap: label")
    studio.replace("reachable(s ==", "reachable(s")
    page.keyboard.press("F2")
    page.keyboard.type("place")
    page.keyboard.press("Enter")
    expect(page.locator(".cm-line", has_text="by: [place, a]")).to_be_visible()


def test_a_slider_moves_the_parameter_and_its_results(studio: Page) -> None:
    studio.open("noisy_obs.yaml")
    expect(studio.score("optimal return")).to_have_text("12")  # 4 steps to the centre of 5 by 5 cells; 15 in all
    slider = studio.page.get_by_label("M", exact=True)
    slider.focus()
    for _ in range(2):
        studio.page.keyboard.press("ArrowRight")
    expect(studio.page.get_by_label("M as a number")).to_have_value("7")
    studio.follow()
    expect(studio.score("optimal return")).to_have_text("16")  # 6 steps to the centre of 7 by 7; 21 in all
    studio.page.get_by_role("button", name="Reset").click()
    expect(studio.score("optimal return")).to_have_text("12")
    expect(studio.page.get_by_label("M as a number")).to_have_value("5")


def test_a_game_is_played_to_its_end_with_regret_and_undo(studio: Page) -> None:
    panel = studio.show("Play")
    fact = lambda name: panel.locator(".facts div", has_text=name).locator("dd")  # noqa: E731
    panel.focus()
    studio.page.keyboard.press("1")
    expect(fact("regret")).to_have_text("251.5")  # 4 along the detour; a trap or a goal at even odds is worth -247.5
    studio.page.keyboard.press("Backspace")
    expect(fact("time")).to_have_text("0 of 5")
    for time in range(1, 6):
        studio.page.keyboard.press("0")
        expect(fact("time")).to_have_text(f"{time} of 5")
    expect(panel.locator(".end")).to_contain_text("truncated")
    expect(fact("return")).to_have_text("4")
    expect(fact("regret")).to_have_text("0")
    assert panel.locator("table tbody tr").count() == 5
    studio.page.keyboard.press("Enter")
    expect(fact("time")).to_have_text("0 of 5")
    panel.get_by_role("button", name="safe").click()
    expect(fact("time")).to_have_text("1 of 5")


def test_a_state_that_is_pointed_at_marks_its_lines_of_the_spec(studio: Page) -> None:
    panel = studio.show("Values")
    row = panel.locator("tbody tr", has_text="detour")
    expect(row.locator("td").first).to_have_text("5")  # from the detour, each step but the first pays... after the step
    row.hover()
    expect(studio.page.locator(".cm-line.marked", has_text="detour: {safe: goal")).to_be_visible()
    panel.get_by_label("policy").first.select_option("soft")
    expect(panel.get_by_label("temperature")).to_be_visible()


def test_a_film_is_stepped_and_scrubbed(studio: Page) -> None:
    panel = studio.show("Rollouts")
    expect(panel).to_contain_text("return of the episode: 4")
    panel.get_by_role("button", name="Play").click()
    expect(panel).to_contain_text("step 5 of 5: action safe, reward 1, return 4")
    panel.get_by_label("step", exact=True).fill("0")
    panel.get_by_label("One step on").click()
    expect(panel).to_contain_text("step 1 of 5: action safe, reward 0")
    panel.get_by_label("step", exact=True).fill("5")
    expect(panel).to_contain_text("step 5 of 5: action safe, reward 1, return 4")


def test_exact_returns_over_a_parameter(studio: Page) -> None:
    studio.open("noisy_obs.yaml")
    panel = studio.show("Sweep")
    panel.get_by_label("values").fill("3, 5, 7")
    panel.get_by_label("values").press("Enter")
    expect(panel.locator("tbody tr")).to_have_count(3)
    assert panel.locator("tbody tr").all_inner_texts()[0].split()[:2] == ["3", "8"]  # 2 steps to the centre, 9 in all
    random = panel.locator("tbody tr").first.locator("td").nth(2).locator("span")
    exact = random.get_attribute("title")
    assert len(exact) > 6 and random.inner_text() == f"{float(exact):.3g}"


def test_a_save_is_refused_after_the_file_was_changed_outside(studio: Page) -> None:
    page = studio.page
    path = studio.served.folder / "sort.yaml"
    before = path.read_text(encoding="utf-8")
    studio.open("sort.yaml")
    studio.replace("title: ", "title: My ")
    page.keyboard.press("Control+s")
    expect(page.locator("#notice")).to_have_text("Saved sort.yaml. ")
    saved = before.replace("title: ", "title: My ", 1)
    assert path.read_text(encoding="utf-8") == saved
    path.write_text(saved + "# by another program\n", encoding="utf-8")
    studio.replace("title: My", "title: Our")
    page.keyboard.press("Control+s")
    expect(page.locator("#notice.problem")).to_be_visible()
    assert path.read_text(encoding="utf-8") == saved + "# by another program\n"
    page.get_by_role("button", name="Open the file again").click()
    expect(page.locator(".cm-line", has_text="title: My")).to_be_visible()


def test_a_new_spec_is_begun_saved_copied_and_shared(studio: Page, browser: Any) -> None:
    page = studio.page
    page.locator("#open").click()
    page.locator("#choices").get_by_text("corridor").click()
    expect(page.locator("#file")).to_have_value("")
    page.keyboard.press("Control+s")
    expect(page.locator("#file")).to_be_focused()
    page.keyboard.type("mine.yaml")
    page.keyboard.press("Control+s")
    expect(page.locator("#notice")).to_contain_text("Saved mine.yaml.")
    assert (studio.served.folder / "mine.yaml").read_text(encoding="utf-8") == studio.text
    page.locator("#copy").click()
    page.get_by_role("button", name="LaTeX").click()
    expect(page.locator("#notice")).to_contain_text("Copied")
    assert r"\begin{" in page.evaluate("navigator.clipboard.readText()")
    studio.replace("horizon: 2 * L", "horizon: 3 * L")
    page.locator("#share").click()
    expect(page.locator("#notice")).to_contain_text("address")
    fragment = page.evaluate("navigator.clipboard.readText()")
    other = Page(browser, studio.served, fragment)
    assert other.text == studio.text and "horizon: 3 * L" in other.text
    other.context.close()


def test_everything_is_reached_by_keyboard(studio: Page) -> None:
    page = studio.page
    page.locator("body").press("Tab")
    reached = set()
    for _ in range(60):
        where = page.evaluate("() => document.activeElement.id || document.activeElement.className.split(' ')[0]")
        reached.add(where)
        if where == "cm-content":
            page.keyboard.press("Escape")
        page.keyboard.press("Tab")
    assert {
        "open",
        "save",
        "copy",
        "share",
        "theme",
        "help",
        "cm-content",
        "divider",
        "tab-Spec",
        "panel-Spec",
    } <= reached
    page.locator("#tab-Spec").focus()
    for name in (*TABS[1:], TABS[0]):
        page.keyboard.press("ArrowRight")
        expect(page.locator(f"#panel-{name}")).to_be_visible()
    page.locator("#theme").press("Enter")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 27)"
    page.reload()
    studio.follow()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 27)"
    page.keyboard.press("Alt+3")
    expect(page.locator("#panel-Values")).to_be_visible()


@pytest.mark.parametrize(("theme", "width"), [("light", 1280), ("dark", 390)])
@pytest.mark.skipif(AXE is None, reason="axe-core is not installed: npm install in docs/tools/studio")
def test_axe_finds_nothing(browser: Any, tasks: Served, theme: str, width: int) -> None:
    assert AXE is not None
    size = {"width": width, "height": 800}
    studio = Page(browser, tasks, color_scheme=theme, reduced_motion="reduce", viewport=size)
    found = {}

    def examine(what: str) -> None:
        studio.page.evaluate(AXE.read_text(encoding="utf-8"))
        for each in studio.page.evaluate("axe.run()")["violations"]:
            found[what, each["id"]] = [node["html"] for node in each["nodes"]]

    studio.page.locator("#open").click()
    examine("files")
    studio.page.keyboard.press("Escape")
    studio.open("noisy_obs.yaml")
    for tab in TABS:
        studio.show(tab)
        examine(tab)
    studio.show("Spec")
    studio.page.locator("#help").click()
    examine("keys")
    studio.page.keyboard.press("Escape")
    studio.replace("horizon:", "horizn:")
    expect(studio.page.locator("section.old").first).to_be_visible()
    examine("mistakes")
    assert found == {}, json.dumps({" ".join(where): nodes[:3] for where, nodes in found.items()}, indent=1)
    studio.context.close()


@pytest.mark.parametrize("width", [390, 760, 1920])
def test_no_width_scrolls_sideways(browser: Any, tasks: Served, width: int) -> None:
    studio = Page(browser, tasks, viewport={"width": width, "height": 844})
    studio.open("proc_goal.yaml")
    for tab in TABS:
        studio.show(tab)
        assert studio.page.evaluate("document.documentElement.scrollWidth") == width, tab
        editor = studio.page.locator("#editor").bounding_box()
        assert 300 < editor["height"] < 844 and editor["width"] > 300
    studio.context.close()
    assert studio.said == []
