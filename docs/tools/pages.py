"""Write the generated pages of the documentation: `python -m docs.tools.pages`, in the root of a checkout.

Tables between `<!-- NAME -->` and `<!-- /NAME -->` come from what the program runs on; the prose around them is written on
the page. Outputs of examples are those that the pages have already; `tests/docs/test_snippets.py` checks them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from docs.tools import commands, functions
from docs.tools.language import language
from docs.tools.library import library
from docs.tools.markdown import code, entries, filled
from docs.tools.mistakes import index as mistakes
from docs.tools.probes import probes
from taskspec.exact.scores.difficulty import MEASURES
from taskspec.language.modifiers import MODIFIERS, ModifierArgument, ModifierEntry
from taskspec.language.modifiers.entry import never

DOCS = Path(__file__).parents[1]


def difficulty() -> str:
    """Return the page of difficulty measures."""
    measures = entries((code(m.name), f"{m.doc} ${m.formula}$") for m in MEASURES.values())
    sources: dict[str, list[str]] = {}
    for measure in MEASURES.values():
        if measure.source:
            sources.setdefault(measure.source, []).append(code(measure.name))
    cited = entries((", ".join(names), source) for source, names in sources.items())
    return filled(DOCS / "explain/difficulty.md", {"measures": measures, "sources": cited})


def modifiers() -> str:
    """Return the page of modifiers."""
    rows = [(code(name), " ".join(_facts(entry))) for name, entry in MODIFIERS.items()]
    return filled(DOCS / "reference/modifiers.md", {"modifiers": entries(rows)})


def _facts(entry: ModifierEntry) -> Iterator[str]:
    """Yield what a modifier does, its arguments, what it keeps, and what it needs."""
    yield entry.doc
    for argument in entry.arguments:
        yield f"{_argument(argument)}."
    if keeps := _keeps(entry):
        yield f"*Keeps* {keeps}."
    if entry.needs:
        yield f"*Needs* {entry.needs}."


def _argument(argument: ModifierArgument) -> str:
    """Return an argument with its meaning, its values where words do not say them, and its default."""
    facts = []
    values = argument.range.removeprefix("an int from ").removeprefix("a number from ")
    if values not in ("a number", "a name", "an expression", "true or false"):
        facts.append(values)
    if argument.default is not None:
        facts.append(f"default {str(argument.default).lower()}")
    text = f"{code(argument.name)}: {argument.doc}"
    return f"{text} ({', '.join(facts)})" if facts else text


def _keeps(entry: ModifierEntry) -> str:
    """Return what a modifier keeps, and under which conditions."""
    if entry.keeps == "nothing":
        return ""
    text: str = entry.keeps
    if entry.condition:
        text += f", where {entry.condition}"
    if entry.observed is not never:
        text += "; also from observations"
    if entry.observed_condition:
        text += f", where {entry.observed_condition}"
    return text


PAGES = {
    "explain/difficulty": difficulty,
    "explain/probes": probes,
    "reference/commands": commands.overview,
    "reference/functions": functions.overview,
    "reference/language": language,
    "reference/library": library,
    "reference/mistakes": mistakes,
    "reference/modifiers": modifiers,
}
"""The generated pages, by their name in the folder `docs`."""


def main() -> None:
    """Write all pages."""
    for name, page in PAGES.items():
        (DOCS / f"{name}.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
