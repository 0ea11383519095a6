"""MathML as browsers draw it -> marks."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from tests.verification.printed.marks import (
    CLOSING,
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
    bracketed,
    scripted,
)

BARS = {"|", "‖"}


def read(source: str) -> Line:
    """The marks of a `<math>` element."""
    root = ElementTree.fromstring(source)
    assert root.tag == "math"
    return line(root)


def line(node: Iterable[Element]) -> Line:
    return bracketed(_bars(_row(node)))


def _row(node: Iterable[Element]) -> Line:
    out: Line = ()
    for child in node:
        out += _seen(child)
    return out


def _seen(node: Element) -> Line:
    text = (node.text or "").replace("\u00a0", " ")
    match node.tag:
        case "mrow" if len(node) == 2 and node[1].tag == "mtable" and node[1].get("class") == "cases":
            return (_table(node[1]),)
        case "mrow" if len(node) > 1 and _primes(node[-1]):
            return scripted(line(node[:-1]), None, None, _primes(node[-1]))
        case "mrow" | "mpadded" | "mstyle":
            return _row(node)
        case "mi" if text == "…":
            return (Mark(text),)
        case "mi" | "mn":
            return (Word(text.replace("\u2009", "")),)
        case "mo" if text in BARS:
            return (Mark(text + node.attrib["form"]),)
        case "mo" if text == "∑" or text == "∏":
            return (Big(text),)
        case "mo":
            return (Mark(text),)
        case "mspace":
            return ()
        case "mfrac":
            return (Frac(line(node[0:1]), line(node[1:2])),)
        case "msqrt":
            return (Root(line(node)),)
        case "msub" | "munder":
            return scripted(line(node[0:1]), line(node[1:2]), None)
        case "msup":
            return _raised(node, None, node[1])
        case "msubsup" | "munderover":
            return _raised(node, line(node[1:2]), node[2])
        case "mtable":
            return (_table(node),)
        case other:
            raise Unclear(other)


def _primes(node: Element) -> int:
    """The number of primes in a sign that is nothing else."""
    text = node.text or ""
    return len(text) if node.tag == "mo" and set(text) == {"′"} else 0


def _raised(node: Element, sub: Line | None, above: Element) -> Line:
    """Primes stand first among what is above."""
    marks = line([above])
    primes = 0
    if marks and isinstance(marks[0], Mark) and set(marks[0].text) == {"′"}:
        primes = len(marks[0].text)
        marks = marks[1:]
    return scripted(line(node[0:1]), sub, marks or None, primes)


def _table(node: Element) -> Seen:
    rows = tuple(tuple(line(cell) for cell in row) for row in node)
    return Cases(rows) if node.get("class") == "cases" else Matrix(rows)


def _bars(marks: Line) -> Line:
    """Pairs of bars, which look alike, by the form that each is given."""
    out: list[Line] = [()]
    for seen in marks:
        inner = seen.base if isinstance(seen, Script) else seen
        if isinstance(inner, Mark) and inner.text.endswith("prefix"):
            out.append(())
        elif isinstance(inner, Mark) and inner.text.endswith("postfix"):
            fence = Fence(inner.text[0], bracketed(out.pop()))
            out[-1] += (Script(fence, seen.sub, seen.sup) if isinstance(seen, Script) else fence,)
        else:
            out[-1] += (seen,)
    assert len(out) == 1
    return out[0]


assert "|" not in CLOSING
