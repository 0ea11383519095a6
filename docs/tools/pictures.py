"""Draw the pictures of the README and of other pages: `python -m docs.tools.pictures`, in the root of a checkout.

- `wall-light.svg`, `wall-dark.svg`: figures of tasks of the library.
- `first-light.svg`, `first-dark.svg`: the spec of `docs/index.md` beside what commands print of it: figure, mathematics, exact
  scores. LaTeX and pdftocairo typeset the mathematics.
- `card-light.svg`, `card-dark.svg`: the report of an exam whose results are in the repository; `card-narrow-…` for telephones.
- `paper.svg`, `corrected.svg`: those of all learners, as published and corrected.
- `recall.png`: the printed page of the task of the tutorial.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from html import escape
from pathlib import Path

from docs.tools.galleries import WALL
from taskspec.language import registry
from taskspec.show.figures import chart, scene
from taskspec.show.figures import svg as figure_svg

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs/pictures"
RESULTS = ROOT / "docs/results"
FAMILIES = ("paper", "corrected")
"""Sets of results, each shown as a matrix."""
EXAMINED = "docs/results/paper/gail_im"
"""The results that the card shows."""
SPEC = r"<!-- (?:file|add): {name} -->\n```yaml\n(.*?)```"
"""A block of a page that writes a file, or adds to it."""
FORMULAS = re.compile(r"^(?:- \*\*Rewards\*\*:|  -) (\$.*(?:xrightarrow|R\(s).*\$)$", re.MULTILINE)
KEY = re.compile(r"^(\s*(?:- )?)([\w']+)(:)")
BLACK = re.compile(r"rgb\(0%, ?0%, ?0%\)")
FIGURE_SCALE, FORMULA_SCALE = 1.35, 1.5
WIDTH, MARGIN, COLUMN, LINE = 900, 20, 516, 16.0
"""Sizes in pixels: of the picture, around it, where the right column begins, and from line to line."""
TILES, TILE, GAP, LARGEST = 6, 130, 12, 1.4
"""Tiles in a row, the height of one, the space around its figure, and how much a figure is enlarged at most."""
TEX = r"""\documentclass[border=1pt]{standalone}
\usepackage{amsmath,mathtools,varwidth}
\begin{document}\begin{varwidth}{13cm}\setlength{\parindent}{0pt}\setlength{\parskip}{5pt}
%s
\end{varwidth}\end{document}
"""


@dataclass(frozen=True)
class Example:
    """The spec of the first page, and what commands print of it."""

    spec: str
    figure: str
    formulas: tuple[str, ...]
    scores: tuple[str, ...]

    @property
    def digest(self) -> str:
        """Return what identifies all that the picture shows."""
        shown = "\n".join((self.spec, self.figure, *self.formulas, *self.scores))
        return hashlib.sha256(shown.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Theme:
    """Colours of a picture: those of figures, and what stands for them."""

    name: str
    paper: str
    ink: str
    muted: str
    key: str
    replaced: dict[str, str]


LIGHT = Theme("light", "#ffffff", "#1f2933", "#6b7785", "#0b5cad", {})
DARK = Theme(
    "dark", "#0d1117", "#e6edf3", "#9aa7b4", "#79b8ff",
    {"#ffffff": "#0d1117", "#1f2933": "#e6edf3", "#6b7785": "#9aa7b4", "#b7e4bf": "#2f6b3c", "#f3a6a0": "#8c3a35",
     "#d5d9de": "#454c55", chart.BETWEEN: "#18212b", chart.WORSE: "#33231d", chart.BLUE: "#7cc4f0", chart.FAILS: "#f0a070",
     chart.UNSURE: "#a0a9b3"},
)  # fmt: skip


def spec_of(page: str, name: str) -> str:
    """Return a spec that a page of the documentation shows."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    found = re.findall(SPEC.format(name=re.escape(name)), text, re.DOTALL)
    assert found, f"{page} has no {name}"
    return "".join(found)


