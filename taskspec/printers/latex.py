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
    "upright": r"\mathrm", "bold": r"\mathbf", "blackboard": r"\mathbb", "calligraphic": r"\mathcal",
    "typewriter": r"\mathtt",
}  # fmt: skip
_MATH_CHAR = {"{": r"\{", "}": r"\}", "#": r"\#", "%": r"\%", "&": r"\&", "$": r"\$", "‖": r"\Vert ", "|": r"\vert ",
              "≢": r"\not\equiv "}  # fmt: skip
_WORD = re.compile(r"[A-Za-z0-9]+")
LONG = 16.0
"""From this width on, in letters, a list may break after its commas."""
_RELATIONS = frozenset(c.TEX_SYMBOL) - {"∞"}
_NAMES = {"arg min": r"\arg\min", "arg max": r"\arg\max"}


def escape(text: str) -> str:
    """Return text for LaTeX's text mode: every special character is written out, nothing can become a command."""
    return "".join(_character(char) for char in text)


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
    if char in c.TEX_LETTER:
        return rf"\{c.TEX_LETTER[char]}"
    if char in c.TEX_SYMBOL:
        name = c.TEX_SYMBOL[char]
        return rf"\{name}" if name.isalpha() else name
    if char in _MATH_CHAR:
        return _MATH_CHAR[char]
    # what TeX reads as its own (^^5c is a backslash) goes through text mode, where it is written out
    plain = char.isascii() and char.isprintable() and char not in _SPECIAL
    return char if plain or char in "<>'" else rf"\text{{{_character(char)}}}"


def latex(node: m.Math) -> str:
    """Return LaTeX of a tree, for math mode."""
    return _write(node).strip()


def _write(node: m.Math) -> str:
    match node:
        case m.Ident():
            return _ident(node)
        case m.Num(text=text):
            return _number(text)
        case m.Sym(text=text):
            return _symbol(text)
        case m.Words(text=text):
            return rf"\text{{{escape(text)}}}"
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
        case m.Big():
            return _big(node)
        case m.Hole(name=name):
            return rf"\text{{{escape(name)}}}"
        case _:
            assert_never(node)


def _ident(node: m.Ident) -> str:
    text = node.text
    style = node.style
    if style == "blackboard":
        # amssymb's blackboard letters have no figures; the document defines this one
        return r"\taskspecone " if text == "1" else rf"\mathbb{{{_safe(text)}}}"
    if style == "upright" and text in c.FUNCTIONS:
        return rf"\{text} "
    if style == "upright" and text in _NAMES:
        return f"{_NAMES[text]} "
    if style == "italic":
        if len(text) == 1:  # an arrow that names an action is no relation
            return f"{{{_glyph(text)}}}" if text in _RELATIONS else _glyph(text)
        return rf"\mathit{{{_safe(text)}}}"
    if style == "upright" and (" " in text or "-" in text or not text.isascii()):
        return rf"\text{{{escape(text)}}}"
    return rf"{_STYLE[style]}{{{_safe(text)}}}"


def _safe(text: str) -> str:
    """Return letters of a name in mathematics; anything else goes through text mode."""
    return (
        text
        if _WORD.fullmatch(text)
        else "".join(x if x.isascii() and x.isalnum() else _glyph_or_text(x) for x in text)
    )


def _glyph_or_text(char: str) -> str:
    return _glyph(char) + " " if char in c.TEX_LETTER else rf"\text{{{_character(char)}}}"


def _number(text: str) -> str:
    """Return digits as they are."""
    text = text.replace("−", "-").replace("∞", r"\infty ")
    return text.replace("%", r"\%") if re.fullmatch(r"-?[0-9./%]+|-?\\infty ", text) else rf"\text{{{escape(text)}}}"


def _symbol(text: str) -> str:
    if text == "mod":
        return r" \bmod "
    if text in ",;":
        return f"{text} "
    if text == "′":
        return "'"
    return f" {_glyph(text)} "


def _row(items: tuple[m.Math, ...]) -> str:
    out = ""
    breaks = m.width(m.Row(items)) > LONG
    for item in items:
        piece = _write(item)
        if breaks and item == m.Sym(","):
            piece += r"\allowbreak "
        if out and out[-1].isalpha() and piece[:1].isalpha() and re.search(r"\\[A-Za-z]+$", out):
            out += " "  # a command's name ends here
        out += piece
    return re.sub(r" {2,}", " ", out)


def _script(node: m.Script) -> str:
    base = latex(node.base)
    if isinstance(node.base, m.Row | m.Frac | m.Cases | m.Script):
        base = f"{{{base}}}"
    sub = f"_{_group(node.sub)}" if node.sub is not None else ""
    # TeX takes primes and superscript in one: x'^2
    sup = f"^{_group(node.sup)}" if node.sup is not None else ""
    if sup and node.primes:
        sup = f"^{{{chr(92) + 'prime'} {latex(node.sup) if node.sup is not None else ''}}}"
        return f"{base}{sub}{sup}"
    return f"{base}{sub}{chr(39) * node.primes}{sup}"


def _group(node: m.Math | None) -> str:
    text = latex(node) if node is not None else ""
    return text if len(text) == 1 else f"{{{text}}}"


def _fence(node: m.Fence) -> str:
    left, right = (table.get(side, side) for table, side in
                   ((c.LEFT_TEX, node.left), (c.RIGHT_TEX, node.right)))  # fmt: skip
    inner = latex(node.body)
    if m.is_tall(node.body) or "" in (node.left, node.right):
        return rf"\left{left or '.'} {inner} \right{right or '.'}"
    opening = f"{left} " if left.startswith("\\") and left[-1].isalpha() else left
    closing = rf" {right}" if right.startswith("\\") and right[-1].isalpha() else right
    return f"{opening}{inner}{closing} " if closing[-1].isalpha() else f"{opening}{inner}{closing}"


def _environment(name: str, rows: tuple[tuple[m.Math, ...], ...]) -> str:
    lines = r" \\ ".join(" & ".join(latex(cell) for cell in line) for line in rows)
    return rf"\begin{{{name}}} {lines} \end{{{name}}}"


def _big(node: m.Big) -> str:
    name = {"∑": r"\sum", "∏": r"\prod"}.get(node.symbol, _glyph(node.symbol))
    sub = f"_{{{latex(node.sub)}}}" if node.sub is not None else ""
    sup = f"^{{{latex(node.sup)}}}" if node.sup is not None else ""
    return f"{name}{sub}{sup} "


def _has_big(node: m.Math) -> bool:
    return isinstance(node, m.Big) or any(_has_big(child) for child in m.children(node))
