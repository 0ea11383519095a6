"""The mathematics tree -> LaTeX (amsmath, amssymb, mathtools)."""

from __future__ import annotations

import re
import unicodedata
from typing import assert_never

from taskspec.printers import tex as c
from taskspec.printers import tree as m

_SPECIAL = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%",
    "_": r"\_", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", '"': r"\textquotedbl{}", "`": r"\textasciigrave{}",
    "\u00a0": "~", "–": "--", "—": "---", "‘": "`", "’": "'", "“": "``", "”": "''", "…": r"\ldots{}",
    "\u2009": r"\,", "−": r"\ensuremath{-}", "\u200b": "",
}  # fmt: skip
_STYLE = {
    "upright": r"\mathrm", "bold": r"\mathbf", "calligraphic": r"\mathcal", "typewriter": r"\mathtt",
    "blackboard": r"\mathbb", "italic": r"\mathit",
}  # fmt: skip
_MATH_CHAR = {"{": r"\{", "}": r"\}", "#": r"\#", "%": r"\%", "&": r"\&", "$": r"\$", "‖": r"\Vert ", "|": r"\vert ",
              "≢": r"\not\equiv "}  # fmt: skip
LONG = 16.0
"""From this width on, in letters, a list may break after its commas."""
_RELATIONS = frozenset(c.TEX_SYMBOL) - {"∞"}
_NAMES = {"arg min": r"\arg\min ", "arg max": r"\arg\max "} | {name: rf"\{name} " for name in c.FUNCTIONS}
_SYMBOLS = {"mod": r" \bmod ", ",": ", ", ";": "; ", "′": "'"}


def escape(text: str) -> str:
    """Return text for LaTeX's text mode: every special character is written out, nothing can become a command."""
    return "".join(map(_character, text))


def _character(char: str) -> str:
    if char in _SPECIAL:
        return _SPECIAL[char]
    if char.isascii():
        return char if char.isprintable() or char in "\t\n" else f"[U+{ord(char):04X}]"
    if char in c.TEX_LETTER or (char in c.TEX_SYMBOL and c.TEX_SYMBOL[char].isalpha()):
        return rf"\ensuremath{{{_glyph(char)}}}"
    if "\u00a1" <= char <= "\u017f":  # what T1 fonts hold
        return char
    simpler = unicodedata.normalize("NFKD", char).encode("ascii", "ignore").decode()
    return escape(simpler) if simpler else f"[U+{ord(char):04X}]"


def _glyph(char: str) -> str:
    """Return one character in mathematics."""
    name = c.TEX_LETTER.get(char) or c.TEX_SYMBOL.get(char)
    if name is not None:
        return rf"\{name}" if name.isalpha() else name
    if char in _MATH_CHAR:
        return _MATH_CHAR[char]
    # what TeX reads as its own (^^5c is a backslash) goes through text mode, where it is written out
    plain = char.isascii() and char.isprintable() and char not in _SPECIAL
    return char if plain or char in "<>'" else rf"\text{{{_character(char)}}}"


def latex(node: m.Math) -> str:
    """Return LaTeX of a tree, for math mode."""
    return _write(node).strip()


