"""The tree of a YAML text: what stands where. Offsets count characters; ends are exclusive."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

Style = Literal["plain", "'", '"', "|", ">"]


@dataclass(slots=True, eq=False)
class ScalarNode:
    """A single value: its text once quotes, escapes and folded lines are taken care of."""

    value: str
    start: int
    end: int
    style: Style


@dataclass(slots=True, eq=False)
class SequenceNode:
    """A list; `flow` when written between brackets."""

    start: int
    flow: bool
    end: int = 0
    items: list[Node] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class MappingNode:
    """Entries in the order written, repeated keys included; `flow` when written between braces."""

    start: int
    flow: bool
    end: int = 0
    entries: list[tuple[ScalarNode, Node]] = field(default_factory=list)
    index: dict[str, tuple[ScalarNode, Node]] = field(default_factory=dict)


Node: TypeAlias = ScalarNode | SequenceNode | MappingNode


class TextProblem(NamedTuple):
    """A problem with the text, placed by offsets."""

    code: str
    start: int
    end: int
    message: str
    hint: str | None = None

    def covers(self, other: TextProblem) -> bool:
        """Whether another problem lies within this one."""
        return self.start <= other.start and other.end <= self.end
