"""The one module that imports PyYAML: a YAML text becomes a tree of nodes, within bounds set beforehand.

The parser's events are used rather than its loader: they come one at a time, so that a text of ten
thousand brackets is refused at the hundredth, and nothing in the text can name a Python object.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml

from taskspec.base.limits import Limits, how_to_raise, limits
from taskspec.source.nodes import (
    Composed,
    MappingNode,
    Node,
    ScalarNode,
    SequenceNode,
    Style,
    Syntax,
    TextProblem,
    special_start,
)

_STYLES: dict[str | None, Style] = {"'": "'", '"': '"', "|": "|", ">": ">"}


class RefusedError(Exception):
    """The text cannot be read any further; the finding says why."""

    def __init__(self, finding: TextProblem) -> None:
        super().__init__(finding.message)
        self.finding = finding


def compose(text: str) -> Composed:
    """Return the tree of a YAML text. Never raises for a bad text: what was wrong is in the result."""
    builder = _Builder(text)
    try:
        for event in _events(text):
            builder.take(event)
    except yaml.MarkedYAMLError as error:
        builder.result.syntax = _syntax(error, builder)
        if "maximum nesting depth" in builder.result.syntax.problem:  # libyaml has a bound of its own
            builder.result.stop = _too_deep(builder.result.syntax.at)
            builder.result.syntax = None
    except yaml.YAMLError as error:
        builder.result.stop = TextProblem("E112", 0, 0, f"YAML cannot read this: {error}")
    except RefusedError as refused:
        builder.result.stop = refused.finding
    return builder.result


def _events(text: str) -> Iterator[Any]:
    """Yield the parser's events, from libyaml where it is there: it is ten times faster."""
    loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)(text)
    try:
        while loader.check_event():
            yield loader.get_event()
    finally:
        loader.dispose()


def _syntax(error: yaml.MarkedYAMLError, builder: _Builder) -> Syntax:
    at = error.problem_mark
    since = error.context_mark
    return Syntax(
        problem=error.problem or "",
        context=error.context or "",
        at=at.index if at else 0,
        since=since.index if since else None,
        open=builder.open,
        last=builder.last,
    )


def _too_deep(at: int) -> TextProblem:
    return TextProblem("E114", at, at + 1, f"values are nested more than {Limits.depth} deep")


class _Builder:
    """Puts events together into a tree; `open` are the collections that have begun, not ended."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.result = Composed()
        self.open: list[MappingNode | SequenceNode] = []
        self.keys: list[Node | None] = []  # the key whose value comes next, per open collection
        self.last: Node | None = None
        self.count = 0
        self.most = limits().values

    def take(self, event: Any) -> None:
        match event:
            case yaml.ScalarEvent():
                self._refuse_properties(event)
                style = _STYLES.get(event.style, "plain")
                self._place(ScalarNode(event.value, *_range(event), style))
            case yaml.MappingStartEvent() | yaml.SequenceStartEvent():
                self._refuse_properties(event)
                kind = MappingNode if isinstance(event, yaml.MappingStartEvent) else SequenceNode
                self._begin(kind(_range(event)[0], bool(event.flow_style)))
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                self._end(_range(event)[1])
            case yaml.AliasEvent():
                self._refuse_properties(event)
            case yaml.DocumentStartEvent() if self.result.root is not None:
                where, _ = _range(event)
                message = "a second YAML document begins here"
                hint = "one file holds one task: remove the `---`, or use `variants`"
                raise RefusedError(TextProblem("E116", where, where + 3, message, hint))

    @property
    def in_flow(self) -> bool:
        return bool(self.open) and self.open[-1].flow

    def _refuse_properties(self, event: Any) -> None:
        """Anchors, aliases and tags: not part of specs, and nearly always an unquoted operator."""
        if event.anchor is None and getattr(event, "tag", None) is None:
            return
        raise RefusedError(special_start(self.text, _range(event)[0], self.in_flow))

    def _begin(self, node: MappingNode | SequenceNode) -> None:
        if len(self.open) >= Limits.depth:
            raise RefusedError(_too_deep(node.start))
        self._place(node)
        self.open.append(node)
        self.keys.append(None)

    def _end(self, end: int) -> None:
        node = self.open.pop()
        self.keys.pop()
        node.end = end if node.flow else _last_end(node)
        self.last = node

    def _place(self, node: Node) -> None:
        self.count += 1
        if self.count > self.most:
            message = f"the file holds more than {self.most:,} values"
            hint = how_to_raise("values", 2 * self.most)
            raise RefusedError(TextProblem("E114", node.start, node.start + 1, message, hint))
        self.last = node
        match self.open[-1] if self.open else None:
            case None:
                self.result.root = node
            case SequenceNode() as parent:
                parent.items.append(node)
            case MappingNode() as parent:
                self._enter(parent, node)

    def _enter(self, parent: MappingNode, node: Node) -> None:
        key = self.keys[-1]
        if key is None:
            self.keys[-1] = node
            if not isinstance(node, ScalarNode) or (node.style == "plain" and not node.value):
                self.result.bad_keys.append(node)
            return
        self.keys[-1] = None
        if isinstance(key, ScalarNode):
            parent.entries.append((key, node))
            parent.index.setdefault(key.value, (key, node))


def _range(event: Any) -> tuple[int, int]:
    return event.start_mark.index, event.end_mark.index


def _last_end(node: MappingNode | SequenceNode) -> int:
    """Return where a block collection ends: with its last value, not with the blank lines below."""
    children = node.items if isinstance(node, SequenceNode) else [each for _, each in node.entries]
    return max(node.start + 1, children[-1].end if children else 0)