def _write(node: m.Math) -> str:  # noqa: C901, PLR0912
    match node:
        case m.Ident():
            return _ident(node)
        case m.Num(text=text):
            text = text.replace("−", "-").replace("∞", r"\infty ")
            return text.replace("%", r"\%") if re.fullmatch(r"-?[0-9./%]+|-?\\infty ", text) else _text(text)
        case m.Sym(text=text):
            return _SYMBOLS.get(text) or f" {_glyph(text)} "
        case m.Words(text=text) | m.Hole(name=text):
            return _text(text)
        case m.Gap(width=gap):
            return r"\," if gap == "thin" else r"\quad "
        case m.Row(items=items):
            return _row(items)
        case m.Frac(top=top, bottom=bottom):
            return rf"\frac{{{latex(top)}}}{{{latex(bottom)}}}"
        case m.Root(body=body):
            return rf"\sqrt{{{latex(body)}}}"
        case m.Accent(mark=mark, body=body):
            return rf"\{mark}{{{latex(body)}}}"
        case m.Script():
            return _script(node)
        case m.Fence():
            return _fence(node)
        case m.Cases(rows=rows):
            return _environment("dcases" if _has_big(node) else "cases", rows)
        case m.Matrix(rows=rows):
            return _environment("pmatrix", rows)
        case m.Arrow(over=over):
            return rf" \xrightarrow{{{latex(over)}}} "
        case m.Big(symbol=symbol, sub=sub, sup=sup):
            name = {"∑": r"\sum", "∏": r"\prod"}.get(symbol, _glyph(symbol))
            limits = "".join(f"{mark}{{{latex(x)}}}" for mark, x in (("_", sub), ("^", sup)) if x is not None)
            return f"{name}{limits} "
        case _:
            assert_never(node)


def _text(text: str) -> str:
    return rf"\text{{{escape(text)}}}"


def _ident(node: m.Ident) -> str:
    text = node.text
    if node.style == "blackboard" and text == "1":
        return r"\taskspecone "  # amssymb's blackboard letters have no figures; the document defines this one
    if node.style == "upright":
        if text in _NAMES:
            return _NAMES[text]
        if " " in text or "-" in text or not text.isascii():
            return _text(text)
    if node.style == "italic" and len(text) == 1:  # an arrow that names an action is no relation
        return f"{{{_glyph(text)}}}" if text in _RELATIONS else _glyph(text)
    letters = ""
    for char in text:  # anything but plain letters goes through text mode
        if char.isascii() and char.isalnum():
            letters += char
        else:
            letters += _glyph(char) + " " if char in c.TEX_LETTER else _text(char)
    return rf"{_STYLE[node.style]}{{{letters}}}"


def _row(items: tuple[m.Math, ...]) -> str:
    out = ""
    breaks = m.width(m.Row(items)) > LONG
    for item in items:
        piece = _write(item)
        if breaks and item == m.Sym(","):
            piece += r"\allowbreak "
        if piece[:1].isalpha() and re.search(r"\\[A-Za-z]+$", out):
            out += " "  # a command's name ends here
        out += piece
    return re.sub(r" {2,}", " ", out)


def _script(node: m.Script) -> str:
    base = latex(node.base)
    if isinstance(node.base, m.Row | m.Frac | m.Cases | m.Script):
        base = f"{{{base}}}"
    if node.sub is not None:
        base += f"_{_group(latex(node.sub))}"
    if node.sup is None:
        return base + "'" * node.primes
    sup = latex(node.sup)
    if node.primes:  # TeX takes primes and superscript in one: x'^2
        return rf"{base}^{{\prime {sup}}}"
    return f"{base}^{_group(sup)}"


def _group(text: str) -> str:
    return text if len(text) == 1 else f"{{{text}}}"


def _fence(node: m.Fence) -> str:
    left = c.LEFT_TEX.get(node.left, node.left)
    right = c.RIGHT_TEX.get(node.right, node.right)
    inner = latex(node.body)
    if m.is_tall(node.body) or "" in (node.left, node.right):
        return rf"\left{left or '.'} {inner} \right{right or '.'}"
    if left[-1].isalpha():  # a command
        left = f"{left} "
    if right[-1].isalpha():
        right = f" {right} "
    return f"{left}{inner}{right}"


def _environment(name: str, rows: tuple[tuple[m.Math, ...], ...]) -> str:
    lines = r" \\ ".join(" & ".join(map(latex, line)) for line in rows)
    return rf"\begin{{{name}}} {lines} \end{{{name}}}"


def _has_big(node: m.Math) -> bool:
    return isinstance(node, m.Big) or any(map(_has_big, m.children(node)))
