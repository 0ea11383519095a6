"""Completion of a place: keys of the schema, their values, and the names of an expression."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

from taskspec.base.display import setting
from taskspec.base.named import all_names
from taskspec.exact.rules import claim_rules
from taskspec.language.expressions.check import CONSTANTS
from taskspec.language.expressions.dists import CATEGORICAL, DISTS
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.scope import Scope, Unavailable
from taskspec.language.source import Path
from taskspec.language.task.merge import variant_names
from taskspec.language.task.names import signature
from taskspec.tools.authoring.analysis import Analysis, own
from taskspec.tools.authoring.meanings import describe, schemas, type_of
from taskspec.tools.authoring.repair import cursor

_EXPRESSIONS = ("Expression", "Bound", "Horizon", "Constant", "Definition", "Shape")
"""What the schema calls values that are expressions."""
KEYWORDS = ("if", "else", "and", "or", "not", "in", "for", "range", "true", "false")


class Completion(NamedTuple):
    """One thing to write: its text, what kind of thing it is, and what is known of it."""

    label: str
    kind: str
    detail: str = ""
    documentation: str = ""


def complete(analysis: Analysis, offset: int) -> tuple[list[Completion], str]:
    """Return what can be written at an offset of a text, and the beginning of a word there, which it replaces.

    Args:
        analysis: the analysis of the text or, while that cannot be read, of the last text that could.
    """
    at = cursor(analysis.text, offset, analysis.name)
    if at.kind == "text":
        return [], ""
    if at.kind == "key":
        proposals = list(_keys(analysis, at.path[:-1], at.word))
    else:
        proposals = list(_values(analysis, at.path, at.before))
        if at.before == at.word:  # it may become the first key of a mapping
            proposals += _keys(analysis, at.path, at.word)
    fitting = {}
    for each in proposals:
        if each.label.lower().startswith(at.word.lower()):
            fitting[each.label] = each
    return list(fitting.values()), at.word


# -- keys ---------------------------------------------------------------------------------------------------------


def _keys(analysis: Analysis, inside: Path, word: str) -> Iterator[Completion]:
    """Yield the keys that the mapping at a path may have, and that it does not have yet; a word of one is written."""
    present = set(analysis.entries(*inside)) - {word}
    for schema in schemas(inside):
        for key, about in schema.get("properties", {}).items():
            if key not in present and about is not False:
                yield Completion(key, "key", type_of(about), about.get("description", ""))
    kind, entries = _entries(analysis, inside)
    for name in entries:
        if name not in present:
            yield Completion(name, kind)
    if kind == "label" and "rows" in inside and "else" not in present:
        yield Completion("else", "keyword")


def _entries(analysis: Analysis, path: Path) -> tuple[str, list[str]]:
    """Return the names that are keys of a section, and their kind: of components, of labels in rows of a table."""
    attempt = analysis.attempt(path)
    if attempt is None:
        return "", []
    context = attempt.names.context
    state = all_names(context.state)
    action = all_names(context.action)
    in_examples = {"state": state, "next": state, "action": action, "expert": action}
    section = own(path)
    if section == ("dynamics",):
        return "state", [f"{name}'" for name in state]
    if section == ("initial",):
        return "state", state
    if section == ("expert",):
        return "action", action
    if section[:1] == ("examples",) and section[-1] in in_examples:
        return str(section[-1]), in_examples[str(section[-1])]
    if "for" in section or section[-1:] == ("parameters",):
        return "parameter", all_names(context.parameters)
    if not section or section[0] in ("parameters", "state", "action", "figure", "constants", "roles"):
        return "", []
    return "label", list(chain.from_iterable(domain.labels for domain in context.domains))


# -- values -------------------------------------------------------------------------------------------------------


def _values(analysis: Analysis, path: Path, before: str) -> Iterator[Completion]:
    proposed = schemas(path)
    for schema in proposed:
        for option in schema.get("enum", ()):
            yield Completion(str(option), "value", documentation=schema.get("description", ""))
        if schema.get("type") == "boolean":
            yield Completion("true", "value")
            yield Completion("false", "value")
    for word in _words(analysis, path):
        yield Completion(word, "value")
    if own(path)[:1] == ("claims",):
        yield from _claim_words()
        yield from names(analysis.scope(path))
    elif _is_expression(path):
        for variable in dict.fromkeys(_bound_in(analysis, path, before)):
            yield Completion(variable, "variable")
        yield from names(analysis.scope(path))


def _words(analysis: Analysis, path: Path) -> Iterable[str]:
    """Return the words that only one entry takes: names of variants, constants and measures among them."""
    match own(path):
        case ("expert",):
            return ("optimal",)
        case ("horizon",):
            return ("none",)
        case ("figure", "map"):
            return analysis.entries("constants")
        case ("roles", _):
            return list(variant_names(analysis.sections))
        case ("claims", *_):
            return analysis.entries("measures")
        case ("parameters", _, "default"):
            return ("true", "false")
        case (*_, "base"):
            return analysis.entries("variants")
        case (_,) if path[:1] == ("variants",):
            return ("null",)
    return ()


def _bound_in(analysis: Analysis, path: Path, before: str) -> Iterator[str]:
    for match in re.finditer(r"\bfor ([\w, ]+?) in\b", f"{analysis.written(path)} {before}"):
        yield from re.findall(r"\w+", match[1])
    if own(path)[:1] == ("definitions",):
        yield from signature(str(path[-1]))[1] or ()


def _is_expression(path: Path) -> bool:
    for end in range(1, len(path) + 1):
        for schema in schemas(path[:end]):
            if schema.get("title") in _EXPRESSIONS:
                return True
    return False


def names(scope: Scope | None) -> Iterator[Completion]:
    """Yield the names, labels, functions and distributions that an expression may use."""
    if scope is not None:
        for name in dict.fromkeys(scope.names()):
            bound = scope.lookup(name)
            if bound is None:
                yield Completion(name, "label")
            elif not isinstance(bound, Unavailable):
                yield Completion(name, "name", describe(bound))
    yield from _language(scope is None or scope.draws is None)


@lru_cache
def _language(with_draws: bool) -> tuple[Completion, ...]:
    entries = [Completion(each.name, "function", each.signature, each.doc) for each in FUNCTIONS.values()]
    if with_draws:
        for dist in (CATEGORICAL, *DISTS.values()):
            arguments = all_names(dist.arguments)
            entries += [Completion(name, "argument", dist.name) for name in arguments]
            entries.append(Completion(dist.name, "distribution", f"{dist.name}({', '.join(arguments)})", dist.doc))
        entries.append(Completion("shape", "argument", "of a vector of draws"))
    for name, value in CONSTANTS.items():
        entries.append(Completion(name, "constant", setting(value)))
    return (*entries, *(Completion(word, "keyword") for word in KEYWORDS))


@lru_cache
def _claim_words() -> tuple[Completion, ...]:
    words = []
    tables = {"result": claim_rules.RESULTS, "function": claim_rules.FUNCTIONS, "model": claim_rules.MODELS}
    for kind, table in tables.items():
        words += [Completion(name, kind, word.written, word.doc) for name, word in table.items()]
    return (*words, Completion("under", "argument"), Completion("at", "argument"))
