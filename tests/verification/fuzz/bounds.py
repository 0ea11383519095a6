"""Do bounds hold? Random expressions at the corners of their boxes and beside them, by every backend's own arithmetic.

    python -m tests.verification.fuzz.bounds --seconds 600

prints how many values were looked at, and every one that lies outside what `taskspec.language.expressions.interval` says of it.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.language.expressions.ir import Node, walk
from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.types import HUGE, INT_MAX, Kind
from taskspec.language.task.reach import widest
from tests.verification.fuzz import forms
from tests.verification.fuzz.expressions import Expressions, outside, points
from tests.verification.fuzz.forms import Form, Key, Points

QUICK: dict[str, Form] = {
    "reference": forms.by_reference, "lane": forms.by_lane, "batch": forms.by_batch, "numpy": forms.by_numpy,
}  # fmt: skip
COMPILED: dict[str, Form] = {"numba": forms.by_numba, "jax": forms.by_jax}
EVERY = (*OPERATORS, "structure")
MOST_ELEMENTS = 400
"""Expressions of more elements in all compile slowly."""


@dataclass(frozen=True)
class Breach:
    """A value outside its bounds: which promise, on which backend, of which node, and at which point."""

    promise: str
    form: str
    node: Node
    promised: tuple[float, float]
    value: Any
    point: Mapping[Key, tuple[Any, ...]]


def breaches(
    chance: random.Random, used: Mapping[str, Form], root: str | None = None, count: int = 24
) -> tuple[int, list[Breach]]:
    """How many values of one random expression were looked at, and those that lie outside.

    `root` names the operator of which the expression is made; without it, it is a tree of many.
    """
    made = Expressions(chance)
    nodes = list(walk([made.node() if root is None else made.rooted(root)]))
    types = {(r.role, r.name): r.type for r in made.reads}
    if not types or sum(n.type.size for n in nodes) > MOST_ELEMENTS:
        return 0, []
    inside = list(points(made.reads, chance, count))
    anywhere = list(outside(made.reads, chance, count // 2))
    found = list[Breach]()
    looked = 0
    for name, form in used.items():
        for where, promises in ((inside, _PROMISES if name != "jax" else _CERTAIN), (anywhere, _CERTAIN)):
            fitting = [n for n in nodes if _fits(n, name, made)]
            if not fitting:
                continue
            values = form(made.builder, fitting, types, where)
            looked += sum(v.size for v in values)
            found += _outside(made, fitting, values, where, name, promises)
    return looked, found


def _fits(node: Node, form: str, made: Expressions) -> bool:
    """Whether the ints below a node fit what the backend computes with: specs in which they do not are refused.

    Python's ints have no end, but bounds beyond HUGE only say that they are too wide.
    """
    if form in ("reference", "lane"):
        return not widest([node], HUGE / 10)
    limit = 2**63 - 1 if form != "jax" else INT_MAX
    certain = made.builder.certain
    ints = (n for n in walk([node]) if n.type.kind is Kind.INT)
    return not widest([node]) and all(max(map(abs, certain(n))) <= limit for n in ints)


_CERTAIN = ("certain",)
_PROMISES = ("bounds", "finite", "certain")


def _outside(
    made: Expressions, nodes: Sequence[Node], values: forms.Values, where: Points, form: str, promises: Sequence[str]
) -> Iterator[Breach]:
    b = made.builder
    for node, rows in zip(nodes, values, strict=True):
        for promise in promises:
            edge = b.certain(node) if promise == "certain" else b.bounds(node)
            if promise == "finite" and not b.finite(node):
                continue
            wrong = _infinite(rows) if promise == "finite" else _beyond(rows, edge)
            for element, k in zip(*np.nonzero(wrong), strict=True):
                yield Breach(promise, form, node, edge, rows[element, k], where[k])


def _infinite(rows: Any) -> Any:
    ints = (bool, int, np.bool_, np.integer)  # those of the reference may be too large for a float
    return np.vectorize(lambda v: not isinstance(v, ints) and not math.isfinite(v), otypes=[bool])(rows)


def _beyond(rows: Any, edge: tuple[float, float]) -> Any:
    """Compared as Python's numbers, which are exact."""
    return np.array([[v == v and not edge[0] <= v <= edge[1] for v in row] for row in rows.tolist()], bool).reshape(
        rows.shape
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="Look for values outside their bounds.")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--compiled", type=int, default=200, help="one expression in so many is compiled as well")
    options = parser.parse_args()
    end = time.monotonic() + options.seconds
    looked = 0
    tried = 0
    bad = 0
    while time.monotonic() < end:
        used = {**QUICK, **COMPILED} if tried % options.compiled == options.compiled - 1 else QUICK
        root = None if tried % 2 else EVERY[tried // 2 % len(EVERY)]
        count, found = breaches(random.Random(options.seed + tried), used, root)
        for breach in found[:1]:
            print(f"seed {options.seed + tried}: {breach}")
        looked = looked + count
        tried = tried + 1
        bad = bad + bool(found)
    print(f"{tried:,} expressions, {looked:,} values: {bad:,} expressions with values outside their bounds")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
