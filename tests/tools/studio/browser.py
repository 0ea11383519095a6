"""The studio in Chromium: a server of a copy of the tasks of DERAIL, and a page of it that tests, benchmarks and pictures use."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TASKS = Path(__file__).parents[3] / "tasks" / "derail"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
TABS = ("Spec", "Play", "Values", "Rollouts", "Sweep", "Results")


@dataclass(frozen=True)
class Served:
    """A folder of specs that a studio serves, and the address of its page."""

    folder: Path
    address: str


@contextmanager
def served(place: Path) -> Iterator[Served]:
    """Serve a copy of the tasks of DERAIL, in a new folder at a place."""
    folder = place / "derail"
    folder.mkdir()
    for path in (*TASKS.glob("*.yaml"), *TASKS.glob("*.bib")):
        shutil.copy(path, folder)
    command = [sys.executable, "-m", "taskspec", "studio", str(folder / "risky_path.yaml"), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8")
    assert process.stdout is not None
    try:
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None, "the studio did not start"
        yield Served(folder, found[0])
    finally:
        process.terminate()
        process.communicate()


@contextmanager
def chromium() -> Iterator[Any]:
    """Start Chromium."""
    from playwright.sync_api import sync_playwright  # installed where a browser is wanted

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


VIEW = """
  const { EditorView } = await import("/static/codemirror.js");
  const view = EditorView.findFromDOM(document.querySelector(".cm-editor"));
"""
"""JavaScript that finds the editor."""


class Page:
    """A page of the studio, and what its console has said."""

    def __init__(self, browser: Any, served: Served, fragment: str = "", **options: Any) -> None:
        self.served = served
        self.context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
        self.context.grant_permissions(["clipboard-read", "clipboard-write"])
        self.context.set_default_timeout(60_000)
        self.page = self.context.new_page()
        self.said: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("dialog", lambda dialog: dialog.accept())
        self.page.goto(served.address + fragment)
        self.follow()

    def open(self, name: str) -> None:
        """Open a spec by its name, with the keyboard alone."""
        self.page.keyboard.press("Control+o")
        self.page.keyboard.type(name)
        self.page.keyboard.press("Tab")
        self.page.keyboard.press("Enter")
        self.page.wait_for_function("name => document.getElementById('file').value === name", arg=name)
        self.follow()

    def follow(self) -> None:
        """Wait until all that is shown belongs to the text."""
        self.page.wait_for_function(
            """() => document.querySelector(".scores") && document.querySelector("#problems p") &&
               !document.querySelector("[role=tabpanel]:not([hidden]) [aria-busy]")"""
        )

    def select(self, text: str) -> None:
        """Select the first place of a text in the editor."""
        self.page.locator(".cm-content").focus()
        select = """
          const anchor = view.state.doc.toString().indexOf(text);
          view.dispatch({ selection: { anchor, head: anchor + text.length }, scrollIntoView: true });
        """
        self.page.evaluate(f"async (text) => {{ {VIEW} {select} }}", text)

    def replace(self, old: str, new: str) -> None:
        """Select the first place of a text in the editor, and type another one over it."""
        self.select(old)
        self.page.keyboard.type(new)

    @property
    def text(self) -> str:
        """Return the whole text in the editor."""
        text: str = self.page.evaluate(f"async () => {{ {VIEW} return view.state.doc.toString(); }}")
        return text

    def show(self, tab: str) -> Any:
        """Choose a tab and return its panel."""
        self.page.locator(f"#tab-{tab}").click()
        self.page.wait_for_function("name => !document.querySelector(`#panel-${name} [aria-busy]`)", arg=tab)
        return self.page.locator(f"#panel-{tab}")

    def score(self, name: str) -> Any:
        """Return the cell of a score."""
        return self.page.locator(".scores tr", has_text=name).locator("td").first
