"""Numbers, limits and checks that all readers of files share."""

from __future__ import annotations

import lzma
import math
import re
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NoReturn

from taskspec.base.diagnostics import Diagnostic, Origin, Span, SpecError
from taskspec.base.limits import limits
from taskspec.exact.solve.outcomes import Number, Outcome, Outcomes, merged
from taskspec.tools.exchange.tables import FrozenTask, plain_names

MOST_BYTES = 50_000_000
"""The size of a file, unpacked."""
MOST_ROWS = 100_000
"""Pairs of a state and an action."""
MOST_OUTCOMES = 500_000
LARGEST = 10**100
"""The largest size of a reward."""
SLACK = 1e-6
"""How far from 1 the sum of probabilities may be."""
_NUMBER = re.compile(r"[-+]?\d{1,300}(\.\d{0,300})?([eE][-+]?\d{1,3})?(/\d{1,300})?", re.ASCII)


@dataclass(frozen=True)
class ForeignFile:
    """A file that is read: its name for messages, and its content."""

    name: str
    content: bytes

    def wrong(self, message: str, line: int | None = None) -> NoReturn:
        """Raise E728, with the number of the line where there is one."""
        span = None
        if line is not None:
            origin = Origin(self.name, self.text())
            span = Span(origin, line, 1, line, max(2, len(origin.line(line)) + 1))
        else:
            message = f"{self.name}: {message}"
        raise SpecError([Diagnostic("E728", span, message)])

    def text(self) -> str:
        """Return the content as text."""
        return self.content.decode("utf-8")

    def number(self, text: str, line: int | None = None) -> Fraction:
        """Return a number such as `1/3`, `0.25` or `1e-3`."""
        if not _NUMBER.fullmatch(text):
            self.wrong(f"'{text[:40]}' is not a number", line)
        top, _, bottom = text.partition("/")
        below = int(bottom or 1)
        if below == 0:
            self.wrong(f"'{text[:40]}' divides by 0", line)
        return Fraction(top) / below


BROKEN = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RecursionError, NotImplementedError, TypeError,
    ValueError, lzma.LZMAError, tarfile.TarError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What readers raise where a file is not what they expect."""


def guarded(read: Callable[[ForeignFile], FrozenTask]) -> Callable[[ForeignFile], FrozenTask]:
    """Return a reader with E728 in place of each exception that another reader raises."""

    def safely(source: ForeignFile) -> FrozenTask:
        try:
            return read(source)
        except SpecError:
            raise
        except KeyError as error:
            source.wrong(f"it has no {error}")
        except BROKEN as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            source.wrong(f"it is not in the format that its name says: {reason}")

    return safely


Row = Mapping[str, Sequence[Outcome]]
"""The outcomes of a state by the name of the action."""


def assembled(
    source: ForeignFile, start: Mapping[int, Number], rows: Sequence[Row], states: Sequence[object] = (),
    horizon: int | None = None, discount: float = 1.0, **other: Any,
) -> FrozenTask:  # fmt: skip
    """Return the tables of a file after checks of every number.

    An action that a state does not have is not legal there. A state without actions stays, one with the same outcomes for all
    of its actions has them for all.

    Args:
        source: the file.
        start: the probabilities of first states.
        rows: the outcomes in each state.
        states: their names, if the file has some.
        horizon, discount: of the task.
        other: further attributes of the tables.
    """
    if horizon is not None and not (type(horizon) is int and 0 < horizon <= limits().horizon):
        source.wrong(f"the horizon is {horizon}; it must be between 1 and {limits().horizon:,}")
    if not 0 <= discount <= 1:
        source.wrong(f"the discount is {discount}; it must be between 0 and 1")
    names = list(dict.fromkeys(name for row in rows for name in row)) or ["only"]
    if len(rows) * len(names) > MOST_ROWS:
        source.wrong(f"{len(rows):,} states with {len(names):,} actions; {MOST_ROWS:,} pairs are the most that is read")
    if sum(len(outcomes) for row in rows for outcomes in row.values()) > MOST_OUTCOMES:
        source.wrong(f"it has more than {MOST_OUTCOMES:,} outcomes")
    found = []
    for s, row in enumerate(rows):
        own = {name: _checked(source, s, outcomes, len(rows)) for name, outcomes in row.items()}
        usual = next(iter(own.values()), (Outcome(Fraction(1), s, Fraction(0), False),))
        if len(set(own.values())) <= 1:
            found.append((usual,) * len(names))
            continue
        found.append(tuple(own.get(name, ()) for name in names))
    first = _normal(source, "the start distribution", [start.get(s, Fraction(0)) for s in range(len(rows))])
    if len(states) != len(rows):
        states = range(len(rows))
    return FrozenTask(
        name="Imported", states=plain_names([str(name) for name in states], "s"), actions=plain_names(names, "a"),
        start=tuple(first), outcomes=tuple(found), horizon=horizon, discount=discount, **other,
    )  # fmt: skip


def _checked(source: ForeignFile, s: int, outcomes: Sequence[Outcome], count: int) -> Outcomes:
    for outcome in outcomes:
        if not 0 <= outcome.state < count:
            source.wrong(f"state {s} leads to state {outcome.state}, which does not exist")
        if not (math.isfinite(outcome.reward) and -LARGEST <= outcome.reward <= LARGEST):
            source.wrong(f"state {s} pays a reward that is not finite, or too large")
    likely = [outcome for outcome in outcomes if outcome.probability]
    shares = _normal(source, f"state {s}", [outcome.probability for outcome in likely])
    kept = zip(likely, shares, strict=True)
    return merged(Outcome(share, o.state, o.reward, o.ends) for o, share in kept)


def _normal(source: ForeignFile, place: str, probabilities: Sequence[Number]) -> list[Number]:
    """Return probabilities that sum to 1."""
    if not all(0 <= p <= 1 for p in probabilities):
        source.wrong(f"{place} has a probability that is not between 0 and 1")
    total = sum(probabilities)
    if not -SLACK <= total - 1 <= SLACK:
        source.wrong(f"the probabilities of {place} sum to {float(total):.6g}, not to 1")
    if isinstance(total, Fraction) and total != 1:
        return [p / total for p in probabilities]
    return list(probabilities)
