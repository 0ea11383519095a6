"""Files of other tools: unpacked up to a limit, refused with the reason, and made into tables after checks of every number."""

from __future__ import annotations

import gzip
import io
import lzma
import math
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NoReturn

from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.limits import limits
from taskspec.exact.solve.outcomes import Number, Outcome, Outcomes, merged
from taskspec.tools.exchange.frozen_task import FrozenTask, plain_names

MOST_BYTES = 50_000_000
"""The size of a file, unpacked."""
CHUNK = 1_000_000
"""Bytes that are unpacked at a time."""
COMPRESSIONS: dict[bytes, Callable[[io.BytesIO], Any]] = {b"\x1f\x8b": gzip.open, b"\xfd7zXZ\0": lzma.open}
"""From the first bytes of a compressed file to the function that opens it."""
MOST_HEADERS = 1_000_000
"""Bytes of all headers of a tar file: those of about 2,000 members."""
MOST_LISTED = 5
"""Names that one remark lists."""


@dataclass(frozen=True)
class ForeignFile:
    """A file that is read: its name for messages, and its content."""

    name: str
    content: bytes

    def wrong(self, message: str, hint: str | None = None) -> NoReturn:
        """Raise E728."""
        raise spec_error("E728", f"{self.name}: {message}", hint)

    def text(self) -> str:
        return self.content.decode("utf-8")

    def unpacked(self) -> bytes:
        """Return the content without the compression of gzip or xz; no more of it is unpacked than is allowed."""
        opened = None
        for magic, opener in COMPRESSIONS.items():
            if self.content.startswith(magic):
                opened = opener
        if opened is None:
            return self.content
        data = bytearray()
        with opened(io.BytesIO(self.content)) as stream:
            while chunk := stream.read(CHUNK):
                data += chunk
                if len(data) > MOST_BYTES:
                    self.wrong(f"unpacked, it has more than {MOST_BYTES:,} bytes")
        return bytes(data)

    def members(self) -> dict[str, bytes]:
        data = self.unpacked()
        files: dict[str, bytes] = {}
        with tarfile.open(fileobj=_Headers(self, data), mode="r:") as tar:
            for member in tar:
                if not member.isfile():
                    continue
                name = member.name.removeprefix("./").removeprefix("/")
                if name in files or member.issparse():
                    self.wrong(f"`{name}` is there twice, or in pieces")
                files[name] = data[member.offset_data : member.offset_data + member.size]
                if len(files[name]) != member.size:
                    self.wrong("it ends too early")
            end = tar.offset
        if not data.startswith(bytes(tarfile.BLOCKSIZE), end):
            self.wrong("it ends too early")
        return files


class _Headers(io.BytesIO):
    """A tar file whose headers are read, up to a limit of bytes."""

    def __init__(self, source: ForeignFile, data: bytes) -> None:
        super().__init__(data)
        self.source = source
        self.left = MOST_HEADERS

    def read(self, size: int | None = -1) -> bytes:
        """Read some bytes of headers."""
        if size is None or not 0 <= size <= self.left:
            self.source.wrong(f"it has more than {MOST_HEADERS:,} bytes of headers: too many files, or names too long")
        self.left -= size
        return super().read(size)


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


def listed(names: Sequence[str]) -> str:
    """Return names with commas; of many, the first ones and how many more there are."""
    shown = ", ".join(names[:MOST_LISTED])
    if len(names) > MOST_LISTED:
        return f"{shown} and {len(names) - MOST_LISTED:,} more"
    return shown


MOST_ROWS = 100_000
"""Pairs of a state and an action."""
MOST_OUTCOMES = 500_000
LARGEST = 10**100
"""The largest size of a reward, or of what is observed."""
SLACK = 1e-6
"""How far from 1 the sum of probabilities may be."""

Row = Mapping[str, Sequence[Outcome]]
"""The outcomes of a state by the name of the action."""


@dataclass(frozen=True)
class Contents:
    """The parts of a file that a task has.

    Attributes:
        start: the probabilities of first states.
        rows: the outcomes in each state.
        states: their names, if the file has some.
        seen: the numbers that are observed in each state; None where the state itself is observed.
        labels: sets of states that mean something to readers, by name.
        values: the values of components in each state, by name.
        lost: the parts of the file that are not in the other attributes.
    """

    start: Mapping[int, Number]
    rows: Sequence[Row]
    states: Sequence[object] = ()
    horizon: int | None = None
    discount: float = 1.0
    seen: tuple[tuple[float, ...], ...] | None = None
    labels: Mapping[str, frozenset[int]] = field(default_factory=dict)
    values: tuple[Mapping[str, int], ...] = ()
    lost: Sequence[str] = ()
    remarks: Sequence[str] = ()


