"""Why YAML could not be read, in an author's words, and texts that it reads as something else than meant.

The parser's own messages describe its state. Each rule below recognises one situation from where
the parser gave up, what it had read last, and the text around; the first that applies explains it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence

from taskspec.language.source import nodes

_WORD_LINE = re.compile(r"""[\w']+$|"[^"]*"$""")
_BACKSLASH = "use single quotes, or write the backslash twice"
_SPECIAL_CONTEXTS = ("anchor", "alias", "tag", "block scalar", "directive")
_SPECIAL_PROBLEMS = (
    "tag",
    "cannot start any token",
    "sequence entries are not allowed",
    "mapping keys are not allowed",
    "node content",
)


def explain(text: str, syntax: nodes.Syntax) -> nodes.TextProblem:
    """Explain why the YAML parser refused a text: the first rule that applies."""
    for rule in _RULES:
        if finding := rule(text, syntax):
            return finding
    at = min(syntax.at, max(len(text.rstrip()) - 1, 0))
    words = " ".join(filter(None, (syntax.context, syntax.problem)))
    return nodes.TextProblem("E112", at, at + 1, f"YAML cannot read on from here ({words})")


def _tab(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    if text[syntax.at : syntax.at + 1] != "\t" and "tab" not in syntax.problem.split():
        return None
    tab = text.find("\t", nodes.line_start(text, syntax.at))
    return nodes.TextProblem("E105", tab, tab + 1, "a tab where YAML wants spaces", "replace each tab by spaces")


def _escape(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    is_escape = "escape" in syntax.problem or "hexdecimal" in syntax.problem
    at = text.rfind("\\", 0, syntax.at + 1)
    if not is_escape or "quoted" not in syntax.context or at + 1 == len(text):
        return None  # tags have escapes of their own; and after the last character, the quote is never closed
    message = f"`{text[at : at + 2]}` means nothing between double quotes"
    return nodes.TextProblem("E117", at, at + 2, message, _BACKSLASH)


def _open_quote(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    start = syntax.since
    last = syntax.last
    if "quoted" in syntax.context and start is not None:
        return nodes.TextProblem(
            "E111", start, nodes.line_end(text, start), f"this text begins with {text[start]} and is never closed"
        )
    if (
        not isinstance(last, nodes.ScalarNode)
        or last.style not in ("'", '"')
        or "\n" not in text[last.start : last.end]
    ):
        return None
    if text[last.end : syntax.at].strip():
        return None
    line = text.count("\n", 0, last.end) + 1
    message = f"this text begins with {last.style} and is not closed before line {line}"
    return nodes.TextProblem(
        "E111", last.start, nodes.line_end(text, last.start), message, f"close it with another {last.style}"
    )


def _no_colon(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    if "could not find expected ':'" not in syntax.problem or syntax.since is None:
        return None
    return _colon_missing(text, syntax.since)


def _colon_missing(text: str, start: int) -> nodes.TextProblem:
    end = nodes.value_end(text, start, in_flow=False)
    message = f"`{nodes.shown(text[start:end])}` is not of the form `key: value`"
    return nodes.TextProblem("E112", start, end, message, "write a colon and a space after the key")


def _split_by_bracket(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    """Explain an index or a call between braces or brackets: `{x: p[0]}`."""
    last = syntax.last
    if not syntax.in_flow or text[syntax.at : syntax.at + 1] not in ("[", "{"):
        return None
    if not isinstance(last, nodes.ScalarNode) or last.style != "plain":
        return None
    return _split(text, last.start)


def _not_closed(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    """Explain a bracket without its partner: the parser ran into the end, or into the next key."""
    if syntax.in_flow:
        for node in syntax.open:
            if node.flow and not nodes.is_closed(text, node.start):
                message = f"this `{text[node.start]}` is never closed"
                return nodes.TextProblem("E111", node.start, node.start + 1, message)
    return None


def _special(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    at = syntax.at
    if any(word in syntax.context for word in _SPECIAL_CONTEXTS):
        if syntax.since is not None:
            at = syntax.since
    elif not any(word in syntax.problem for word in _SPECIAL_PROBLEMS):
        return None
    char = text[at : at + 1]
    if char not in nodes.SPECIAL or (syntax.in_flow and char in ",]}"):
        return None
    return nodes.special_start(text, at, syntax.in_flow)


def _colon(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    if "mapping values are not allowed" not in syntax.problem:
        return None
    last = syntax.last
    at = syntax.at
    if isinstance(last, nodes.MappingNode) and text[last.start] == "{":
        return _brace(text, last)
    if isinstance(last, nodes.ScalarNode):
        begin = last.start
    else:
        begin = nodes.line_start(text, at)
    if not syntax.open:
        return _colon_missing(text, begin)
    this_line = nodes.line_start(text, at)
    if begin < this_line and _WORD_LINE.match(text[this_line:at].strip()):
        start = at - len(text[this_line:at].lstrip())
        message = f"`{nodes.shown(text[start:at])}` is indented as if it belonged to the value above"
        return nodes.TextProblem("E110", start, at, message, "align it with the keys next to it")
    advice = nodes.in_quotes(text[begin : nodes.value_end(text, at, in_flow=False)])
    return nodes.TextProblem("E104", at, at + 1, "a colon followed by a space inside a value", advice)


def _after_value(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    last = syntax.last
    at = syntax.at
    if last is None or text[last.end : at].strip(" \t") or last.end > at or at == len(text):
        return None
    if isinstance(last, nodes.MappingNode) and text[last.start] == "{":
        return _brace(text, last)
    is_quoted = isinstance(last, nodes.ScalarNode) and last.style in "\"'"
    if not is_quoted and not (isinstance(last, nodes.SequenceNode) and last.flow):
        return None
    end = max(at + 1, nodes.value_end(text, at, syntax.in_flow))
    ended = "quote" if is_quoted else "bracket"
    message = f"`{nodes.shown(text[at:end])}` follows the {ended} that ends the value"
    return nodes.TextProblem("E109", at, end, message, nodes.in_quotes(text[last.start : end]))


def _brace(text: str, node: nodes.MappingNode, in_flow: bool = False) -> nodes.TextProblem:
    end = max(node.end, nodes.value_end(text, node.start, in_flow))
    message = "an expression cannot start with `{`: YAML reads a mapping"
    return nodes.TextProblem("E103", node.start, end, message, nodes.in_quotes(text[node.start : end]))


def _indentation(text: str, syntax: nodes.Syntax) -> nodes.TextProblem | None:
    at = syntax.at
    if text[nodes.line_start(text, at) : at].strip(" -") or at >= len(text.rstrip()):
        return None
    if text[at] == ":":
        return nodes.TextProblem("E108", at, at + 1, "there is nothing before this `:`")
    end = nodes.value_end(text, at, in_flow=False)
    message = f"`{nodes.shown(text[at:end])}` does not line up with the lines above"
    hint = "keys of one mapping, and the dashes of one list, start in the same column"
    return nodes.TextProblem("E110", at, end, message, hint)


_RULES: tuple[Callable[[str, nodes.Syntax], nodes.TextProblem | None], ...] = (
    _tab, _escape, _open_quote, _no_colon, _split_by_bracket, _not_closed, _special, _colon, _after_value, _indentation,
)  # fmt: skip


# -- texts that YAML reads without complaint, as something else than their author meant -----------------------------

_TEX = re.compile(r"\\(?:\\|([abefrv0](?=[A-Za-z])|n(?:u|abla|eq)\b|t(?:heta|au|imes|ilde|frac)))")
"""An escape that makes a control character, or begins the name of a well-known TeX command."""


def find(text: str, root: nodes.Node, bad_keys: list[nodes.Node]) -> Iterator[nodes.TextProblem]:
    """Yield every trap in a tree, in no particular order."""
    for node in bad_keys:
        yield from _bad_key(text, node)
    stack = [root]
    while stack:
        node = stack.pop()
        match node:
            case nodes.ScalarNode():
                yield from _scalar(text, node)
            case nodes.MappingNode():
                for entry in node.entries:
                    stack += entry
                cuts = list(_flow_mapping(text, node)) if node.flow else []
                yield from cuts
                for each in _duplicates(node):
                    if not any(cut.covers(each) for cut in cuts):
                        yield each
            case nodes.SequenceNode():
                stack += node.items
                if node.flow:
                    yield from _cut(text, node.items)


def _bad_key(text: str, node: nodes.Node) -> Iterator[nodes.TextProblem]:
    if not isinstance(node, nodes.ScalarNode):
        advice = nodes.in_quotes(text[node.start : node.end])
        yield nodes.TextProblem("E108", node.start, node.end, "a key is text", advice)
    elif text[node.start : node.start + 1] not in (",", "}"):  # else it is left over from a comma: that is the problem
        yield nodes.TextProblem("E108", node.start, node.start + 1, "there is nothing before this `:`")


def _scalar(text: str, node: nodes.ScalarNode) -> Iterator[nodes.TextProblem]:
    if node.style == "plain" and nodes.is_overlong_number(node.value):
        message = f"a number of {len(node.value)} digits"
        yield nodes.TextProblem("E114", node.start, node.end, message, "a float keeps about 16 digits")
    if node.style == '"':
        for escape in _TEX.finditer(text, node.start, node.end):
            if escape.group(1):
                message = f"`\\{escape.group(1)[0]}` between double quotes is a control character"
                yield nodes.TextProblem("E117", escape.start(), escape.start() + 2, message, _BACKSLASH)


def _duplicates(node: nodes.MappingNode) -> Iterator[nodes.TextProblem]:
    for key, _ in node.entries:
        if node.index[key.value][0] is not key:
            message = f"the key `{nodes.shown(key.value)}` occurs twice in this mapping"
            yield nodes.TextProblem("E101", key.start, key.end, message, "remove one, or rename it")


def _flow_mapping(text: str, node: nodes.MappingNode) -> Iterator[nodes.TextProblem]:
    if text[node.start] != "{":
        return  # one pair in a list: `[a: b]`
    without = []
    for key, value in node.entries:
        if isinstance(value, nodes.ScalarNode) and value.style == "plain" and not value.value:
            without.append(key)
    if without and len(without) == len(node.entries) and ":" not in text[node.start : node.end]:
        yield _brace(text, node, in_flow=True)
        return
    parts: list[nodes.Node] = []
    for entry in node.entries:
        parts += entry
    cuts = list(_cut(text, parts))
    yield from cuts
    for key in without:
        message = f"the key `{nodes.shown(key.value)}` has no value"
        hint = "a list goes in brackets, a text with a comma in quotes"
        if ":" in key.value:
            hint = "write a space after the colon"
        problem = nodes.TextProblem("E107", key.start, key.end, message, hint)
        if not any(cut.covers(problem) for cut in cuts):
            yield problem


def _cut(text: str, pieces: Sequence[nodes.Node]) -> Iterator[nodes.TextProblem]:
    done = 0
    for node in pieces:
        is_plain = isinstance(node, nodes.ScalarNode) and node.style == "plain"
        is_open = text.count("(", node.start, node.end) > text.count(")", node.start, node.end)
        if is_plain and is_open and node.start >= done:
            problem = _split(text, node.start)
            done = problem.end
            yield problem


def _split(text: str, start: int) -> nodes.TextProblem:
    end = nodes.value_end(text, start, in_flow=True)
    message = f"YAML splits `{nodes.shown(text[start:end])}`, because it is between braces or brackets"
    return nodes.TextProblem("E106", start, end, message, nodes.in_quotes(text[start:end]))
