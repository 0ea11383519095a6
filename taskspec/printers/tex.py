"""A small part of TeX's mathematics -> the mathematics tree.

Reads the templates of the operator table, the symbols that authors give and the `$...$` of descriptions. Commands
come from a closed list; anything else is shown as the text it is, so that no text of a spec reaches TeX as a command.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field

from taskspec.printers import characters as c
from taskspec.printers.tree import (
    Accent,
    Arrow,
    Big,
    Cases,
    Fence,
    Frac,
    Gap,
    Hole,
    Ident,
    Math,
    Matrix,
    Num,
    Root,
    Row,
    Script,
    Style,
    Sym,
    Words,
    row,
)  # fmt: skip

MAX_DEPTH = 40
_TOKEN = re.compile(r"\\[A-Za-z]+\*?|\\.|[0-9]+(?:\.[0-9]+)?|\s+|.", re.DOTALL)
_STYLES: dict[str, Style] = {
    "mathbb": "blackboard", "mathbbm": "blackboard", "mathds": "blackboard", "mathcal": "calligraphic",
    "mathrm": "upright", "mathit": "italic", "mathbf": "bold", "boldsymbol": "bold", "operatorname": "upright",
    "mathtt": "typewriter", "texttt": "typewriter",
}  # fmt: skip
_IGNORED = {"textstyle", "displaystyle", "limits", "nolimits", "big", "Big", "bigl", "bigr", "Bigl", "Bigr"}
_SPACES = {",": "thin", ";": "thin", ":": "thin", "!": None, " ": "thin", "quad": "wide", "qquad": "wide"}
_BIG = {"sum": "∑", "prod": "∏"}
_SAME = {r"\lbrace": r"\{", r"\rbrace": r"\}", r"\thinspace": r"\,", r"\cr": r"\\"}
"""Longer spellings, which Markdown leaves alone."""
_PLAIN = {"*": "⋅", "-": "−", "'": "′"}


@dataclass
class _TexReader:
    """One pass over the tokens; `holes` are the names that stand for arguments."""

    tokens: list[str]
    holes: Collection[str] = ()
    at: int = 0
    depth: int = 0
    stops: list[str] = field(default_factory=list)

    def peek(self) -> str | None:
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def take(self) -> str:
        self.at += 1
        return self.tokens[self.at - 1]

    def skip_blanks(self) -> None:
        while (token := self.peek()) is not None and token.isspace():
            self.at += 1

    def items(self, *stops: str) -> list[Math]:
        """Things up to one of the stops (left where it is) or the end."""
        found: list[Math] = []
        self.stops.extend(stops)
        self.depth += 1
        while (token := self.peek()) is not None and token not in stops and token not in self.stops:
            if token.isspace():
                self.at += 1
            elif token in "_^'" and len(token) == 1:
                found.append(self.script(found.pop() if found else Row(())))
            else:
                found += self.one()
        self.depth -= 1
        del self.stops[len(self.stops) - len(stops) :]
        return found

    def script(self, base: Math) -> Math:
        sub, sup, primes = None, None, 0
        while (token := self.peek()) is not None and token in ("_", "^", "'"):
            self.at += 1
            if token == "'":
                primes += 1
            elif token == "_":
                sub = self.argument()
            else:
                sup = self.argument()
        if isinstance(base, Big):
            return Big(base.symbol, sub, sup)
        return Script(base, sub, sup, primes)

    def argument(self) -> Math:
        """A group, or the next single thing."""
        self.skip_blanks()
        if self.peek() is None:
            return Row(())
        found = self.one()
        return row(*found)

    def digit_or_argument(self) -> Math:
        r"""As `argument`, but of a number only the first digit: `\frac12` is a half."""
        self.skip_blanks()
        token = self.peek()
        if token is None or not token[0].isdigit():
            return self.argument()
        self.tokens[self.at : self.at + 1] = [token[0], *([token[1:]] if token[1:] else [])]
        return Num(self.take())

    def one(self) -> list[Math]:
        token = self.take()
        if self.depth > MAX_DEPTH:
            return [Words(token)]
        if token == "{":
            return [self.group()]
        if token[0] == "\\":
            return self.command(token)
        if token[0].isdigit():
            return [Num(token)]
        if token in "([":
            return [self.fenced(token, c.PAIRS[token])]
        if token.isalpha():
            return [Ident(token)]
        if token == "~":
            return [Gap()]
        return [Sym(_PLAIN.get(token, token))] if token not in "{}$&#%^_\\" else [Words(token)]

    def group(self) -> Math:
        name = self.raw(peek_only=True)
        if name in self.holes:
            self.raw()
            return Hole(name)
        inner = self.items("}")
        if self.peek() == "}":
            self.at += 1
        return row(*inner)

    def raw(self, peek_only: bool = False) -> str:
        """The text of a group as written, its opening brace already read."""
        start, level, at = self.at, 1, self.at
        while at < len(self.tokens) and level:
            level += {"{": 1, "}": -1}.get(self.tokens[at], 0)
            at += 1
        if not peek_only:
            self.at = at
        return "".join(self.tokens[start : at - 1 if level == 0 else at])

    def raw_argument(self) -> str:
        self.skip_blanks()
        if self.peek() != "{":
            return self.take() if self.peek() is not None else ""
        self.at += 1
        return self.raw()

    def fenced(self, left: str, right: str, token: str | None = None) -> Math:
        """A body up to its closing delimiter; when that is missing the opening one stands alone."""
        close = token if token is not None else c.RIGHT_TEX.get(right, right)
        inner = self.items(close)
        if self.peek() == close:
            self.at += 1
            return Fence(left, row(*inner), right)
        return Row((Sym(left), *inner))

    def command(self, token: str) -> list[Math]:
        name = token[1:]
        name = c.ALIASES.get(name, name)
        if name in c.GREEK:
            return [Ident(c.GREEK[name])]
        if token in (r"\{", r"\lvert", r"\lVert", r"\lfloor", r"\lceil", r"\langle"):
            left = c.DELIMITERS[token]
            return [self.fenced(left, *_closing(token))]
        if name in c.SYMBOLS:
            return [Sym(c.SYMBOLS[name])]
        if name in c.FUNCTIONS:
            return [Ident(name, "upright")]
        if name in _BIG:
            return [Big(_BIG[name])]
        if name in _SPACES:
            gap = _SPACES[name]
            return [Gap("wide" if gap == "wide" else "thin")] if gap else []
        return [] if name in _IGNORED else self.structure(token, name)

    def structure(self, token: str, name: str) -> list[Math]:
        if name in _STYLES:
            return [Ident(_spaces(self.raw_argument()), _STYLES[name])]
        match name:
            case "frac" | "tfrac" | "dfrac":
                return [Frac(self.digit_or_argument(), self.digit_or_argument())]
            case _ if name in c.ACCENTS:
                return [Accent(name, self.argument())]
            case "xrightarrow":
                return [Arrow(self.argument())]
            case "sqrt":
                return [Root(self.argument())]
            case "text" | "textrm" | "mbox" | "textit":
                return [Words(self.raw_argument())]
            case "bmod" | "mod":
                return [Ident("mod", "upright") if name == "mod" else Sym("mod")]
            case "pmod":
                return [Gap("wide"), Fence("(", Row((Ident("mod", "upright"), Gap(), self.argument())), ")")]
            case "left":
                return [self.stretched()]
            case "begin":
                return [self.environment()]
            case "#" | "%" | "&" | "_" | "$" | "}":
                return [Sym(name) if name != "_" else Words("_")]
            case "|":
                return [Sym("‖")]
            case _:
                return [Words(token)]

    def stretched(self) -> Math:
        self.skip_blanks()
        left = self.take() if self.peek() is not None else "."
        inner = self.items(r"\right")
        right = "."
        if self.peek() == r"\right":
            self.at += 1
            self.skip_blanks()
            right = self.take() if self.peek() is not None else "."
        return Fence(c.DELIMITERS.get(left, left[:1]), row(*inner), c.DELIMITERS.get(right, right[:1]))

    def environment(self) -> Math:
        name = self.raw_argument()
        lines: list[list[Math]] = [[]]
        while True:
            lines[-1].append(row(*self.items("&", r"\\", r"\end")))
            token = self.peek()
            if token is None or token == r"\end":
                break
            self.at += 1
            if token == r"\\":
                lines.append([])
        if self.peek() == r"\end":
            self.at += 1
            self.raw_argument()
        if name == "cases":
            return Cases(tuple((r[0], r[1] if len(r) > 1 else Row(())) for r in lines))
        return Matrix(tuple(tuple(r) for r in lines))


def _closing(token: str) -> tuple[str, str]:
    """The closing delimiter of an opening command: its character and its command."""
    closing = token.replace(r"\l", r"\r") if token != r"\{" else r"\}"
    return c.DELIMITERS[closing], closing


def _spaces(text: str) -> str:
    """The text of an upright name: TeX's spaces are spaces."""
    return text.replace(r"\,", "\u2009").replace(r"\ ", " ").replace(r"\_", "_")


def read(text: str, holes: Collection[str] = ()) -> Math:
    """The tree of a piece of TeX mathematics.

    Never fails: what it does not know is shown as text.

    Args:
        text: TeX, without dollars.
        holes: names which, alone in braces, stand for arguments of a template.
    """
    reader = _TexReader([_SAME.get(token, token) for token in _TOKEN.findall(text)], holes)
    found: list[Math] = []
    while reader.peek() is not None:
        found += reader.items()
        if reader.peek() is not None:  # a closing brace that closes nothing
            found.append(Words(reader.take()))
    return row(*found)
