"""Pages -> a gallery: a tile for each task, and a form that filters them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from markupsafe import Markup

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import ON_PAGES, plural, visible
from taskspec.base.display import number as digits
from taskspec.exact.scores.difficulty import hidden_bits
from taskspec.language.expressions.types import Kind
from taskspec.language.task.questions import components_read
from taskspec.language.task.record import count, short
from taskspec.show.figures import svg
from taskspec.show.pages.hypertext import HtmlWriter
from taskspec.show.pages.page import Page
from taskspec.show.pages.render import html_environment
from taskspec.show.pages.render.suite import Suite

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
    tiles = [tile for folder, suite in suites.items() for tile in _tiles(folder, suite)]
    filters = {
        "capability": sorted({tile["capability"] for tile in tiles} - {""}),
        "suite": list(dict.fromkeys(suite.title for suite in suites.values())),
        "size": [name for name in (*(name for _, name in SIZES), CONTINUOUS) if any(t["size"] == name for t in tiles)],
        "state": [name for name in (SEEN, HIDDEN) if any(tile["state"] == name for tile in tiles)],
    }
    chosen = {name: values for name, values in filters.items() if len(values) > 1}
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
            about = "" if score.exact else "about "
            shown.append(f"{word} {about}{digits(float(score.value), 3)}")
    return ", ".join(shown)


def _observed(page: Page) -> str:
    """Return whether observations show the whole state: by the exact model, or else by the components that they read."""
    task = page.task
    if task.observation.is_state:
        return SEEN
    model = page.facts.model
    if model is not None and model.task is task:
        try:
            is_hidden = hidden_bits(model) > 1e-9
        except SpecError:
            is_hidden = _reads_less(page)
    else:
        is_hidden = _reads_less(page)
    if is_hidden:
        return HIDDEN
    return SEEN


def _reads_less(page: Page) -> bool:
    task = page.task
    return not {c.name for c in task.state} <= components_read(task.observation.nodes)
