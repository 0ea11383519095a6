"""Names that look alike: two with one printed symbol, and letters of other alphabets that look like Latin ones."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from taskspec.base.diagnostics import Collector, Diagnostic
from taskspec.lang.syntax import Name
from taskspec.printers import plain
from taskspec.printers.names import of_task
from taskspec.registry import load
from taskspec.task.merge import merge
from taskspec.task.task import Task, TaskLike

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
    """Return W524 for names with one symbol, and W527 for names that look like others in Latin letters."""
    task = load(task)
    merged = merge(task.source.document, task.source.variant)
    collector = Collector()
    for path, message in _same_symbols(task):
        hint = "give one of them another `symbol`, or labels other `symbols`"
        collector.add("W524", merged.key_span(path), message, hint)
    for path, message in _foreign_letters(task):
        collector.add("W527", merged.key_span(path), message, "write it in Latin letters, here and where it is used")
    return collector.diagnostics


def _same_symbols(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield two names with one symbol, or a name and a label; labels of different components may share theirs."""
    notation = of_task(task)
    names = [(path, name, f"the {_SECTIONS[path[0]]} '{name}'") for path, name in _names(task)]
    observed = task.source.surface.sections.get("observation")
    for name, expr in observed.items() if isinstance(observed, dict) else ():
        if name not in task.spec.state and not (
            isinstance(expr, Name) and expr.written == name
        ):  # it is something else
            names.append((("observation", name), name, f"the observation '{name}'"))
    seen = {"R": "the reward"}
    if task.discount != 1:
        seen["γ"] = "the discount"
    for path, name, what in names:
        symbol = plain(notation.symbol(name))
        if symbol in seen:
            yield path, f"pages print `{symbol}` for {seen[symbol]} and for {what}"
        seen.setdefault(symbol, what)
    for section, components in (("state", task.state), ("action", task.action)):
        for c in components:
            for label, tree in notation.labels.get(c.name, {}).items():
                symbol = plain(tree)
                if symbol in seen:
                    what = f"the label '{label}' of '{c.name}'"
                    yield (section, c.name), f"pages print `{symbol}` for {seen[symbol]} and for {what}"


def _foreign_letters(task: Task) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield a name or label that looks like one in Latin letters."""
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
    """Yield the place of every declared name, and the name without the parameters of a function."""
    spec = task.spec
    parts = (spec.parameters.entries, spec.constants, spec.definitions, spec.noise, spec.state, spec.action)
    for section, declared in zip(_SECTIONS, parts, strict=True):
        for written in declared:
            yield (section, written), written.partition("(")[0].strip()
