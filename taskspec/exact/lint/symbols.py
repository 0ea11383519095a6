"""What a page would print alike."""

from __future__ import annotations

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
