"""Every small change of a source file: another operator, a number off by one, a statement left out.

Passed over is what programs do not depend on: docstrings and messages, annotations, decorators, `__repr__`, assertions, and
what stands under `TYPE_CHECKING`. All changes of a file are numbered, always in the same order.
"""

from __future__ import annotations

import ast
import copy
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Div, ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
}  # fmt: skip
NAMES = {
    "min": "max",
    "any": "all",
    "floor": "ceil",
    "minimum": "maximum",
    "lower": "upper",
    "low": "high",
    "first": "last",
}
NAMES |= {after: before for before, after in NAMES.items()}
NOT_EXCHANGED = (
    "isinstance",
    "issubclass",
    "cast",
    "getattr",
    "min",
    "max",
    "minimum",
    "maximum",
    "gcd",
    "lcm",
    "TypeVar",
)
"""Functions whose arguments are the same the other way round, or of which it would be no more than a crash."""
PROSE = re.compile(r"[A-Za-z]{2,},? [A-Za-z]{2,}")
"""Two words in a row: a text for people."""
TYPE_NAME = re.compile(r"_?[A-Z]")

HEADS = (ast.If, ast.For, ast.While, ast.With, ast.FunctionDef, ast.ClassDef, ast.match_case)
"""What has a first line and a body."""

Index = int | None


@dataclass(frozen=True)
class Mutant:
    """One change: what stood there, and what stands there instead.

    `place` is the function or class around it, `nth` counts changes of one file that read alike, and `span` is the first and the
    last line of the statement.
    """

    file: str
    number: int
    place: str
    line: int
    span: tuple[int, int]
    before: str
    after: str
    nth: int

    @property
    def key(self) -> str:
        """Names it as long as the text around it stays, wherever in the file it moves."""
        return f"{self.file}::{self.place}: {self.before} => {self.after} ({self.nth})"

    def __str__(self) -> str:
        return f"{self.file}:{self.line} in {self.place or 'the module'}: {self.before} => {self.after}"


@dataclass(frozen=True)
class Site:
    """A node in its tree: `holder`'s field, or the element of it, that it stands in; and the nodes around it, outermost first."""

    holder: ast.AST
    field: str
    index: Index
    around: tuple[ast.AST, ...]

    @property
    def node(self) -> ast.AST:
        value = getattr(self.holder, self.field)
        return value if self.index is None else value[self.index]

    def put(self, node: ast.AST) -> None:
        if self.index is None:
            setattr(self.holder, self.field, node)
        else:
            getattr(self.holder, self.field)[self.index] = node


def mutants(file: str, source: str) -> list[Mutant]:
    """All changes of a file."""
    tree = ast.parse(source)
    seen = Counter[str]()
    found = []
    for number, (site, after) in enumerate(changes(tree)):
        held = site.node
        shown = _shown(site)
        before = _text(shown)
        site.put(after)
        now = _text(shown if shown is not held else after)
        site.put(held)
        place = ".".join(n.name for n in site.around if isinstance(n, ast.FunctionDef | ast.ClassDef))
        line, span = _lines(site)
        alike = f"{place}: {before} => {now}"
        found.append(Mutant(file, number, place, line, span, before, now, seen[alike]))
        seen[alike] += 1
    return found


def mutated(source: str, number: int) -> str:
    """The source with one change."""
    tree = ast.parse(source)
    for n, (site, after) in enumerate(changes(tree)):
        if n == number:
            site.put(after)
            return ast.unparse(ast.fix_missing_locations(tree)) + "\n"
    raise ValueError(f"there is no change {number}")


def changes(tree: ast.Module) -> Iterator[tuple[Site, ast.AST]]:
    """What may be changed, each with what is put there instead."""
    for site in _sites(tree, ()):
        for change in CHANGES:
            for after in change(site.node, site):
                yield site, ast.copy_location(after, site.node)


def _sites(node: ast.AST, around: tuple[ast.AST, ...]) -> Iterator[Site]:
    for field, value in ast.iter_fields(node):
        for index, child in enumerate(value) if isinstance(value, list) else ((None, value),):
            if isinstance(child, ast.AST) and not _passed_over(child, field, node):
                site = Site(node, field, index, (*around, node))
                yield site
                yield from _sites(child, site.around)


def _passed_over(node: ast.AST, field: str, holder: ast.AST) -> bool:
    match node:
        case ast.Assert() | ast.Import() | ast.ImportFrom():
            return True
        case ast.FunctionDef(name="__repr__"):
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.BinOp(op=ast.BitOr()) | ast.Subscript()):
            return bool(TYPE_NAME.match(name))  # an alias of a type
        case ast.IfExp(body=one, orelse=other):
            return _is_prose(one) or _is_prose(other)
        case ast.JoinedStr():
            return _is_prose(node)
        case ast.keyword(arg="hint" | "doc" | "message" | "samples" | "repr" | "strict"):
            return True
    if isinstance(holder, ast.Raise):
        return True
    if isinstance(holder, ast.Call) and isinstance(holder.func, ast.Name) and field == "args":
        return holder.func.id in ("isinstance", "issubclass", "cast") and node is holder.args[-1]
    return field in ("annotation", "returns", "decorator_list", "bases", "format_spec", "conversion", "type_comment")


