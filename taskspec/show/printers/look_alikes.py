"""Names that look alike: one symbol for two of them, or letters of other alphabets that look like Latin ones; broken symbols."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from taskspec.base.diagnostics import Collector, Diagnostic
from taskspec.language.expressions.syntax import Name
from taskspec.language.registry import load
from taskspec.language.source import Path
from taskspec.language.task.merge import merge
from taskspec.language.task.questions import written_in
from taskspec.language.task.task import Task, TaskLike
from taskspec.show.printers.names import of_task
from taskspec.show.printers.tex import mended
from taskspec.show.printers.text import plain

ALIKE = str.maketrans(
    "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0455\u0456\u0458\u04bb\u051b\u051d\u0501"  # Cyrillic, small
    "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0423\u0425\u0405\u0406\u0408"  # and capital
    "\u03bf\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7\u0585",  # Greek; Armenian
    "aeopcyxsijhqwdABEKMHOPCTYXSIJoABEZHIKMNOPTYXo",
)
"""Letters of other alphabets, and the Latin letters that they look like."""


_SECTIONS = {
    "parameters": "parameter", "constants": "constant", "definitions": "definition", "noise": "noise", "state": "component",
    "action": "action",
}  # fmt: skip


def look_alikes(task: TaskLike) -> tuple[Diagnostic, ...]:
    """Look for names with one symbol (W524) or none in TeX (W532), and for names that look like Latin ones (W527)."""
    task = load(task)
    merged = merge(task.source.document, task.source.variant)
    collector = Collector()
    for path, message in _same_symbols(task):
        hint = "give one of them another `symbol`, or labels other `symbols`"
        collector.add("W524", merged.key_span(path), message, hint)
    for place, given in _given_symbols(task):
        for problem in mended(given)[:1]:
            hint = "symbols are TeX's mathematics without dollars, such as `c_0` or `\\beta`"
            collector.add("W532", merged.span(place), f"the symbol `{given}` is broken: {problem}", hint)
    for path, message in _foreign_letters(task):
        collector.add("W527", merged.key_span(path), message, "write it in Latin letters, here and where it is used")
    return collector.diagnostics


def _same_symbols(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield two names with one symbol, or a name and a label; labels of different components may share theirs."""
    notation = of_task(task)
    seen = {"R": "the reward"}
    if task.discount != 1:
        seen["γ"] = "the discount"
    for path, name, subject in _symbols(task):
        symbol = plain(notation.symbol(name))
        if symbol in seen:
            yield path, f"pages print `{symbol}` for {seen[symbol]} and for {subject}"
        seen.setdefault(symbol, subject)
    for section, components in (("state", task.state), ("action", task.action)):
        for c in components:
            for label, tree in notation.labels.get(c.name, {}).items():
                symbol = plain(tree)
                if symbol in seen:
                    subject = f"the label '{label}' of '{c.name}'"
                    yield (section, c.name), f"pages print `{symbol}` for {seen[symbol]} and for {subject}"


def _given_symbols(task: Task) -> Iterator[tuple[Path, str]]:
    spec = task.spec
    parts = {"parameters": spec.parameters.entries, "state": spec.state, "action": spec.action}
    for section, entries in parts.items():
        for name, entry in entries.items():
            if entry.symbol is not None:
                yield (section, name, "symbol"), entry.symbol
            for i, given in enumerate(getattr(entry, "symbols", None) or ()):
                yield (section, name, "symbols", i), given


def _symbols(task: Task) -> Iterator[tuple[tuple[str, str], str, str]]:
    """Yield the path of each name that is printed as a symbol, the name, and words for it."""
    for path, name in _names(task):
        yield path, name, f"the {_SECTIONS[path[0]]} '{name}'"
    observed = written_in(task, "observation")
    if not isinstance(observed, dict):
        return
    for name, expr in observed.items():
        is_itself = isinstance(expr, Name) and expr.written == name
        if name not in task.spec.state and not is_itself:
            yield ("observation", name), name, f"the observation '{name}'"


def _foreign_letters(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    names = list(_names(task))
    for section, components in (("state", task.state), ("action", task.action)):
        for c in components:
            if c.domain is not None:
                names += [((section, c.name), str(label)) for label in c.domain.labels]
    for path, name in names:
        latin = name.translate(ALIKE)
        if latin != name and latin.isascii():
            letter = next(a for a, b in zip(name, latin, strict=True) if a != b)
            yield path, f"'{name}' is not '{latin}': its '{letter}' is {unicodedata.name(letter)}, U+{ord(letter):04X}"


def _names(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    spec = task.spec
    parts = (spec.parameters.entries, spec.constants, spec.definitions, spec.noise, spec.state, spec.action)
    for section, declared in zip(_SECTIONS, parts, strict=True):
        for written in declared:
            yield (section, written), written.partition("(")[0].strip()
