"""Texts between braces or brackets that YAML cuts in pieces, put together again: what to write in quotes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from taskspec.source.nodes import MappingNode, Node, ScalarNode, SequenceNode, TextProblem, in_quotes, shown, value_end
from taskspec.source.scalars import resolve

_BRACKETED = re.compile(r"\([^()\[\]{}]*\)|\[[^()\[\]{}]*\]|\{[^()\[\]{}]*\}")
_LISTS = frozenset({"values", "symbols", "shape", "by"})
"""Keys whose value may be a list of words or numbers."""
_FOR = re.compile(r"\sfor\s.+\sin\s", re.DOTALL)


def in_list(text: str, node: SequenceNode) -> Iterator[TextProblem]:
    """Yield items of a list that were one text: a call with a comma in it, or all of a comprehension."""
    done = 0
    for item in node.items:
        if _is_plain(item) and _opens(text, item) and item.start >= done:
            finding = cut(text, item.start, [node])
            done = finding.end
            yield finding


def in_mapping(text: str, node: MappingNode) -> Iterator[TextProblem]:
    """Yield entries of a mapping that were one text, and keys that have no value for another reason."""
    done = 0
    for key, value in node.entries:
        if key.start < done:
            continue
        finding: TextProblem | None = None
        if _opens(text, key):
            finding = cut(text, key.start)
        elif _is_plain(value):
            finding = _value(text, node, key, value)
        elif is_absent(value):
            finding = _without_value(key)
        if finding:
            done = finding.end
            yield finding


def _value(text: str, node: MappingNode, owner: ScalarNode, value: Node) -> TextProblem | None:
    """Return the finding for the value of a key that went on behind its comma, if it did; it takes all keys that came of that."""
    end = value_end(text, value.start, in_flow=True) if _opens(text, value) else value.end
    is_list = owner.value in _LISTS
    is_word = isinstance(resolve(text[value.start : value.end]), str)
    lone: list[ScalarNode] = []
    for key, other in node.entries:
        if key.start < end:
            continue
        if not (is_word or is_list) or not is_absent(other) or is_key(text, key):
            break
        end = value_end(text, key.start, in_flow=True) if _opens(text, key) else key.end
        lone.append(key)
    if end == value.end:
        return None
    if is_list and lone:
        return _pieces(text, value.start, end, f"a list goes in brackets: [{shown(text[value.start : end])}]")
    if len(lone) == 1 and lone[0].value.isidentifier() and text[value.start : lone[0].start].count("(") == 0:
        return _lone_word(text, value, lone[0])
    return _pieces(text, value.start, end)


def is_absent(value: Node) -> bool:
    """Return whether nothing stands where a value should."""
    return isinstance(value, ScalarNode) and value.style == "plain" and not value.value


def is_key(text: str, key: ScalarNode) -> bool:
    """Return whether what stands between braces without a value was meant as a key, and not as part of something else."""
    after = re.compile(r"\s*").match(text, key.end)
    return _is_glued(key) or (after is not None and text[after.end() : after.end() + 1] == ":")


def cut(text: str, start: int, within: Sequence[Node] = ()) -> TextProblem:
    """Return the finding for an expression that YAML cuts in pieces; of a comprehension, all of the list that it is.

    `within` are the collections around it, the innermost last.
    """
    end = value_end(text, start, in_flow=True)
    for parent in reversed(within):
        if not (isinstance(parent, SequenceNode) and parent.flow and is_comprehension(text[start:end])):
            break
        start = parent.start
        end = value_end(text, parent.start, in_flow=True)
    return _pieces(text, start, end)


def _pieces(text: str, start: int, end: int, hint: str | None = None) -> TextProblem:
    message = f"YAML splits `{shown(text[start:end])}`, because it is between braces or brackets"
    return TextProblem("E106", start, end, message, hint or in_quotes(text[start:end]))


def is_comprehension(written: str) -> bool:
    """Return whether `f(i) for i in range(0, 4)` is written, with its `for` outside all brackets."""
    while (inner := _BRACKETED.sub("", written)) != written:
        written = inner
    return _FOR.search(written) is not None


def _is_plain(node: Node) -> bool:
    return isinstance(node, ScalarNode) and node.style == "plain" and bool(node.value)


def _opens(text: str, node: Node) -> bool:
    """Return whether a piece of text opens more brackets than it closes."""
    return _is_plain(node) and text.count("(", node.start, node.end) > text.count(")", node.start, node.end)


def _is_glued(key: ScalarNode) -> bool:
    """Return whether a key without value was meant as `key: value`, and lacks the space."""
    return key.style == "plain" and re.fullmatch(r"\w+:[^:]+", key.value) is not None


def _lone_word(text: str, value: Node, key: ScalarNode) -> TextProblem:
    """Return a single word may be the rest of the text before it, or a key that lacks its value."""
    advice = in_quotes(text[value.start : key.end])
    return _no_value(key, f"if it belongs to the text before the comma, {advice}; or else write `{key.value}: value`")


def _without_value(key: ScalarNode) -> TextProblem:
    glued = f"write a space after the colon: {key.value.replace(':', ': ', 1)}" if _is_glued(key) else None
    return _no_value(key, glued)


def _no_value(key: ScalarNode, hint: str | None) -> TextProblem:
    return TextProblem("E107", key.start, key.end, f"the key `{shown(key.value)}` has no value", hint)
