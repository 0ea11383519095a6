"""The mathematics tree as LaTeX (amsmath, amssymb, mathtools) and as MathML Core."""

from __future__ import annotations

import html
import re
import unicodedata
from collections.abc import Sequence
from typing import assert_never

from taskspec.show.printers import tex as c
from taskspec.show.printers import tree as m
from taskspec.show.printers.text import plain

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
LONG = 16.0  # from this width on, in letters, a list may break after its commas
_RELATIONS = frozenset(c.TEX_SYMBOL) - {"∞"}
_NAMES = {"arg min": r"\arg\min ", "arg max": r"\arg\max "} | {name: rf"\{name} " for name in c.FUNCTIONS}
_LOWERED = '<mpadded voffset="-0.45em" height="0.2em"><mstyle scriptlevel="-1">{}</mstyle></mpadded>'
"""A prime above an index: a superscript would raise the sign twice, and make it small."""
_SYMBOLS = {"mod": r" \bmod ", ",": ", ", ";": "; ", "′": "'"}


def escape(text: str) -> str:
    """Escape text for LaTeX's text mode: every special character is written out, nothing can become a command."""
    return "".join(map(_character, text))


def _character(char: str) -> str:
    if char in _SPECIAL:
        return _SPECIAL[char]
    if char.isascii():
        if char.isprintable() or char in "\t\n":
            return char
        return f"[U+{ord(char):04X}]"
    if char in c.TEX_LETTER or (char in c.TEX_SYMBOL and c.TEX_SYMBOL[char].isalpha()):
        return rf"\ensuremath{{{_glyph(char)}}}"
    if "\u00a1" <= char <= "\u017f":  # what T1 fonts hold
        return char
    simpler = unicodedata.normalize("NFKD", char).encode("ascii", "ignore").decode()
    if simpler:
        return escape(simpler)
    return f"[U+{ord(char):04X}]"


def _glyph(char: str) -> str:
    name = c.TEX_LETTER.get(char) or c.TEX_SYMBOL.get(char)
    if name is not None:
        if name.isalpha():
            return rf"\{name}"
        return name
    if char in _MATH_CHAR:
        return _MATH_CHAR[char]
    # what TeX reads as its own (^^5c is a backslash) goes through text mode, where it is written out
    plain = char.isascii() and char.isprintable() and char not in _SPECIAL
    if plain or char in "<>'":
        return char
    return rf"\text{{{_character(char)}}}"


def latex(node: m.Math) -> str:
    return _tex(node).strip()


def _tex(node: m.Math) -> str:  # noqa: C901, PLR0912
    match node:
        case m.Ident():
            return _ident(node)
        case m.Num(text=text):
            text = text.replace("−", "-").replace("∞", r"\infty ")
            if re.fullmatch(r"-?[0-9./%]+|-?\\infty ", text):
                return text.replace("%", r"\%")
            return _text(text)
        case m.Sym(text=text):
            return _SYMBOLS.get(text) or f" {_glyph(text)} "
        case m.Words(text=text) | m.Hole(name=text):
            return _text(text)
        case m.Gap(width=gap):
            if gap == "thin":
                return r"\,"
            return r"\quad "
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
            name = "dcases" if m.Big in map(type, m.parts(node)) else "cases"
            return _environment(name, rows)
        case m.Matrix(rows=rows):
            return _environment("pmatrix", rows)
        case m.Arrow(over=over):
            return rf" \xrightarrow{{{latex(over)}}} "
        case m.Big(symbol=symbol, sub=sub, sup=sup):
            written = {"∑": r"\sum", "∏": r"\prod"}.get(symbol, _glyph(symbol))
            if sub is not None:
                written += f"_{{{latex(sub)}}}"
            if sup is not None:
                written += f"^{{{latex(sup)}}}"
            return f"{written} "
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
        if text in _RELATIONS:
            return f"{{{_glyph(text)}}}"
        return _glyph(text)
    letters = ""
    for char in text:  # anything but plain letters goes through text mode
        if char.isascii() and char.isalnum():
            letters += char
        elif char in c.TEX_LETTER:
            letters += f"{_glyph(char)} "
        else:
            letters += _text(char)
    return rf"{_STYLE[node.style]}{{{letters}}}"


def _row(items: tuple[m.Math, ...]) -> str:
    out = ""
    breaks = m.width(m.Row(items)) > LONG
    for item in items:
        piece = _tex(item)
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
    if len(text) == 1:
        return text
    return f"{{{text}}}"


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


_FENCES = frozenset("()[]{}|‖⌊⌋⌈⌉⟨⟩")
_EN = '<mspace width="0.5em"/>'
_OPERATORS = {
    "mod": '<mo lspace="0.28em" rspace="0.28em">mod</mo>', "…": "<mi>…</mi>", "/": '<mo lspace="0" rspace="0">/</mo>',
    "⋅": '<mo lspace="0.15em" rspace="0.15em">⋅</mo>',
}  # fmt: skip


def mathml(node: m.Math, block: bool = False) -> str:
    """Write a `<math>` element; its alternative text is the plain form."""
    display = ' display="block"' * block
    return f'<math{display} alttext="{html.escape(plain(node))}">{_element(node)}</math>'


