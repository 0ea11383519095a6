"""Meanings of the words of a spec: type, range and value, the place of the declaration, and all uses."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any

from taskspec.base.codes import codes
from taskspec.base.diagnostics import Fix, Origin, Span
from taskspec.base.display import setting
from taskspec.base.named import all_names
from taskspec.exact.rules import claim_rules
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import CATEGORICAL, DISTS
from taskspec.language.expressions.interval import bounds
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.scope import Binding, FunctionDef, Lazy, Poisoned, Scope, Unavailable, Value
from taskspec.language.expressions.types import Domain, Expression, Kind, Refused
from taskspec.language.source import Path
from taskspec.language.task.names import signature
from taskspec.language.task.questions import constant
from taskspec.language.task.schema.export import forms_of, json_schema, schemas_at
from taskspec.show.printers import text as printed
from taskspec.show.record import interval
from taskspec.tools.authoring.analysis import Analysis, name_span
from taskspec.tools.authoring.repair import cursor, word_at

_CALLED = re.compile(r"[^\W\d]\w*$")


def describe(bound: Binding | None) -> str:
    """Return the type, and the value or the range, of what a name means, in one line."""
    match bound:
        case Value(node=node, domain=domain):
            return _of_node(node, domain)
        case Lazy(domain=domain) if domain is not None:
            return _labels(domain)
        case Lazy(resolve=resolve):
            try:
                value = resolve(s.Name("", False, s.Place(s.SourceText("", _nowhere), 0, 0)))
            except (Poisoned, Refused):
                return ""
            return _of_node(value.node, value.domain)
        case FunctionDef(body=body):
            return f"{bound.signature} = {printed(body)}"
        case Unavailable(message=message):
            return message
    return ""


def hover(analysis: Analysis, offset: int) -> str | None:
    """Return what is known of the word at an offset, in Markdown; None where nothing is."""
    word, start = word_at(analysis.text, offset)
    if not word:
        return _of_mistakes(analysis, offset)
    at = cursor(analysis.text, start + len(word), analysis.name)
    if at.kind == "text":
        return None
    language = _call(word, None)
    if at.kind == "key" and word.rstrip("'") not in analysis.declarations:
        return _of_key(word, at.path)
    scope = analysis.scope(at.path)
    bound = scope.lookup(word) if scope is not None else None
    lines = []
    declaration = analysis.declarations.get(word.rstrip("'"))
    if declaration is not None:
        lines.append(", ".join(filter(None, [f"`{word}`: {declaration.noun}", describe(bound)])))
        documentation = analysis.written((*declaration.path, "doc"))
        if isinstance(documentation, str):
            lines.append(documentation)
    elif bound is not None:
        lines.append(", ".join(filter(None, [f"`{word}`", describe(bound)])))
    elif language is not None:
        lines.append(f"`{language[0]}`: {language[1]}")
    return "\n\n".join(lines) or None


def definition(analysis: Analysis, offset: int) -> Span | None:
    """Return the place where the name at an offset is declared."""
    word, _ = word_at(analysis.text, offset)
    declaration = analysis.declarations.get(word.rstrip("'"))
    if declaration is None or not declaration.path or analysis.document is None:
        return None
    if isinstance(declaration.path[-1], int) or declaration.noun == "alias of a parameter":
        return analysis.document.span(declaration.path)
    return analysis.document.key_span(declaration.path)


def name_at(analysis: Analysis, offset: int) -> str | None:
    """Return the name at an offset, without its prime; None for a word that is not declared."""
    word, _ = word_at(analysis.text, offset)
    name = word.rstrip("'")
    if name in analysis.declarations:
        return name
    return None


def references(analysis: Analysis, name: str | None) -> list[Span]:
    """Return every place of a name in a text: its declaration, keys and uses in expressions, by place."""
    if name not in analysis.declarations:
        return []
    return sorted(set(_places(analysis, name)), key=lambda span: (span.line, span.column))


def rename(analysis: Analysis, name: str | None, new: str) -> list[Fix]:
    """Return the changes that give a name in a text another name; primes and arguments stay."""
    changes = []
    for span in references(analysis, name):
        written = span.origin.line(span.line)[span.column - 1 : span.end_column - 1]
        first = written.find(name or "")
        if span.line == span.end_line and first >= 0:
            start = span.column + first
            changes.append(Fix(replace(span, column=start, end_column=start + len(name or "")), new))
    return changes


def signature_at(analysis: Analysis, offset: int) -> tuple[str, str, int] | None:
    """Return how the call is written whose arguments an offset is in, its documentation, and the number of the argument."""
    at = cursor(analysis.text, offset, analysis.name)
    closed = commas = 0
    for i, char in reversed([*enumerate(at.before)]):
        if char in ")]}":
            closed += 1
        elif char == "," and not closed:
            commas += 1
        elif char in "([{" and closed:
            closed -= 1
        elif char == "(":
            name = _CALLED.search(at.before[:i])
            call = None
            if name is not None:
                call = _call(name.group(), analysis.scope(at.path))
            if call is None:
                return None
            return (*call, commas)
        elif char in "[{":
            commas = 0  # those are of the list
    return None


# -- parts --------------------------------------------------------------------------------------------------------


def _places(analysis: Analysis, name: str) -> Iterator[Span]:
    document = analysis.document
    if document is None:
        return
    declared = analysis.declarations[name].path
    if declared and isinstance(declared[-1], int):
        yield document.span(declared)
    elif declared:
        yield document.key_span(declared)
    yield from map(name_span, analysis.uses(name))
    parts: list[Path] = [()]
    parts += [("variants", key) for key in analysis.entries("variants")]
    for part in parts:
        for section in ("initial", "dynamics", "expert", "parameters", "state", "action"):
            for key in analysis.entries(*part, section):
                if signature(str(key).rstrip("'"))[0] == name:
                    yield document.key_span((*part, section, key))


def _of_node(node: Expression, domain: Domain | None) -> str:
    value = constant(node) if node.type.is_scalar else None
    if domain is not None:
        if value is not None:
            return f"{domain.labels[int(value)]}, {_labels(domain)}"
        return _labels(domain)
    if value is not None:
        return f"{node.type} {setting(value)}"
    if node.type.kind is Kind.BOOL:
        return str(node.type)
    low, high = bounds(node, {})
    return f"{node.type} in {interval(low, high)}"


def _labels(domain: Domain) -> str:
    return f"choice of {domain.listed}"


def _of_key(key: str, path: Path) -> str | None:
    for schema in schemas(path):
        if "description" in schema:
            return f"`{key}`: {schema['description']}"
    return None


def _call(word: str, scope: Scope | None) -> tuple[str, str] | None:
    bound = scope.lookup(word) if scope is not None else None
    if isinstance(bound, FunctionDef):
        return bound.signature, printed(bound.body)
    if word in FUNCTIONS:
        return FUNCTIONS[word].signature, FUNCTIONS[word].doc
    for dist in (CATEGORICAL, *DISTS.values()):
        if dist.name == word:
            return f"{word}({', '.join(all_names(dist.arguments))})", dist.doc
    said = claim_rules.FUNCTIONS.get(word) or claim_rules.MODELS.get(word)
    if said is None:
        return None
    return (said.written, said.doc)


def _of_mistakes(analysis: Analysis, offset: int) -> str | None:
    line = analysis.text.count("\n", 0, offset) + 1
    for diagnostic in analysis.diagnostics:
        if diagnostic.span is not None and diagnostic.span.line == line:
            code = codes()[diagnostic.code]
            return f"**{code.code}** {code.title}\n\n{code.explanation}"
    return None


def _nowhere(start: int, end: int) -> Span:
    """Return the place of a name that only an editor looks up; nothing that is reported there is shown."""
    return Span(Origin("", ""), 1, 1, 1, 1)


# -- the JSON Schema of specs, by path --------------------------------------------------------------------------------


@lru_cache(maxsize=512)
def schemas(path: Path) -> tuple[dict[str, Any], ...]:
    """Return what the JSON Schema of specs says of the value at a path, one entry for each form that it may have."""
    return tuple(schemas_at(json_schema(), "Spec", path))


def type_of(schema: dict[str, Any]) -> str:
    for form in reversed(list(forms_of(json_schema(), schema))):
        kind = form.get("title") or form.get("type")
        if isinstance(kind, str) and kind != "null":
            return kind
    return ""


# -- words in the expressions of a text, for editors that colour by meaning -------------------------------------------

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
    kinds: dict[Span, str] = {}
    for attempt in analysis.attempts:
        for expr in attempt.merged.parsed.values():
            for node in s.below(expr):
                place, kind = _token(node, analysis)
                if place is not None:
                    span = place.span
                    if span.origin.name == analysis.name and span.line == span.end_line:
                        kinds[span] = kind
    in_order = sorted(kinds, key=lambda span: (span.line, span.column))
    return [(kinds[span], span) for span in in_order]


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
            if declared is None:
                return place, "variable"
            return place, _NOUNS.get(declared.noun, "variable")
    return None, ""