def assembled(source: ForeignFile, contents: Contents) -> FrozenTask:
    """Return the tables of a file.

    An action that a state does not have is not legal there. A state without actions stays, and one with the same outcomes for
    all of its actions has them for all, so that an action without an alternative anywhere is left out.
    """
    rows = contents.rows
    actions = _actions(rows)
    _check_sizes(source, contents, len(actions))
    _check_observations(source, contents)
    names = list(map(str, contents.states or range(len(rows))))
    start = [contents.start.get(s, Fraction(0)) for s in range(len(rows))]
    outcomes = []
    for s, row in enumerate(rows):
        outcomes.append(_checked_row(source, s, row, actions, len(rows)))
    task = FrozenTask(
        name="Imported", states=plain_names(names, "s"), actions=plain_names(actions, "a"),
        start=tuple(_normal(source, "the start distribution", start)), outcomes=tuple(outcomes),
        horizon=contents.horizon, discount=contents.discount, seen=contents.seen, values=contents.values,
        labels=contents.labels, remarks=tuple(contents.remarks),
    )  # fmt: skip
    if contents.lost:
        task = task.remarked(f"lost: {listed(sorted(contents.lost))}")
    single: set[str] = set()
    all_outcomes: list[Sequence[Outcome]] = []
    for row in rows:
        single |= row.keys() - set(actions)
        all_outcomes += row.values()
    if single:
        task = task.remarked(f"lost: actions without an alternative ({listed(sorted(map(repr, single)))})")
    renamed = []
    for given, plain in zip([*names, *actions], [*task.states, *task.actions], strict=True):
        if given != plain and not given.isdecimal():
            renamed.append(f"{given[:20]!r} -> {plain}")
    if renamed:
        task = task.remarked(f"renamed: {listed(renamed)}")
    if any(map(_pays_by_chance, all_outcomes)):
        task = task.remarked("rewards that are drawn: their mean, for each next state")
    return task


def _check_sizes(source: ForeignFile, contents: Contents, actions: int) -> None:
    horizon = contents.horizon
    if horizon is not None and not (type(horizon) is int and 0 < horizon <= limits().horizon):
        source.wrong(f"the horizon is {horizon}; it must be between 1 and {limits().horizon:,}")
    if not 0 <= contents.discount <= 1:
        source.wrong(f"the discount is {contents.discount}; it must be between 0 and 1")
    count = len(contents.rows)
    if count * actions > MOST_ROWS:
        source.wrong(f"{count:,} states with {actions:,} actions; {MOST_ROWS:,} pairs are the most that is read")
    outcomes = 0
    for row in contents.rows:
        outcomes += sum(map(len, row.values()))
    if outcomes > MOST_OUTCOMES:
        source.wrong(f"it has more than {MOST_OUTCOMES:,} outcomes")
    if contents.states and len(contents.states) != count:
        source.wrong(f"it has {len(contents.states):,} names for {count:,} states")
    for name, held in (("the start distribution", contents.start), *contents.labels.items()):
        if not set(held) <= set(range(count)):
            source.wrong(f"{name} has states beyond its {count:,}")


def _check_observations(source: ForeignFile, contents: Contents) -> None:
    seen = contents.seen
    if seen is None:
        return
    if len(seen) != len(contents.rows) or len(set(map(len, seen))) != 1 or not seen[0]:
        source.wrong(f"it does not have equally many observed numbers for each of its {len(contents.rows):,} states")
    for row in seen:
        if not all(abs(value) <= LARGEST for value in row):
            source.wrong("it has an observation that is not finite, or too large")


def _actions(rows: Sequence[Row]) -> list[str]:
    """Return the actions of all states that have several; one action if none has."""
    several: dict[str, None] = {}
    single: dict[str, None] = {}
    for row in rows:
        if len(row) > 1:
            several |= dict.fromkeys(row)
        else:
            single |= dict.fromkeys(row)
    return list(several) or [next(iter(single), "only")]


def _checked_row(source: ForeignFile, s: int, row: Row, actions: Sequence[str], count: int) -> tuple[Outcomes, ...]:
    """Return the outcomes of each action in a state; the same for all where those that it has do the same."""
    own = {name: _checked(source, s, outcomes, count) for name, outcomes in row.items()}
    if len(set(own.values())) <= 1:
        stays = (Outcome(Fraction(1), s, Fraction(0), False),)
        return (next(iter(own.values()), stays),) * len(actions)
    return tuple(own.get(name, ()) for name in actions)


def _checked(source: ForeignFile, s: int, outcomes: Sequence[Outcome], count: int) -> Outcomes:
    for outcome in outcomes:
        if not 0 <= outcome.state < count:
            source.wrong(f"state {s} leads to state {outcome.state}, which does not exist")
        if not (math.isfinite(outcome.reward) and -LARGEST <= outcome.reward <= LARGEST):
            source.wrong(f"state {s} pays a reward that is not finite, or too large")
    likely = _likely(outcomes)
    shares = _normal(source, f"state {s}", [outcome.probability for outcome in likely])
    kept = []
    for outcome, share in zip(likely, shares, strict=True):
        kept.append(Outcome(share, outcome.state, outcome.reward, outcome.ends))
    return merged(kept)


def _pays_by_chance(outcomes: Sequence[Outcome]) -> bool:
    paid: dict[tuple[int, bool], Number] = {}
    return any(paid.setdefault((o.state, o.ends), o.reward) != o.reward for o in _likely(outcomes))


def _likely(outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.probability]


def _normal(source: ForeignFile, place: str, probabilities: Sequence[Number]) -> list[Number]:
    if not all(0 <= p <= 1 for p in probabilities):
        source.wrong(f"{place} has a probability that is not between 0 and 1")
    total = sum(probabilities)
    if not -SLACK <= total - 1 <= SLACK:
        source.wrong(f"the probabilities of {place} sum to {float(total):.6g}, not to 1")
    if isinstance(total, Fraction) and total != 1:
        return [p / total for p in probabilities]
    return list(probabilities)
