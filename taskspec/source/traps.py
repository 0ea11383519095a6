"""Texts that YAML reads without complaint, as something else than their author meant."""

from __future__ import annotations

import re
from collections.abc import Iterator

from taskspec.source.commas import in_list, in_mapping, is_absent, is_key
from taskspec.source.excerpts import in_quotes, shown, value_end
from taskspec.source.nodes import MappingNode, Node, ScalarNode, SequenceNode, TextProblem
from taskspec.source.scalars import is_overlong_number
from taskspec.source.syntax import starts_with_brace

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
                cuts = list(_flow_mapping(text, node)) if node.flow else []
                yield from cuts
                yield from (each for each in _duplicates(node) if not any(cut.covers(each) for cut in cuts))
            case SequenceNode() if node.flow:
                yield from in_list(text, node)


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
        return TextProblem("E108", node.start, node.start + 1, "there is nothing before this `:`")
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
            message = f"the key `{shown(key.value)}` occurs twice in this mapping"
            yield TextProblem("E101", key.start, key.end, message, "remove one, or rename it")


def _flow_mapping(text: str, node: MappingNode) -> Iterator[TextProblem]:
    if text[node.start] != "{":
        return  # one pair in a list: `[a: b]`
    empty = [key for key, value in node.entries if is_absent(value)]
    if empty and len(empty) == len(node.entries) and not is_key(text, empty[0]):
        end = max(node.end, value_end(text, node.start, in_flow=True))
        yield starts_with_brace(text, node.start, end)
    else:
        yield from in_mapping(text, node)
