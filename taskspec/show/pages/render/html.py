"""Pages -> a static site: a gallery and a page a task, mathematics as MathML, no network.

The one script is the gallery's: it filters the tasks, and without it all of them are there.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from markupsafe import Markup

from taskspec.base.display import ON_PAGES, visible
from taskspec.base.extras import need
from taskspec.language.printers.text import plain
from taskspec.show.figures import Scene, layers, svg
from taskspec.show.figures.film import film
from taskspec.show.figures.machine import state_labels
from taskspec.show.pages.hypertext import HtmlWriter, origin_of
from taskspec.show.pages.page import Page
from taskspec.show.pages.render import html_environment
from taskspec.show.pages.render.gallery import gallery, gallery_style
from taskspec.show.pages.render.suite import Suite, notation

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
    for i, page in enumerate(suite.pages):
        before = suite.pages[i - 1] if i else None
        if i + 1 < len(suite.pages):
            after = suite.pages[i + 1]
        else:
            after = None
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
    style = Markup("".join(env.get_template(name).render() for name in ("style.css", "report.css")))
    return visible(env.get_template(template).render(style=style, **values), ON_PAGES)


def _page(suite: Suite, page: Page) -> dict[str, Any]:
    scene = suite.scenes.get(page.anchor)
    titles = [each.title for each in page.settings]
    states = marked_states(page)
    return {
        "page": page,
        "states": states.values(),
        **HtmlWriter(suite.cited, states).words(page.summary, page.description, page.sections, titles),
        "figures": _figures(page, scene),
        "caption": scene.caption if scene else "",
        "others": [(each.caption, Markup(svg(each.scene, css=True))) for each in suite.others(page)],
        "source": _highlighted(page.source_text),
    }


def marked_states(page: Page) -> dict[str, int]:
    """Return codes of states by their symbols, for those whose transitions have a line of their own."""
    section = page.section("dynamics")
    if section:
        origins = {origin_of(line.content) for line in section.lines} - {""}
    else:
        origins = set()
    if not origins:
        return {}
    return {plain(label): code for code, label in state_labels(page.task).items() if plain(label) in origins}


def _figures(page: Page, scene: Scene | None) -> list[tuple[str, Markup]]:
    """Return the figure, and where results are exact the same with each overlay; the reader chooses one by its word."""
    if scene is None:
        return []
    found = {"task": scene}
    if page.facts.model is not None and len(scene.items) <= MOST_ITEMS:
        found |= layers(page.task, page.facts.model)
    shown = [(_LAYERS[name], Markup(svg(each, css=True))) for name, each in found.items()]
    if page.facts.model is not None or isinstance(page.task.annotations.expert, tuple):
        moving = film(page.task)
        if moving is not None:
            shown.insert(1, ("film", Markup(moving)))
    return shown


@lru_cache(maxsize=32)
def _highlighted(text: str) -> Markup:
    """Return YAML with its parts marked by class; the pages of variants have one source."""
    pygments, lexers, formatters = (need(f"pygments{x}", "docs") for x in ("", ".lexers.data", ".formatters"))
    formatter = formatters.HtmlFormatter(nowrap=True, classprefix="y-")
    return Markup(pygments.highlight(text, lexers.YamlLexer(), formatter))


_KINDS = {"nt": "link", "c1": "muted", "m": "number", "kc": "number", "p": "muted"}
