"""Names that look like others: on a page, or by letters of another alphabet."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import Linted
from taskspec.printers import plain
from taskspec.printers.names import of_task

_KINDS = {
    "parameters": "parameter", "constants": "constant", "definitions": "definition", "noise": "noise", "state": "component",
    "action": "action",
}  # fmt: skip


def printed_alike(case: Linted, collector: Collector) -> None:
    """W524: two names with one symbol, or a name and a label; labels of different components may share theirs."""
    notation = of_task(case.task)
    seen: dict[str, str] = {}
    for section, written, name in _names(case):
        symbol, what = plain(notation.symbol(name)), f"the {_KINDS[section]} '{name}'"
        if symbol in seen:
            _add(case, collector, (section, written), symbol, seen[symbol], what)
        seen.setdefault(symbol, what)
    for section, components in (("state", case.task.state), ("action", case.task.action)):
        for c in components:
            for label, tree in notation.labels.get(c.name, {}).items():
                if (symbol := plain(tree)) in seen:
                    _add(case, collector, (section, c.name), symbol, seen[symbol], f"the label '{label}' of '{c.name}'")


ALIKE = str.maketrans(
    "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0455\u0456\u0458\u04bb\u051b\u051d\u0501"  # Cyrillic, small
    "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0423\u0425\u0405\u0406\u0408"  # and capital
    "\u03bf\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7\u0585",  # Greek; Armenian
    "aeopcyxsijhqwdABEKMHOPCTYXSIJoABEZHIKMNOPTYXo",
)
"""Letters of other alphabets that are drawn like Latin ones, which they stand for here."""


def foreign_letters(case: Linted, collector: Collector) -> None:
    """W527: a name that nobody can tell from one in Latin letters."""
    names = [((section, written), name) for section, written, name in _names(case)]
    for section, components in (("state", case.task.state), ("action", case.task.action)):
        labels = [((section, c.name), str(label)) for c in components if c.domain for label in c.domain.labels]
        names += labels
    for place, name in names:
        latin = name.translate(ALIKE)
        if latin != name and latin.isascii():
            letter = next(a for a, b in zip(name, latin, strict=True) if a != b)
            message = f"'{name}' is not '{latin}': its '{letter}' is {unicodedata.name(letter)}, U+{ord(letter):04X}"
            collector.add("W527", case.key(*place), message, "write it in Latin letters, here and where it is used")


def _names(case: Linted) -> Iterator[tuple[str, str, str]]:
    """Every name with the section that declares it, and how it is written there."""
    spec = case.task.spec
    parts = (spec.parameters.entries, spec.constants, spec.definitions, spec.noise, spec.state, spec.action)
    for section, declared in zip(_KINDS, parts, strict=True):
        for written in declared:
            yield section, written, written.partition("(")[0].strip()


def _add(case: Linted, collector: Collector, place: tuple[str, str], symbol: str, first: str, second: str) -> None:
    message = f"pages print `{symbol}` for {first} and for {second}"
    collector.add("W524", case.key(*place), message, "give one of them another `symbol`, or labels other `symbols`")
