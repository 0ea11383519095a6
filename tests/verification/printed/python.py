"""Text of the language -> surface syntax, through Python's own parser and a translation of its nodes that is the tests' own."""

from __future__ import annotations

import ast
import re

from taskspec.language.expressions import syntax as s
from tests.verification.printed.trees import PLACE

PRIME = "ʹ"
BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**"}
COMPARE = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.In: "in",
    ast.NotIn: "not in",
}
UNARY = {ast.USub: "-", ast.UAdd: "+", ast.Not: "not"}


def read(text: str) -> s.Expr:
    """The tree of a text that `printers.text` wrote."""
    return _expr(ast.parse(re.sub(r"(?<=\w)'", PRIME, text), mode="eval").body)


def _all(nodes: list[ast.expr]) -> tuple[s.Expr, ...]:
    return tuple(map(_expr, nodes))


def _expr(node: ast.expr) -> s.Expr:
    match node:
        case ast.Constant(value=bool(value)):
            return s.Boolean(value, PLACE)
        case ast.Constant(value=str(value)):
            return s.Quoted(value, PLACE)
        case ast.Constant(value=int(value) | float(value)):
            return s.Number(value, repr(value), PLACE)
        case ast.Name(id=name):
            return s.Name(name.rstrip(PRIME), name.endswith(PRIME), PLACE)
        case ast.UnaryOp(op=op, operand=x):
            return s.Unary(UNARY[type(op)], _expr(x), PLACE)
        case ast.BinOp(left=a, op=op, right=b):
            return s.Binary(BINARY[type(op)], _expr(a), _expr(b), PLACE)
        case ast.BoolOp(op=op, values=values):
            return s.Logical("and" if isinstance(op, ast.And) else "or", _all(values), PLACE)
        case ast.Compare(left=a, ops=ops, comparators=others):
            return s.Compare(_expr(a), tuple(zip((COMPARE[type(o)] for o in ops), _all(others), strict=True)), PLACE)
        case ast.IfExp(test=c, body=a, orelse=b):
            return s.IfElse(_expr(c), _expr(a), _expr(b), PLACE)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return s.Call(name, _all(args), (), PLACE, PLACE)
        case ast.Subscript(value=x, slice=ast.Tuple(elts=items)):
            return s.Subscript(_expr(x), tuple(map(_index, items)), PLACE)
        case ast.Subscript(value=x, slice=item):
            return s.Subscript(_expr(x), (_index(item),), PLACE)
        case ast.Tuple(elts=items) | ast.List(elts=items):
            return s.Vector(_all(items), PLACE)
        case ast.Set(elts=items):
            return s.SetOf(_all(items), PLACE)
        case ast.Dict(keys=keys, values=values):
            return s.Weights(tuple(zip(_all(keys), _all(values), strict=True)), PLACE)  # type: ignore[arg-type]
        case ast.SetComp(elt=x, generators=clauses) | ast.ListComp(elt=x, generators=clauses):
            return s.Comprehension(_expr(x), tuple(map(_clause, clauses)), isinstance(node, ast.SetComp), PLACE)
    raise AssertionError(ast.dump(node))


def _index(node: ast.expr) -> s.Expr | s.Slice:
    if not isinstance(node, ast.Slice):
        return _expr(node)
    return s.Slice(*(None if x is None else _expr(x) for x in (node.lower, node.upper, node.step)), PLACE)


def _clause(node: ast.comprehension) -> s.Clause:
    assert isinstance(node.target, ast.Name)
    return s.Clause((node.target.id,), _expr(node.iter), _all(node.ifs))
