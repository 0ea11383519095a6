"""Marks -> a value, by the conventions of printed mathematics, and strictly: what a reader could take for two things is refused.

A sum or product sign takes the product that follows it, a quantifier and `arg max` all that follows; two signs never stand
side by side; `mod` and `/` have a single factor behind them, and `mod` stands beside no sum, no sign and no product; `∧` and
`∨` are not mixed without brackets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tests.verification.printed import algebra as al
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
)

VECTORS = {"v", "w", "p", "s", "h"}
FUNCTIONS = {
    "min", "max", "round", "sign", "log", "sin", "cos", "tan", "tanh", "atan2", "clip", "sort", "argsort", "cumsum", "reverse",
    "argmin", "argmax", "swap", "f", "g", "Bernoulli", "Exp", "Poisson", "𝒩", "Unif", "Perm",
}  # fmt: skip
QUANTIFIERS = {"∃": "some", "∀": "every"}


def value(line: Line, names: Mapping[str, al.Value], depth: int = 0) -> al.Value:
    """What a whole formula stands for.

    Args:
        line: what is printed.
        names: values of the letters and words.
        depth: how many bound variables there are around it.

    Raises:
        Unclear: when it could be read in two ways, or in none.
    """
    return Reader(line, names, depth).whole()


def split(line: Line, mark: str, first: bool = False) -> list[Line]:
    """Parts between marks; with `first`, before and after the first of them."""
    parts: list[Line] = [()]
    for seen in line:
        if seen == Mark(mark) and not (first and len(parts) > 1):
            parts.append(())
        else:
            parts[-1] += (seen,)
    return parts


class Reader:
    def __init__(self, line: Line, names: Mapping[str, al.Value], depth: int) -> None:
        self.line = line
        self.names = names
        self.depth = depth
        self.at = 0

    def inner(self, line: Line, bound: str | None = None) -> Reader:
        if bound is None:
            return Reader(line, self.names, self.depth)
        return Reader(line, {**self.names, bound: al.bound(self.depth)}, self.depth + 1)

    def sub(self, line: Line) -> al.Value:
        return self.inner(line).whole()

    def peek(self) -> Seen | None:
        return self.line[self.at] if self.at < len(self.line) else None

    def sees(self, *marks: str) -> str | None:
        seen = self.peek()
        return seen.text if isinstance(seen, Mark) and seen.text in marks else None

    def takes(self, *marks: str) -> str | None:
        found = self.sees(*marks)
        self.at += found is not None
        return found

    # -- conditions -----------------------------------------------------------------------------------------------

    def whole(self) -> al.Value:
        found = self.statement()
        if self.peek() is not None:
            raise Unclear(f"{self.peek()} after the end")
        return found

    def statement(self) -> al.Value:
        if sign := self.takes(*QUANTIFIERS):
            return self.quantified(QUANTIFIERS[sign])
        parts = [self.literal()]
        signs = set()
        while sign := self.takes("∧", "∨"):
            signs.add(sign)
            parts.append(self.literal())
        if len(signs) > 1:
            raise Unclear("∧ beside ∨")
        return al.disjunction(parts) if signs == {"∨"} else al.conjunction(parts)

    def quantified(self, kind: str) -> al.Value:
        rest = self.line[self.at :]
        self.at = len(self.line)
        if len(rest) > 1 and rest[1] == Mark(":") and isinstance(rest[0], Word):
            return al.mixed(kind, self.inner(rest[2:], rest[0].text).whole())
        raise Unclear("a quantifier without a variable")

    def literal(self) -> al.Value:
        if self.takes("¬"):
            return al.negation(self.factor())
        left = self.sum()
        if self.takes("≡", "≢"):
            return self.congruence(left, self.line[self.at - 1] == Mark("≡"))
        links = []
        while sign := self.takes("∈", "∉", *al.RELATIONS):
            if sign in ("∈", "∉"):
                found = al.member(left, self.set())
                links.append(found if sign == "∈" else al.negation(found))
                break
            right = self.sum()
            links.append(al.RELATIONS[sign](left, right))
            left = right
        return al.conjunction(links) if links else left

    def congruence(self, left: al.Value, holds: bool) -> al.Value:
        zero, modulus = self.line[self.at : self.at + 2]
        if zero != Word("0") or not isinstance(modulus, Fence) or modulus.body[0] not in (Word("mod"), Mark("mod")):
            raise Unclear("a congruence")
        self.at += 2
        found = al.equal(al.modulo(left, self.sub(modulus.body[1:])), 0)
        return found if holds else al.negation(found)

    # -- numbers --------------------------------------------------------------------------------------------------

    def sum(self) -> al.Value:
        if self.is_extreme():
            return self.extreme()
        start = self.at
        signs = [sign] if (sign := self.takes("−", "+")) else []
        total = self.term()
        total = al.subtract(0, total) if sign == "−" else total
        while sign := self.takes("−", "+"):
            signs.append(sign)
            total = al.subtract(total, self.term()) if sign == "−" else al.add(total, self.term())
        if signs and Mark("mod") in self.line[start : self.at]:
            raise Unclear("mod beside a sign")
        return total

    def term(self) -> al.Value:
        start = self.at
        left = self.product()
        if self.sees("mod"):
            before = self.inner(self.line[start : self.at])
            if (before.factor(), before.peek())[1] is not None:
                raise Unclear("a product before mod")
        if sign := self.takes("mod", "/"):
            right = self.factor()
            if self.sees("mod", "/", "⋅", "×") or self.starts_factor():
                raise Unclear(f"a product after {sign}")
            return al.modulo(left, right) if sign == "mod" else al.divide(left, right)
        return left

    def product(self) -> al.Value:
        if isinstance(self.peek(), Big):
            return self.big()
        found = 1
        last = self.factor()
        whole = self.is_vector_before()
        single = self.is_single_before()  # of a call it is not known here whether it is a vector
        while (sign := self.takes("⋅", "×", "⊙")) or self.starts_factor():
            if isinstance(self.peek(), Big):
                return al.multiply(al.multiply(found, last), self.big())
            right = self.factor()
            both = whole and self.is_vector_before()
            if both and sign == "⋅":
                last = al.mixed("dot", last, right)
                whole = False
                continue
            single = single and self.is_single_before()
            if both != (sign == "⊙") and single:
                raise Unclear(f"{sign} between a vector and a number, or two vectors side by side")
            found = al.multiply(found, last)
            last = right
            whole = whole or self.is_vector_before()
        return al.multiply(found, last)

    def is_single_before(self) -> bool:
        """Whether the factor just read is a name alone."""
        seen = self.line[self.at - 1]
        return isinstance(seen.base if isinstance(seen, Script) else seen, Word)

    def is_vector_before(self) -> bool:
        """Whether the factor just read is the name of a whole vector."""
        seen = self.line[self.at - 1]
        if isinstance(seen, Script):
            return isinstance(seen.base, Word) and seen.base.text in VECTORS and seen.sub is None
        return isinstance(seen, Word) and seen.text in VECTORS

    def starts_factor(self) -> bool:
        """Whether what follows is multiplied, there being nothing in between."""
        return not isinstance(self.peek(), Mark | None) and not self.is_extreme()

    def is_extreme(self) -> bool:
        seen = self.peek()
        return isinstance(seen, Script) and seen.base in (Word("arg max"), Word("arg min"))

    def extreme(self) -> al.Value:
        seen = self.peek()
        assert isinstance(seen, Script) and isinstance(seen.base, Word) and seen.sub is not None
        self.at += 1
        body = self.inner(self.line[self.at :], variable(seen.sub))
        found = al.mixed(seen.base.text, body.term())
        self.at += body.at
        if self.sees("+", "−", "⋅"):
            raise Unclear(f"{seen.base.text} beside another term")
        return found

    def big(self) -> al.Value:
        seen = self.peek()
        assert isinstance(seen, Big)
        self.at += 1
        name, limits = self.range(seen)
        body = self.inner(self.line[self.at :], name)
        found = body.product()
        self.at += body.at
        if self.sees("mod", "/"):
            raise Unclear(f"{seen.sign} beside mod or /")
        return al.mixed(seen.sign, *limits, found if name else al.index(found, (al.bound(self.depth),)))

    def range(self, seen: Big) -> tuple[str | None, Sequence[Any]]:
        if seen.sub is None:
            return None, ("all",)
        first, *low = split(seen.sub, "=")
        if not low:
            return variable(first), ("all",)
        assert seen.sup is not None
        return variable(first), (self.sub(low[0]), self.sub(seen.sup))

    # -- factors --------------------------------------------------------------------------------------------------

    def factor(self) -> al.Value:
        seen = self.peek()
        if seen is None or isinstance(seen, Mark | Big):
            raise Unclear(f"{seen}, where a value belongs")
        self.at += 1
        core = seen.base if isinstance(seen, Script) else seen
        if isinstance(core, Word):
            return self.word(core.text, seen)
        if isinstance(core, Fence) and core.left == "‖":
            return self.norm(core.body, seen)
        return self.changed(self.scripts(self.single(core), seen))

    def norm(self, body: Line, seen: Seen) -> al.Value:
        assert isinstance(seen, Script) and seen.sub is not None
        found = al.mixed("norm", self.sub(body), self.sub(seen.sub))
        return found if seen.sup is None else al.power(found, self.sub(seen.sup))

    def changed(self, whole: al.Value) -> al.Value:
        """`v[i <- x]` behind a vector."""
        seen = self.peek()
        if isinstance(seen, Fence) and seen.left == "[":
            self.at += 1
            i, x = split(seen.body, "←")
            return al.mixed("put", whole, self.sub(i), self.sub(x))
        return whole

    def scripts(self, whole: al.Value, seen: Seen, primes: int = 0) -> al.Value:
        """A value with the index and the exponent that stand beside it."""
        if not isinstance(seen, Script):
            return whole
        if seen.primes != primes:
            raise Unclear("a prime on what has no next value")
        found = whole if seen.sub is None else al.index(whole, [self.index(i) for i in split(seen.sub, ",")])
        return found if seen.sup is None else al.power(found, self.sub(seen.sup))

    def index(self, line: Line) -> Any:
        if len(line) == 1 and isinstance(line[0], Fence) and line[0].left == "{":
            return self.elements(line[0].body)
        parts = split(line, ":")
        if len(parts) == 1:
            return self.sub(line)
        return tuple(self.sub(part) if part else None for part in parts)

    def single(self, core: Seen) -> al.Value:
        match core:
            case Frac(top=top, bottom=bottom):
                return al.divide(self.sub(top), self.sub(bottom))
            case Root(body=body):
                return al.mixed("sqrt", self.sub(body))
            case Cases(rows=rows):
                return self.cases(rows)
            case Matrix(rows=rows):
                return al.mixed("vector", *(al.mixed("vector", *map(self.sub, row)) for row in rows))
            case Fence(left="("):
                return self.group(core.body)
            case Fence(left="⌊"):
                return al.floor(self.sub(core.body))
            case Fence(left="⌈"):
                return al.mixed("ceil", self.sub(core.body))
            case Fence(left="|"):
                return al.mixed("bars", self.sub(core.body))
            case _:
                raise Unclear(f"{core} by itself")

    def group(self, body: Line) -> al.Value:
        parts = split(body, ",")
        return self.sub(body) if len(parts) == 1 else al.mixed("vector", *map(self.sub, parts))

    def cases(self, rows: Sequence[tuple[Line, Line]]) -> al.Value:
        match rows[0][1]:
            case (Word(text="with probability "), *_):
                return al.mixed("weights", *((self.sub(a), self.sub(b[1:])) for a, b in rows))
        *some, last = rows
        if last[1] != (Word("otherwise"),):
            raise Unclear("cases without an otherwise")
        found = self.sub(last[0])
        for then, condition in reversed(some):
            if condition[0] != Word("if "):
                raise Unclear("a case without an if")
            found = al.choice(self.sub(condition[1:]), self.sub(then), found)
        return found

    def word(self, text: str, seen: Seen) -> al.Value:
        after = self.peek()
        core = after.base if isinstance(after, Script) else after
        if isinstance(core, Fence) and (text in FUNCTIONS or text in ("𝟙", "#")):
            assert after is not None
            self.at += 1
            return self.scripts(self.applied(text, seen, core), after)
        if text == "e" and isinstance(seen, Script) and (seen.sub is None) != (seen.sup is None):
            return al.mixed("exp" if seen.sub is None else "onehot", self.sub(seen.sub or seen.sup or ()))
        return self.changed(self.scripts(self.named(text, seen), seen, seen.primes if isinstance(seen, Script) else 0))

    def named(self, text: str, seen: Seen) -> al.Value:
        if text[0].isdigit():
            return al.number(text)
        name = text + "'" * (seen.primes if isinstance(seen, Script) else 0)
        if name in self.names:
            return self.names[name]
        raise Unclear(f"{name} is unknown")

    def applied(self, text: str, seen: Seen, fence: Fence) -> al.Value:
        if text == "𝟙" and fence.left == "[":
            return self.sub(fence.body)
        if text == "#" and fence.left == "{":
            first, condition = split(fence.body, ":")
            return al.mixed("count", self.inner(condition, variable(first)).whole())
        if fence.left == "{":
            return al.mixed(text, self.elements(fence.body))
        if fence.left != "(":
            raise Unclear(f"{text} before {fence.left}")
        below = seen.sub if isinstance(seen, Script) and seen.sub else ()
        return al.mixed(text, *(self.sub(part) for line in (below, fence.body) if line for part in split(line, ",")))

    # -- sets -----------------------------------------------------------------------------------------------------

    def set(self) -> tuple[Any, ...]:
        seen = self.peek()
        self.at += 1
        if isinstance(seen, Script) and isinstance(seen.base, Fence) and seen.sup is not None:
            return ("power", self.elements(seen.base.body), self.sub(seen.sup))
        if isinstance(seen, Fence) and seen.left == "{":
            return self.elements(seen.body)
        raise Unclear(f"{seen} is no set")

    def elements(self, body: Line) -> tuple[Any, ...]:
        if Mark("…") in body:
            low, dots, high = split(body, ",")
            assert dots == (Mark("…"),)
            return al.integers(self.sub(low), self.sub(high))
        if Mark(":") in body:
            return self.builder(*split(body, ":"))
        return ("set", *(self.sub(part) for part in split(body, ",") if part))

    def builder(self, head: Line, conditions: Line) -> tuple[Any, ...]:
        """{x ∈ D : c}, {f(x) : x ∈ D, c}."""
        if Mark("∈") in head:
            head, conditions = head[:1], (*head, Mark(","), *conditions)
        domain, *rest = split(conditions, ",")
        name, inside = split(domain, "∈")
        parts = [self.inner(part, variable(name)).whole() for part in (head, *rest)]
        return ("builder", self.inner(inside).set(), *parts)


def variable(line: Line) -> str:
    if len(line) != 1 or not isinstance(line[0], Word):
        raise Unclear("not a variable")
    return line[0].text
