"""What entries of the table of operators ask of whoever makes nodes (`lang.builder`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from taskspec.lang.ir import Const, Node
from taskspec.lang.types import Kind, Shape, Type


class NodeMaker(Protocol):
    """Makes nodes; each method is that of `lang.builder.Builder`."""

    def const(self, value: Any, type: Type) -> Const: ...

    def scalar(self, value: Any) -> Const: ...

    def apply(self, name: str, *args: Node) -> Node: ...

    def structure(self, name: str, args: Sequence[Node], static: tuple[int, ...] = ()) -> Node: ...

    def cast(self, node: Node, kind: Kind) -> Node: ...

    def stretch(self, node: Node, shape: Shape) -> Node: ...

    def position(self, index: Node, length: int) -> Node: ...

    def check_size(self, shape: Shape) -> None: ...
