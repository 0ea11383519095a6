"""Surface syntax and mathematics as plain text: expressions that parse again, and formulas as a line of Unicode."""

from __future__ import annotations

from collections.abc import Iterable
from typing import assert_never

from taskspec.language.expressions import syntax as s
from taskspec.show.printers import tex as c
from taskspec.show.printers import tree as m
from taskspec.show.printers.pieces import NAME, TEXT

_TIGHT = frozenset("()[]{}|‖′!")
_AFTER = frozenset(",;:")
_DIVIDES = (m.Sym("mod"), m.Sym("/"))
_MULTIPLIES = (*_DIVIDES, m.Sym("⋅"), m.Sym("⊙"), m.Sym("×"))
_SUB = str.maketrans("0123456789+-=()aehijklmnoprstuvx", "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ")
_SUP = str.maketrans("0123456789+-−=()n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁻⁼⁽⁾ⁿ")


def text(expr: s.Expr) -> str:
    """Write an expression as text; lists and tables that only YAML can write become conditionals."""
    return _write(expr)[0]


def _operands(operator: str, *exprs: s.Expr) -> list[str]:
    rule = TEXT[operator]
    parts = []
    for i, expr in enumerate(exprs):
        written, level = _write(expr)
        if level < rule.operand(i):
            written = f"({written})"
        parts.append(written)
    return parts


def _write(expr: s.Expr) -> tuple[str, int]:  # noqa: C901, PLR0912
    match expr:
        case s.Number(text=written):
            return written, NAME
        case s.Boolean(value=value):
            return str(value), NAME
        case s.Quoted(value=value):
            quote = '"'
            if quote in value:
                quote = "'"
            return f"{quote}{value}{quote}", NAME
        case s.Name():
            return expr.written, NAME
        case s.Unary(op="not", operand=operand):
            return f"not {_operands('not', operand)[0]}", TEXT["not"].own
        case s.Unary(op=op, operand=operand):
            return f"{op}{_operands('sign', operand)[0]}", TEXT["sign"].own
        case s.Binary(op=op, left=left, right=right):
            sign = f" {op} ".replace(" ** ", "**")
            return sign.join(_operands(op, left, right)), TEXT[op].own
        case s.Logical(op=op, operands=operands):
            return f" {op} ".join(_operands(op, *operands)), TEXT[op].own
        case s.Compare(first=first, rest=rest):
            written, *sides = _operands("compare", first, *(side for _, side in rest))
            for (op, _), side in zip(rest, sides, strict=True):
                written += f" {op} {side}"
            return written, TEXT["compare"].own
        case s.IfElse(condition=c, then=then, otherwise=otherwise):
            value, condition, other = _operands("if", then, c, otherwise)
            return f"{value} if {condition} else {other}", TEXT["if"].own
        case s.Call(function=function, args=args, keywords=keywords):
            arguments = [*map(text, args), *(f"{name}={text(value)}" for name, value in keywords)]
            return f"{function}({', '.join(arguments)})", NAME
        case s.Subscript(value=value, indices=indices):
            (base,) = _operands("subscript", value)
            if isinstance(value, s.Number):
                base = f"({base})"
            return f"{base}[{', '.join(map(_index, indices))}]", NAME
        case s.Vector() | s.SetOf() | s.Weights() | s.Comprehension():
            return _display(expr), NAME
        case s.Piecewise(branches=branches, otherwise=otherwise):
            return _write(_conditional(branches, otherwise, expr.place))
        case s.Table():
            return _write(_as_conditional(expr.by, expr.rows, expr.place))
        case _:
            assert_never(expr)


def _index(index: s.Expr | s.Slice) -> str:
    if isinstance(index, s.Vector):  # round brackets would make it several indices
        return f"[{', '.join(map(text, index.items))}]"
    if not isinstance(index, s.Slice):
        return text(index)
    written = ""
    if index.start is not None:
        written += text(index.start)
    written += ":"
    if index.stop is not None:
        written += text(index.stop)
    if index.step is not None:
        written += f":{text(index.step)}"
    return written


def _display(expr: s.Vector | s.SetOf | s.Weights | s.Comprehension) -> str:
    match expr:
        case s.Vector(items=items):
            inner = ", ".join(map(text, items))
            if len(items) < 2:
                return f"[{inner}]"
            return f"({inner})"
        case s.SetOf(items=items):
            return f"{{{', '.join(map(text, items))}}}"
        case s.Weights(pairs=pairs):
            entries = [f"{text(value)}: {text(p)}" for value, p in pairs]
            return f"{{{', '.join(entries)}}}"
        case s.Comprehension(element=element, clauses=clauses, is_set=is_set):
            inner = text(element)
            for clause in clauses:
                written = _operands("clause", clause.domain, *clause.conditions)
                inner += f" for {', '.join(clause.targets)} in {' if '.join(written)}"
            if is_set:
                return f"{{{inner}}}"
            return f"[{inner}]"


