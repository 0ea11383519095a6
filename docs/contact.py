"""The contact sheets of all tasks: figures at several settings, and pages as wide as a telephone.

Both on light paper, on dark paper, and as without the green cones.

python docs/contact.py build/contact.html
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from taskspec import registry
from taskspec.base.files import write_text
from taskspec.figures import Scene, scene, svg
from taskspec.pages.render.html import gallery_style, page_style
from taskspec.pages.write import gather_pages, write_pages
from taskspec.task.task import Task

SETTINGS: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "branching": ({"L": 3, "B": 2}, {"L": 4, "B": 4}, {"L": 10, "B": 2}, {"L": 40, "B": 12}),
    "largest_sum": ({"L": 2}, {"L": 4}, {"L": 25}, {"L": 400}),
    "noisy_obs": ({"M": 2, "L": 1}, {"M": 5, "L": 20}, {"M": 15, "L": 60}, {"M": 60, "L": 1000}),
    "parabola": ({"h": 1}, {"h": 20}, {"h": 400, "dx": 0.01}),
    "proc_goal": ({"D": 1}, {"D": 10}, {"D": 100}),
    "sort": ({"L": 2}, {"L": 4}, {"L": 20}, {"L": 100}),
    "cliff_world": ({"W": 3, "H": 2}, {"W": 15, "H": 6}, {"W": 100, "H": 20}, {"W": 200, "H": 80}),
    "random_transition": ({"S": 4, "A": 2}, {"S": 16, "A": 3}, {"S": 60, "A": 4}, {"S": 100, "A": 4}),
}
"""Small, usual and large values of the parameters that figures depend on, by the name of the spec."""
OWN_NAMES: dict[str, dict[str, str]] = {"LargestSumSeals": {"L": "length"}}
TWINS = "XY"
"""Variants whose names end so have the figure of the task that they are based on."""

LOOKS = ("light", "dark", "deuteranopic")
# Viénot, Brettel and Mollon (1999), in linear light as SVG filters have it.
FILTER = """<svg width="0" height="0" aria-hidden="true"><filter id="deuteranopia" color-interpolation-filters="linearRGB">
<feColorMatrix values="0.29275 0.70725 0 0 0  0.29275 0.70725 0 0 0  -0.02234 0.02234 1 0 0  0 0 0 1 0"/></filter></svg>"""
STYLE = """
body { padding: 1rem; } table { border-collapse: collapse; width: 100%; table-layout: fixed; }
th, td { padding: 0.5rem; vertical-align: top; font-weight: 400; text-align: left; } th { width: 12rem; font-size: 0.85rem; }
td { background: var(--paper); color: var(--ink); } td p { font-size: 0.75rem; color: var(--muted); margin: 0.2rem 0 0; }
.deuteranopic { filter: url(#deuteranopia); } tr { border-top: 1px solid #8888; }
"""


def drawn_names() -> list[str]:
    """Ids of the tasks of the repository whose figures are their own."""
    return [name for name in registry.task_ids() if not name.partition("-v")[0].endswith(TWINS)]


def shown(ids: Iterable[str]) -> Iterator[tuple[Task, str]]:
    """Tasks at every setting, and the words for it; those without sizes once."""
    for name in ids:
        task = registry.load(name)
        names = {p.name: p.name for p in task.parameters} | OWN_NAMES.get(task.name, {})
        wanted = SETTINGS.get(Path(task.source.document.origin.name).stem, ({},))
        given = [{names[key]: value for key, value in values.items() if key in names} for values in wanted]
        for i, values in enumerate(given):
            if values not in given[:i]:
                yield registry.load(name, **values), ", ".join(f"{key} = {value}" for key, value in values.items())


def sheet(ids: Iterable[str]) -> str:
    """The page of these tasks; it stands alone."""
    style = page_style() + gallery_style() + STYLE
    dark = re.search(r"@media \(prefers-color-scheme: dark\) \{\s*:root (\{.*?\})", style, re.DOTALL)
    light = re.search(r":root (\{.*?\})", style, re.DOTALL)
    assert dark is not None
    assert light is not None
    style += f".light, .deuteranopic {light[1]} .dark {dark[1]}"
    rows = "".join(_row(task, words, scene(task)) for task, words in shown(ids))
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>Contact sheet</title>'
    body = f"{FILTER}<table>{rows}</table>"
    return f'<!doctype html><html lang="en"><head>{head}<style>{style}</style></head><body>{body}</body></html>\n'


def _row(task: Task, words: str, drawn: Scene | None) -> str:
    notes = "" if drawn is None else " ".join(drawn.notes)
    figure = "no figure" if drawn is None else svg(drawn, css=True)
    cells = "".join(f'<td class="{look}">{figure}<p>{escape(notes)}</p></td>' for look in LOOKS)
    return f"<tr><th>{escape(task.name)}<br>{escape(words)}</th>{cells}</tr>"


PHONE = 390
"""The width of a telephone's screen in pixels."""
FRAMES = f"""
iframe {{ width: {PHONE}px; height: 700px; border: 1px solid #8888; }}
"""


def page_sheet(ids: Iterable[str], folder: Path) -> str:
    """Write the pages of tasks into a folder, and return the page that shows them in every look."""
    tasks = [registry.load(name) for name in ids]
    suite = gather_pages(tasks, "Contact sheet")
    write_pages(suite, ["html"], folder)
    rows = ""
    for page in suite.pages:
        frames = ""
        text = (folder / f"{page.anchor}.html").read_text(encoding="utf-8")
        write_text(folder / f"dark-{page.anchor}.html", text.replace("(prefers-color-scheme: dark)", "all"))
        for look in LOOKS:
            address = escape(f"{folder.name}/{'dark-' if look == 'dark' else ''}{page.anchor}.html")
            frames += (
                f'<iframe class="{look}" src="{address}" title="{escape(page.name)}, {look}" loading="lazy"></iframe>'
            )
        rows += f"<h2>{escape(page.name)}</h2>{frames}"
    head = f'<meta charset="utf-8"><title>Pages</title><style>{STYLE}{FRAMES}</style>'
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{FILTER}{rows}</body></html>\n'


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "build/contact.html")
    pages = target.with_name(f"{target.stem}-pages.html")
    write_text(target, sheet(drawn_names()))
    write_text(pages, page_sheet(drawn_names(), target.with_suffix("")))
    sys.stdout.write(f"wrote {target} and {pages}\n")
