"""Pages -> a static site: a gallery and a page a task, mathematics as MathML, no network.

The one script is the gallery's: it filters the tasks, and without it all of them are there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Any

from markupsafe import Markup

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import ON_PAGES, plural, visible
from taskspec.base.display import number as digits
from taskspec.base.extras import need
from taskspec.base.named import all_names
from taskspec.exact.scores.difficulty import hidden_bits
from taskspec.language.expressions.types import Kind
from taskspec.language.task.questions import components_read
from taskspec.show.figures import Scene, layers, svg
from taskspec.show.figures.film import film
from taskspec.show.figures.machine import state_labels
from taskspec.show.pages.hypertext import HtmlWriter, origin_of
from taskspec.show.pages.page import Page
from taskspec.show.pages.render import html_environment
from taskspec.show.pages.render.suite import Suite, notation
from taskspec.show.printers.text import plain
from taskspec.show.record import count, short

SIZES = ((10, "up to 10 states"), (100, "11 to 100 states"), (1000, "101 to 1,000 states"), (math.inf, "more states"))
CONTINUOUS = "infinitely many states"
SEEN = "state is observed"
HIDDEN = "state is partly hidden"
ALL = {"capability": "any capability", "suite": "any suite", "size": "any size", "state": "observed or hidden"}
"""What a filter says that leaves nothing out."""
SHOWN_SCORES = {
    "random return": "random", "expert return": "expert", "best return with memory": "best with memory",
    "optimal return": "optimal",
}  # fmt: skip
"""Returns on a tile, by their names on pages."""
MOST_CHARACTERS = 40_000  # a figure with more is no thumbnail


def gallery(suites: Mapping[str, Suite]) -> str:
    """Return the tasks of suites as tiles, for a page of its own.

    Args:
        suites: by the address of the folder in which their pages are, such as `derail/`, or empty.
    """
    tiles: list[dict[str, Any]] = []
    for folder, suite in suites.items():
        tiles += _tiles(folder, suite)
    orders = {
        "capability": sorted({tile["capability"] for tile in tiles} - {""}),
        "suite": [suite.title for suite in suites.values()],
        "size": [*dict(SIZES).values(), CONTINUOUS],
        "state": [SEEN, HIDDEN],
    }
    chosen = {}
    for name, order in orders.items():
        on_tiles = {tile[name] for tile in tiles}
        values = list(dict.fromkeys(filter(on_tiles.__contains__, order)))
        if len(values) > 1:
            chosen[name] = values
    template = html_environment().get_template("cards.html")
    return visible(template.render(cards=tiles, filters=chosen, all=ALL, hidden=HIDDEN), ON_PAGES)


def gallery_style() -> str:
    """Return CSS of galleries and figures, for a page that says what `--ink`, `--paper` and the other colours are."""
    return html_environment().get_template("gallery.css").render()


def _tiles(folder: str, suite: Suite) -> Iterator[dict[str, Any]]:
    writer = HtmlWriter(suite.cited)
    for page in suite.pages:
        if page.anchor not in suite.folded:
            continue
        drawn = Markup()
        if page.anchor in suite.scenes:
            drawn = Markup(svg(suite.scenes[page.anchor], css=True))
        if len(drawn) > MOST_CHARACTERS:
            drawn = Markup()
        yield {
            "page": page, "address": f"{folder}{page.anchor}.html", "summary": writer.prose(page.summary), "figure": drawn,
            "capability": page.capability, "suite": suite.title, "size": _size(page), "state": _observed(page),
            "extent": extent(page), "scores": scores(page), "keywords": " ".join(page.task.spec.keywords),
            "variants": [(other.name, f"{folder}{other.anchor}.html") for other in suite.folded[page.anchor]],
        }  # fmt: skip


def _size(page: Page) -> str:
    states = count(page.task.state)
    if states is None:
        return CONTINUOUS
    return next(name for most, name in SIZES if states <= most)


def extent(page: Page) -> str:
    """Return the size of a task in words: `21 states, 2 actions, 10 steps`."""
    task = page.task
    parts = []
    for components, one, several in ((task.state, "state", "states"), (task.action, "action", "actions")):
        number = count(components)
        if number is None and any(c.type.kind is Kind.REAL for c in components):
            parts.append(f"continuous {several}")
        elif number is None:
            parts.append(f"infinitely many {several}")
        elif number == 1:
            parts.append(f"1 {one}")
        else:
            parts.append(f"{short(number)} {several}")
    if task.horizon is not None:
        parts.append(plural(task.horizon, "step"))
    return ", ".join(parts)


def scores(page: Page) -> str:
    """Return the known returns of a task to three digits: `random 0.284, optimal 0.4`."""
    shown = []
    for name, word in SHOWN_SCORES.items():
        score = page.facts.scores.get(name)
        if score is not None:
            shown.append(f"{word} {'about ' * (not score.exact)}{digits(float(score.value), 3)}")
    return ", ".join(shown)


def _observed(page: Page) -> str:
    """Return whether observations show the whole state: by the exact model, or else by the components that they read."""
    task = page.task
    if task.observation.is_state:
        return SEEN
    model = page.facts.model
    is_hidden = not set(all_names(task.state)) <= components_read(task.observation.nodes)
    if model is not None and model.task is task:
        with suppress(SpecError):
            is_hidden = hidden_bits(model) > 1e-9
    if is_hidden:
        return HIDDEN
    return SEEN


MOST_ITEMS = 2000  # larger figures are drawn once, without overlays
_LAYERS = {
    "task": "task", "values": "best returns", "policy": "best actions", "expert": "expert", "occupancy": "visits",
}  # fmt: skip
"""What readers choose overlays by."""


def site(suite: Suite) -> dict[str, str]:
    """Return files by name: `index.html` and one for each task."""
    env = html_environment()
    highlighted = "".join(f".y-{short}{{color:var(--{color})}}\n" for short, color in _KINDS.items())
    common = {"suite": suite.title, "style": Markup(page_style() + gallery_style() + highlighted)}
    count = len(suite.pages)
    files = {
        "index.html": env.get_template("index.html").render(
            count=count,
            notation=HtmlWriter({}).prose(notation(suite.pages)),
            gallery=Markup(gallery({"": suite})),
            **common,
        )
    }
    neighbours = [None, *suite.pages, None]
    for i, page in enumerate(suite.pages):
        before = neighbours[i]
        after = neighbours[i + 2]
        files[f"{page.anchor}.html"] = env.get_template("task.html").render(
            before=before, after=after, **_page(suite, page), **common
        )
    return {name: visible(text, ON_PAGES) for name, text in files.items()}


def page_style() -> str:
    """Return CSS of pages that stand alone, with the colours on light and on dark paper."""
    return html_environment().get_template("style.css").render()


def page_of(template: str, **values: Any) -> str:
    """Return a page that stands alone, in the style of the others: the templates are `report.html` and `findings.html`."""
    env = html_environment()
    style = Markup(page_style() + env.get_template("report.css").render())
    return visible(env.get_template(template).render(style=style, **values), ON_PAGES)


def _page(suite: Suite, page: Page) -> dict[str, Any]:
    scene = suite.scenes.get(page.anchor)
    caption = scene.caption if scene is not None else ""
    titles = [each.title for each in page.settings]
    states = marked_states(page)
    return {
        "page": page,
        "states": states.values(),
        **HtmlWriter(suite.cited, states).words(page.summary, page.description, page.sections, titles),
        "figures": _figures(page, scene),
        "caption": caption,
        "others": [(each.caption, Markup(svg(each.scene, css=True))) for each in suite.others(page)],
        "source": _highlighted(page.source_text),
    }


def marked_states(page: Page) -> dict[str, int]:
    """Return codes of states by their symbols, for those whose transitions have a line of their own."""
    section = page.section("dynamics")
    if section is None:
        return {}
    origins = {origin_of(line.content) for line in section.lines} - {""}
    codes: dict[str, int] = {}
    if not origins:
        return codes
    for code, label in state_labels(page.task).items():
        symbol = plain(label)
        if symbol in origins:
            codes[symbol] = code
    return codes


def _figures(page: Page, scene: Scene | None) -> list[tuple[str, Markup]]:
    """Return the figure, and where results are exact the same with each overlay; the reader chooses one by its word."""
    if scene is None:
        return []
    scenes = {"task": scene}
    if page.facts.model is not None and len(scene.items) <= MOST_ITEMS:
        scenes |= layers(page.task, page.facts.model)
    shown = []
    for name, each in scenes.items():
        shown.append((_LAYERS[name], Markup(svg(each, css=True))))
    if page.facts.model is not None or isinstance(page.task.annotations.expert, tuple):
        moving = film(page.task)
        if moving is not None:
            shown.insert(1, ("film", Markup(moving)))
    return shown


@lru_cache(maxsize=32)
def _highlighted(text: str) -> Markup:
    """Return YAML with its parts marked by class; the pages of variants have one source."""
    pygments = need("pygments", "docs")
    lexers = need("pygments.lexers.data", "docs")
    formatters = need("pygments.formatters", "docs")
    formatter = formatters.HtmlFormatter(nowrap=True, classprefix="y-")
    return Markup(pygments.highlight(text, lexers.YamlLexer(), formatter))


_KINDS = {"nt": "link", "c1": "muted", "m": "number", "kc": "number", "p": "muted"}
