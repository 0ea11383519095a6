"""Take the pictures of the studio in Chromium, light and dark: `python -m docs.tools.screens`, in the root of a checkout."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.tools.studio.browser import Page, chromium, served

PICTURES = Path(__file__).parents[1] / "pictures"
SIZE = {"width": 1280, "height": 760}


def spec(studio: Page) -> None:
    """Show the figure, scores and mathematics of RiskyPath, beside the lines of the spec that they are made of."""
    studio.select("claims:")
    studio.page.keyboard.press("ArrowLeft")


def values(studio: Page) -> None:
    """Show the maximum-entropy policy of RiskyPath, with the lines of the spec about one of its states."""
    panel = studio.show("Values")
    panel.get_by_label("policy").first.select_option("maxent")
    studio.follow()
    panel.locator("tbody tr", has_text="detour").hover()


SCREENS: dict[str, Callable[[Page], None]] = {"light": spec, "dark": values}
"""What is shown, by theme."""


def main() -> None:
    """Write each picture."""
    with tempfile.TemporaryDirectory() as place, served(Path(place)) as tasks, chromium() as browser:
        for theme, show in SCREENS.items():
            studio = Page(browser, tasks, color_scheme=theme, viewport=SIZE)
            show(studio)
            studio.page.wait_for_timeout(300)  # until the lines are marked
            studio.page.screenshot(path=PICTURES / f"studio-{theme}.png")


if __name__ == "__main__":
    main()
