"""UMB, the unified Markov binary format of model checkers: a tar file of arrays with an index in JSON.

Source: https://github.com/pmc-tools/umb, version 1.0. Storm, PRISM, Modest and stormvogel read it. Probabilities and rewards are
rationals, rewards belong to the next state, and the components of the state are its valuations.
"""

from __future__ import annotations

import gzip
import io
import json
import re
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from taskspec.base import __version__
from taskspec.exchange.reading import MOST_BYTES, MOST_OUTCOMES, MOST_ROWS, ForeignFile, assembled
from taskspec.exchange.tables import FrozenOutcome, FrozenTask, Number

INDEX = "index.json"
STATES = "state-to-choices.bin"
BRANCHES = "choice-to-branches.bin"
TARGETS = "branch-to-target.bin"
PROBABILITIES = "branch-to-probability.bin"
INITIAL = "state-is-initial.bin"
ACTIONS = "actions/choices/"
VALUATIONS = "valuations/states/valuations.bin"
BITS = 32
"""Of the value of a component."""
_IDENTIFIER = re.compile(r"[0-9a-z_-]+")
_RATIONAL = 128
"""The least number of bits of a rational; longer ones have a multiple of it."""


# -- writing ----------------------------------------------------------------------------------------------------------


def write(task: FrozenTask) -> bytes:
    """Return the file of a settled task."""
    choices = [outcomes for by_action in task.outcomes for outcomes in by_action]
    branches = [outcome for outcomes in choices for outcome in outcomes]
    shares, share_type = _rationals([outcome.probability for outcome in branches])
    rewards, reward_type = _rationals([outcome.reward for outcome in branches])
    names = [name.encode() for name in task.actions]
    files = {
        STATES: _ranges(map(len, task.outcomes)),
        BRANCHES: _ranges(map(len, choices)),
        TARGETS: np.array([outcome.state for outcome in branches], "<u8").tobytes(),
        PROBABILITIES: shares,
        INITIAL: _bits([probability > 0 for probability in task.start]),
        f"{ACTIONS}values.bin": np.array([a for row in task.outcomes for a in range(len(row))], "<u4").tobytes(),
        f"{ACTIONS}string-mapping.bin": _ranges(map(len, names)),
        f"{ACTIONS}strings.bin": b"".join(names),
        "annotations/rewards/reward/branches/values.bin": rewards,
        VALUATIONS: np.array([list(row.values()) for row in task.values], "<i4").tobytes(),
    }
    propositions = {}
    for i, (name, held) in enumerate(task.labels.items()):
        identifier = name if _IDENTIFIER.fullmatch(name) else f"label-{i}"
        propositions[identifier] = {"alias": name, "applies-to": ["states"], "type": {"type": "bool", "size": 1}}
        files[f"annotations/aps/{identifier}/states/values.bin"] = _bits([s in held for s in range(len(task.states))])
    variables = [{"name": name, "type": {"type": "int", "size": BITS}} for name in task.values[0]]
    index = {
        "format-version": 1, "format-revision": 0,
        "model-data": {"name": task.name},
        "file-data": {"tool": "taskspec", "tool-version": __version__, "parameters": {"horizon": task.horizon}},
        "transition-system": {
            "time": "discrete", "#players": 1, "#states": len(task.states), "#initial-states": 1, "#choices": len(choices),
            "#choice-actions": len(task.actions), "#branches": len(branches), "#branch-actions": 0, "#observations": 0,
            "branch-probability-type": share_type,
        },
        "annotations": {
            "rewards": {"reward": {"alias": "reward", "applies-to": ["branches"], "type": reward_type}},
            "aps": propositions,
        },
        "valuations": {"states": {"unique": True, "classes": [{"variables": variables}]}},
    }  # fmt: skip
    return _packed({INDEX: json.dumps(index, indent=1).encode(), **files})


def _packed(files: Mapping[str, bytes]) -> bytes:
    """Return a compressed tar file, the same one for the same content."""
    result = io.BytesIO()
    with gzip.GzipFile(fileobj=result, mode="wb", mtime=0) as zipped, tarfile.open(fileobj=zipped, mode="w") as tar:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return result.getvalue()


def _ranges(counts: Iterator[int]) -> bytes:
    return np.concatenate([[0], np.cumsum(list(counts))]).astype("<u8").tobytes()


