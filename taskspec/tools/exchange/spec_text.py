"""Tables as the text of a spec: decision tables with as few keys as tell their values apart."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from taskspec.base.display import small_fraction
from taskspec.base.limits import limits
from taskspec.exact.solve.outcomes import Number
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.tools.exchange.frozen_task import FrozenTask, visited

PLAIN = 10_000
"""The largest denominator of a float that is written as a fraction."""
SIMPLE = 1_000
"""The largest denominator of a return that is written as a fraction: others are near one by chance."""
LONGEST = 256
"""Bits of the numbers in a fraction that is written in full."""
EXACT = 1e-12
MOST_IN_GRAPH = 12
MOST_DRAWN = 300
"""States of a matrix that is drawn."""
MOST_ENDS = 12
"""States that are listed in a condition; more of them are written as a table."""
Entries = dict[tuple[str, str, str], str]
"""Values as text by state, action and next state."""
KEYS = ((), ("s",), ("a",), ("s'",), ("s", "a"), ("s", "s'"), ("s", "a", "s'"))
"""Keys of a table; the first that suffice are taken."""
_AT = {"s": 0, "a": 1, "s'": 2}


def spec_text(task: FrozenTask) -> str:
    """Write tables as the text of a spec."""
    return "\n".join(_lines(task)) + "\n"


def task_of_tables(task: FrozenTask) -> Task:
    """Build the task that the tables define."""
    return build(read_text(spec_text(task), f"{task.name}.yaml"))


def written(value: Number) -> str:
    """Write a number as specs do: `2`, `1/3`, or with all its decimals."""
    if isinstance(value, Fraction):
        if max(value.numerator.bit_length(), value.denominator.bit_length()) <= LONGEST:
            return str(value)
        value = float(value)
    return _near(value, PLAIN)


def _near(value: Number, largest: int) -> str:
    """Write a float as a fraction, if it is very near one with a small denominator; else with all its decimals."""
    fraction = small_fraction(value, largest, EXACT * abs(float(value)))
    if fraction is None:
        return repr(value)
    return str(fraction)


def _lines(task: FrozenTask) -> Iterator[str]:
    yield from ("taskspec: 1", f"name: {task.name}")
    for key in ("title", "summary"):
        if key in task.text:
            yield f"{key}: {_quoted(task.text[key])}"
    description = task.text.get("description", "").strip()
    if description:
        yield "description: |"
        yield from (f"  {line}".rstrip() for line in description.splitlines())
    if task.text.get("capability"):
        yield f"capability: {_quoted(task.text['capability'])}"
    yield ""
    yield from ("state:", f"  s: {{type: choice, values: [{', '.join(task.states)}]}}")
    yield from ("action:", f"  a: {{type: choice, values: [{', '.join(task.actions)}]}}")
    if task.seen is not None:
        yield from _observation(task.states, task.seen)
    yield from _legal(task)
    yield f"horizon: {task.horizon or 'none'}"
    if task.discount != 1:
        yield f"discount: {written(task.discount)}"
    yield from ("initial:", f"  s: {_distribution(zip(task.states, task.start, strict=True))}", "dynamics:")
    yield from _TableText("  s'", task, _next_states(task)).lines()
    yield from _rewards("reward", task)
    yield from _ends(task)
    yield from _absorbing(task)
    yield from _measures(task)
    yield "expert: optimal"
    if task.claims:
        yield "claims:"
        for name, value in task.claims.items():
            yield f"  - {name} == {_near(value, SIMPLE)}"
    yield from _figure(task)


def _observation(states: Sequence[str], seen: Sequence[tuple[float, ...]]) -> Iterator[str]:
    numbers = list(itertools.chain.from_iterable(seen))
    yield from ("observation:", "  seen:", "    value:", "      by: [s]", "      rows:")
    for name, row in zip(states, seen, strict=True):
        values = ", ".join(map(written, row))
        if len(row) > 1:
            values = f"[{values}]"
        yield f"        {name}: {values}"
    yield from (f"    low: {written(min(numbers))}", f"    high: {written(max(numbers))}")


def _legal(task: FrozenTask) -> Iterator[str]:
    entries: Entries = {}
    for s in sorted(task.acting):
        for a, outcomes in enumerate(task.outcomes[s]):
            entries[task.states[s], task.actions[a], ""] = str(bool(outcomes)).lower()
    if "false" in entries.values():
        yield from _TableText("legal", task, entries).lines()


def _figure(task: FrozenTask) -> Iterator[str]:
    if task.width is not None:
        if visited(task) is not task:
            yield 'accept: {W501: "cells of the grid that no episode enters"}'
        yield f"figure: {{kind: grid, at: [s % {task.width}, s // {task.width}]}}"
        return
    if len(task.states) <= MOST_IN_GRAPH:
        yield from ("figure:", "  kind: graph")
    elif len(task.states) <= MOST_DRAWN:
        yield from ("figure:", "  kind: matrix")


def _next_states(task: FrozenTask) -> Entries:
    """Next states; `s` in states that no action leaves."""
    entries: Entries = {}
    for s, by_action in enumerate(task.outcomes):
        stays = all(outcome.state == s for outcome in itertools.chain.from_iterable(by_action))
        for a, outcomes in enumerate(by_action):
            if not outcomes:
                continue
            value = "s"
            if not stays:
                value = _distribution((task.states[outcome.state], outcome.probability) for outcome in outcomes)
            entries[task.states[s], task.actions[a], ""] = value
    return entries


def has_mean_rewards(task: FrozenTask) -> bool:
    """Tell whether the spec has expected rewards, because a table of rewards by next state would be too large."""
    return _reward_table("reward", task).cells > limits().cells


def _reward_table(name: str, task: FrozenTask) -> _TableText:
    entries: Entries = {}
    for s, a, outcome in task.taken_steps():
        entries[task.states[s], task.actions[a], task.states[outcome.state]] = written(outcome.reward)
    return _TableText(name, task, entries)


def _rewards(name: str, task: FrozenTask) -> Iterator[str]:
    table = _reward_table(name, task)
    if table.cells <= limits().cells:
        yield from table.lines()
        return
    means: Entries = {}
    for s in task.acting:
        for a, outcomes in enumerate(task.outcomes[s]):
            if outcomes:
                mean = sum(outcome.probability * outcome.reward for outcome in outcomes)
                means[task.states[s], task.actions[a], ""] = written(mean)
    yield from _TableText(name, task, means).lines()


def _measures(task: FrozenTask) -> Iterator[str]:
    if task.measures:
        yield "measures:"
    for name, paid in task.measures.items():
        yield from _rewards(f"  {name}", paid)


def _absorbing(task: FrozenTask) -> Iterator[str]:
    entries: Entries = {}
    for _, _, outcome in task.taken_steps():
        if task.absorbing and (outcome.ends or task.last is not None):
            name = task.states[outcome.state]
            entries[name, "", ""] = written(task.absorbing[outcome.state])
    if entries:
        yield from _TableText("absorbing_reward", task, entries).lines()


def _ends(task: FrozenTask) -> Iterator[str]:
    if task.last is not None:
        yield f"terminal: t == {task.last}"
        return
    entries: Entries = {}
    for s, a, outcome in task.taken_steps():
        entries[task.states[s], task.actions[a], task.states[outcome.state]] = str(outcome.ends).lower()
    if "true" not in entries.values():
        return
    table = _TableText("terminal", task, entries)
    ends = []
    for name in task.states:
        if table.rows.get((name,)) == "true":
            ends.append(name)
    if table.keys == ("s'",) and len(ends) <= MOST_ENDS:
        condition = f"in {{{', '.join(ends)}}}"
        if len(ends) == 1:
            condition = f"== {ends[0]}"
        yield f"terminal: s' {condition}"
        return
    yield from table.lines()


class _TableText:
    """A decision table with as few keys as tell its values apart."""

    def __init__(self, name: str, task: FrozenTask, entries: Entries) -> None:
        self.name = name
        self.counts = {"s": len(task.states), "a": len(task.actions), "s'": len(task.states)}
        for keys in KEYS:
            rows = _rows_by(entries, keys)
            if rows is not None:
                break
        assert rows is not None
        self.keys = keys
        self.rows = rows

    @property
    def cells(self) -> int:
        """The number of cells, written or not."""
        total = 1
        for key in self.keys:
            total *= self.counts[key]
        return total

    def lines(self) -> Iterator[str]:
        """Yield the lines of the table in YAML."""
        if not self.keys:
            yield f"{self.name}: {self.rows[()]}"
            return
        indent = " " * (len(self.name) - len(self.name.lstrip()) + 2)
        yield from (f"{self.name}:", f"{indent}by: [{', '.join(self.keys)}]", f"{indent}rows:")
        texts = self._texts(self.rows, self.keys)
        common = _common(texts.values())
        is_shared = list(texts.values()).count(common) > 1 or len(texts) < self.counts[self.keys[0]]
        for first, text in texts.items():
            if text != common or not is_shared:
                yield f"{indent}  {first}: {text}"
        if is_shared:
            yield f"{indent}  else: {common}"

    def _texts(self, rows: Mapping[tuple[str, ...], str], keys: tuple[str, ...]) -> dict[str, str]:
        below: dict[str, dict[tuple[str, ...], str]] = {}
        for key, value in rows.items():
            below.setdefault(key[0], {})[key[1:]] = value
        return {first: self._row(rest, keys[1:]) for first, rest in below.items()}

    def _row(self, rows: Mapping[tuple[str, ...], str], keys: tuple[str, ...]) -> str:
        """Write one row: a value where all are equal, or values by the next key.

        A distribution that all share stands under `else`: alone it would be read as values by the next key.
        """
        first = next(iter(rows.values()))
        if len(set(rows.values())) == 1:
            if keys and first.startswith("{"):
                return f"{{else: {first}}}"
            return first
        texts = self._texts(rows, keys)
        common = _common(texts.values())
        is_whole = len(texts) == self.counts[keys[0]]
        if not is_whole or list(texts.values()).count(common) > 1:
            for key, text in list(texts.items()):
                if text == common:
                    del texts[key]
            texts["else"] = common
        return _mapping(texts)


def _rows_by(entries: Entries, keys: tuple[str, ...]) -> dict[tuple[str, ...], str] | None:
    """Index entries by some of their keys; None where these do not tell them apart."""
    rows: dict[tuple[str, ...], str] = {}
    for entry, value in entries.items():
        key = tuple(entry[_AT[name]] for name in keys)
        if rows.setdefault(key, value) != value:
            return None
    return rows


def _common(values: Iterable[str]) -> str:
    return Counter(values).most_common(1)[0][0]


def _distribution(pairs: Iterable[tuple[str, Number]]) -> str:
    """Write a draw of states; a state that occurs twice, with and without an end, has the sum of both."""
    likely: dict[str, Number] = {}
    for name, probability in pairs:
        if probability > 0:
            likely[name] = likely.get(name, 0) + probability
    if len(likely) == 1:
        return next(iter(likely))
    return _mapping({name: written(probability) for name, probability in likely.items()})


def _mapping(texts: Mapping[str, str]) -> str:
    return f"{{{', '.join(f'{key}: {text}' for key, text in texts.items())}}}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
