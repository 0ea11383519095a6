"""Text for people: control characters as escapes such as `\\x1b` or `\\u202e`, numbers, and tables for notebooks.

Labels, file names and prose come from the authors of specs. Terminals obey control characters, and those of the bidirectional
algorithm change how a line reads (Boucher and Anderson, "Trojan Source", 2023).
"""

from __future__ import annotations

import json
import math
import re
import sys
import unicodedata
from collections.abc import Iterable, Sequence
from fractions import Fraction
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fractions import Fraction

_HIDDEN = frozenset({"Cc", "Cf", "Cn", "Cs", "Zl", "Zp"})
"""Unicode: control, format, unassigned, lone surrogates (of file names that are no UTF-8), line and paragraph separators."""
ON_PAGES = "\n\t\u200b\u200c\u200d"
"""Characters that pages keep: line breaks, tabs, break opportunities, and joiners of Persian, Hindi and emoji."""


def visible(text: str, keep: str = "\n") -> str:
    """Return a text with hidden characters as escapes, but for those in `keep`."""
    if text.isprintable():
        return text
    for char in filter(_is_hidden, set(text) - set(keep)):
        text = text.replace(char, char.encode("unicode_escape").decode())
    return text


def json_data(data: Any) -> Any:
    """Return data as JSON can hold it: keys and numbers that are not finite as text."""
    match data:
        case dict():
            return {str(key): json_data(value) for key, value in data.items()}
        case list() | tuple():
            return [json_data(item) for item in data]
        case float() if not math.isfinite(data):
            return str(data)
    return data


def visible_json(data: Any) -> str:
    """Return data as JSON, as `json_data` has it, with hidden characters as escapes."""
    text = json.dumps(json_data(data), indent=2, ensure_ascii=False, default=str)
    if text.replace("\n", "").isprintable():
        return text
    return "".join(json.dumps(c)[1:-1] if c != "\n" and _is_hidden(c) else c for c in text)


def lettered(letter: str) -> str:
    """Return a character of a map, or `blank` for white space."""
    if letter.strip():
        return letter
    return "blank"


def _is_hidden(char: str) -> bool:
    return not char.isprintable() and unicodedata.category(char) in _HIDDEN


def html_table(caption: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return an HTML table with a caption, a header, and rows of escaped text, for `_repr_html_`."""
    body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in rows)
    head = ""
    if header:
        head = f"<thead><tr>{_cells('th', header)}</tr></thead>"
    return f"<table><caption>{_shown(caption)}</caption>{head}<tbody>{body}</tbody></table>"


class InNotebooks:
    """Something that notebooks show as `taskspec.tools.notebook` writes it; the package finds this room on first use."""

    def _repr_html_(self) -> str:
        return str(sys.modules["taskspec"].notebook.html(self))


def _cells(tag: str, values: Sequence[object]) -> str:
    return "".join(f'<{tag} style="text-align: left">{_shown(value)}</{tag}>' for value in values)


def _shown(value: object) -> str:
    return escape(visible(str(value)))


# Numbers, with a real minus sign, `∞` for infinity, and no negative zero.


def number(value: float, digits: int = 6) -> str:
    """Return a number with significant digits: `0.333333`, `−2`, `1e+20`."""
    return _signed(f"{value:.{digits}g}")


def decimal(value: float, places: int = 4) -> str:
    """Return a number in decimals without trailing zeros, thousands apart: `12,345.5`; three digits of very small ones."""
    if abs(value) < 1e15:
        text = f"{value:,.{places}f}"
    else:
        text = f"{value:.4g}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if value != 0 and not text.strip("-0."):
        text = f"{value:.3g}"
    return _signed(text)


def fixed(value: float, places: int) -> str:
    """Return a number with so many decimals, thousands apart: `0.50`."""
    return _signed(f"{value:,.{places}f}")


def estimate(value: float, half: float) -> tuple[str, str]:
    """Return a mean and half its confidence interval, to the digits that the interval allows."""
    if not half > 0:
        return decimal(value), "0"
    if not 1e-9 < half < 1e15:
        return number(value, 3), number(half, 2)
    places = max(0, 1 - math.floor(math.log10(half)))
    return fixed(value, places), fixed(half, places)


def interval(low: float, high: float, places: int = 2) -> str:
    """Return an interval: `[−0.20, 0.35]`."""
    return f"[{fixed(low, places)}, {fixed(high, places)}]"


def small_fraction(value: float | Fraction, largest: int, error: float = 1e-12) -> Fraction | None:
    """Return the fraction with a denominator of at most `largest` that a number equals up to an error; None without one."""
    near = Fraction(value).limit_denominator(largest)
    if abs(near - Fraction(value)) <= error:
        return near
    return None


def setting(value: Any) -> str:
    """Return the value of a parameter: `true`, `0.5`, `left`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    return str(value)


def plural(count: int, noun: str) -> str:
    """Return a count with its noun: `1 task`, `1,200 tasks`."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def listed(names: Sequence[str]) -> str:
    """Return `a, b and c`."""
    *most, last = names
    if not most:
        return last
    return f"{', '.join(most)} and {last}"


def duration(seconds: float) -> str:
    """Return `84 s`, `12 min`, `3.5 h`."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


_COUNT = re.compile(r"(\d+(?:\.\d+)?)([kM]?)")
_UNITS = {"": 1, "k": 1_000, "M": 1_000_000}


def count_of(text: str) -> int | None:
    """Return a number such as `500k` or `1.5M`; None for another text."""
    match = _COUNT.fullmatch(text.replace("_", "").replace(",", ""))
    if match is None:
        return None
    return round(float(match[1]) * _UNITS[match[2]])


def _signed(text: str) -> str:
    if not text.strip("-0.,"):
        text = text.removeprefix("-")
    return text.replace("inf", "∞").replace("-", "−")
