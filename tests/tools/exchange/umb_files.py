"""UMB files, written and taken apart as the specification of the format says, without the package."""

import gzip
import io
import itertools
import json
import struct
import tarfile
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

SYSTEM = {
    "time": "discrete", "#players": 1, "#states": 1, "#initial-states": 1, "#choices": 1, "#branches": 1, "#choice-actions": 0,
}  # fmt: skip
REWARD = {"rewards": {"paid": {"applies-to": ["choices"], "type": {"type": "double"}}}}

Choice = tuple[str, float, dict[int, float]]
"""The name of an action, its reward, and the probabilities of next states."""


def packed(files: dict[str, bytes]) -> bytes:
    """A tar file, compressed."""
    result = io.BytesIO()
    with tarfile.open(fileobj=result, mode="w") as tar:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return gzip.compress(result.getvalue(), mtime=0)


def umb(system: dict[str, Any] | None = None, files: dict[str, bytes] | None = None, **index: Any) -> bytes:
    """A model of one state that is never left, with other entries of its index, and other files."""
    whole = {"transition-system": SYSTEM | (system or {}), "annotations": REWARD} | index
    usual = {"branch-to-target.bin": bytes(8), "state-is-initial.bin": struct.pack("<Q", 1)}
    return packed({"index.json": json.dumps(whole).encode(), **usual, **(files or {})})


def model(
    states: Sequence[Sequence[Choice]], classes: Sequence[int] = (), files: dict[str, bytes] | None = None, **index: Any
) -> bytes:
    """A decision process that starts in state 0; with observations, a partially observable one."""
    names: list[str] = []
    actions = []
    rewards = []
    targets: list[int] = []
    probabilities: list[float] = []
    counts = []  # of next states, by choice
    for name, reward, row in itertools.chain(*states):
        if name not in names:
            names.append(name)
        actions.append(names.index(name))
        rewards.append(reward)
        targets += row.keys()
        probabilities += row.values()
        counts.append(len(row))
    system = {
        "#states": len(states), "#choices": len(actions), "#branches": len(targets), "#choice-actions": len(names),
        "#observations": 0, "branch-probability-type": {"type": "double"},
    }  # fmt: skip
    parts = {
        "state-to-choices.bin": bounds(map(len, states)),
        "choice-to-branches.bin": bounds(counts),
        "branch-to-target.bin": np.array(targets, "<u8").tobytes(),
        "branch-to-probability.bin": np.array(probabilities, "<f8").tobytes(),
        "annotations/rewards/paid/choices/values.bin": np.array(rewards, "<f8").tobytes(),
        "actions/choices/values.bin": np.array(actions, "<u4").tobytes(),
        "actions/choices/string-mapping.bin": bounds(map(len, map(str.encode, names))),
        "actions/choices/strings.bin": "".join(names).encode(),
    }
    if classes:
        system |= {"#observations": max(classes) + 1, "observations-apply-to": "states"}
        parts["observations/states/values.bin"] = np.array(classes, "<u8").tobytes()
    return umb(system, parts | (files or {}), **index)


def bounds(sizes: Any) -> bytes:
    """Where ranges begin, and where the last one ends."""
    return np.cumsum([0, *sizes], dtype="<u8").tobytes()


def unpacked(content: bytes) -> dict[str, bytes]:
    """The files of a UMB file."""
    with tarfile.open(fileobj=io.BytesIO(content)) as tar:
        return {name: tar.extractfile(name).read() for name in tar.getnames()}  # type: ignore[union-attr]


def rationals(content: bytes) -> list[Fraction]:
    """Numerators and denominators of 64 bits, side by side."""
    return list(itertools.starmap(Fraction, struct.iter_unpack("<qQ", content)))
