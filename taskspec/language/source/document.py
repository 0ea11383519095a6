"""The one module that imports PyYAML: a YAML text becomes a document, plain data with the place of every value.

The parser's events are used rather than its loader: they come one at a time, so that a text of ten thousand brackets is refused
at the hundredth, and nothing in the text can name a Python object.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import yaml

from taskspec.base.diagnostics import Origin, Span
from taskspec.base.limits import Limits, how_to_raise, limits
from taskspec.language.source import nodes
from taskspec.language.source.nodes import MappingNode, Node, ScalarNode, SequenceNode, places

Path: TypeAlias = tuple[str | int, ...]
"""Where a value stands in the data: keys of mappings and indices of lists, from the root down."""


EXTENDS = "extends"
"""The section that takes what is left out from another file."""


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """A YAML text as plain data (`dict`, `list`, `str`, `int`, `float`, `bool`, `None`).

    Scalars follow YAML 1.2's core schema. Keys are always text, exactly as written (`0`, `true` and
    `1e-3` too): they are names, labels or expressions.
    """

    origin: Origin
    data: Any
    _root: Node
    _lines: list[int]
    _places: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    others: Mapping[str, Document] = field(default_factory=dict)
    """The documents that this one extends, by how it names their files."""
    merged: dict[str | None, Any] = field(default_factory=dict, init=False)
    """Its variants, and itself (None), merged into what they are based on, if they were asked for; not kept by `replace`."""

    @property
    def files(self) -> tuple[str, ...]:
        """The names of all documents that this one rests on, without its own."""
        names: list[str] = []
        for other in self.others.values():
            names += (other.origin.name, *other.files)
        return tuple(dict.fromkeys(names))

    def span(self, path: Path, start: int | None = None, end: int | None = None) -> Span:
        """Return the place of a value, or of the characters `start` to `end` of a text's value.

        A path that leads nowhere gives the place of the last value on its way that exists.
        """
        key, node = self._find(path)
        if isinstance(node, ScalarNode) and (start is not None or end is not None):
            return self._between(*self._characters(node, start, end))
        if node.end <= node.start and key is not None:
            return self._between(key.start, key.end)  # nothing is written after this key
        return self._between(node.start, node.end)

    def key_span(self, path: Path) -> Span:
        """Return the place of the key that a path ends with; of the item, when it ends in a list."""
        key, node = self._find(path)
        if key:
            return self._between(key.start, key.end)
        return self._between(node.start, node.end)

    def text(self, path: Path) -> str:
        """Return the text of a scalar as written (`0.10`, `1e-3`), quotes and line folds undone.

        Raises KeyError when there is no scalar at the path.
        """
        _, node = self._find(path, strict=True)
        if not isinstance(node, ScalarNode):
            raise KeyError(path)
        return node.value

    def search(self, word: str) -> tuple[Path, bool, str] | None:
        """Return the path of the first key or value that holds a word, whether it is the key, and its text."""
        stack: list[tuple[Path, Node]] = [((), self._root)]
        while stack:
            path, node = stack.pop()
            match node:
                case ScalarNode() if word in node.value:
                    return path, False, node.value
                case SequenceNode():
                    stack += [((*path, i), item) for i, item in enumerate(node.items)][::-1]
                case MappingNode():
                    for key, _ in node.entries:
                        if word in key.value:
                            return (*path, key.value), True, key.value
                    stack += [((*path, key.value), item) for key, item in node.entries][::-1]
        return None

    def _find(self, path: Path, strict: bool = False) -> tuple[ScalarNode | None, Node]:
        key: ScalarNode | None = None
        node = self._root
        for step in path:
            match node, step:
                case MappingNode(), str() if step in node.index:
                    key, node = node.index[step]
                case SequenceNode(), int() if 0 <= step < len(node.items):
                    key = None
                    node = node.items[step]
                case _ if strict:
                    raise KeyError(path)
                case _:
                    break
        return key, node

    def _characters(self, node: ScalarNode, start: int | None, end: int | None) -> tuple[int, int]:
        """Offsets in the file of a range of a scalar's value; an empty range has an empty place."""
        if id(node) not in self._places:
            self._places[id(node)] = places(self.origin.text, node)
        ranges = self._places[id(node)]
        first = max(0, min(start or 0, len(ranges)))
        last = len(ranges)
        if end is not None:
            last = max(first, min(end, last))
        if first < last:
            return ranges[first][0], ranges[last - 1][1]
        where = node.end
        if first < len(ranges):
            where = ranges[first][0]
        elif ranges:
            where = ranges[-1][1]
        return where, where

    def _between(self, start: int, end: int) -> Span:
        return span(self.origin, self._lines, start, end)


