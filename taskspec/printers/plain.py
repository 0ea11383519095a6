"""The mathematics tree -> one line of plain text: alternative texts, labels, terminals."""

from __future__ import annotations

from typing import assert_never

from taskspec.printers import characters as c
from taskspec.printers import tree as m

_TIGHT = frozenset("()[]{}|‖′!")
_AFTER = frozenset(",;:")
_DIVIDES = (m.Sym("mod"), m.Sym("/"))
_MULTIPLIES = (*_DIVIDES, m.Sym("⋅"), m.Sym("×"))
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
        case m.Gap(width=gap):
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
    texts = [plain(_apart(item, items[i - 1] if i else None, items[i + 1 :])) for i, item in enumerate(items)]
    if items and isinstance(items[0], m.Sym):
        texts[0] = texts[0].lstrip() if items[0].text in _AFTER else texts[0].strip()
    return "".join(texts).replace("  ", " ")


def _apart(node: m.Math, before: m.Math | None, after: tuple[m.Math, ...]) -> m.Math:
    """A factor with its fraction in brackets where the slash would take in what stands beside it: (x/y)z."""
    if isinstance(node, m.Frac) and before in _DIVIDES:
        return m.brackets(node)
    beside = next((x for x in after if not isinstance(x, m.Gap)), None)
    multiplies = beside in _MULTIPLIES or not isinstance(beside, m.Sym | m.Words | None)
    return _closed(node) if multiplies else node


def _closed(node: m.Math) -> m.Math:
    """The same with the fraction that it ends with in brackets."""
    if isinstance(node, m.Row) and node.items:
        return m.Row((*node.items[:-1], _closed(node.items[-1])))
    return m.brackets(node) if isinstance(node, m.Frac) else node


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
    if set(raised) <= known and not known & set(text):  # a script of a script would be one with it
        return raised
    return f"{mark}{text}" if len(text) == 1 or text.isdecimal() else f"{mark}({text})"
