"""The section on symmetries: what is seen and done in the twins of a task, and whether returns are proved to be kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from taskspec.appendix.lines import formula
from taskspec.appendix.prose import CodeSpan, Inline, Inlines, Mark, Text, inlines, listing
from taskspec.appendix.writing import Writing
from taskspec.exact.abstraction.symmetries import kept
from taskspec.lang import syntax as s
from taskspec.printers import tree as m

_MAPS = {"observation": "what is seen: ", "action": "actions: "}


def symmetries(w: Writing) -> Iterator[Inlines]:
    """A line for each: its name, what it is, its maps, and how it is known to keep returns."""
    exprs: Mapping[str, Mapping[str, Mapping[str, s.Expr]]] = w.parsed("symmetries") or {}
    for symmetry in w.task.symmetries:
        content: list[Inline] = [CodeSpan(symmetry.name), Text(": ")]
        content += [*inlines(symmetry.doc), Text("; ")] if symmetry.doc else []
        for key, lines in exprs[symmetry.name].items():
            shown = [formula(w.symbol(name), m.Sym("↦"), w.math(expr)) for name, expr in lines.items()]
            content += [Text(_MAPS[key]), *listing([(each,) for each in shown]), Text("; ")]
        found = kept(w.task, symmetry)
        how = "proved" if found.is_proved else f"tested at {found.points:,} points"
        yield (
            *content,
            Text("returns are kept "),
            Mark(found.problem is None, how if found.problem is None else "false"),
        )
