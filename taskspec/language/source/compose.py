"""The one module that imports PyYAML: a YAML text becomes a tree of nodes, within bounds set beforehand.

The parser's events are used rather than its loader: they come one at a time, so that a text of ten
thousand brackets is refused at the hundredth, and nothing in the text can name a Python object.
"""

from __future__ import annotations

from typing import Any

import yaml

from taskspec.base.limits import Limits, how_to_raise, limits
from taskspec.language.source import nodes

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
        if error.problem_mark:
            at = error.problem_mark.index
        else:
            at = 0
        if error.context_mark:
            since = error.context_mark.index
        else:
            since = None
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
                self._begin(kind(start.index, bool(event.flow_style)))
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                self._end(end.index)
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

    def _begin(self, node: nodes.MappingNode | nodes.SequenceNode) -> None:
        if len(self.open) >= Limits.depth:
            raise RefusedError(_too_deep(node.start))
        self._place(node)
        self.open.append(node)
        self.keys.append(None)

    def _end(self, end: int) -> None:
        node = self.open.pop()
        self.keys.pop()
        node.end = end
        if not node.flow and self.last is not None:  # a block ends with its last value, not with the blank lines below
            node.end = max(node.start + 1, self.last.end)
        self.last = node

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
