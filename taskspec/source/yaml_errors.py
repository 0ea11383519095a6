"""Why YAML could not be read, in an author's words, and texts that it reads as something else than meant.

The parser's own messages describe its state. Each rule below recognises one situation from where
the parser gave up, what it had read last, and the text around; the first that applies explains it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from taskspec.source.commas import cut, in_list, in_mapping, is_absent, is_key
from taskspec.source.nodes import (
    SPECIAL,
    MappingNode,
    Node,
    ScalarNode,
    SequenceNode,
    Syntax,
    TextProblem,
    in_quotes,
    is_closed,
    line_end,
    line_start,
    shown,
    special_start,
    value_end,
)
from taskspec.source.scalars import is_overlong_number

_FOREIGN = (
    (r"[^?\n]+\s(\?)\s", "`c ? x : y` is not part of the language", "write `x if c else y`"),
    (r"(lambda)\s", "`lambda` is not part of the language", "write what it returns, or a definition with arguments"),
)
"""Expressions of other languages that have a colon: in quotes they would be as wrong."""
_WORD_LINE = re.compile(r"""[\w']+$|"[^"]*"$""")
_KEY_LINE = re.compile(r"[\r\n][ \t]*(?:- +)?[\w']+:(?=\s)")
"""The begin of a line below the first that looks like `key: value`."""


def explain(text: str, syntax: Syntax) -> TextProblem:
    """Return the finding for a text that the YAML parser refused."""
    for rule in _RULES:
        if finding := rule(text, syntax):
            return finding
    return _unknown(text, syntax)


def _tab(text: str, syntax: Syntax) -> TextProblem | None:
    at = syntax.at
    if _char(text, at) != "\t" and "tab" not in syntax.problem.split():
        return None
    tab = text.find("\t", line_start(text, at))
    hint = "replace each tab by spaces"
    return TextProblem("E105", tab, tab + 1, "a tab where YAML wants spaces", hint)


def _open_quote(text: str, syntax: Syntax) -> TextProblem | None:
    if "quoted" not in syntax.context or syntax.since is None:
        return None
    quote = text[syntax.since]
    hint = "inside single quotes, a quote is written twice: ''" if quote == "'" else None
    message = f"this text begins with {quote} and is never closed"
    return TextProblem("E111", syntax.since, line_end(text, syntax.since), message, hint)


def _closed_too_late(text: str, syntax: Syntax) -> TextProblem | None:
    """Return a quote that is not closed: what closes it is a quote or a prime in a later line, with keys in between."""
    last = syntax.last
    if not isinstance(last, ScalarNode) or last.style not in ("'", '"') or text[last.end : syntax.at].strip():
        return None
    if not _KEY_LINE.search(text, last.start, last.end):
        return None
    ends_at = text.count("\n", 0, last.end) + 1
    message = f"this text begins with {last.style} and is not closed before line {ends_at}"
    return TextProblem("E111", last.start, line_end(text, last.start), message, f"close it with another {last.style}")


def _escape(text: str, syntax: Syntax) -> TextProblem | None:
    if "escape" not in syntax.problem and "hexdecimal" not in syntax.problem:
        return None
    if "quoted" not in syntax.context:  # tags have escapes of their own
        return None
    at = text.rfind("\\", 0, syntax.at + 1)
    if at + 1 == len(text):
        return None  # the quote is never closed
    message = f"`{text[at : at + 2]}` means nothing between double quotes"
    return TextProblem("E117", at, at + 2, message, "use single quotes, or write the backslash twice")


def _no_colon(text: str, syntax: Syntax) -> TextProblem | None:
    if "could not find expected ':'" not in syntax.problem or syntax.since is None:
        return None
    return _colon_missing(text, syntax.since)


def _colon_missing(text: str, start: int) -> TextProblem:
    end = value_end(text, start, in_flow=False)
    message = f"`{shown(text[start:end])}` is not of the form `key: value`"
    return TextProblem("E112", start, end, message, "write a colon and a space after the key")


def _special(text: str, syntax: Syntax) -> TextProblem | None:
    if any(word in syntax.context for word in _SPECIAL_CONTEXTS):
        at = syntax.at if syntax.since is None else syntax.since
    elif any(word in syntax.problem for word in _SPECIAL_PROBLEMS):
        at = syntax.at
    else:
        return None
    char = _char(text, at)
    in_flow = bool(syntax.open) and syntax.open[-1].flow
    if in_flow and char in (",", ":", "]", "}"):
        code = "E108" if char == ":" else "E112"
        return TextProblem(code, at, at + 1, f"there is nothing before this `{char}`")
    return special_start(text, at, in_flow) if char in SPECIAL else None


_SPECIAL_CONTEXTS = ("anchor", "alias", "tag", "block scalar", "directive")
_SPECIAL_PROBLEMS = (
    "tag",
    "cannot start any token",
    "sequence entries are not allowed",
    "mapping keys are not allowed",
    "node content",
)


def _not_closed(text: str, syntax: Syntax) -> TextProblem | None:
    """Return a bracket without its partner: the parser ran into the end, or into the next key."""
    if not syntax.open or not syntax.open[-1].flow:
        return None
    for node in syntax.open:
        if node.flow and not is_closed(text, node.start):
            message = f"this `{text[node.start]}` is never closed"
            return TextProblem("E111", node.start, node.start + 1, message)
    return None


def _split_by_bracket(text: str, syntax: Syntax) -> TextProblem | None:
    """Return an index or a call inside a flow collection: `{x: p[0]}`."""
    last = syntax.last
    if not syntax.open or not syntax.open[-1].flow or _char(text, syntax.at) not in ("[", "{"):
        return None
    if not isinstance(last, ScalarNode) or last.style != "plain":
        return None
    return cut(text, last.start, syntax.open)


def _unmatched(text: str, syntax: Syntax) -> TextProblem | None:
    char = _char(text, syntax.at)
    at = syntax.at
    if not syntax.open or not syntax.open[-1].flow or char not in ("]", "}"):
        return None
    opened = text[syntax.open[-1].start]
    message = f"this `{char}` closes nothing: the last bracket opened is `{opened}`"
    return TextProblem("E112", at, at + 1, message, "text with brackets in it goes in quotes")


def _colon_at_end(text: str, syntax: Syntax) -> TextProblem | None:
    """Return a colon glued to the comma or bracket after it: `{type:, low: 0}`."""
    if "unexpected ':'" not in syntax.problem:
        return None
    hint = "write a value after the colon, or put text with colons in quotes"
    return TextProblem("E107", syntax.at, syntax.at + 1, "there is no value after this colon", hint)


def _no_comma(text: str, syntax: Syntax) -> TextProblem | None:
    if not re.search(r"expected ','", syntax.problem) or syntax.at >= len(text):
        return None
    end = max(syntax.at + 1, value_end(text, syntax.at, in_flow=True))
    message = f"a comma is missing before `{shown(text[syntax.at : end])}`"
    return TextProblem("E112", syntax.at, end, message)


def _colon_in_flow(text: str, syntax: Syntax) -> TextProblem | None:
    last = syntax.last
    if not syntax.open or not syntax.open[-1].flow or _char(text, syntax.at) != ":":
        return None
    if not isinstance(last, ScalarNode):
        return None
    message = f"a second colon in one entry, after `{shown(text[last.start : syntax.at])}`"
    hint = "put a comma before the next key, or the value in quotes"
    return TextProblem("E104", syntax.at, syntax.at + 1, message, hint)


def _colon(text: str, syntax: Syntax) -> TextProblem | None:
    if "mapping values are not allowed" not in syntax.problem:
        return None
    last = syntax.last
    at = syntax.at
    if isinstance(last, MappingNode) and text[last.start] == "{":
        return _brace(text, last)
    begin = last.start if isinstance(last, ScalarNode) else line_start(text, at)
    if not syntax.open:
        return _colon_missing(text, begin)
    this_line = line_start(text, at)
    if begin < this_line and _WORD_LINE.match(text[this_line:at].strip()):
        start = at - len(text[this_line:at].lstrip())
        key = shown(text[start:at])
        message = f"`{key}` is indented as if it belonged to the value above"
        hint = "align it with the keys next to it"
        return TextProblem("E110", start, at, message, hint)
    end = value_end(text, at, in_flow=False)
    message = "a colon followed by a space inside a value"
    for form, what, hint in _FOREIGN:
        if found := re.match(form, text[begin:at]):
            return TextProblem("E104", begin + found.start(1), at + 1, what, hint)
    return TextProblem("E104", at, at + 1, message, in_quotes(text[begin:end]))


def _after_value(text: str, syntax: Syntax) -> TextProblem | None:
    """Return something follows, on the same line, a value that was already complete."""
    last = syntax.last
    at = syntax.at
    if last is None or text[last.end : at].strip(" \t") or last.end > at or at == len(text):
        return None
    if isinstance(last, MappingNode) and text[last.start] == "{":
        return _brace(text, last)
    is_quoted = isinstance(last, ScalarNode) and last.style in "\"'"
    if not is_quoted and not (isinstance(last, SequenceNode) and last.flow):
        return None
    in_flow = bool(syntax.open) and syntax.open[-1].flow
    end = max(at + 1, value_end(text, at, in_flow))
    if is_quoted and last.end == at and text[at:end].endswith("'") and text[last.start] == "'":
        return _apostrophe(text, last.start, at, end)
    ended = "quote" if is_quoted else "bracket"
    message = f"`{shown(text[at:end])}` follows the {ended} that ends the value"
    if "\n" in text[last.start : last.end]:
        line = text.count("\n", 0, last.start) + 1
        hint = f"the value begins with the {ended} in line {line}: is its other {ended} missing there?"
        return TextProblem("E109", at, end, message, hint)
    return TextProblem("E109", at, end, message, in_quotes(text[last.start : end]))


def _apostrophe(text: str, start: int, at: int, end: int) -> TextProblem:
    message = "the apostrophe ends the text that began with a single quote"
    return TextProblem("E109", at - 1, at, message, in_quotes(text[start + 1 : end - 1]))


def _brace(text: str, node: MappingNode) -> TextProblem:
    end = max(node.end, value_end(text, node.start, in_flow=False))
    return starts_with_brace(text, node.start, end)


def starts_with_brace(text: str, start: int, end: int) -> TextProblem:
    """Return the finding for an expression that YAML takes for a mapping."""
    message = "an expression cannot start with `{`: YAML reads a mapping"
    return TextProblem("E103", start, end, message, in_quotes(text[start:end]))


def _indentation(text: str, syntax: Syntax) -> TextProblem | None:
    at = syntax.at
    if text[line_start(text, at) : at].strip(" -") or at >= len(text.rstrip()):
        return None
    end = value_end(text, at, in_flow=False)
    if _char(text, at) == ":":
        return TextProblem("E108", at, at + 1, "there is nothing before this `:`")
    message = f"`{shown(text[at:end])}` does not line up with the lines above"
    hint = "keys of one mapping, and the dashes of one list, start in the same column"
    return TextProblem("E110", at, end, message, hint)


def _unknown(text: str, syntax: Syntax) -> TextProblem:
    at = min(syntax.at, max(len(text.rstrip()) - 1, 0))
    words = " ".join(part for part in (syntax.context, syntax.problem) if part)
    return TextProblem("E112", at, at + 1, f"YAML cannot read on from here ({words})")


def _char(text: str, at: int) -> str:
    return text[at : at + 1]


_RULES: tuple[Callable[[str, Syntax], TextProblem | None], ...] = (
    _tab,
    _escape,
    _colon_at_end,
    _open_quote,
    _closed_too_late,
    _no_colon,
    _split_by_bracket,
    _not_closed,
    _special,
    _colon,
    _after_value,
    _unmatched,
    _colon_in_flow,
    _no_comma,
    _indentation,
)


# Texts that YAML reads without complaint, as something else than their author meant.

# An escape that makes a control character, or begins the name of a well-known TeX command.
_TEX = re.compile(r"\\(?:\\|([abefrv0](?=[A-Za-z])|n(?:u|abla|eq)\b|t(?:heta|au|imes|ilde|frac)))")


def find(text: str, root: Node, bad_keys: list[Node]) -> Iterator[TextProblem]:
    """Yield every trap in a tree, in no particular order."""
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
    """Yield a node and everything below it, keys included."""
    stack = [node]
    while stack:
        node = stack.pop()
        yield node
        if isinstance(node, SequenceNode):
            stack += node.items
        elif isinstance(node, MappingNode):
            stack += [part for entry in node.entries for part in entry]


def _inside_split(node: Node, text: str) -> bool:
    """Return whether an empty key is only what a comma left over: then the comma is the problem."""
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
