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
from taskspec.exact.solve.outcomes import Number, Outcome
from taskspec.tools.exchange.reading import MOST_BYTES, MOST_OUTCOMES, ForeignFile, assembled
from taskspec.tools.exchange.settled import legal_choices
from taskspec.tools.exchange.tables import FrozenTask

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


def write(task: FrozenTask) -> bytes:
    """Return the file of a settled task."""
    legal = [list(legal_choices(by_action)) for by_action in task.outcomes]
    choices = [outcomes for row in legal for _, outcomes in row]
    branches = [outcome for outcomes in choices for outcome in outcomes]
    shares, share_type = _rationals([outcome.probability for outcome in branches])
    rewards, reward_type = _rationals([outcome.reward for outcome in branches])
    names = [name.encode() for name in task.actions]
    files = {
        STATES: _ranges(map(len, legal)),
        BRANCHES: _ranges(map(len, choices)),
        TARGETS: np.array([outcome.state for outcome in branches], "<u8").tobytes(),
        PROBABILITIES: shares,
        INITIAL: _bits([probability > 0 for probability in task.start]),
        f"{ACTIONS}values.bin": np.array([a for row in legal for a, _ in row], "<u4").tobytes(),
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


def read(source: ForeignFile) -> FrozenTask:
    """Return the settled task of a file; rewards of states, choices and branches are added, of the first reward."""
    return _Archive(source).task()


class _Archive:
    """The files of an archive; what contradicts the specification raises some exception."""

    def __init__(self, source: ForeignFile) -> None:
        self.source = source
        self.files: dict[str, bytes] = {}
        total = 0
        with tarfile.open(fileobj=io.BytesIO(source.content)) as tar:
            for member in tar:
                total += member.size
                if total > MOST_BYTES:
                    source.wrong(f"unpacked, it has more than {MOST_BYTES:,} bytes")
                content = tar.extractfile(member) if member.isfile() else None
                if content is not None:
                    self.files[member.name.removeprefix("./").removeprefix("/")] = content.read()
        self.index: dict[str, Any] = json.loads(self.files[INDEX])
        self.system = self.index["transition-system"]
        if self.system["time"] != "discrete" or self.system["#players"] > 1:
            source.wrong("only Markov chains and Markov decision processes in discrete time are read")
        self.sizes = {entity: int(self.system[f"#{entity}"]) for entity in ("states", "choices", "branches")}
        if max(self.sizes.values()) > MOST_OUTCOMES:
            source.wrong(f"it has more than {MOST_OUTCOMES:,} states, choices or branches")

    def _array(self, name: str, kind: str, size: int) -> list[Any]:
        """Return the numbers of a file, as many as there should be."""
        found = np.frombuffer(self.files[name], kind)
        if len(found) != size:
            self.source.wrong(f"`{name}` has {len(found):,} numbers, not {size:,}")
        return list(found.tolist())

    def _ranges(self, name: str, size: int) -> list[slice]:
        """Return the range of each entity; one after the other where the file is absent."""
        bounds = self._array(name, "<u8", size + 1) if name in self.files else [*range(size + 1)]
        if bounds != sorted(bounds):
            self.source.wrong(f"`{name}` has ranges that overlap")
        return [slice(a, b) for a, b in pairwise(bounds)]

    def _numbers(self, name: str, kind: Mapping[str, Any], entity: str, usual: int = 0) -> list[Number]:
        """Return doubles or rationals; the usual number where the file is absent."""
        size = self.sizes[entity]
        if name not in self.files:
            return [Fraction(usual)] * size
        if kind["type"] == "double":
            return self._array(name, "<f8", size)
        half = int(kind.get("size", _RATIONAL)) // 16
        if kind["type"] != "rational" or len(self.files[name]) != 2 * half * size:
            self.source.wrong(f"`{name}` does not have {size:,} doubles or rationals")
        found: list[Number] = []
        for at in range(0, 2 * half * size, 2 * half):
            above = int.from_bytes(self.files[name][at : at + half], "little", signed=True)
            found.append(Fraction(above, int.from_bytes(self.files[name][at + half : at + 2 * half], "little")))
        return found

    def _flags(self, name: str) -> frozenset[int]:
        """Return the states that are marked."""
        marks = np.unpackbits(np.frombuffer(self.files.get(name, b""), np.uint8), bitorder="little")
        return frozenset(np.flatnonzero(marks[: self.sizes["states"]]).tolist())

    def _actions(self) -> list[str]:
        """Return the name of the action of each choice."""
        count = self.system["#choice-actions"]
        used = [0] * self.sizes["choices"]
        if f"{ACTIONS}values.bin" in self.files:
            used = self._array(f"{ACTIONS}values.bin", "<u4", self.sizes["choices"])
        text = self.files.get(f"{ACTIONS}strings.bin")
        if text is None:
            return [f"a{i}" for i in used]
        names = [text[part].decode("utf-8", "replace") for part in self._ranges(f"{ACTIONS}string-mapping.bin", count)]
        return [names[i] for i in used]

    def task(self) -> FrozenTask:
        annotations = self.index.get("annotations", {})
        name, kind = next(iter(annotations.get("rewards", {}).items()), ("", {"type": {}}))
        folder = f"annotations/rewards/{name}"
        paid = {each: self._numbers(f"{folder}/{each}/values.bin", kind["type"], each) for each in self.sizes}
        targets = self._array(TARGETS, "<u8", self.sizes["branches"])
        share_type = self.system.get("branch-probability-type", {})
        shares = self._numbers(PROBABILITIES, share_type, "branches", 1)
        branches = self._ranges(BRANCHES, self.sizes["choices"])
        names = self._actions()
        rows = []
        for s, choices in enumerate(self._ranges(STATES, self.sizes["states"])):
            row: dict[str, list[Outcome]] = {}
            for choice in range(self.sizes["choices"])[choices]:
                before = paid["states"][s] + paid["choices"][choice]
                outcomes = []
                for b in range(self.sizes["branches"])[branches[choice]]:
                    outcomes.append(Outcome(shares[b], targets[b], before + paid["branches"][b], False))
                row[names[choice] if names[choice] not in row else f"a{len(row)}"] = outcomes
            rows.append(row)
        first = self._flags(INITIAL) or {0}
        labels = {}
        for identifier, entry in annotations.get("aps", {}).items():
            labels[str(entry.get("alias", identifier))] = self._flags(f"annotations/aps/{identifier}/states/values.bin")
        horizon = (self.index.get("file-data", {}).get("parameters") or {}).get("horizon")
        return assembled(
            self.source, {s: Fraction(1, len(first)) for s in first}, rows, labels=labels, values=self._values(),
            horizon=horizon,
        )  # fmt: skip

    def _values(self) -> tuple[dict[str, int], ...]:
        """Return the values of the variables of states, where all of them are ints or truth values in one class."""
        classes = self.index.get("valuations", {}).get("states", {}).get("classes", [])
        layout = []
        at = 0
        for variable in classes[0]["variables"] if len(classes) == 1 else ():
            kind = variable.get("type", {"type": "padding", "size": variable.get("padding")})
            if kind["type"] not in ("int", "uint", "bool", "padding") or variable.get("is-optional"):
                return ()
            layout.append((variable.get("name"), at, int(kind["size"]), kind["type"], variable.get("offset", 0)))
            at += int(kind["size"])
        content = self.files.get(VALUATIONS, b"")
        if not layout or at % 8 or len(content) * 8 != at * self.sizes["states"]:
            return ()
        found = []
        for start in range(0, len(content), at // 8):
            packed = int.from_bytes(content[start : start + at // 8], "little")
            row = {}
            for name, low, size, kind, offset in layout:
                value = (packed >> low) % (1 << size)
                if kind == "int" and value >> (size - 1):
                    value -= 1 << size
                if name is not None:
                    row[str(name)] = value + offset
            found.append(row)
        return tuple(found)
