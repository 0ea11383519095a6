"""Values in the lane form: the sources of what nodes have come to, element by element or as one flat sequence."""

from __future__ import annotations

import marshal
import re
from dataclasses import dataclass, field
from typing import Any

from taskspec.backends.emit.source import tuple_of
from taskspec.lang.ir import Node

UNROLLED = 16
"""Vectors up to this many elements become one expression for each."""
_ATOM = re.compile(r"-?[\w.]+(\[\d+\])?")


@dataclass(slots=True)
class LaneValue:
    """The source of a value: one expression per element, or the name of a flat sequence, or both."""

    atoms: list[str] | None = None
    packed: str | None = None

    @property
    def text(self) -> str:
        assert self.atoms is not None
        return self.atoms[0]


@dataclass(kw_only=True)
class LaneValues:
    """The values of nodes so far, the statements that work them out, and the constants that these refer to.

    With `unrolled` large enough, every element is an expression of its own.
    """

    constants: dict[str, Any] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    values: dict[int, LaneValue] = field(default_factory=dict)
    fresh: int = 0
    unrolled: int = UNROLLED

    def name(self) -> str:
        self.fresh += 1
        return f"v{self.fresh}"

    def assign(self, text: str) -> str:
        """A name for an expression; atoms need none."""
        return text if _ATOM.fullmatch(text) else self.named(text)

    def named(self, text: str) -> str:
        """A new name for an expression."""
        name = self.name()
        self.lines.append(f"{name} = {text}")
        return name

    def constant(self, value: Any) -> str:
        """The name of a value that is kept outside the function; tuples of the same numbers are kept once."""
        for name, known in self.constants.items():
            if known is value or _identical(known, value):
                return name
        name = f"C{len(self.constants)}"
        self.constants[name] = value
        return name

    def _shared(self, value: LaneValue) -> LaneValue:
        if value.atoms is not None:
            value.atoms = [self.assign(a) for a in value.atoms]
        return value

    def atoms(self, node: Node) -> list[str]:
        """One expression per element, row-major."""
        value = self.values[id(node)]
        if value.atoms is None:
            assert value.packed is not None
            names = [self.name() for _ in range(node.type.size)]
            self.lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = {value.packed}")
            value.atoms = names
        return value.atoms

    def packed(self, node: Node) -> str:
        """The name of a flat sequence of the elements."""
        value = self.values[id(node)]
        if value.packed is None:
            value.packed = self.assign(tuple_of(self.atoms(node)))
        return value.packed

    def scalar(self, node: Node) -> str:
        return self.atoms(node)[0]

    def scalar_of(self, node: Node) -> str:
        """The source of a node that may not be a direct argument; it was emitted with the others."""
        value = self.values[id(node)]
        value.atoms = [self.assign(a) for a in self.atoms(node)]
        return value.atoms[0]


def _identical(a: Any, b: Any) -> bool:
    """Whether two tuples hold the same numbers of the same types: (1, 0) equals (True, False), and 0.0 equals -0.0."""
    alike = isinstance(a, tuple) and isinstance(b, tuple) and a == b
    return alike and marshal.dumps(a, 2) == marshal.dumps(b, 2)  # of version 2, which knows no references