def _element(node: m.Math) -> str:  # noqa: C901, PLR0912
    match node:
        case m.Ident():
            return _identifier(node)
        case m.Num(text=text):
            return f"<mn>{html.escape(text)}</mn>"
        case m.Sym(text=text):
            if text in _FENCES:
                return f'<mo fence="true" stretchy="false">{text}</mo>'
            return _OPERATORS.get(text) or f"<mo>{html.escape(text)}</mo>"
        case m.Words(text=text):
            # not <mtext>: a row of texts and one sign would count as an operator, and lose the space around the sign
            return f'<mi mathvariant="normal">{html.escape(_held(text))}</mi>'
        case m.Gap(width=gap):
            size = {"thin": "0.17em", "wide": "1em"}[gap]
            return f'<mspace width="{size}"/>'
        case m.Row(items=items):
            return f"<mrow>{''.join(map(_element, items))}</mrow>"
        case m.Frac(top=top, bottom=bottom):
            return f"<mfrac>{_element(top)}{_element(bottom)}</mfrac>"
        case m.Root(body=body):
            return f"<msqrt>{_element(body)}</msqrt>"
        case m.Accent(mark=mark, body=body):
            return f'<mover accent="true">{_element(body)}<mo stretchy="false">{c.ACCENTS[mark][0]}</mo></mover>'
        case m.Script(base=base, sub=sub, sup=sup, primes=primes):
            return _primed(base, sub, sup, primes)
        case m.Fence(left=left, body=body, right=right):
            return _fenced(left, _element(body), right, m.is_tall(body))
        case m.Cases(rows=rows):
            return _fenced("{", _table(rows, ' class="cases"'), "")
        case m.Matrix(rows=rows):
            return _fenced("(", _table(rows), ")")
        case m.Arrow(over=over):
            return f'<mover><mo stretchy="false">⟶</mo><mrow>{_EN}{_element(over)}{_EN}</mrow></mover>'
        case m.Big(symbol=symbol, sub=sub, sup=sup):
            above = _element(sup) if sup is not None else None
            return _scripted("under", "over", f"<mo>{html.escape(symbol)}</mo>", sub, above)
        case m.Hole(name=name):
            return f"<mtext>{html.escape(name)}</mtext>"
        case _:
            assert_never(node)


def _held(text: str) -> str:
    """Keep spaces at the ends of words, which MathML would drop."""
    inner = text.strip(" ")
    if not inner:
        return "\u00a0" * len(text)
    before, after = text.split(inner)
    return "\u00a0" * len(before) + inner + "\u00a0" * len(after)


def _identifier(node: m.Ident) -> str:
    text = html.escape(node.text)
    match node.style:
        case "blackboard":
            return f'<mi mathvariant="normal">{c.BLACKBOARD.get(node.text, text)}</mi>'
        case "calligraphic":
            return f'<mi mathvariant="normal">{c.CALLIGRAPHIC.get(node.text, text)}</mi>'
        case "upright" if len(node.text) == 1:
            return f'<mi mathvariant="normal">{text}</mi>'
        case "bold":
            return f'<mi class="bold">{text}</mi>'
        case "typewriter":
            return f"<mtext><code>{text}</code></mtext>"
        case _:
            return f"<mi>{text}</mi>"


def _fenced(left: str, inner: str, right: str, grows: bool = True) -> str:
    fixed = ' stretchy="false"' * (not grows)
    if left:
        inner = f'<mo fence="true" form="prefix"{fixed}>{html.escape(left)}</mo>{inner}'
    if right:
        inner += f'<mo fence="true" form="postfix"{fixed}>{html.escape(right)}</mo>'
    return f"<mrow>{inner}</mrow>"


def _primed(base: m.Math, sub: m.Math | None, sup: m.Math | None, primes: int) -> str:
    """Set scripts and primes; a prime without an index stands beside the base, as the sign is as high as a superscript."""
    inner = _element(base)
    above = _element(sup) if sup is not None else None
    if primes:
        marks = f'<mo lspace="0" rspace="0">{"′" * primes}</mo>'
        if sub is None or above is not None:
            inner = f"<mrow>{inner}{marks}</mrow>"
        else:
            above = _LOWERED.format(marks)
    return _scripted("sub", "sup", inner, sub, above)


def _scripted(below: str, above: str, base: str, sub: m.Math | None, sup: str | None) -> str:
    """Set scripts below and above a base; the elements are named `munder`, `msubsup` and so on."""
    if sub is not None and sup is not None:
        return f"<m{below}{above}>{base}{_element(sub)}{sup}</m{below}{above}>"
    if sub is not None:
        return f"<m{below}>{base}{_element(sub)}</m{below}>"
    if sup is None:
        return base
    return f"<m{above}>{base}{sup}</m{above}>"


def _table(rows: Sequence[Sequence[m.Math]], style: str = "") -> str:
    lines = ""
    for row in rows:
        cells = "</mtd><mtd>".join(map(_element, row))
        lines += f"<mtr><mtd>{cells}</mtd></mtr>"
    return f"<mtable{style}>{lines}</mtable>"
