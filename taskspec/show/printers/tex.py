"""A small part of TeX's mathematics -> the mathematics tree, and the characters that TeX has names for."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field

from taskspec.show.printers import tree as m
from taskspec.show.printers.tree import Math

GREEK: dict[str, str] = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ϵ", "varepsilon": "ε", "zeta": "ζ",
    "eta": "η", "theta": "θ", "vartheta": "ϑ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν",
    "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "ϕ", "varphi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ",
    "Pi": "Π", "Sigma": "Σ", "Upsilon": "Υ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω", "ell": "ℓ",
}  # fmt: skip

SYMBOLS: dict[str, str] = {
    "cdot": "⋅", "odot": "⊙", "times": "×", "div": "÷", "pm": "±", "mp": "∓", "circ": "∘", "ast": "∗",
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
"""Marks that TeX sets over a letter: the mark alone, and as a character that joins the one before it."""

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
_STYLES: dict[str, m.Style] = {
    "mathbb": "blackboard", "mathbbm": "blackboard", "mathds": "blackboard", "mathcal": "calligraphic",
    "mathrm": "upright", "mathit": "italic", "mathbf": "bold", "boldsymbol": "bold", "operatorname": "upright",
    "mathtt": "typewriter", "texttt": "typewriter",
}  # fmt: skip
_IGNORED = {"textstyle", "displaystyle", "limits", "nolimits", "big", "Big", "bigl", "bigr", "Bigl", "Bigr", "!"}
_SINGLE: dict[str, Math] = {
    **{name: m.Ident(char) for name, char in GREEK.items()},
    **{name: m.Sym(char) for name, char in SYMBOLS.items()},
    **{name: m.Ident(name, "upright") for name in (*FUNCTIONS, "mod")},
    **{name: m.Sym(name) for name in "#%&$}"},
    **{name: m.Gap() for name in (",", ";", ":", " ")},
    "quad": m.Gap("wide"), "qquad": m.Gap("wide"), "sum": m.Big("∑"), "prod": m.Big("∏"), "_": m.Words("_"),
    "bmod": m.Sym("mod"), "|": m.Sym("‖"),
}  # fmt: skip
"""Commands that stand for one thing."""
_SAME = {r"\lbrace": r"\{", r"\rbrace": r"\}", r"\thinspace": r"\,", r"\cr": r"\\"}
"""Longer spellings, which Markdown leaves alone."""
_PLAIN = {"*": "⋅", "-": "−", "'": "′"}
_CLOSING = {
    "(": ")", "[": "]", r"\{": r"\}", r"\lvert": r"\rvert", r"\lVert": r"\rVert", r"\lfloor": r"\rfloor", r"\lceil": r"\rceil",
    r"\langle": r"\rangle",
}  # fmt: skip


@dataclass
class _TexReader:
    """One pass over the tokens; `holes` are the names of arguments."""

    tokens: list[str]
    holes: Collection[str] = ()
    at: int = 0
    depth: int = 0
    stops: list[str] = field(default_factory=list)
    mended: list[str] = field(default_factory=list)
    """What is no TeX, and was mended, in words."""

    def peek(self) -> str | None:
        if self.at < len(self.tokens):
            return self.tokens[self.at]
        return None

    def take(self) -> str:
        self.at += 1
        if self.at <= len(self.tokens):
            return self.tokens[self.at - 1]
        return ""

    def taken(self, token: str) -> bool:
        """Read a token if it is the next one."""
        is_next = self.peek() == token
        self.at += is_next
        return is_next

    def skip_blanks(self) -> None:
        while (token := self.peek()) is not None and token.isspace():
            self.at += 1

    def items(self, *stops: str) -> list[Math]:
        """Read trees up to one of the stops (left where it is) or the end."""
        trees: list[Math] = []
        self.stops.extend(stops)
        self.depth += 1
        while (token := self.peek()) is not None and token not in self.stops:
            if token.isspace():
                self.at += 1
            elif token in ("_", "^", "'"):
                base: Math = m.Row(())
                if trees:
                    base = trees.pop()
                trees.append(self.script(base))
            else:
                trees += self.one()
        self.depth -= 1
        del self.stops[len(self.stops) - len(stops) :]
        return trees

    def script(self, base: Math) -> Math:
        sub = None
        sup = None
        primes = 0
        while (token := self.peek()) in ("_", "^", "'"):
            self.at += 1
            if token == "'":
                primes += 1
            elif token == "_":
                sub = self.argument()
            else:
                sup = self.argument()
        if isinstance(base, m.Big):
            return m.Big(base.symbol, sub, sup)
        return m.Script(base, sub, sup, primes)

    def argument(self) -> Math:
        self.skip_blanks()
        if self.peek() is None:
            self.mended.append("an argument is missing at the end")
            return m.Row(())
        return m.row(*self.one())

    def digit_or_argument(self) -> Math:
        r"""Read an argument; of a number only the first digit: `\\frac12` is a half."""
        self.skip_blanks()
        token = self.peek()
        if token is None or not token[0].isdigit():
            return self.argument()
        self.tokens[self.at : self.at + 1] = list(filter(None, (token[0], token[1:])))
        return m.Num(self.take())

    def one(self) -> list[Math]:
        token = self.take()
        if self.depth > MAX_DEPTH:
            return [m.Words(token)]
        if token in _CLOSING:
            return [self.fenced(token)]
        if token == "{":
            return [self.group()]
        if token[0] == "\\":
            name = ALIASES.get(token[1:], token[1:])
            if name in _IGNORED:
                return []
            if name in _SINGLE:
                return [_SINGLE[name]]
            return self.structure(token, name)
        if token[0].isdigit():
            return [m.Num(token)]
        if token.isalpha():
            return [m.Ident(token)]
        if token == "~":
            return [m.Gap()]
        return [self.sign(token)]

    def sign(self, token: str) -> Math:
        if token in "}$&#%^_":
            self.mended.append(f"`{token}` is out of place")
            return m.Words(token)
        return m.Sym(_PLAIN.get(token, token))

    def group(self) -> Math:
        start = self.at
        name = self.raw()
        if name in self.holes:
            return m.Hole(name)
        self.at = start
        inner = self.items("}")
        if not self.taken("}"):
            self.mended.append("`{` is not closed")
        return m.row(*inner)

    def raw(self) -> str:
        """Read the text of a group as written, its opening brace already read."""
        text = ""
        level = 1
        while (token := self.take()) and (token != "}" or level > 1):
            level += {"{": 1, "}": -1}.get(token, 0)
            text += token
        if not token:
            self.mended.append("`{` is not closed")
        return text

    def raw_argument(self) -> str:
        self.skip_blanks()
        if self.taken("{"):
            return self.raw()
        return self.take()

    def fenced(self, token: str) -> Math:
        """Read a body up to its closing delimiter; without one the opening delimiter stands alone."""
        closing = _CLOSING[token]
        inner = self.items(closing)
        if self.taken(closing):
            return m.Fence(DELIMITERS[token], m.row(*inner), DELIMITERS[closing])
        return m.Row((m.Sym(DELIMITERS[token]), *inner))

    def structure(self, token: str, name: str) -> list[Math]:
        if name in _STYLES:
            text = self.raw_argument().replace(r"\,", "\u2009").replace(r"\ ", " ").replace(r"\_", "_")
            return [m.Ident(text, _STYLES[name])]
        match name:
            case "frac" | "tfrac" | "dfrac":
                return [m.Frac(self.digit_or_argument(), self.digit_or_argument())]
            case _ if name in ACCENTS:
                return [m.Accent(name, self.argument())]
            case "xrightarrow":
                return [m.Arrow(self.argument())]
            case "sqrt":
                return [m.Root(self.argument())]
            case "text" | "textrm" | "mbox" | "textit":
                return [m.Words(self.raw_argument())]
            case "pmod":
                return [m.Gap("wide"), m.brackets(m.Row((m.upright("mod"), m.Gap(), self.argument())))]
            case "left":
                return [self.sized()]
            case "begin":
                return [self.environment()]
            case _:
                self.mended.append(f"`{token}` is not known")
                return [m.Words(token)]

    def sized(self) -> Math:
        left = self.delimiter()
        inner = self.items(r"\right")
        right = ""
        if self.taken(r"\right"):
            right = self.delimiter()
        else:
            self.mended.append(r"`\left` has no `\right`")
        return m.Fence(left, m.row(*inner), right)

    def delimiter(self) -> str:
        self.skip_blanks()
        token = self.take()
        return DELIMITERS.get(token, token[:1])

    def environment(self) -> Math:
        name = self.raw_argument()
        lines: list[list[Math]] = [[]]
        while True:
            lines[-1].append(m.row(*self.items("&", r"\\", r"\end")))
            token = self.take()
            if token == r"\\":
                lines.append([])
            elif token != "&":
                break
        if token == r"\end":
            self.raw_argument()
        if name == "cases":
            return m.Cases(tuple((line[0], (*line, m.Row(()))[1]) for line in lines))
        return m.Matrix(tuple(map(tuple, lines)))


def read(text: str, holes: Collection[str] = ()) -> Math:
    """Return the tree of a piece of TeX mathematics.

    Never fails: what it does not know is shown as text.

    Args:
        text: TeX, without dollars.
        holes: names which, alone in braces, are arguments of a template.
    """
    return _read(text, holes)[0]


def mended(text: str) -> list[str]:
    """Return what `read` mends in a piece of TeX mathematics, in words; empty for one that is right."""
    return _read(text, ())[1]


def _read(text: str, holes: Collection[str]) -> tuple[Math, list[str]]:
    reader = _TexReader([_SAME.get(token, token) for token in _TOKEN.findall(text)], holes)
    return m.row(*reader.items()), reader.mended
