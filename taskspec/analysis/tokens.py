"""The names, functions and labels in the expressions of a text, for editors that colour by meaning."""

from __future__ import annotations

from taskspec.analysis.analysis import Analysis
from taskspec.base.diagnostics import Span
from taskspec.lang import syntax as s

TOKEN_KINDS = ("parameter", "variable", "property", "function", "enumMember", "number")
"""Kinds of tokens, as the protocol of editors calls them: an action is a property, a label a member of an enumeration."""

_NOUNS = {
    "parameter": "parameter",
    "alias of a parameter": "parameter",
    "constant": "parameter",
    "action component": "property",
    "label": "enumMember",
}


def tokens(analysis: Analysis) -> list[tuple[str, Span]]:
    """Return each token with its kind, by place; tokens do not overlap."""
    found: dict[Span, str] = {}
    for attempt in analysis.attempts:
        for expr in attempt.merged.parsed.values():
            for node in s.below(expr):
                place, kind = _token(node, analysis)
                if place is not None:
                    span = place.span
                    if span.origin.name == analysis.name and span.line == span.end_line:
                        found[span] = kind
    return [(kind, span) for span, kind in sorted(found.items(), key=lambda each: (each[0].line, each[0].column))]


def _token(node: object, analysis: Analysis) -> tuple[s.Place | None, str]:
    match node:
        case s.Call(name_place=place):
            return place, "function"
        case s.Number(place=place):
            return place, "number"
        case s.Quoted(place=place):
            return place, "enumMember"
        case s.Name(id=name, place=place):
            declared = analysis.declarations.get(name)
            return place, _NOUNS.get(declared.noun, "variable") if declared else "variable"
    return None, ""