def span(origin: Origin, lines: list[int], start: int, end: int) -> Span:
    line = bisect_right(lines, start)
    end_line = bisect_right(lines, max(start, end))
    column = start - lines[line - 1] + 1
    end_column = max(start, end) - lines[end_line - 1] + 1
    return Span(origin, line, column, end_line, end_column)


_STYLES: dict[str | None, nodes.Style] = {"'": "'", '"': '"', "|": "|", ">": ">"}


class RefusedError(Exception):
    """The text cannot be read any further; the finding says why."""

    def __init__(self, finding: nodes.TextProblem) -> None:
        super().__init__(finding.message)
        self.finding = finding


def compose(text: str) -> nodes.Composed:
    """Parse a YAML text into a tree. Never raises for a bad text: the result says what was wrong."""
    builder = _Builder(text)
    result = builder.result
    loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)(text)  # libyaml is ten times faster, where it is there
    try:
        while loader.check_event():
            builder.take(loader.get_event())
    except yaml.MarkedYAMLError as error:
        at = 0
        if error.problem_mark:
            at = error.problem_mark.index
        since = None
        if error.context_mark:
            since = error.context_mark.index
        if "maximum nesting depth" in str(error.problem):  # libyaml has a bound of its own
            result.stop = _too_deep(at)
        else:
            result.syntax = nodes.Syntax(
                error.problem or "", error.context or "", at, since, builder.open, builder.last
            )
    except yaml.YAMLError as error:
        result.stop = nodes.TextProblem("E112", 0, 0, f"YAML cannot read this: {error}")
    except RefusedError as refused:
        result.stop = refused.finding
    finally:
        loader.dispose()
    return result


def _too_deep(at: int) -> nodes.TextProblem:
    return nodes.TextProblem("E114", at, at + 1, f"values are nested more than {Limits.depth} deep")


class _Builder:
    """Puts events together into a tree; `open` are the collections that have begun, not ended."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.result = nodes.Composed()
        self.open: list[nodes.MappingNode | nodes.SequenceNode] = []
        self.keys: list[nodes.Node | None] = []  # the key whose value comes next, per open collection
        self.last: nodes.Node | None = None
        self.count = 0
        self.most = limits().values

    def take(self, event: Any) -> None:
        start: Any = event.start_mark
        end: Any = event.end_mark
        match event:
            case yaml.ScalarEvent():
                self._refuse_properties(event)
                style = _STYLES.get(event.style, "plain")
                self._place(nodes.ScalarNode(event.value, start.index, end.index, style))
            case yaml.MappingStartEvent() | yaml.SequenceStartEvent():
                self._refuse_properties(event)
                kind = nodes.MappingNode if isinstance(event, yaml.MappingStartEvent) else nodes.SequenceNode
                if len(self.open) >= Limits.depth:
                    raise RefusedError(_too_deep(start.index))
                node = kind(start.index, bool(event.flow_style))
                self._place(node)
                self.open.append(node)
                self.keys.append(None)
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                done = self.open.pop()
                self.keys.pop()
                done.end = end.index
                if not done.flow and self.last is not None:  # a block ends with its last value, not with blank lines
                    done.end = max(done.start + 1, self.last.end)
                self.last = done
            case yaml.AliasEvent():
                self._refuse_properties(event)
            case yaml.DocumentStartEvent() if self.result.root is not None:
                where = start.index
                message = "a second YAML document begins here"
                hint = "one file holds one task: remove the `---`, or use `variants`"
                raise RefusedError(nodes.TextProblem("E116", where, where + 3, message, hint))

    def _refuse_properties(self, event: Any) -> None:
        """Refuse anchors, aliases and tags: not part of specs, and nearly always an unquoted operator."""
        if event.anchor is not None or getattr(event, "tag", None) is not None:
            in_flow = bool(self.open) and self.open[-1].flow
            raise RefusedError(nodes.special_start(self.text, event.start_mark.index, in_flow))

    def _place(self, node: nodes.Node) -> None:
        self.count += 1
        if self.count > self.most:
            message = f"the file holds more than {self.most:,} values"
            hint = how_to_raise("values", 2 * self.most)
            raise RefusedError(nodes.TextProblem("E114", node.start, node.start + 1, message, hint))
        self.last = node
        match self.open[-1] if self.open else None:
            case None:
                self.result.root = node
            case nodes.SequenceNode() as parent:
                parent.items.append(node)
            case nodes.MappingNode() as parent:
                self._enter(parent, node)

    def _enter(self, parent: nodes.MappingNode, node: nodes.Node) -> None:
        key = self.keys[-1]
        if key is None:
            self.keys[-1] = node
            if not isinstance(node, nodes.ScalarNode) or (node.style == "plain" and not node.value):
                self.result.bad_keys.append(node)
            return
        self.keys[-1] = None
        if isinstance(key, nodes.ScalarNode):
            parent.entries.append((key, node))
            parent.index.setdefault(key.value, (key, node))
