"""LaTeX as it is set -> marks. Knows the commands that may be printed, and refuses any other."""

from __future__ import annotations

import re

from tests.verification.printed.marks import (
    Big,
    Cases,
    Fence,
    Frac,
    Line,
    Mark,
    Matrix,
    Root,
    Script,
    Seen,
    Unclear,
    Word,
    scripted,
)

TOKEN = re.compile(r"\\[A-Za-z]+|\\.|[0-9]+(?:\.[0-9]+)?|\s+|.")
MARKS = {
    "cdot": "⋅", "odot": "⊙", "times": "×", "leq": "≤", "geq": "≥", "neq": "≠", "equiv": "≡", "land": "∧", "lor": "∨",
    "lnot": "¬", "in": "∈", "notin": "∉", "bmod": "mod", "ldots": "…", "leftarrow": "←", "exists": "∃", "forall": "∀",
}  # fmt: skip
LETTERS = {"theta": "θ", "infty": "∞"}
WORDS = {"min", "max", "log", "sin", "cos", "tan", "tanh", "arg"}
PAIRS = {r"\{": r"\}", r"\lvert": r"\rvert", r"\lVert": r"\rVert", r"\lfloor": r"\rfloor", r"\lceil": r"\rceil",
         "(": ")", "[": "]"}  # fmt: skip
LEFT = {r"\{": "{", r"\lvert": "|", r"\lVert": "‖", r"\lfloor": "⌊", r"\lceil": "⌈", "(": "(", "[": "["}
INVISIBLE = {r"\,", r"\quad", r"\allowbreak", r"\ "}


def read(source: str) -> Line:
    """The marks of a formula.

    Raises:
        Unclear: when it is not LaTeX as it should be printed.
    """
    reader = _Reader(TOKEN.findall(source))
    line = reader.line(())
    if reader.tokens:
        raise Unclear(f"{reader.tokens[-1]} closes nothing")
    return line


class _Reader:
    def __init__(self, tokens: list[str]) -> None:
        self.tokens = tokens[::-1]

    def peek(self) -> str:
        """The next token; spaces between tokens mean nothing."""
        while self.tokens and self.tokens[-1].isspace():
            self.tokens.pop()
        return self.tokens[-1] if self.tokens else ""

    def take(self, *wanted: str) -> str:
        self.peek()
        found = self.tokens.pop() if self.tokens else "the end"
        if wanted and found not in wanted:
            raise Unclear(f"{found}, where {wanted} belongs")
        return found

    def line(self, stops: tuple[str, ...]) -> Line:
        out: Line = ()
        while (token := self.peek()) and token not in (*stops, "}"):
            if token in ("_", "^", "'"):
                out = scripted(out, *self.scripts())
            else:
                out += self.things()
        return _joined(out)

    def scripts(self) -> tuple[Line | None, Line | None, int]:
        sub = sup = None
        primes = 0
        while self.peek() in ("_", "^", "'"):
            token = self.take()
            if token == "'":
                primes += 1
            elif token == "_":
                sub = self.argument()
            elif self.tokens[-2:] == [r"\prime", "{"]:  # TeX takes primes and a superscript in one
                del self.tokens[-2:]
                primes = primes + 1
                sup = self.line(())
                self.take("}")
            else:
                sup = self.argument()
        return sub, sup, primes

    def argument(self) -> Line:
        if self.peek() != "{":
            return self.things()
        self.take("{")
        found = self.line(())
        self.take("}")
        return found

    def raw(self) -> str:
        """The text of an upright name or of prose, escapes undone."""
        self.take("{")
        out = []
        while (token := self.tokens.pop()) != "}":
            out.append(token[1:] if token in (r"\#", r"\_") else token)
        return "".join(out)

    def things(self) -> Line:
        token = self.peek()
        if token == "{":
            return self.argument()
        self.take()
        if token in INVISIBLE:
            return ()
        if token in LEFT:
            return (self.fence(token, PAIRS[token]),)
        if token == r"\left":
            token = self.take()
            found = Fence(LEFT[token], self.line((r"\right",)))
            self.take(r"\right")
            self.take(PAIRS[token])
            return (found,)
        if token[0].isalnum():
            return (Word(token),)
        return (self.command(token[1:]),) if token[0] == "\\" else (Mark({"-": "−"}.get(token, token)),)

    def fence(self, left: str, right: str) -> Fence:
        found = Fence(LEFT[left], self.line((right,)))
        self.take(right)
        return found

    def command(self, name: str) -> Seen:
        if name == "not":
            self.take(r"\equiv")
            return Mark("≢")
        if name in MARKS:
            return Mark(MARKS[name])
        if name in WORDS or name in LETTERS:
            return Word(LETTERS.get(name, name))
        match name:
            case "frac":
                return Frac(self.argument(), self.argument())
            case "sqrt":
                return Root(self.argument())
            case "sum" | "prod":
                return Big({"sum": "∑", "prod": "∏"}[name])
            case "mathrm" | "mathit":
                return Word(self.raw())
            case "text":
                return Word(self.raw())
            case "mathcal":
                return Word({"N": "𝒩"}[self.raw()])
            case "taskspecone":
                return Word("𝟙")
            case "begin":
                return self.environment(self.raw())
            case _:
                raise Unclear(f"\\{name}")

    def environment(self, name: str) -> Seen:
        rows: list[list[Line]] = [[]]
        while True:
            rows[-1].append(self.line(("&", r"\\", r"\end")))
            token = self.take("&", r"\\", r"\end")
            if token == r"\end":
                break
            if token == r"\\":
                rows.append([])
        if self.raw() != name:
            raise Unclear(f"{name} does not end")
        if name == "pmatrix":
            return Matrix(tuple(map(tuple, rows)))
        return Cases(tuple((row[0], row[1]) for row in rows))


def _joined(line: Line) -> Line:
    """`arg max` is one word."""
    out: list[Seen] = []
    for seen in line:
        inner = seen.base if isinstance(seen, Script) else seen
        if out and out[-1] == Word("arg") and isinstance(inner, Word):
            out.pop()
            whole = Word(f"arg {inner.text}")
            seen = Script(whole, seen.sub, seen.sup) if isinstance(seen, Script) else whole
        out.append(seen)
    return tuple(out)