def _conditional(branches: tuple[tuple[s.Expr, s.Expr], ...], otherwise: s.Expr, place: s.Place) -> s.Expr:
    result = otherwise
    for condition, value in reversed(branches):
        result = s.IfElse(condition, value, result, place)
    return result


def _as_conditional(by: tuple[s.Expr, ...], rows: tuple[s.TableRow, ...], place: s.Place) -> s.Expr:
    """Write a table as nested conditionals; without an `else` row, the last row is one."""
    branches = []
    last = None
    for row in rows:
        body = row.body
        if isinstance(body, tuple):
            body = _as_conditional(by[1:], body, place)
        if row.key is None:
            last = body
        else:
            branches.append((s.Compare(by[0], (("==", row.key),), place), body))
    if last is None:
        _, last = branches.pop()
    return _conditional(tuple(branches), last, place)


def plain(node: m.Math) -> str:  # noqa: C901, PLR0912
    match node:
        case m.Ident(text=text, style="blackboard"):
            return c.BLACKBOARD.get(text, text)
        case m.Ident(text=text, style="calligraphic"):
            return c.CALLIGRAPHIC.get(text, text)
        case m.Ident(text=text) | m.Num(text=text) | m.Words(text=text) | m.Hole(name=text):
            return text
        case m.Sym(text=text):
            if text in _TIGHT:
                return text
            if text in _AFTER:
                return f"{text} "
            return f" {text} "
        case m.Gap(width=gap):
            if gap == "thin":
                return " "
            return "  "
        case m.Row(items=items):
            return _row(items)
        case m.Frac(top=top, bottom=bottom):
            return f"{_atom(top)}/{_atom(bottom)}"
        case m.Root(body=body):
            return f"√({plain(body)})"
        case m.Accent(mark=mark, body=body):
            return plain(body) + c.ACCENTS[mark][1]
        case m.Script(base=base, sub=sub, sup=sup, primes=primes):
            return f"{_atom(base)}{'′' * primes}{_small(sub, _SUB, '_')}{_small(sup, _SUP, '^')}"
        case m.Fence(left=left, body=body, right=right):
            return f"{left}{plain(body)}{right}"
        case m.Cases(rows=rows):
            return f"{{ {_rows(rows)} }}"
        case m.Matrix(rows=rows):
            return f"[{_rows(rows)}]"
        case m.Arrow(over=over):
            return f" —{plain(over)}→ "
        case m.Big(symbol=symbol, sub=sub, sup=sup):
            if sub is not None:
                symbol += f"_({plain(sub)})"
            if sup is not None:
                symbol += f"^({plain(sup)})"
            return f"{symbol} "
        case _:
            assert_never(node)


def _rows(rows: Iterable[Iterable[m.Math]]) -> str:
    lines = [" ".join(map(plain, row)).strip() for row in rows]
    return "; ".join(lines)


def _row(items: tuple[m.Math, ...]) -> str:
    texts = []
    for i, item in enumerate(items):
        beside = next((x for x in items[i + 1 :] if not isinstance(x, m.Gap)), None)
        if isinstance(item, m.Frac) and i > 0 and items[i - 1] in _DIVIDES:
            item = m.brackets(item)
        elif beside in _MULTIPLIES or not isinstance(beside, m.Sym | m.Words | None):
            item = _closed(item)
        texts.append(plain(item))
    match items:
        case (m.Sym(text=first), *_) if first in _AFTER:
            texts[0] = texts[0].lstrip()
        case (m.Sym(), *_):
            texts[0] = texts[0].strip()
    return "".join(texts).replace("  ", " ")


def _closed(node: m.Math) -> m.Math:
    """Put the fraction at the end in brackets."""
    if isinstance(node, m.Row) and node.items:
        return m.Row((*node.items[:-1], _closed(node.items[-1])))
    if isinstance(node, m.Frac):
        return m.brackets(node)
    return node


def _atom(node: m.Math) -> str:
    text = plain(node)
    if isinstance(node, m.Ident | m.Num | m.Accent | m.Script | m.Fence):
        return text
    return f"({text})"


def _small(node: m.Math | None, table: dict[int, int], mark: str) -> str:
    """Write scripts in small letters if there are such, else after a mark."""
    if node is None:
        return ""
    text = plain(node)
    raised = text.replace(" ", "").translate(table)
    known = set(map(chr, table.values()))
    if set(raised) <= known and not known & set(text):  # a script of a script would be one with it
        return raised
    if len(text) == 1 or text.isdecimal():
        return f"{mark}{text}"
    return f"{mark}({text})"
