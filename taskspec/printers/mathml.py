"""The mathematics tree -> MathML Core, as browsers draw it without scripts."""

from __future__ import annotations

from html import escape
from typing import assert_never

from taskspec.printers import tex as c
from taskspec.printers import tree as m
from taskspec.printers.text import plain

_FENCES = frozenset("()[]{}|‖⌊⌋⌈⌉⟨⟩")
_DISPLAY = ' display="block"'


def mathml(node: m.Math, block: bool = False) -> str:
    """Return a `<math>` element; its alternative text is the plain form."""
    display = _DISPLAY if block else ""
    alt = escape(plain(node), quote=True)
    return f'<math{display} alttext="{alt}">{_write(node)}</math>'


_EN = '<mspace width="0.5em"/>'


def _write(node: m.Math) -> str:
    match node:
        case m.Ident():
            return _ident(node)
        case m.Num(text=text):
            return f"<mn>{escape(text)}</mn>"
        case m.Sym(text=text):
            return _symbol(text)
        case m.Words(text=text):
            # not <mtext>: a row of texts and one sign would count as an operator, and lose the space around the sign
            return f'<mi mathvariant="normal">{escape(_held(text))}</mi>'
        case m.Gap(width=gap):
            return f'<mspace width="{"0.17em" if gap == "thin" else "1em"}"/>'
        case m.Row(items=items):
            return f"<mrow>{_items(items)}</mrow>"
        case m.Frac(top=top, bottom=bottom):
            return f"<mfrac>{_write(top)}{_write(bottom)}</mfrac>"
        case m.Root(body=body):
            return f"<msqrt>{_write(body)}</msqrt>"
        case m.Accent(mark=mark, body=body):
            return f'<mover accent="true">{_write(body)}<mo stretchy="false">{c.ACCENTS[mark][0]}</mo></mover>'
        case m.Script():
            return _script(node)
        case m.Fence(left=left, body=body, right=right):
            grows = m.is_tall(body)
            return (
                f"<mrow>{_delimiter(left, 'prefix', grows)}{_write(body)}{_delimiter(right, 'postfix', grows)}</mrow>"
            )
        case m.Cases(rows=rows):
            return f"<mrow>{_delimiter('{', 'prefix')}{_table(rows, 'cases')}</mrow>"
        case m.Matrix(rows=rows):
            return f"<mrow>{_delimiter('(', 'prefix')}{_table(rows)}{_delimiter(')', 'postfix')}</mrow>"
        case m.Arrow(over=over):
            return f'<mover><mo stretchy="false">⟶</mo><mrow>{_EN}{_write(over)}{_EN}</mrow></mover>'
        case m.Big():
            return _big(node)
        case m.Hole(name=name):
            return f"<mtext>{escape(name)}</mtext>"
        case _:
            assert_never(node)


def _items(items: tuple[m.Math, ...]) -> str:
    """Return neighbours, with the invisible gap after a function's name."""
    return "".join(_write(item) for item in items)


def _held(text: str) -> str:
    """Keep spaces at the ends of words, which MathML would drop."""
    inner = text.strip(" ")
    lead = text[: len(text) - len(text.lstrip(" "))]
    tail = text[len(text.rstrip(" ")) :]
    return "\u00a0" * len(lead) + inner + "\u00a0" * (len(tail) if inner else 0)


def _ident(node: m.Ident) -> str:
    text = node.text
    match node.style:
        case "blackboard":
            return f'<mi mathvariant="normal">{escape(c.BLACKBOARD.get(text, text))}</mi>'
        case "calligraphic":
            return f'<mi mathvariant="normal">{escape(c.CALLIGRAPHIC.get(text, text))}</mi>'
        case "upright":
            variant = ' mathvariant="normal"' if len(text) == 1 else ""
            return f"<mi{variant}>{escape(text)}</mi>"
        case "bold":
            return f'<mi class="bold">{escape(text)}</mi>'
        case "typewriter":
            return f"<mtext><code>{escape(text)}</code></mtext>"
        case _:
            return f"<mi>{escape(text)}</mi>"


def _symbol(text: str) -> str:
    if text == "mod":
        return '<mo lspace="0.28em" rspace="0.28em">mod</mo>'
    if text in _FENCES:
        return f'<mo fence="true" stretchy="false">{escape(text)}</mo>'
    if text == "…":
        return "<mi>…</mi>"
    if text == "/":
        return '<mo lspace="0" rspace="0">/</mo>'
    if text == "⋅":
        return '<mo lspace="0.15em" rspace="0.15em">⋅</mo>'
    return f"<mo>{escape(text)}</mo>"


def _delimiter(text: str, form: str, grows: bool = True) -> str:
    fixed = "" if grows else ' stretchy="false"'
    return f'<mo fence="true" form="{form}"{fixed}>{escape(text)}</mo>' if text else ""


def _script(node: m.Script) -> str:
    base = _write(node.base)
    above = f'<mo lspace="0" rspace="0">{"′" * node.primes}</mo>' if node.primes else ""
    sup = above or None
    if node.sup is not None:
        sup = f"<mrow>{above}{_write(node.sup)}</mrow>" if above else _write(node.sup)
    if node.sub is not None and sup is not None:
        return f"<msubsup>{base}{_write(node.sub)}{sup}</msubsup>"
    if node.sub is not None:
        return f"<msub>{base}{_write(node.sub)}</msub>"
    return f"<msup>{base}{sup}</msup>" if sup is not None else base


def _big(node: m.Big) -> str:
    sign = f"<mo>{escape(node.symbol)}</mo>"
    match node.sub, node.sup:
        case None, None:
            return sign
        case sub, None if sub is not None:
            return f"<munder>{sign}{_write(sub)}</munder>"
        case None, sup if sup is not None:
            return f"<mover>{sign}{_write(sup)}</mover>"
        case sub, sup:
            assert sub is not None and sup is not None
            return f"<munderover>{sign}{_write(sub)}{_write(sup)}</munderover>"


def _table(rows: tuple[tuple[m.Math, ...], ...], kind: str = "") -> str:
    style = ' class="cases"' if kind else ""
    lines = "".join(f"<mtr>{''.join(f'<mtd>{_write(cell)}</mtd>' for cell in line)}</mtr>" for line in rows)
    return f"<mtable{style}>{lines}</mtable>"
