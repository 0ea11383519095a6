"""The mathematics tree -> one line of plain text: alternative texts, labels, terminals."""

from __future__ import annotations

from typing import assert_never

from taskspec.printers import characters as c
from taskspec.printers import tree as m

_TIGHT = frozenset("()[]{}|‖′!")
_AFTER = frozenset(",;:")
_SUB = str.maketrans("0123456789+-=()aehijklmnoprstuvx", "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ")
_SUP = str.maketrans("0123456789+-−=()n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁻⁼⁽⁾ⁿ")
_SUBBED, _SUPPED = set("₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ"), set("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿ")


def plain(node: m.Math) -> str:
    """A readable line of Unicode text."""
    match node:
        case m.Ident(text=text, style="blackboard"):
            return c.BLACKBOARD.get(text, text)
        case m.Ident(text=text) | m.Num(text=text) | m.Words(text=text) | m.Hole(name=text):
            return text
        case m.Sym(text=text):
            return text if text in _TIGHT else f"{text} " if text in _AFTER else f" {text} "
        case m.Space(width=gap):
            return " " if gap == "thin" else "  "
        case m.Row(items=items):
            return _row(items)
        case m.Frac(top=top, bottom=bottom):
            return f"{_atom(top)}/{_atom(bottom)}"
        case m.Root(body=body):
            return f"√({plain(body)})"
        case m.Accent(mark=mark, body=body):
            return plain(body) + c.ACCENTS[mark][1]
        case m.Script():
            return _script(node)
        case m.Fence(left=left, body=body, right=right):
            return f"{left}{plain(body)}{right}"
        case m.Cases(rows=rows):
            return "{ " + "; ".join(f"{plain(a)} {plain(b)}".strip() for a, b in rows) + " }"
        case m.Matrix(rows=rows):
            return "[" + "; ".join(" ".join(plain(x) for x in line) for line in rows) + "]"
        case m.Arrow(over=over):
            return f" —{plain(over)}→ "
        case m.Big(symbol=symbol, sub=sub, sup=sup):
            limits = "".join(f"{mark}({plain(x)})" for mark, x in (("_", sub), ("^", sup)) if x is not None)
            return f"{symbol}{limits} "
        case _:
            assert_never(node)


def _row(items: tuple[m.Math, ...]) -> str:
    texts = [plain(item) for item in items]
    if items and isinstance(items[0], m.Sym):
        texts[0] = texts[0].lstrip() if items[0].text in _AFTER else texts[0].strip()
    return "".join(texts).replace("  ", " ")


def _atom(node: m.Math) -> str:
    text = plain(node)
    return text if isinstance(node, m.Ident | m.Num | m.Accent | m.Script | m.Fence) else f"({text})"


def _script(node: m.Script) -> str:
    text = _atom(node.base) + "′" * node.primes
    if node.sub is not None:
        text += _small(plain(node.sub), _SUB, _SUBBED, "_")
    if node.sup is not None:
        text += _small(plain(node.sup), _SUP, _SUPPED, "^")
    return text


def _small(text: str, table: dict[int, int], known: set[str], mark: str) -> str:
    raised = text.replace(" ", "").translate(table)
    if set(raised) <= known:
        return raised
    return f"{mark}{text}" if len(text) == 1 or text.isdigit() else f"{mark}({text})"