def example() -> Example:
    """Return the spec of the first page with its figure, mathematics and scores."""
    spec = spec_of("index.md", "risky_path.yaml")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "mine"
        folder.mkdir()
        (folder / "risky_path.yaml").write_text(spec, encoding="utf-8")
        run(["figure", "risky_path.yaml", "-o", "figure.svg"], folder)
        run(["docs", "risky_path.yaml", "-f", "markdown", "--no-results", "-o", "page"], folder)
        page = "\n".join(path.read_text(encoding="utf-8") for path in (folder / "page").glob("*.md"))
        solved = run(["solve", "risky_path.yaml"], folder).rstrip().split("\n")[1:5]
        proved = re.search(r"\d+ proved", run(["check", "risky_path.yaml"], folder))
        assert proved is not None, "the claims of risky_path.yaml are not proved"
        figure = (folder / "figure.svg").read_text(encoding="utf-8")
    formulas = [line for line in FORMULAS.findall(page) if "for all" not in line]  # which change nothing
    scores = (*(line.strip() for line in solved), f"claims {proved[0]}")
    return Example(spec.rstrip("\n"), figure, tuple(formulas), scores)


def run(arguments: list[str], folder: Path) -> str:
    """Return what a command of taskspec prints."""
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "90", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "taskspec", *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=True)
    return done.stdout


def typeset(formulas: tuple[str, ...]) -> str:
    """Return formulas as SVG, one below the other."""
    text = "\n\n".join(formula.replace(r"\cr", r"\\") for formula in formulas)
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "formulas.tex").write_text(TEX % text, encoding="utf-8")
        for command in (
            ["pdflatex", "-interaction=batchmode", "formulas"],
            ["pdftocairo", "-svg", "formulas.pdf", "formulas.svg"],
        ):
            subprocess.run(command, cwd=name, check=True, capture_output=True)
        return (Path(name) / "formulas.svg").read_text(encoding="utf-8")


def first(shown: Example, mathematics: str, theme: Theme) -> str:
    """Return the picture of a spec beside what is made of it."""
    lines = shown.spec.split("\n")
    parts = [_code(line, MARGIN + LINE * (i + 0.75), theme) for i, line in enumerate(lines)]
    figure = _within(shown.figure, COLUMN, MARGIN, FIGURE_SCALE)
    below = MARGIN + FIGURE_SCALE * _size(shown.figure)[1] + MARGIN
    formulas = BLACK.sub(theme.ink, _within(mathematics, COLUMN, below, FORMULA_SCALE))
    bottom = below + FORMULA_SCALE * _size(mathematics)[1] + 2 * MARGIN
    height = max(2 * MARGIN + LINE * len(lines), bottom + (LINE + 2) * len(shown.scores))
    table = [_score(line, bottom + (LINE + 2) * i, theme) for i, line in enumerate(shown.scores)]
    figure = recolored(figure, theme)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="0 0 {WIDTH} {height:.0f}" width="{WIDTH}" height="{height:.0f}" role="img">'
        f"<title>The spec RiskyPath, its figure, mathematics and exact scores</title><!-- of {shown.digest} -->"
        f'<rect width="{WIDTH}" height="{height:.0f}" rx="8" fill="{theme.paper}"/>'
        f'<path d="M{COLUMN - 16},{MARGIN} V{height - MARGIN:.0f}" stroke="{theme.muted}" stroke-width="0.5"/>'
        '<g font-family="ui-monospace,SFMono-Regular,Menlo,Consolas,DejaVu Sans Mono,monospace" font-size="11">'
    )
    return "\n".join([head, *parts, *table, "</g>", figure, formulas, "</svg>"]) + "\n"


def _code(line: str, y: float, theme: Theme) -> str:
    """Return a line of YAML, its key in a colour."""
    text = KEY.sub(rf'\1<tspan fill="{theme.key}">\2</tspan>\3', escape(line, quote=False))
    return f'<text x="{MARGIN}" y="{y:.1f}" xml:space="preserve" fill="{theme.ink}">{text}</text>'


def _score(line: str, y: float, theme: Theme) -> str:
    """Return a line of scores: its name, its value, and how that is known."""
    name, value, *how = line.split()
    cells = ((COLUMN, theme.muted, name), (COLUMN + 90, theme.ink, value), (COLUMN + 170, theme.muted, " ".join(how)))
    return "".join(f'<text x="{x}" y="{y:.1f}" fill="{color}">{escape(text)}</text>' for x, color, text in cells)


def _size(svg: str) -> tuple[float, float]:
    """Return width and height of a drawing."""
    found = re.search(r'viewBox="[\d.-]+ [\d.-]+ ([\d.]+) ([\d.]+)"', svg)
    assert found is not None, "a drawing without a size"
    return float(found[1]), float(found[2])


