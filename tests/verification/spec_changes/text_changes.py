"""Every small change of one expression: a token replaced, a prime set or taken away, a part left out or exchanged.

Changes are made in the text, so that one changes what an author would have mistyped, and nothing else. Many of them no longer
have a meaning; whoever builds the spec finds out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise

from taskspec.base.diagnostics import Origin, Span, SpecError
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.operators import FUNCTIONS
from taskspec.language.expressions.parse import parse

_TOKEN = re.compile(
    r"""(?P<quoted>"[^"]*"|'(?:(?!')\W|\w(?=\w|\s))[^']*')
      | (?P<number>\d+(?:\.\d+)?(?:[eE][-+]?\d+)?)
      | (?P<word>[^\W\d]\w*'?)
      | (?P<sign>\*\*|//|<=|>=|==|!=|[-+*/%<>])
      | (?P<other>\S)""",
    re.VERBOSE,
)
_SIGNS: Mapping[str, Sequence[str]] = {
    "<": ("<=", ">", ">="), "<=": ("<", ">", ">="), ">": (">=", "<", "<="), ">=": (">", "<", "<="),
    "==": ("!=", "<=", ">="), "!=": ("==", "<", ">"),
    "+": ("-", "*"), "-": ("+", "*"), "*": ("+", "/", "**"), "/": ("*", "//"), "//": ("/", "*"), "%": ("//", "*"), "**": ("*",),
}  # fmt: skip
_WORDS: Mapping[str, Sequence[str]] = {
    "and": ("or",), "or": ("and",), "in": ("not in",), "True": ("False",), "False": ("True",), "true": ("false",),
    "false": ("true",), "min": ("max",), "max": ("min",), "any": ("all",), "all": ("any",), "floor": ("ceil", "round"),
    "ceil": ("floor", "round"), "round": ("floor", "ceil"), "argmin": ("argmax",), "argmax": ("argmin",), "sin": ("cos",),
    "cos": ("sin",), "sort": ("reverse", "argsort"), "argsort": ("sort",), "sum": ("prod", "max"), "prod": ("sum",),
    "norm1": ("norm2",), "norm2": ("norm1",), "Uniform": ("UniformInt",), "UniformInt": ("Uniform",), "count": ("any",),
}  # fmt: skip
_TRUTHS = frozenset({"True", "False", "true", "false"})
_RESERVED = _TRUTHS | {"if", "else", "for", "and", "or", "not", "in"}
NOWHERE = Span(Origin("", ""), 1, 1, 1, 1)  # the place of everything in a text that stands in no file


@dataclass(frozen=True, slots=True)
class Change:
    """The characters from `start` to `end` of a text, replaced by `new`."""

    start: int
    end: int
    new: str

    def apply(self, text: str) -> str:
        return text[: self.start] + self.new + text[self.end :]


@dataclass(frozen=True, slots=True)
class Replacements:
    """Names of the same type, for each name; and the names that take a prime."""

    alike: Mapping[str, Sequence[str]]
    primed: frozenset[str]


def changes(text: str, names: Replacements) -> Iterator[Change]:
    """Yield every change of an expression, each resulting text once."""
    seen = {text}
    for change in (*_by_token(text, names), *_by_part(text)):
        changed = change.apply(text)
        if changed not in seen and changed.strip():
            seen.add(changed)
            yield change


def _by_token(text: str, names: Replacements) -> Iterator[Change]:
    before = ""
    for found in _TOKEN.finditer(text):
        token = found.group()
        kind = found.lastgroup
        follows = text[found.end() :].lstrip()
        replacements: Sequence[str] = ()
        ends_operand = before[-1:].isalnum() or before[-1:] in tuple("_')]}")
        is_sign = kind == "sign" and token in "+-" and (not ends_operand or before in _RESERVED - _TRUTHS)
        is_negation = token == "not" and not follows.startswith("in ")
        is_argument = follows.startswith("=") and not follows.startswith("==")
        if is_sign or is_negation:  # it is left out, with the space behind it
            yield Change(found.start(), len(text) - len(follows), "")
        elif kind == "number":
            replacements = off_by_one(token)
        elif kind == "sign":
            replacements = _SIGNS[token]
        elif kind == "word" and token != "not" and (before, token) != ("not", "in") and not is_argument:
            replacements = _words(token, follows, names)
        for new in replacements:
            yield Change(found.start(), found.end(), new)
        before = token


def _words(token: str, follows: str, names: Replacements) -> list[str]:
    found = list(_WORDS.get(token, ()))
    if token in _RESERVED or follows.startswith("("):
        return found
    bare = token.removesuffix("'")
    found += [other + token[len(bare) :] for other in names.alike.get(bare, ())]
    if bare != token:
        found.append(bare)
    elif bare in names.primed:
        found.append(bare + "'")
    return found


def off_by_one(number: str) -> list[str]:
    """Return a number with its last digit one higher, and one lower where it stays a number without a sign."""
    value = Decimal(number)
    step = Decimal(1).scaleb(min(0, int(value.as_tuple().exponent)))
    found = [str(value + step)]
    if value >= step:
        found.append(str(value - step))
    return found


def _by_part(text: str) -> Iterator[Change]:
    """Yield what changes whole parts: operands left out, branches and arguments exchanged, calls undone, signs turned."""
    try:
        root = parse(s.SourceText(text, lambda start, end: NOWHERE))
    except SpecError:
        return
    for node in s.below(root):
        if isinstance(node, tuple(_PARTS)):
            yield from _PARTS[type(node)](node, text)


def _source(expr: s.Expr, text: str) -> str:
    return text[expr.place.start : expr.place.end]


def _whole(expr: s.Expr, new: str) -> Change:
    return Change(expr.place.start, expr.place.end, new)


def _operands(node: s.Binary, text: str) -> Iterator[Change]:
    """Without one of the operands, and with the other sign of the first where it is one of a sum."""
    gap = text[node.left.place.end : node.right.place.start]
    at = node.left.place.end + gap.index(node.op)
    yield _whole(node, text[node.place.start : at].rstrip())
    yield _whole(node, text[at + len(node.op) : node.place.end].lstrip())
    if node.op in "+-" and not isinstance(node.left, s.Unary | s.Number):
        yield Change(node.place.start, node.place.start, "-")


def _conditions(node: s.Logical, text: str) -> Iterator[Change]:
    """Without one of the conditions, and with one of them denied where no other change does."""
    parts = [f"({_source(operand, text)})" for operand in node.operands]
    for i, operand in enumerate(node.operands):
        yield _whole(node, "(" + f" {node.op} ".join(parts[:i] + parts[i + 1 :]) + ")")
        if not isinstance(operand, s.Compare | s.Unary):
            yield _whole(operand, f"(not {parts[i]})")


def _links(node: s.Compare, text: str) -> Iterator[Change]:
    """Yield a chain without its last link, and without its first."""
    if len(node.rest) > 1:
        yield _whole(node, text[node.place.start : node.rest[-2][1].place.end])
        yield _whole(node, text[node.rest[0][1].place.start : node.place.end])


def _branches(node: s.IfElse, text: str) -> Iterator[Change]:
    then, condition, otherwise = (_source(e, text) for e in (node.then, node.condition, node.otherwise))
    yield _whole(node, f"({then})")
    yield _whole(node, f"({otherwise})")
    yield _whole(node, f"(({otherwise}) if {condition} else ({then}))")


def _arguments(node: s.Call, text: str) -> Iterator[Change]:
    """Neighbouring arguments exchanged, and a function of the language undone."""
    for one, other in pairwise(node.args):
        between = text[one.place.end : other.place.start]
        new = _source(other, text) + between + _source(one, text)
        yield Change(one.place.start, other.place.end, new)
    if node.function in FUNCTIONS and node.args:
        yield _whole(node, f"({_source(node.args[0], text)})")


def _elements(node: s.SetOf, text: str) -> Iterator[Change]:
    """Yield a set without one of its elements."""
    items = [_source(item, text) for item in node.items]
    if len(items) > 1:
        for i in range(len(items)):
            yield _whole(node, "{" + ", ".join(items[:i] + items[i + 1 :]) + "}")


def _ends(node: s.Subscript, text: str) -> Iterator[Change]:
    """Yield a slice without one of its ends."""
    for index in node.indices:
        if isinstance(index, s.Slice):
            for end in (index.start, index.stop):
                if end is not None:
                    yield _whole(end, "")


_PARTS: dict[type, Callable[..., Iterator[Change]]] = {
    s.Binary: _operands,
    s.Logical: _conditions,
    s.Compare: _links,
    s.IfElse: _branches,
    s.Call: _arguments,
    s.SetOf: _elements,
    s.Subscript: _ends,
}