def _is_prose(node: ast.AST) -> bool:
    texts = (n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str))
    return any(PROSE.search(text) for text in texts)


# -- the changes: what may be put in the place of a node ----------------------------------------------------------------


def compared(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    if isinstance(node, ast.Compare):
        for k, op in enumerate(node.ops):
            yield ast.Compare(node.left, [*node.ops[:k], COMPARISONS[type(op)](), *node.ops[k + 1 :]], node.comparators)


def calculated(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC and not _is_text(node.left):
        yield ast.BinOp(node.left, ARITHMETIC[type(node.op)](), node.right)
    if isinstance(node, ast.AugAssign) and type(node.op) in ARITHMETIC:
        yield ast.AugAssign(node.target, ARITHMETIC[type(node.op)](), node.value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield node.operand


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def combined(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    if isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.And() if isinstance(node.op, ast.Or) else ast.Or(), node.values)


def negated(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    """A condition, where it is no comparison; those have changes of their own."""
    if site.field == "test" and isinstance(node, ast.Name | ast.Call | ast.Attribute | ast.Subscript):
        yield ast.UnaryOp(ast.Not(), node)


def counted(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    match node:
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield ast.Constant(value + 1)
            yield ast.Constant(value - 1)


def returned(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    match node:
        case ast.Return(value=ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield ast.Return(ast.Constant(None))


def left_out(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    """A statement that does something and binds no name, or a branch."""
    match node:
        case ast.Expr(value=ast.Call() | ast.Yield() | ast.YieldFrom()) | ast.AugAssign() | ast.Raise() | ast.Delete():
            yield ast.Pass()
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
            yield ast.Pass()
        case ast.If():
            yield ast.If(ast.Constant(False), node.body, node.orelse)
        case ast.Break():
            yield ast.Continue()
        case ast.Continue():
            yield ast.Break()
        case ast.comprehension(ifs=[_, *_]):
            yield ast.comprehension(node.target, node.iter, node.ifs[1:], node.is_async)
        case ast.match_case():
            yield ast.match_case(node.pattern, ast.Constant(False), node.body)


def exchanged(node: ast.AST, site: Site) -> Iterator[ast.AST]:
    """A name for its opposite, or the first two arguments of a call for each other."""
    match node:
        case ast.Name(id=name) if name in NAMES and site.field == "func":
            yield ast.Name(NAMES[name], ast.Load())
        case ast.Attribute(attr=name, ctx=ast.Load()) if name in NAMES:
            yield ast.Attribute(node.value, NAMES[name], ast.Load())
        case ast.Call(args=[one, other, *rest]) if not any(isinstance(a, ast.Starred) for a in (one, other)):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if ast.dump(one) != ast.dump(other) and name not in NOT_EXCHANGED:
                yield ast.Call(node.func, [other, one, *rest], node.keywords)


CHANGES: tuple[Callable[[ast.AST, Site], Iterator[ast.AST]], ...] = (
    compared, calculated, combined, negated, counted, returned, left_out, exchanged,
)  # fmt: skip


# -- how a change is named ----------------------------------------------------------------------------------------------


def _shown(site: Site) -> ast.AST:
    """The smallest node around a change that is long enough to be recognised."""
    for node in (site.node, *reversed(site.around)):
        if isinstance(node, ast.stmt | ast.match_case | ast.comprehension) or (
            isinstance(node, ast.expr) and len(ast.unparse(node)) > 14
        ):
            return node
    return site.node


def _text(node: ast.AST) -> str:
    """The head of a statement, or an expression, in one line."""
    if isinstance(node, ast.Match):
        return f"match {ast.unparse(node.subject)}:"
    if isinstance(node, HEADS):
        node = copy.copy(node)
        node.body = [ast.Pass()]
        if isinstance(node, ast.If | ast.For | ast.While):
            node.orelse = []
        return ast.unparse(node).strip().splitlines()[0]
    return " ".join(ast.unparse(node).split())


def _lines(site: Site) -> tuple[int, tuple[int, int]]:
    """The line of a change, and the lines of the statement or lambda that it is in."""
    path = (*site.around, site.node)
    placed = [n.pattern if isinstance(n, ast.match_case) else n for n in path]
    placed = [n for n in placed if hasattr(n, "lineno")]
    text = next(
        (n for n in placed if isinstance(n, ast.JoinedStr)), placed[-1]
    )  # what is in it may have no place of its own
    held = next(n for n in reversed(path) if isinstance(n, ast.stmt | ast.Lambda))
    last = held.body[0].lineno - 1 if isinstance(held, HEADS) else held.end_lineno or held.lineno
    return text.lineno, (held.lineno, max(held.lineno, last))
