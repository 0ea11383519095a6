"""The contact sheets: what people see of all tasks, to be looked at.

Figures at several settings, pages as wide as a telephone, and exams, each on light paper, on dark paper, and as without the green
cones; and what commands print in 80 columns. Of the repository's tasks and of specs that only tests know.

python -m docs.tools.contact build/contact
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from taskspec.base.files import write_text
from taskspec.language import registry
from taskspec.language.task.task import Task
from taskspec.learn.exam import report, results
from taskspec.show.figures import Scene, scene, svg
from taskspec.show.pages.render.html import gallery_style, page_style
from taskspec.show.pages.write import gather_pages, write_pages

ROOT = Path(__file__).resolve().parents[2]
SETTINGS: Mapping[str, tuple[Mapping[str, Any], ...]] = {
    "branching": ({"L": 3, "B": 2}, {"L": 4, "B": 4}, {"L": 10, "B": 2}, {"L": 20, "B": 12}),
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


def foreign_specs() -> list[str]:
    """Paths of the specs that only tests know."""
    return sorted(str(path) for path in (ROOT / "tests" / "specs").rglob("*.yaml"))


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
    return _document("Figures", style, f"<table>{rows}</table>")


def _document(title: str, style: str, body: str) -> str:
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title>'
    return (
        f'<!doctype html><html lang="en"><head>{head}<style>{style}</style></head><body>{FILTER}{body}</body></html>\n'
    )


def _row(task: Task, words: str, drawn: Scene | None) -> str:
    notes = "" if drawn is None else " ".join(drawn.notes)
    figure = "no figure" if drawn is None else svg(drawn, css=True)
    cells = "".join(f'<td class="{look}">{figure}<p>{escape(notes)}</p></td>' for look in LOOKS)
    return f"<tr><th>{escape(task.name)}<br>{escape(words)}</th>{cells}</tr>"


PHONE = 390
"""The width of a telephone's screen in pixels."""
FRAMES = f"iframe {{ width: {PHONE}px; height: 700px; border: 1px solid #8888; }} iframe.whole {{ width: 1100px; }}"


def page_sheet(names: Iterable[str], folder: Path) -> str:
    """Write the pages of tasks into a folder, and return the page that shows them in every look."""
    suite = gather_pages([registry.load(name) for name in names], "Contact sheet")
    write_pages(suite, ["html"], folder)
    return _frames({page.name: folder / f"{page.anchor}.html" for page in suite.pages}, folder.parent)


def card_sheet(folder: Path) -> str:
    """Write the pages of the exams of the documentation into a folder, and return the page that shows them in every look."""
    found = {
        path.parent.name: results.read(path.parent) for path in sorted(ROOT.glob("docs/results/paper/*/exam.json*"))
    }
    files = {}
    for name, exam in found.items():
        files[name] = folder / name / "report.html"
        report.write(exam, folder / name, ["html"])
    files["all"] = folder / "learners.html"
    report.write_several(found, folder, ["html"])
    return _frames(files, folder.parent)


def _frames(files: Mapping[str, Path], folder: Path) -> str:
    """Return the page that shows files in every look; it is in the folder."""
    rows = ""
    for name, path in files.items():
        dark = path.with_name(f"dark-{path.name}")
        write_text(dark, path.read_text(encoding="utf-8").replace("(prefers-color-scheme: dark)", "all"))
        rows += f"<h2>{escape(name)}</h2>"
        for look in (*LOOKS, "whole"):
            address = escape((dark if look == "dark" else path).relative_to(folder).as_posix())
            rows += f'<iframe class="{look}" src="{address}" title="{escape(name)}, {look}" loading="lazy"></iframe>'
    return _document("Pages", STYLE + FRAMES, rows)


COLUMNS = 80
FOLDER = "tests/specs"
ONE = "tests/specs/figures/keys.yaml"
COMMANDS: tuple[Sequence[str], ...] = (
    (), ("list",), ("check", FOLDER), ("check", "tests/errors"), ("show", ONE), ("show", "tests/specs/multi_choice.yaml"),
    ("solve", ONE), ("solve", "Tiger", "--difficulty"), ("run", ONE), ("exam", "--help"),
    ("exam", "q_learning", "--tasks", "tests/specs/values/end_in_place.yaml", "--seeds", "2", "-o", "{out}/exam"),
    ("report", "docs/results/paper/gail_im"), ("report", "docs/results/paper"), ("docs", FOLDER, "-o", "{out}/docs"),
    ("docs", "--help"), ("explain", "E403"), ("solve", "Riskypath"), ("figure", "classic_control/Pendulum", "-o", "{out}/x.bmp"),
)  # fmt: skip
"""What people run first, on specs of others."""


def terminal_sheet() -> str:
    """Return the page of what commands print; lines that are longer than the terminal are marked."""
    body = ""
    with tempfile.TemporaryDirectory() as out:
        for command in COMMANDS:
            words = [word.format(out=out) for word in command]
            done = subprocess.run(
                [sys.executable, "-m", "taskspec", *words], cwd=ROOT, capture_output=True, text=True, check=False,
                env={**os.environ, "COLUMNS": str(COLUMNS), "NO_COLOR": "1", "PYTHONPATH": str(ROOT)},
            )  # fmt: skip
            lines = (done.stdout + done.stderr).splitlines()
            shown = (escape(line) if len(line) <= COLUMNS else f"<mark>{escape(line)}</mark>" for line in lines)
            body += f"<h2>taskspec {escape(' '.join(words))}</h2><pre>{chr(10).join(shown)}</pre>"
    return _document("Terminal", f"pre {{ width: {COLUMNS}ch; outline: 1px solid #8888; }}", body)


def write_all(folder: Path) -> Path:
    """Write all sheets into a folder, and an index of them."""
    names = [*drawn_names(), *foreign_specs()]
    sheets = {
        "figures": sheet(names), "pages": page_sheet(names, folder / "pages"), "cards": card_sheet(folder / "cards"),
        "terminal": terminal_sheet(),
    }  # fmt: skip
    for name, text in sheets.items():
        write_text(folder / f"{name}-sheet.html", text)
    links = "".join(f'<li><a href="{name}-sheet.html">{name}</a></li>' for name in sheets)
    write_text(folder / "index.html", _document("Contact sheets", "", f"<ul>{links}</ul>"))
    return folder / "index.html"


if __name__ == "__main__":
    sys.stdout.write(f"wrote {write_all(Path(sys.argv[1] if len(sys.argv) > 1 else 'build/contact'))}\n")
