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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, chain, pairwise
from typing import Any

import numpy as np

from taskspec.base import __version__
from taskspec.exact.solve.outcomes import Number, Outcome, Outcomes
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.reading import MOST_OUTCOMES, Contents, ForeignFile, assembled, listed
from taskspec.tools.exchange.settled import END, FIRST

INDEX = "index.json"
STATES = "state-to-choices.bin"
BRANCHES = "choice-to-branches.bin"
TARGETS = "branch-to-target.bin"
PROBABILITIES = "branch-to-probability.bin"
INITIAL = "state-is-initial.bin"
ACTIONS = "actions/choices/"
OBSERVATIONS = "observations/states/values.bin"
VALUATIONS = "valuations/states/valuations.bin"
BITS = 32
"""Of the value of a component."""
MOST_VARIABLES = 1_000
MOST_VALUES = 5_000_000
"""Values of all variables of states, at most."""
_IDENTIFIER = re.compile(r"[0-9a-z_-]+")
_RATIONAL = 128
"""The least number of bits of a rational; longer ones have a multiple of it."""
_MOST_RATIONAL = 16_384
"""Bits of a rational that is read."""
_GROUPS = {"aps": "label", "rewards": "reward"}
"""Groups of annotations."""


def write(task: FrozenTask) -> bytes:
    """Return the file of a settled task."""
    taken: list[int] = []
    choices: list[Outcomes] = []
    counts = []
    for by_action in task.outcomes:
        for a, outcomes in enumerate(by_action):
            if outcomes:
                taken.append(a)
                choices.append(outcomes)
        counts.append(len(by_action) - by_action.count(()))
    branches = list(chain(*choices))
    shares, share_type = _rationals([outcome.probability for outcome in branches])
    rewards, reward_type = _rationals([outcome.reward for outcome in branches])
    names = [name.encode() for name in task.actions]
    files = {
        STATES: _ranges(counts),
        BRANCHES: _ranges(map(len, choices)),
        TARGETS: np.array([outcome.state for outcome in branches], "<u8").tobytes(),
        PROBABILITIES: shares,
        INITIAL: _bits(task.starts, len(task.states)),
        f"{ACTIONS}values.bin": np.array(taken, "<u4").tobytes(),
        f"{ACTIONS}string-mapping.bin": _ranges(map(len, names)),
        f"{ACTIONS}strings.bin": b"".join(names),
        "annotations/rewards/reward/branches/values.bin": rewards,
        VALUATIONS: np.array([list(row.values()) for row in task.values], "<i4").tobytes(),
    }
    observed: dict[str, Any] = {"#observations": 0}
    if task.seen is not None:
        classes: dict[tuple[float, ...], int] = {}
        numbers = [classes.setdefault(row, len(classes)) for row in task.seen]
        files[OBSERVATIONS] = np.array(numbers, "<u8").tobytes()
        observed = {"#observations": len(classes), "observations-apply-to": "states"}
    propositions = {}
    for i, (name, held) in enumerate(task.labels.items()):
        identifier = name if _IDENTIFIER.fullmatch(name) else f"label-{i}"
        propositions[identifier] = {"alias": name, "applies-to": ["states"], "type": {"type": "bool", "size": 1}}
        files[f"annotations/aps/{identifier}/states/values.bin"] = _bits(held, len(task.states))
    variables = [{"name": name, "type": {"type": "int", "size": BITS}} for name in task.values[0]]
    index = {
        "format-version": 1, "format-revision": 0,
        "model-data": {"name": task.name},
        "file-data": {"tool": "taskspec", "tool-version": __version__, "parameters": {"horizon": task.horizon}},
        "transition-system": {
            "time": "discrete", "#players": 1, "#states": len(task.states), "#initial-states": 1, "#choices": len(choices),
            "#choice-actions": len(task.actions), "#branches": len(branches), "#branch-actions": 0, **observed,
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
    result = io.BytesIO()
    with gzip.GzipFile(fileobj=result, mode="wb", mtime=0) as zipped, tarfile.open(fileobj=zipped, mode="w") as tar:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return result.getvalue()


def _ranges(counts: Iterable[int]) -> bytes:
    return np.array([0, *accumulate(counts)], "<u8").tobytes()


def _bits(marked: Iterable[int], size: int) -> bytes:
    padded = np.zeros(-(-size // 64) * 64, np.bool_)
    padded[list(marked)] = True
    return np.packbits(padded, bitorder="little").tobytes()


def _rationals(values: Sequence[Number]) -> tuple[bytes, dict[str, Any]]:
    """Return numerators and denominators, side by side, all of the size of the longest; and their type."""
    exact = [Fraction(value) for value in values]
    longest = 0
    for v in exact:
        longest = max(longest, v.numerator.bit_length() + 1, v.denominator.bit_length())
    half = -(-2 * longest // _RATIONAL) * _RATIONAL // 16
    parts = []
    for v in exact:
        parts.append(v.numerator.to_bytes(half, "little", signed=True) + v.denominator.to_bytes(half, "little"))
    return b"".join(parts), {"type": "rational", "size": 16 * half}


def read(source: ForeignFile) -> FrozenTask:
    """Return the settled task of a file; rewards of states, choices and branches are added, of the first reward."""
    return _Archive(source).task()


class _Archive:
    """The files of an archive, taken out one by one; what contradicts the specification raises some exception."""

    def __init__(self, source: ForeignFile) -> None:
        self.source = source
        self.files = source.members()
        self.index: dict[str, Any] = json.loads(self.files.pop(INDEX))
        self.annotations = self.index.get("annotations", {})
        self.system = self.index["transition-system"]
        self.remarks: list[str] = []
        if self.system["time"] != "discrete" or self.system["#players"] > 1:
            source.wrong("only Markov chains and Markov decision processes in discrete time are read")
        self.n_actions = int(self.system["#choice-actions"])
        self.sizes = {entity: int(self.system[f"#{entity}"]) for entity in ("states", "choices", "branches")}
        sizes = (self.n_actions, *self.sizes.values())
        if min(sizes) < 0 or max(sizes) > MOST_OUTCOMES:
            source.wrong(f"it has more than {MOST_OUTCOMES:,} states, choices, branches or actions, or less than none")

    def task(self) -> FrozenTask:
        """Return the settled task; files that nothing reads are lost."""
        paid = self._rewards()
        targets = self._array(TARGETS, "<u8", self.sizes["branches"])
        share_type = self.system.get("branch-probability-type", {})
        shares = self._numbers(PROBABILITIES, share_type, "branches", 1)
        branches = self._ranges(BRANCHES, self.sizes["choices"], self.sizes["branches"])
        names = self._actions()
        rows = []
        for s, choices in enumerate(self._ranges(STATES, self.sizes["states"], self.sizes["choices"])):
            row: dict[str, list[Outcome]] = {}
            for choice in range(choices.start, choices.stop):
                before = paid["states"][s] + paid["choices"][choice]
                outcomes = []
                for b in range(branches[choice].start, branches[choice].stop):
                    outcomes.append(Outcome(shares[b], targets[b], before + paid["branches"][b], False))
                row[self._fresh(names[choice], row)] = outcomes
            rows.append(row)
        horizon = None
        if self.index.get("file-data", {}).get("tool") == "taskspec":
            horizon = self.index["file-data"]["parameters"]["horizon"]
        start = self._start()
        seen = self._observations()
        labels = self._labels()
        values = self._values()
        lost = set(map(_part, self.files))
        for key in self.index.get("model-data", {}):
            if key != "name":
                lost.add(f"model-data {key}")
        return assembled(self.source, Contents(
            start, rows, horizon=horizon, seen=seen, labels=labels, values=values, lost=tuple(lost), remarks=self.remarks,
        ))  # fmt: skip

    def _fresh(self, name: str, row: Mapping[str, Any]) -> str:
        if name not in row:
            return name
        remark = "actions with the same name in one state: numbered"
        if remark not in self.remarks:
            self.remarks.append(remark)
        return f"{name}_{len(row)}"

    def _array(self, name: str, kind: str, size: int) -> list[Any]:
        numbers = np.frombuffer(self.files.pop(name), kind)
        if len(numbers) != size:
            self.source.wrong(f"`{name}` has {len(numbers):,} numbers, not {size:,}")
        return list(numbers.tolist())

    def _ranges(self, name: str, size: int, whole: int) -> list[slice]:
        """Return `size` ranges up to `whole`; one after the other where the file is absent."""
        bounds = [*range(size + 1)]
        if name in self.files:
            bounds = self._array(name, "<u8", size + 1)
        if bounds != sorted(bounds) or (bounds[0], bounds[-1]) != (0, whole):
            self.source.wrong(f"`{name}` has ranges that overlap, or do not cover {whole:,} entries")
        return [slice(a, b) for a, b in pairwise(bounds)]

    def _numbers(self, name: str, kind: Mapping[str, Any], entity: str, usual: int = 0) -> list[Number]:
        size = self.sizes[entity]
        if name not in self.files:
            return [Fraction(usual)] * size
        if kind["type"] == "double":
            return self._array(name, "<f8", size)
        if kind["type"] != "rational":
            self.source.wrong(f"`{name}` has numbers of the type {kind['type']}; doubles and rationals are read")
        bits = int(kind.get("size", _RATIONAL))
        content = self.files.pop(name)
        if bits % _RATIONAL or not 0 < bits <= _MOST_RATIONAL or len(content) * 8 != bits * size:
            self.source.wrong(f"`{name}` does not have {size:,} rationals of at most {_MOST_RATIONAL:,} bits")
        half = bits // 16
        numbers: list[Number] = []
        for at in range(0, len(content), 2 * half):
            above = int.from_bytes(content[at : at + half], "little", signed=True)
            numbers.append(Fraction(above, int.from_bytes(content[at + half : at + 2 * half], "little")))
        return numbers

    def _flags(self, name: str) -> frozenset[int]:
        if name not in self.files:
            return frozenset()
        size = self.sizes["states"]
        words = np.array(self._array(name, "<u8", -(-size // 64)), "<u8")
        marks = np.unpackbits(words.view(np.uint8), bitorder="little")
        return frozenset(np.flatnonzero(marks[:size]).tolist())

    def _start(self) -> dict[int, Fraction]:
        first = self._flags(INITIAL)
        declared = self.system["#initial-states"]
        if not first or declared != len(first):
            self.source.wrong(f"{len(first)} states are marked as initial, {declared} are declared")
        if len(first) > 1:
            self.remarks.append(f"first states: {len(first):,}, of which one is drawn, all equally likely")
        return dict.fromkeys(first, Fraction(1, len(first)))

    def _labels(self) -> dict[str, frozenset[int]]:
        labels = {}
        for identifier, entry in self.annotations.get("aps", {}).items():
            name = entry.get("alias", identifier)
            if name in (FIRST, END):
                labels[name] = self._flags(f"annotations/aps/{identifier}/states/values.bin")
        return labels

    def _rewards(self) -> dict[str, list[Number]]:
        rewards = self.annotations.get("rewards", {})
        if not rewards:
            labels = listed(list(self.annotations.get("aps", {}))) or "none"
            hint = f"add a reward where the file is made; its labels: {labels}"
            self.source.wrong("it has no rewards, so that all policies are equally good", hint)
        name, entry = next(iter(rewards.items()))
        folder = f"annotations/rewards/{name}"
        return {each: self._numbers(f"{folder}/{each}/values.bin", entry["type"], each) for each in self.sizes}

    def _observations(self) -> tuple[tuple[float, ...], ...] | None:
        """Return the number of the observation of each state; None where there are no observations."""
        count = self.system.get("#observations", 0)
        seen = None
        if count and self.system["observations-apply-to"] == "states":
            classes = [0] * self.sizes["states"]
            if OBSERVATIONS in self.files:
                classes = self._array(OBSERVATIONS, "<u8", self.sizes["states"])
            if max(classes) >= count:
                self.source.wrong(f"a state has the observation {max(classes)}, of {count}")
            seen = tuple((float(i),) for i in classes)
        is_other = any(name.startswith("observations/") for name in self.files)
        if (count and seen is None) or is_other:
            self.source.wrong("its observations depend on branches or on chance; only observations of states are read")
        return seen

    def _actions(self) -> list[str]:
        used = [0] * self.sizes["choices"]
        if f"{ACTIONS}values.bin" in self.files:
            used = self._array(f"{ACTIONS}values.bin", "<u4", self.sizes["choices"])
        text = self.files.pop(f"{ACTIONS}strings.bin", None)
        if text is None:
            return [f"a{i}" for i in used]
        names = []
        for part in self._ranges(f"{ACTIONS}string-mapping.bin", self.n_actions, len(text)):
            names.append(text[part].decode("utf-8", "replace"))
        return [names[i] for i in used]

    def _values(self) -> tuple[dict[str, int], ...]:
        classes = self.index.get("valuations", {}).get("states", {}).get("classes", [])
        if len(classes) != 1:
            return ()
        layout = _layout(classes[0]["variables"])
        bits = sum(variable.size for variable in layout)
        content = self.files.get(VALUATIONS, b"")
        if not 0 < len(layout) <= MOST_VARIABLES or len(layout) * self.sizes["states"] > MOST_VALUES:
            return ()
        if bits % 8 or len(content) * 8 != bits * self.sizes["states"]:
            return ()
        del self.files[VALUATIONS]
        rows = []
        for start in range(0, len(content), bits // 8):
            packed = int.from_bytes(content[start : start + bits // 8], "little")
            row = {}
            for variable in layout:
                if variable.name is not None:
                    row[variable.name] = variable.value(packed)
                packed >>= variable.size
            rows.append(row)
        return tuple(rows)


def _part(name: str) -> str:
    folders = name.split("/")[:-1]
    if not folders:
        return name
    if folders[0] != "annotations":
        return "/".join(folders)
    return f"{_GROUPS.get(folders[1], folders[1])} {'/'.join(folders[2:3])}"


@dataclass(frozen=True)
class _Variable:
    """A variable of a valuation; padding has no name."""

    name: str | None
    size: int
    is_signed: bool = False
    offset: int = 0

    def value(self, packed: int) -> int:
        """Return the value in the lowest bits of a number."""
        value = packed % (1 << self.size)
        if self.is_signed and value >> (self.size - 1):
            value -= 1 << self.size
        return value + self.offset


def _layout(variables: Sequence[Mapping[str, Any]]) -> list[_Variable]:
    """Return the variables of a valuation; none where one of them is neither an int nor a truth value."""
    layout = []
    for variable in variables:
        if "padding" in variable:
            layout.append(_Variable(None, int(variable["padding"])))
            continue
        kind = variable["type"]
        usual = {"int": 64, "uint": 64, "bool": 1}.get(kind["type"])
        if usual is None or variable.get("is-optional"):
            return []
        size = int(kind.get("size", usual))
        layout.append(_Variable(str(variable["name"]), size, kind["type"] == "int", variable.get("offset", 0)))
    return layout
