"""Warnings about names that nothing depends on or that print alike, idle errata, and accepted warnings."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.base.diagnostics import Diagnostic, Span
from taskspec.check.context import Doubt, LintContext
from taskspec.printers import plain
from taskspec.printers.names import of_task
from taskspec.task.merge import before, merge
from taskspec.task.task import Task

# -- unused names ---------------------------------------------------------------------------------

NAMED = ("parameters", "constants", "definitions", "noise")
ROOTS = (
    "state", "action", "observation", "horizon", "terminal", "discount", "initial", "dynamics", "reward",
    "absorbing_reward", "memory", "expert", "abstraction", "symmetries",
)  # fmt: skip
PROSE = frozenset({"doc", "symbol", "symbols", "message"})
INSTANCE_SEED = "instance_seed"
_WORD = re.compile(r"[^\W\d]\w*")


def unused_names(context: LintContext) -> Iterator[Doubt]:
    """Yield parameters, constants, definitions and noise that nothing depends on."""
    for section, name in unused(context.task):
        what = {"parameters": "parameter", "constants": "constant", "definitions": "definition"}.get(section, "noise")
        yield Doubt(context.key(section, name), f"nothing uses the {what} '{name}'")


def unused(task: Task) -> list[tuple[str, str]]:
    """Return section and written name of everything that no part of the task depends on, in order."""
    data = task.written
    entries = {(section, str(name)): value for section in NAMED for name, value in (data.get(section) or {}).items()}
    entries.pop(("parameters", "require"), None)
    defined = {name.partition("(")[0].strip(): (section, name) for section, name in entries}
    wanted = {word for section in ROOTS for word in _words(data.get(section))}
    wanted |= set(_words((data.get("parameters") or {}).get("require")))
    wanted.add(INSTANCE_SEED)
    followed = _followed(wanted, {word: entries[place] for word, place in defined.items()})
    return [place for word, place in defined.items() if word not in followed]


def mentioned(task: Task, section: str, name: str | None = None) -> set[str]:
    """Return every word of a section (or of one of its entries), and of the definitions, constants and noises that it names."""
    value = task.written.get(section)
    if name is not None:
        value = value.get(name) if isinstance(value, dict) else None
    return followed(task, set(_words(value)))


def followed(task: Task, found: set[str]) -> set[str]:
    """Return some words, and every word of the definitions, constants and noises that they name."""
    data = task.written
    entries = {
        str(written).partition("(")[0].strip(): inner
        for part in NAMED[1:]
        for written, inner in (data.get(part) or {}).items()
    }
    wanted = set(found)
    _followed(wanted, entries)
    return wanted


def _followed(wanted: set[str], entries: Mapping[str, Any]) -> set[str]:
    """Return the entries that some words name, directly or through other entries; add the words of those to `wanted`."""
    followed: set[str] = set()
    while fresh := (wanted & entries.keys()) - followed:
        for word in fresh:
            followed.add(word)
            wanted |= set(_words(entries[word])) - {word}
    return followed


def _words(value: Any) -> Iterator[str]:
    """Yield every word in the expressions of a section, keys included, prose excluded."""
    match value:
        case str():
            yield from _WORD.findall(value)
        case dict():
            for key, inner in value.items():
                if key not in PROSE:
                    yield from _words(str(key))
                    yield from _words(inner)
        case list():
            for inner in value:
                yield from _words(inner)
        case _:
            return


# -- symbols --------------------------------------------------------------------------------------

_KINDS = {
    "parameters": "parameter", "constants": "constant", "definitions": "definition", "noise": "noise", "state": "component",
    "action": "action",
}  # fmt: skip


def printed_alike(context: LintContext) -> Iterator[Doubt]:
    """Yield two names with one symbol, or a name and a label; labels of different components may share theirs."""
    notation = of_task(context.task)
    seen: dict[str, str] = {}
    for section, written, name in _names(context):
        symbol = plain(notation.symbol(name))
        what = f"the {_KINDS[section]} '{name}'"
        if symbol in seen:
            yield _same_symbol(context.key(section, written), symbol, seen[symbol], what)
        seen.setdefault(symbol, what)
    for section, components in (("state", context.task.state), ("action", context.task.action)):
        for c in components:
            for label, tree in notation.labels.get(c.name, {}).items():
                symbol = plain(tree)
                if symbol in seen:
                    what = f"the label '{label}' of '{c.name}'"
                    yield _same_symbol(context.key(section, c.name), symbol, seen[symbol], what)


ALIKE = str.maketrans(
    "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0455\u0456\u0458\u04bb\u051b\u051d\u0501"  # Cyrillic, small
    "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0423\u0425\u0405\u0406\u0408"  # and capital
    "\u03bf\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7\u0585",  # Greek; Armenian
    "aeopcyxsijhqwdABEKMHOPCTYXSIJoABEZHIKMNOPTYXo",
)
"""Letters of other alphabets, and the Latin letters that they look like."""


def foreign_letters(context: LintContext) -> Iterator[Doubt]:
    """Yield a name that looks like one in Latin letters."""
    names = [((section, written), name) for section, written, name in _names(context)]
    for section, components in (("state", context.task.state), ("action", context.task.action)):
        labels = [((section, c.name), str(label)) for c in components if c.domain for label in c.domain.labels]
        names += labels
    for place, name in names:
        latin = name.translate(ALIKE)
        if latin != name and latin.isascii():
            letter = next(a for a, b in zip(name, latin, strict=True) if a != b)
            message = f"'{name}' is not '{latin}': its '{letter}' is {unicodedata.name(letter)}, U+{ord(letter):04X}"
            yield Doubt(context.key(*place), message, "write it in Latin letters, here and where it is used")


def _names(context: LintContext) -> Iterator[tuple[str, str, str]]:
    """Yield every name: the section that declares it, the key there, and the name."""
    spec = context.task.spec
    parts = (spec.parameters.entries, spec.constants, spec.definitions, spec.noise, spec.state, spec.action)
    for section, declared in zip(_KINDS, parts, strict=True):
        for written in declared:
            yield section, written, written.partition("(")[0].strip()


def _same_symbol(place: Span, symbol: str, first: str, second: str) -> Doubt:
    message = f"pages print `{symbol}` for {first} and for {second}"
    return Doubt(place, message, "give one of them another `symbol`, or labels other `symbols`")


# -- errata ---------------------------------------------------------------------------------------


def idle_errata(context: LintContext) -> Iterator[Doubt]:
    """Yield an erratum of a variant about a section that is as it is without the variant."""
    task = context.task
    merged = context.merged
    based = before(task.document, task.variant)
    if based is None or not merged.data.get("errata") or not merged.is_own(("errata",)):
        return
    for i, entry in enumerate(merged.data["errata"]):
        for j, section in enumerate(entry.get("about") or ()):
            if merged.data.get(section) == based.data.get(section):
                message = f"this erratum is about `{section}`, which this variant does not change"
                yield Doubt(merged.span(("errata", i, "about", j)), message)


# -- accepted warnings ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Accepted:
    """A warning that the spec accepts, the reason, and its place."""

    warning: Diagnostic
    because: str
    place: Span


def set_aside(task: Task, found: Sequence[Diagnostic]) -> tuple[list[Diagnostic], list[Accepted]]:
    """Split diagnostics into those to report, and warnings that the task accepts."""
    reasons = task.spec.accept
    merged = merge(task.document, task.variant)
    accepted = [
        Accepted(each, reasons[each.code], merged.key_span(("accept", each.code)))
        for each in found
        if each.severity == "warning" and each.code in reasons
    ]
    aside = [each.warning for each in accepted]
    return [each for each in found if each not in aside], accepted


def idle(task: Task, accepted: Sequence[Accepted], unknown: Sequence[str] = ()) -> list[Diagnostic]:
    """Reasons for warnings that a whole check did not give; `unknown` are codes that it did not look for."""
    reasons = task.spec.accept
    merged = merge(task.document, task.variant)
    unneeded = [code for code in reasons if code not in {*unknown, *(each.warning.code for each in accepted)}]
    return [
        Diagnostic("W511", merged.key_span(("accept", code)), f"there is no {code} to accept", "remove this entry")
        for code in unneeded
    ]
