"""What is wrong with a text that Python's parser refuses, in the terms of this language."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import NoReturn

_CONFUSIONS = (
    (r"&&", "write `and`"),
    (r"\|\|", "write `or`"),
    (r"(?<![=!<>])=(?!=)", "`==` compares; `=` is only for keyword arguments"),
    (r"!(?!=)", "write `not x`"),
    (r"\?", "write `x if condition else y`"),
)
_CHARACTERS = {
    "−": "`-`", "–": "`-`", "×": "`*`", "·": "`*`", "⋅": "`*`", "÷": "`/`", "≤": "`<=`", "≥": "`>=`", "≠": "`!=`", "∧": "`and`",
    "∨": "`or`", "¬": "`not`", "∈": "`in`", "∞": "`inf`", "′": "`'`", "’": "`'`", "‘": "`'`", "“": '`"`', "”": '`"`', "„": '`"`',
    "²": "`**2`", "√": "`sqrt(x)`", "∑": "`sum(x)`", "∏": "`prod(x)`", "‖": "`norm2(x)`", "π": "`pi`",
    **dict.fromkeys("\u00a0\u2002\u2003\u2009\u200a\u202f\u3000", "an ordinary space"),
}  # fmt: skip
"""What to write for characters of mathematics and of typography, the likeliest ones."""
_INVISIBLE = "\u00ad\u200b\u200c\u200d\u2060\ufeff"
_PRODUCT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)([^\W\d]\w*)")
_PERCENT = re.compile(r"(?<![\w.])(\d{1,15}(?:\.\d{1,15})?)\s*%(?=\s*(?:$|[)\]},*/%<>=]|(?:and|or|if|else|for)\b))")
"""A number of per cent, with nothing behind the sign that it could be divided by."""
_WORDS = re.compile(r"\s*\w+(\s+\w+)+\s*")


class SyntaxFailure(Exception):
    """One syntax error; a text gives at most one, since what follows it is guesswork."""

    def __init__(self, start: int, end: int, message: str, hint: str | None = None, code: str = "E301") -> None:
        self.start, self.end, self.message, self.hint, self.code = start, end, message, hint, code


def explain(value: str, error: Exception) -> NoReturn:
    """Say what Python's parser stumbled over, in the terms of this language."""
    for pattern, hint in _CONFUSIONS:
        found = re.search(pattern, value)
        if found:
            raise SyntaxFailure(found.start(), found.end(), f"'{found[0]}' is not an operator here", hint)
    percent = _PERCENT.search(value)
    if percent:
        share = Fraction(percent[1]) / 100
        hint = f"write `{share}`: `%` is the remainder of a division"
        raise SyntaxFailure(percent.start(), percent.end(), f"'{percent[0]}' is not a number here", hint)
    if not isinstance(error, SyntaxError):
        raise SyntaxFailure(0, len(value), "this expression is nested too deeply", code="E314")
    if "integer string conversion" in (error.msg or ""):
        raise SyntaxFailure(0, len(value), "a number in this expression has too many digits", code="E314")
    start = _offset(value, error.lineno or 1, error.offset or 1)
    end = _offset(value, error.end_lineno or error.lineno or 1, error.end_offset or error.offset or 1)
    if start >= len(value):
        raise SyntaxFailure(
            max(0, len(value.rstrip()) - 1),
            len(value.rstrip()),
            "the expression ends too early here",
        )
    message = (error.msg or "invalid syntax").split(". Perhaps")[0]
    product = _PRODUCT.search(value) if message.endswith("literal") else None
    if product:
        hint = f"a product is written `{product[1]} * {product[2]}`"
        raise SyntaxFailure(product.start(), product.end(), f"'{product[0]}' is neither a number nor a name", hint)
    if message.startswith("invalid syntax"):
        message = "this cannot be read as an expression"
    advice = "a label of several words needs its own quotes" if _WORDS.fullmatch(value) else None
    if message.startswith("expected 'else'") or value.startswith(("if ", "if(")):
        advice = "write `x if condition else y`"
    if value.startswith("|"):
        advice = "write `abs(x)`"
    if message.startswith("invalid ") and value[start] in _CHARACTERS:
        advice = f"write {_CHARACTERS[value[start]]}"
    if message.startswith("invalid ") and value[start] in _INVISIBLE:
        advice = "delete this character, which cannot be seen"
    raise SyntaxFailure(start, max(end, start + 1), message, advice)


def _offset(value: str, line: int, column: int) -> int:
    """Character offset of a 1-based line and column of the text wrapped in one bracket."""
    lines = value.split("\n")
    before = sum(len(text) + 1 for text in lines[: line - 1])
    return max(0, before + column - 1 - (1 if line == 1 else 0))