def _within(svg: str, x: float, y: float, scale: float) -> str:
    """Return a drawing as a part of another one."""
    width, height = _size(svg)
    inner = re.sub(r"^.*?(?=<svg)", "", svg, flags=re.DOTALL)
    inner = re.sub(r' (?:width|height)="[\d.]+(?:pt)?"', "", inner.partition(">")[0]) + ">" + inner.partition(">")[2]
    place = f'<svg x="{x}" y="{y:.1f}" width="{width * scale:.1f}" height="{height * scale:.1f}"'
    return inner.replace("<svg", place, 1).rstrip()


def recolored(svg: str, theme: Theme) -> str:
    """Return a drawing in the colours of a theme."""
    for light, other in theme.replaced.items():
        svg = svg.replace(light, other)
    return svg


def wall(theme: Theme) -> str:
    """Return the figures of some tasks, each over its name."""
    rows = -(-len(WALL) // TILES)
    width = WIDTH / TILES
    height = rows * TILE + MARGIN
    parts = []
    for i, name in enumerate(WALL):
        task = registry.load(name)
        drawn = scene(task)
        assert drawn is not None, f"{name} has no figure"
        x = width * (i % TILES)
        y = MARGIN / 2 + TILE * (i // TILES)
        figure = figure_svg(drawn)
        own = _size(figure)
        room = (width - 2 * GAP, TILE - 2 * GAP - LINE)
        scale = min(room[0] / own[0], room[1] / own[1], LARGEST)
        left = x + (width - own[0] * scale) / 2
        top = y + GAP + (room[1] - own[1] * scale) / 2
        frame = f'x="{x + GAP / 2:.1f}" y="{y + GAP / 2:.1f}" width="{width - GAP:.1f}" height="{TILE - GAP}"'
        parts += [
            f'<rect {frame} rx="6" fill="none" stroke="{theme.muted}" stroke-opacity="0.4"/>',
            recolored(_within(figure, round(left, 1), top, scale), theme),
            f'<text x="{x + width / 2:.1f}" y="{y + TILE - GAP:.1f}" fill="{theme.ink}">{escape(task.name)}</text>',
        ]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" role="img">'
        f"<title>Figures of {len(WALL)} tasks of the library</title>"
        f'<rect width="{WIDTH}" height="{height}" rx="8" fill="{theme.paper}"/>'
        '<g font-family="system-ui,-apple-system,Segoe UI,Helvetica,Arial,DejaVu Sans,sans-serif" font-size="11" '
        'text-anchor="middle">'
    )
    return "\n".join([head, *parts, "</g></svg>"]) + "\n"


def card(*options: str) -> str:
    """Return the report of an exam as a picture."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "card.svg"
        run(["report", str(ROOT / EXAMINED), "-o", str(path), *options], ROOT)
        return path.read_text(encoding="utf-8")


def matrix(family: str) -> str:
    """Return the scores of all learners of a family as a picture."""
    with tempfile.TemporaryDirectory() as name:
        run(["report", str(RESULTS / family), "-f", "svg", "-o", name], ROOT)
        return (Path(name) / "table.svg").read_text(encoding="utf-8")


def tutorial() -> bytes:
    """Return the printed page of the task of the tutorial."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "mine"
        folder.mkdir()
        (folder / "recall.yaml").write_text(spec_of("start/tutorial.md", "recall.yaml"), encoding="utf-8")
        run(["docs", "recall.yaml", "-f", "pdf", "-o", "printed"], folder)
        place = ["-x", "85", "-y", "80", "-W", "660", "-H", "1000"]  # without margins
        command = ["pdftoppm", "-png", "-r", "100", *place, "-singlefile", "printed/document.pdf", "page"]
        subprocess.run(command, cwd=folder, check=True)
        return (folder / "page.png").read_bytes()


def main() -> None:
    """Draw all pictures."""
    PICTURES.mkdir(exist_ok=True)
    shown = example()
    for theme in (LIGHT, DARK):
        (PICTURES / f"wall-{theme.name}.svg").write_text(wall(theme), encoding="utf-8")
    mathematics = typeset(shown.formulas)
    for theme in (LIGHT, DARK):
        (PICTURES / f"first-{theme.name}.svg").write_text(first(shown, mathematics, theme), encoding="utf-8")
    for stem, drawn in {"card": card(), "card-narrow": card("--narrow")}.items():
        for theme in (LIGHT, DARK):
            (PICTURES / f"{stem}-{theme.name}.svg").write_text(recolored(drawn, theme), encoding="utf-8")
    for family in FAMILIES:
        (PICTURES / f"{family}.svg").write_text(matrix(family), encoding="utf-8")
    (PICTURES / "recall.png").write_bytes(tutorial())


if __name__ == "__main__":
    main()
