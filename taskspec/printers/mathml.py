"""The mathematics tree -> MathML Core, as browsers draw it without scripts."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import assert_never

from taskspec.printers import tex as c
from taskspec.printers import tree as m
from taskspec.printers.text import plain

_FENCES = frozenset("()[]{}|‖⌊⌋⌈⌉⟨⟩")
_EN = '<mspace width="0.5em"/>'
_SYMBOLS = {
    "mod": '<mo lspace="0.28em" rspace="0.28em">mod</mo>', "…": "<mi>…</mi>", "/": '<mo lspace="0" rspace="0">/</mo>',
    "⋅": '<mo lspace="0.15em" rspace="0.15em">⋅</mo>',
}  # fmt: skip


def mathml(node: m.Math, block: bool = False) -> str:
    """Return a `<math>` element; its alternative text is the plain form."""
    display = ' display="block"' if block else ""
    return f'<math{display} alttext="{escape(plain(node))}">{_write(node)}</math>'


def _write(node: m.Math) -> str:  # noqa: C901, PLR0912
    match node:
        case m.Ident():
            return _ident(node)
        case m.Num(text=text):
            return f"<mn>{escape(text)}</mn>"
        case m.Sym(text=text):
            if text in _FENCES:
                return f'<mo fence="true" stretchy="false">{text}</mo>'
            return _SYMBOLS.get(text) or f"<mo>{escape(text)}</mo>"
        case m.Words(text=text):
            # not <mtext>: a row of texts and one sign would count as an operator, and lose the space around the sign
            return f'<mi mathvariant="normal">{escape(_held(text))}</mi>'
        case m.Gap(width=gap):
            return f'<mspace width="{"0.17em" if gap == "thin" else "1em"}"/>'
        case m.Row(items=items):
            return f"<mrow>{''.join(map(_write, items))}</mrow>"
        case m.Frac(top=top, bottom=bottom):
            return f"<mfrac>{_write(top)}{_write(bottom)}</mfrac>"
        case m.Root(body=body):
            return f"<msqrt>{_write(body)}</msqrt>"
        case m.Accent(mark=mark, body=body):
            return f'<mover accent="true">{_write(body)}<mo stretchy="false">{c.ACCENTS[mark][0]}</mo></mover>'
        case m.Script():
            return _script(node)
        case m.Fence(left=left, body=body, right=right):
            return _fenced(left, _write(body), right, m.is_tall(body))
        case m.Cases(rows=rows):
            return _fenced("{", _table(rows, ' class="cases"'), "")
        case m.Matrix(rows=rows):
            return _fenced("(", _table(rows), ")")
        case m.Arrow(over=over):
            return f'<mover><mo stretchy="false">⟶</mo><mrow>{_EN}{_write(over)}{_EN}</mrow></mover>'
        case m.Big(symbol=symbol, sub=sub, sup=sup):
            above = None if sup is None else _write(sup)
            return _scripted("under", "over", f"<mo>{escape(symbol)}</mo>", sub, above)
        case m.Hole(name=name):
            return f"<mtext>{escape(name)}</mtext>"
        case _:
            assert_never(node)


def _held(text: str) -> str:
    """Keep spaces at the ends of words, which MathML would drop."""
    inner = text.strip(" ")
    if not inner:
        return "\u00a0" * len(text)
    before, after = text.split(inner)
    return "\u00a0" * len(before) + inner + "\u00a0" * len(after)


def _ident(node: m.Ident) -> str:
    text = escape(node.text)
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
    fixed = "" if grows else ' stretchy="false"'
    if left:
        inner = f'<mo fence="true" form="prefix"{fixed}>{escape(left)}</mo>{inner}'
    if right:
        inner += f'<mo fence="true" form="postfix"{fixed}>{escape(right)}</mo>'
    return f"<mrow>{inner}</mrow>"


def _script(node: m.Script) -> str:
    sup = None if node.sup is None else _write(node.sup)
    if node.primes:
        primes = f'<mo lspace="0" rspace="0">{"′" * node.primes}</mo>'
        sup = primes if sup is None else f"<mrow>{primes}{sup}</mrow>"
    return _scripted("sub", "sup", _write(node.base), node.sub, sup)


def _scripted(below: str, above: str, base: str, sub: m.Math | None, sup: str | None) -> str:
    """Return a base with what stands below and above; the names of the elements are `munder`, `msubsup` and so on."""
    if sub is not None and sup is not None:
        return f"<m{below}{above}>{base}{_write(sub)}{sup}</m{below}{above}>"
    if sub is not None:
        return f"<m{below}>{base}{_write(sub)}</m{below}>"
    return base if sup is None else f"<m{above}>{base}{sup}</m{above}>"


def _table(rows: Sequence[Sequence[m.Math]], style: str = "") -> str:
    lines = ""
    for row in rows:
        cells = "".join(f"<mtd>{_write(cell)}</mtd>" for cell in row)
        lines += f"<mtr>{cells}</mtr>"
    return f"<mtable{style}>{lines}</mtable>"
