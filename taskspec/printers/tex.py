"""A small part of TeX's mathematics -> the mathematics tree, and the characters that TeX has names for."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field

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

# -- characters, for reading and for writing

GREEK: dict[str, str] = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ϵ", "varepsilon": "ε", "zeta": "ζ",
    "eta": "η", "theta": "θ", "vartheta": "ϑ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν",
    "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "ϕ", "varphi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ",
    "Pi": "Π", "Sigma": "Σ", "Upsilon": "Υ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω", "ell": "ℓ",
}  # fmt: skip

SYMBOLS: dict[str, str] = {
    "cdot": "⋅", "times": "×", "div": "÷", "pm": "±", "mp": "∓", "circ": "∘", "ast": "∗",
    "leq": "≤", "geq": "≥", "neq": "≠", "equiv": "≡", "approx": "≈", "sim": "∼", "propto": "∝", "ll": "≪",
    "gg": "≫", "in": "∈", "notin": "∉", "subset": "⊂", "subseteq": "⊆", "cup": "∪", "cap": "∩",
    "setminus": "∖", "land": "∧", "lor": "∨", "lnot": "¬", "forall": "∀", "exists": "∃", "to": "→",
    "leftarrow": "←", "uparrow": "↑", "downarrow": "↓", "leftrightarrow": "↔", "updownarrow": "↕", "nearrow": "↗",
    "searrow": "↘", "swarrow": "↙", "nwarrow": "↖", "mapsto": "↦", "Rightarrow": "⇒", "iff": "⟺", "star": "⋆",
    "bullet": "•", "infty": "∞", "ldots": "…", "cdots": "⋯",
    "vdots": "⋮", "partial": "∂", "nabla": "∇", "emptyset": "∅", "mid": "∣", "prime": "′", "langle": "⟨", "rangle": "⟩",
    "lfloor": "⌊", "rfloor": "⌋", "lceil": "⌈", "rceil": "⌉",
}  # fmt: skip

ACCENTS: dict[str, tuple[str, str]] = {
    "dot": ("˙", "\u0307"), "ddot": ("¨", "\u0308"), "hat": ("^", "\u0302"), "tilde": ("~", "\u0303"), "bar": ("¯", "\u0304"),
    "vec": ("→", "\u20d7"),
}  # fmt: skip
"""What TeX sets over a letter: the mark alone, and as a character that joins the one before it."""

ALIASES: dict[str, str] = {
    "le": "leq", "ge": "geq", "ne": "neq", "wedge": "land", "vee": "lor", "neg": "lnot", "gets": "leftarrow",
    "rightarrow": "to", "widehat": "hat", "widetilde": "tilde", "overline": "bar",
    "dots": "ldots", "dotsc": "ldots", "dotsb": "cdots", "implies": "Rightarrow",
}  # fmt: skip

DELIMITERS: dict[str, str] = {
    "(": "(", ")": ")", "[": "[", "]": "]", r"\{": "{", r"\}": "}", r"\lvert": "|", r"\rvert": "|",
    r"\lVert": "‖", r"\rVert": "‖", r"\lfloor": "⌊", r"\rfloor": "⌋", r"\lceil": "⌈", r"\rceil": "⌉",
    r"\langle": "⟨", r"\rangle": "⟩", ".": "",
}  # fmt: skip
"""How TeX writes what opens and closes."""

PAIRS: dict[str, str] = {"(": ")", "[": "]", "{": "}", "⌊": "⌋", "⌈": "⌉", "⟨": "⟩"}
LEFT_TEX: dict[str, str] = {v: k for k, v in DELIMITERS.items() if k not in (r"\rvert", r"\rVert")}
RIGHT_TEX: dict[str, str] = {v: k for k, v in DELIMITERS.items() if k not in (r"\lvert", r"\lVert")}

FUNCTIONS = frozenset({
    "arccos", "arcsin", "arctan", "arg", "cos", "cosh", "cot", "det", "dim", "exp", "gcd", "inf", "ker", "lim", "log",
    "ln", "max", "min", "sin", "sinh", "sup", "tan", "tanh", "Pr",
})  # fmt: skip
"""Names that TeX knows as upright functions."""

BLACKBOARD: dict[str, str] = {
    "R": "ℝ", "Z": "ℤ", "N": "ℕ", "Q": "ℚ", "C": "ℂ", "E": "𝔼", "P": "ℙ", "1": "𝟙",
}  # fmt: skip
CALLIGRAPHIC: dict[str, str] = {"S": "𝒮", "A": "𝒜", "N": "𝒩", "O": "𝒪", "T": "𝒯", "U": "𝒰", "D": "𝒟"}

TEX_LETTER: dict[str, str] = {char: name for name, char in GREEK.items()}
TEX_SYMBOL: dict[str, str] = {char: name for name, char in SYMBOLS.items()} | {"−": "-", "∼": "sim"}


# Reads the templates of the operator table, the symbols that authors give and the `$...$` of descriptions. Commands
# come from a closed list; anything else is shown as the text it is, so that no text of a spec reaches TeX as a command.

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
        """Return things up to one of the stops (left where it is) or the end."""
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
        sub = None
        sup = None
        primes = 0
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
        """Return a group, or the next single thing."""
        self.skip_blanks()
        if self.peek() is None:
            return Row(())
        found = self.one()
        return row(*found)

    def digit_or_argument(self) -> Math:
        r"""Read an argument; of a number only the first digit: `\\frac12` is a half."""
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
            return [self.fenced(token, PAIRS[token])]
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
        """Return the text of a group as written, its opening brace already read."""
        start = self.at
        level = 1
        at = self.at
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
        """Return a body up to its closing delimiter; when that is missing the opening one stands alone."""
        close = token if token is not None else RIGHT_TEX.get(right, right)
        inner = self.items(close)
        if self.peek() == close:
            self.at += 1
            return Fence(left, row(*inner), right)
        return Row((Sym(left), *inner))

    def command(self, token: str) -> list[Math]:
        name = token[1:]
        name = ALIASES.get(name, name)
        if name in GREEK:
            return [Ident(GREEK[name])]
        if token in (r"\{", r"\lvert", r"\lVert", r"\lfloor", r"\lceil", r"\langle"):
            left = DELIMITERS[token]
            return [self.fenced(left, *_closing(token))]
        if name in SYMBOLS:
            return [Sym(SYMBOLS[name])]
        if name in FUNCTIONS:
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
            case _ if name in ACCENTS:
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
        return Fence(DELIMITERS.get(left, left[:1]), row(*inner), DELIMITERS.get(right, right[:1]))

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
    """Return the closing delimiter of an opening command: its character and its command."""
    closing = token.replace(r"\l", r"\r") if token != r"\{" else r"\}"
    return DELIMITERS[closing], closing


def _spaces(text: str) -> str:
    """Return the text of an upright name: TeX's spaces are spaces."""
    return text.replace(r"\,", "\u2009").replace(r"\ ", " ").replace(r"\_", "_")


def read(text: str, holes: Collection[str] = ()) -> Math:
    """Return the tree of a piece of TeX mathematics.

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
