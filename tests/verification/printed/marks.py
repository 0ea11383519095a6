"""What a reader sees: symbols side by side, fractions, roots, scripts, brackets, cases. Invisible groups are gone."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Mark:
    """An operator, a relation, a sign of punctuation."""

    text: str


@dataclass(frozen=True)
class Word:
    """A letter, a name, a number, a word."""

    text: str


@dataclass(frozen=True)
class Frac:
    top: Line
    bottom: Line


@dataclass(frozen=True)
class Root:
    body: Line


@dataclass(frozen=True)
class Script:
    base: Seen
    sub: Line | None = None
    sup: Line | None = None
    primes: int = 0


@dataclass(frozen=True)
class Fence:
    left: str
    body: Line


@dataclass(frozen=True)
class Cases:
    rows: tuple[tuple[Line, Line], ...]


@dataclass(frozen=True)
class Matrix:
    rows: tuple[tuple[Line, ...], ...]


@dataclass(frozen=True)
class Big:
    sign: str
    sub: Line | None = None
    sup: Line | None = None


Seen = Mark | Word | Frac | Root | Script | Fence | Cases | Matrix | Big
Line = tuple[Seen, ...]

CLOSING = {"(": ")", "[": "]", "{": "}", "⌊": "⌋", "⌈": "⌉"}


class Unclear(Exception):
    """What is printed has two readings, or none."""


def scripted(base: Line, sub: Line | None, sup: Line | None, primes: int = 0) -> Line:
    """A script stands beside the last thing before it, whatever invisible group it was set to."""
    if not base:
        raise Unclear("a script on nothing")
    *before, last = base
    if isinstance(last, Big):
        return (*before, replace(last, sub=sub, sup=sup))
    if isinstance(last, Mark | Frac | Cases):
        raise Unclear(f"a script on {type(last).__name__}")
    if not isinstance(last, Script):
        return (*before, Script(last, sub, sup, primes))
    if last.sup is not None or (sub is not None and last.sub is not None) or (primes and last.sub is not None):
        raise Unclear("a script on a script")
    return (*before, replace(last, sub=last.sub if sub is None else sub, sup=sup, primes=last.primes + primes))


def bracketed(line: Line) -> Line:
    """Marks with every pair of brackets made one, scripts on a closing bracket being on the pair."""
    stack: list[tuple[str, list[Seen]]] = [("", [])]
    for seen in line:
        inner = seen.base if isinstance(seen, Script) else seen
        if isinstance(inner, Mark) and inner.text in CLOSING:
            stack.append((inner.text, []))
        elif isinstance(inner, Mark) and inner.text in CLOSING.values():
            left, body = stack.pop()
            if CLOSING.get(left) != inner.text:
                raise Unclear(f"{inner.text} closes {left or 'nothing'}")
            fence = Fence(left, tuple(body))
            stack[-1][1].append(replace(seen, base=fence) if isinstance(seen, Script) else fence)
        else:
            stack[-1][1].append(seen)
    if len(stack) != 1:
        raise Unclear(f"{stack[-1][0]} is not closed")
    return tuple(stack[0][1])