def _bits(values: Sequence[bool]) -> bytes:
    padded = np.zeros(-(-len(values) // 64) * 64, np.bool_)
    padded[: len(values)] = values
    return np.packbits(padded, bitorder="little").tobytes()


def _rationals(values: Sequence[Number]) -> tuple[bytes, dict[str, Any]]:
    """Return numerators and denominators, side by side, all of the size of the longest; and their type."""
    exact = [Fraction(value) for value in values]
    longest = max(max(v.numerator.bit_length() + 1, v.denominator.bit_length()) for v in exact)
    half = -(-2 * longest // _RATIONAL) * _RATIONAL // 16
    parts = []
    for v in exact:
        parts.append(v.numerator.to_bytes(half, "little", signed=True) + v.denominator.to_bytes(half, "little"))
    return b"".join(parts), {"type": "rational", "size": 16 * half}


# -- reading ----------------------------------------------------------------------------------------------------------


def read(source: ForeignFile) -> FrozenTask:
    """Return the settled task of a file; rewards of states, choices and branches are added, of the first reward."""
    return _Archive(source).task()


class _Archive:
    """The files of an archive, with checks of their sizes."""

    def __init__(self, source: ForeignFile) -> None:
        self.source = source
        self.files: dict[str, bytes] = {}
        total = 0
        try:
            with tarfile.open(fileobj=io.BytesIO(source.content)) as tar:
                for member in tar:
                    total += member.size
                    if total > MOST_BYTES:
                        source.wrong(f"unpacked, it has more than {MOST_BYTES:,} bytes")
                    content = tar.extractfile(member) if member.isfile() else None
                    if content is not None:
                        self.files[member.name.removeprefix("./").removeprefix("/")] = content.read()
            self.index = json.loads(self.files.get(INDEX, b""))
        except (tarfile.TarError, EOFError, OSError, ValueError, RecursionError) as error:
            source.wrong(f"this is no UMB file: {error}")
        self.system = self._get(self.index, "transition-system", dict)
        if self.system.get("time") != "discrete" or self._count("#players") > 1:
            source.wrong("only Markov chains and Markov decision processes in discrete time are read")
        self.states = self._count("#states")
        self.choices = self._count("#choices")
        self.branches = self._count("#branches")
        if max(self.states, self.choices) > MOST_ROWS or self.branches > MOST_OUTCOMES:
            source.wrong(f"it has more than {MOST_ROWS:,} choices, or more than {MOST_OUTCOMES:,} branches")

    def _get(self, data: Any, key: str, kind: type) -> Any:
        value = data.get(key) if isinstance(data, dict) else None
        if not isinstance(value, kind):
            self.source.wrong(f"the index has no `{key}`, or one of the wrong type")
        return value

    def _count(self, key: str) -> int:
        count: int = self._get(self.system, key, int)
        if count < 0:
            self.source.wrong(f"`{key}` is negative")
        return count

    def _array(self, name: str, kind: str, size: int) -> Any:
        """Return the numbers of a file; None where it is absent."""
        content = self.files.get(name)
        if content is None:
            return None
        if len(content) != size * np.dtype(kind).itemsize:
            self.source.wrong(f"`{name}` has {len(content):,} bytes, not those of {size:,} numbers")
        return np.frombuffer(content, kind)

    def _ranges(self, name: str, size: int, total: int) -> list[int]:
        found = self._array(name, "<u8", size + 1)
        bounds = [*range(size + 1)] if found is None else found.tolist()
        if bounds[0] != 0 or bounds[-1] != total or any(a > b for a, b in pairwise(bounds)):
            self.source.wrong(f"`{name}` is no list of ranges")
        return bounds

    def _numbers(self, name: str, kind: Any, size: int) -> list[Number]:
        """Return doubles or rationals; zeros where the file is absent."""
        if name not in self.files:
            return [Fraction(0)] * size
        form = self._get(kind, "type", str)
        if form == "double":
            return list(self._array(name, "<f8", size).tolist())
        bits = kind.get("size", _RATIONAL)
        if form != "rational" or not isinstance(bits, int) or bits % _RATIONAL or bits <= 0:
            self.source.wrong(f"`{name}` has numbers of the type {form}, which is not read")
        content = self.files[name]
        half = bits // 16
        if len(content) != 2 * half * size:
            self.source.wrong(f"`{name}` has {len(content):,} bytes, not those of {size:,} rationals")
        found: list[Number] = []
        for at in range(0, len(content), 2 * half):
            below = int.from_bytes(content[at + half : at + 2 * half], "little")
            if below == 0:
                self.source.wrong(f"`{name}` has a rational with the denominator 0")
            found.append(Fraction(int.from_bytes(content[at : at + half], "little", signed=True), below))
        return found

    def _flags(self, name: str) -> list[int]:
        """Return the states that are marked."""
        content = self._array(name, "<u8", -(-self.states // 64))
        if content is None:
            return []
        marks = np.unpackbits(content.view(np.uint8), bitorder="little")[: self.states]
        return [int(s) for s in np.flatnonzero(marks)]

    def _strings(self, count: int) -> list[str]:
        strings = self.files.get(f"{ACTIONS}strings.bin", b"")
        if f"{ACTIONS}string-mapping.bin" not in self.files:
            return [f"a{i}" for i in range(count)]
        bounds = self._ranges(f"{ACTIONS}string-mapping.bin", count, len(strings))
        return [strings[a:b].decode("utf-8", "replace") for a, b in pairwise(bounds)]

    def _rewards(self) -> tuple[list[Number], list[Number], list[Number]]:
        """Return the first reward of states, choices and branches."""
        known = (self.index.get("annotations") or {}).get("rewards") or {}
        name = next(iter(known), "")
        kind = self._get(known[name], "type", dict) if known else None
        folder = f"annotations/rewards/{name}"
        sizes = {"states": self.states, "choices": self.choices, "branches": self.branches}
        of_states, of_choices, of_branches = (
            self._numbers(f"{folder}/{entity}/values.bin", kind, size) for entity, size in sizes.items()
        )
        return of_states, of_choices, of_branches

    def task(self) -> FrozenTask:
        first = self._ranges(STATES, self.states, self.choices)
        begins = self._ranges(BRANCHES, self.choices, self.branches)
        targets = self._array(TARGETS, "<u8", self.branches)
        if targets is None:
            self.source.wrong(f"it has no `{TARGETS}`")
        shares: list[Number] = [Fraction(1)] * self.branches
        if PROBABILITIES in self.files:
            shares = self._numbers(PROBABILITIES, self.system.get("branch-probability-type"), self.branches)
        names = self._strings(self._count("#choice-actions"))
        used = self._array(f"{ACTIONS}values.bin", "<u4", self.choices)
        of_states, of_choices, of_branches = self._rewards()
        rows = []
        for s in range(self.states):
            row: dict[str, list[FrozenOutcome]] = {}
            for choice in range(first[s], first[s + 1]):
                name = f"a{choice - first[s]}"
                if used is not None and used[choice] < len(names):
                    name = names[used[choice]]
                if name in row:
                    name = f"{name}_{choice - first[s]}"
                paid = of_states[s] + of_choices[choice]
                row[name] = [
                    FrozenOutcome(shares[b], int(targets[b]), paid + of_branches[b], False)
                    for b in range(begins[choice], begins[choice + 1])
                ]
            rows.append(row)
        initial = self._flags(INITIAL) or [0]
        labels = {}
        for identifier, entry in ((self.index.get("annotations") or {}).get("aps") or {}).items():
            alias = entry.get("alias", identifier) if isinstance(entry, dict) else identifier
            labels[str(alias)] = frozenset(self._flags(f"annotations/aps/{identifier}/states/values.bin"))
        horizon = ((self.index.get("file-data") or {}).get("parameters") or {}).get("horizon")
        return assembled(
            self.source, {s: Fraction(1, len(initial)) for s in initial}, rows, labels=labels, values=self._values(),
            horizon=horizon if isinstance(horizon, int) and horizon > 0 else None,
        )  # fmt: skip

    def _values(self) -> tuple[dict[str, int], ...]:
        """Return the values of the variables of states, where all of them are ints or truth values in one class."""
        classes = ((self.index.get("valuations") or {}).get("states") or {}).get("classes") or [{}]
        layout = []
        at = 0
        for variable in classes[0].get("variables") or []:
            kind = variable.get("type") or {}
            size = variable.get("padding") or kind.get("size", 1 if kind.get("type") == "bool" else 64)
            if "name" in variable:
                if kind.get("type") not in ("int", "uint", "bool") or variable.get("is-optional"):
                    return ()
                layout.append((str(variable["name"]), at, size, kind["type"] == "int", variable.get("offset", 0)))
            at += size
        content = self.files.get(VALUATIONS, b"")
        if not layout or len(classes) > 1 or len(content) * 8 != at * self.states:
            return ()
        found = []
        for s in range(self.states):
            packed = int.from_bytes(content[s * at // 8 : (s + 1) * at // 8], "little")
            row = {}
            for name, low, size, is_signed, offset in layout:
                value = (packed >> low) & ((1 << size) - 1)
                if is_signed and value >> (size - 1):
                    value -= 1 << size
                row[name] = value + offset
            found.append(row)
        return tuple(found)
