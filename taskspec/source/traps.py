"""Texts that YAML reads without complaint, as something else than their author meant."""

from __future__ import annotations

import re
from collections.abc import Iterator

from taskspec.source.excerpts import in_quotes, shown, value_end
from taskspec.source.nodes import MappingNode, Node, ScalarNode, SequenceNode, TextProblem
from taskspec.source.scalars import is_overlong_number
from taskspec.source.syntax import split_expression, starts_with_brace

# An escape that makes a control character, or begins the name of a well-known TeX command.
_TEX = re.compile(r"\\(?:\\|([abefrv0](?=[A-Za-z])|n(?:u|abla|eq)\b|t(?:heta|au|imes|ilde|frac)))")


def find(text: str, root: Node, bad_keys: list[Node]) -> Iterator[TextProblem]:
    """Every trap in a tree, in no particular order."""
    for node in bad_keys:
        if not _inside_split(node, text):
            yield _bad_key(text, node)
    for node in walk(root):
        match node:
            case ScalarNode():
                yield from _scalar(text, node)
            case MappingNode():
                yield from _duplicates(node)
                if node.flow:
                    yield from _flow_mapping(text, node)
            case SequenceNode() if node.flow:
                yield from _split(text, node.items)


def walk(node: Node) -> Iterator[Node]:
    """A node and everything below it, keys included."""
    stack = [node]
    while stack:
        node = stack.pop()
        yield node
        if isinstance(node, SequenceNode):
            stack += node.items
        elif isinstance(node, MappingNode):
            stack += [part for entry in node.entries for part in entry]


def _inside_split(node: Node, text: str) -> bool:
    """Whether an empty key is only what a comma left over: then the comma is the problem."""
    return isinstance(node, ScalarNode) and text[node.start : node.start + 1] in (",", "}")


def _bad_key(text: str, node: Node) -> TextProblem:
    if isinstance(node, ScalarNode):
        return TextProblem("E108", node.start, node.start + 1, "nothing stands before this `:`")
    kind = "list" if isinstance(node, SequenceNode) else "mapping"
    written = text[node.start : node.end]
    hint = 'write a vector as text: "(0, 1)"' if kind == "list" else in_quotes(written)
    return TextProblem("E108", node.start, node.end, f"a {kind} cannot be a key", hint)


def _scalar(text: str, node: ScalarNode) -> Iterator[TextProblem]:
    if node.style == "plain" and is_overlong_number(node.value):
        message = f"a number of {len(node.value)} digits"
        yield TextProblem("E114", node.start, node.end, message, "a float keeps about 16 digits")
    if node.style == '"':
        for found in _TEX.finditer(text, node.start, node.end):
            if found.group(1):
                message = f"`\\{found.group(1)[0]}` between double quotes is a control character"
                hint = "use single quotes, or write the backslash twice"
                yield TextProblem("E117", found.start(), found.start() + 2, message, hint)


def _duplicates(node: MappingNode) -> Iterator[TextProblem]:
    if len(node.index) == len(node.entries):
        return
    for key, _ in node.entries:
        first = node.index[key.value][0]
        if first is not key:
            message = f"the key `{shown(key.value)}` stands twice in this mapping"
            yield TextProblem("E101", key.start, key.end, message, "remove one, or rename it")


def _flow_mapping(text: str, node: MappingNode) -> Iterator[TextProblem]:
    if text[node.start] != "{":
        return  # one pair in a list: `[a: b]`
    empty = [key for key, value in node.entries if _is_absent(value)]
    if empty and len(empty) == len(node.entries) and not _is_key(text, empty[0]):
        end = max(node.end, value_end(text, node.start, in_flow=True))
        yield starts_with_brace(text, node.start, end)
        return
    children = [part for entry in node.entries for part in entry]
    pieces = list(_split(text, children))
    yield from pieces
    for key in empty:
        if not any(piece.start <= key.start < piece.end for piece in pieces):
            yield _without_value(key)


def _is_absent(value: Node) -> bool:
    return isinstance(value, ScalarNode) and value.style == "plain" and not value.value


def _is_key(text: str, key: ScalarNode) -> bool:
    """Whether what stands between braces was meant as a key, and not as a member of a set."""
    after = re.compile(r"\s*").match(text, key.end)
    return _is_glued(key) or (after is not None and text[after.end() : after.end() + 1] == ":")


def _is_glued(key: ScalarNode) -> bool:
    """Whether a key without value was meant as `key: value`, and lacks the space."""
    return key.style == "plain" and re.fullmatch(r"\w+:[^:]+", key.value) is not None


def _without_value(key: ScalarNode) -> TextProblem:
    message = f"the key `{shown(key.value)}` has no value"
    hint = None
    if _is_glued(key):
        hint = f"write a space after the colon: {key.value.replace(':', ': ', 1)}"
    return TextProblem("E107", key.start, key.end, message, hint)


def _split(text: str, children: list[Node]) -> Iterator[TextProblem]:
    """Expressions cut by a comma inside their own brackets: a piece opens more than it closes."""
    done = 0
    for child in children:
        if not isinstance(child, ScalarNode) or child.style != "plain" or child.start < done:
            continue
        if child.value.count("(") > child.value.count(")"):
            finding = split_expression(text, child.start)
            done = finding.end
            yield finding
