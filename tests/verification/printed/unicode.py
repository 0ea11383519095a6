"""One line of Unicode text -> marks."""

from __future__ import annotations

import re

from tests.verification.printed.marks import (
    CLOSING,
    Big,
    Cases,
    Fence,
    Frac,
    Line,
    Mark,
    Root,
    Script,
    Seen,
    Unclear,
    Word,
    scripted,
)

LOW = dict(zip("₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ", "0123456789+-=()aehijklmnoprstuvx", strict=True))
HIGH = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿ", "0123456789+-=()n", strict=True))
NAME = re.compile(r"(arg max|arg min|argsort|argmin|argmax|atan2|cumsum|reverse|round|sign|clip|sort|swap|tanh|min|max|log|sin"
                  r"|cos|tan|Bernoulli|N|Exp|Poisson|Unif|Perm)(?=[({_ₐ-ₜ₀-₎ᵢ-ᵥ])")  # fmt: skip
WORD = re.compile(r"arg max|arg min|move|true|false|go left|\d+(\.\d+)?|[^\W\d_]|𝟙|#")
ROW = re.compile(r" (if |otherwise|with probability )")
SIGNS = "+−⋅⊙×=≠<>≤≥≡≢∈∉∧∨¬∀∃:,…←/"


def read(text: str) -> Line:
    """The marks of a line.

    Raises:
        Unclear: when brackets do not match, or a character is not known.
    """
    reader = _Reader(text)
    found = reader.line("")
    if reader.at < len(text):
        raise Unclear(f"{text[reader.at :]} after the end")
    return found


def _awaits(seen: Seen) -> bool:
    """Whether an operand comes behind a sign, a sum sign, or `arg max` with what goes through all places below."""
    core = seen.base if isinstance(seen, Script) else seen
    return isinstance(seen, Mark | Big) or (isinstance(core, Word) and core.text in ("arg max", "arg min"))


class _Reader:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0

    def sees(self, what: str) -> bool:
        return self.text.startswith(what, self.at)

    def line(self, stop: str) -> Line:
        """Marks up to a closing bracket."""
        out: Line = ()
        while self.at < len(self.text):
            expected = not out or _awaits(out[-1])  # an operand comes next, so that a bar opens
            if stop and self.sees(stop) and (not expected or stop not in "|‖"):
                break
            char = self.text[self.at]
            if char in ")]}⌋⌉;" or ROW.match(self.text, self.at):
                break
            if char in "_^′" or char in LOW or char in HIGH:
                out = scripted(out, *self.scripts())
            elif char == "/" and out and self.text[self.at - 1] != " ":
                self.at += 1
                out = (*out[:-1], self.fraction(out))
            else:
                out += self.thing(expected)
        return out

    def fraction(self, before: Line) -> Frac:
        """`x/y` without spaces is a fraction of its two neighbours; nothing may stand close by that it could take in."""
        bottom = self.thing(True)
        while self.at < len(self.text) and (self.text[self.at] in "_^′" or self.text[self.at] in (LOW | HIGH)):
            bottom = scripted(bottom, *self.scripts())
        close = self.text[self.at : self.at + 1]
        if (len(before) > 2 and before[-2] in (Mark("mod"), Mark("/"))) or (close and close not in " ,;:)]}⌋⌉|‖"):
            raise Unclear("a fraction beside another factor")
        if self.text[self.at :].startswith((" ⋅", " ×", " mod", " /")):
            raise Unclear("a fraction before another factor")
        return Frac(before[-1:], bottom)

    def thing(self, leads: bool) -> Line:
        char = self.text[self.at]
        if char == " ":
            self.at += 1
            return ()
        if self.sees("{ "):
            return (self.cases(),)
        if char in CLOSING or (char in "|‖" and leads):
            return (self.fence(char, CLOSING.get(char, char)),)
        if self.sees("mod "):
            self.at += 4
            return (Mark("mod"),)
        found = NAME.match(self.text, self.at) or WORD.match(self.text, self.at)
        self.at += len(found[0]) if found else 1
        if found:
            return (Word({"N": "𝒩"}.get(found[0], found[0])),)
        if char in SIGNS:
            return (Mark(char),)
        if char in "∑∏":
            return (Big(char),)
        if char == "√":
            return (Root(self.fence("(", ")").body),)
        raise Unclear(f"{char} in {self.text}")

    def fence(self, left: str, right: str) -> Fence:
        self.expect(left)
        body = self.line(right)
        self.expect(right)
        return Fence(left, body)

    def expect(self, what: str) -> None:
        if not self.sees(what):
            raise Unclear(f"no {what} at {self.at}")
        self.at += len(what)

    def scripts(self) -> tuple[Line | None, Line | None, int]:
        sub = sup = None
        primes = 0
        while self.sees("′"):
            primes = primes + 1
            self.at = self.at + 1
        sub = self.script("_", LOW)
        sup = self.script("^", HIGH)
        return sub, sup, primes

    def script(self, mark: str, table: dict[str, str]) -> Line | None:
        start = self.at
        while self.at < len(self.text) and self.text[self.at] in table:
            self.at += 1
        if self.at > start:
            return read("".join(table[c] for c in self.text[start : self.at]).replace("-", "−"))
        if not self.sees(mark):
            return None
        self.at += 1
        if self.sees("("):
            return self.fence("(", ")").body
        found = WORD.match(self.text, self.at)
        assert found is not None
        self.at = found.end()
        return (Word(found[0]),)

    def cases(self) -> Cases:
        self.expect("{ ")
        rows: list[tuple[Line, Line]] = []
        while True:
            value = self.line("")
            word = ROW.match(self.text, self.at)
            if word is None:
                raise Unclear(f"no condition at {self.at}")
            self.at = word.end()
            rows.append((value, (Word(word[1]), *self.line(" }"))))
            if not self.sees("; "):
                break
            self.at += 2
        self.expect(" }")
        return Cases(tuple(rows))
