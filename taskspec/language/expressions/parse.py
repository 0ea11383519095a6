"""Text -> surface syntax, through Python's own parser and a closed subset of its grammar. Nothing is evaluated.

The prime of `x'` is replaced by the letter U+02B9, one character for one, so that Python can read it and
every column stays right. Size and nesting are bounded before Python's parser sees the text. Text that cannot be parsed, and
functions of other languages and libraries, are answered with advice.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Mapping
from functools import lru_cache
from itertools import chain
from keyword import iskeyword, kwlist
from typing import NoReturn

from taskspec.base.diagnostics import Advice, Collector, Diagnostic, SpecError
from taskspec.base.limits import Limits, how_to_raise, limits
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.dists import DISTS
from taskspec.language.expressions.operators import FUNCTIONS

# -- advice -------------------------------------------------------------------------------------------------------

_CONFUSIONS = (
    (r"&&", "write `and`", "and"),
    (r"\|\|", "write `or`", "or"),
    (r"(?<![=!<>])=(?!=)", "`==` compares; `=` is only for keyword arguments", "=="),
    (r"!(?!=)", "write `not x`", "not"),
    (r"\?", "write `x if condition else y`", None),
    (r"(?<=[\w)\]]) mod (?=[\w(])", "write `%`", " % "),
)
"""Operators of other languages, what to say about them, and what is written here in their place."""
_SPACE = "an ordinary space"
_CHARACTERS = {
    "−": "`-`", "–": "`-`", "×": "`*`", "·": "`*`", "⋅": "`*`", "÷": "`/`", "≤": "`<=`", "≥": "`>=`", "≠": "`!=`", "∧": "`and`",
    "∨": "`or`", "¬": "`not`", "∈": "`in`", "∞": "`inf`", "′": "`'`", "’": "`'`", "‘": "`'`", "“": '`"`', "”": '`"`', "„": '`"`',
    "²": "`**2`", "√": "`sqrt(x)`", "∑": "`sum(x)`", "∏": "`prod(x)`", "‖": "`norm2(x)`", "π": "`pi`",
    **dict.fromkeys("\u00a0\u2002\u2003\u2009\u200a\u202f\u3000", _SPACE),
}  # fmt: skip
"""ASCII forms of the likeliest characters of mathematics and of typography."""
_PRODUCT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)([^\W\d]\w*)")


class SyntaxFailure(Exception):
    """One syntax error; a text gives at most one, since what follows it is guesswork."""

    def __init__(self, start: int, end: int, message: str, hint: str | None = None, code: str = "E301") -> None:
        self.start = start
        self.end = end
        self.message = message
        self.hint = hint
        self.code = code


def explain(value: str, error: Exception) -> NoReturn:
    """Say what Python's parser stumbled over, in the terms of this language."""
    _refuse_operators(value)
    _refuse_keywords(value)
    if not isinstance(error, SyntaxError):
        raise SyntaxFailure(0, len(value), "this expression is nested too deeply", code="E314")
    if "integer string conversion" in (error.msg or ""):
        raise SyntaxFailure(0, len(value), "a number in this expression has too many digits", code="E314")
    line = error.lineno or 1
    column = error.offset or 1
    start = _offset(value, line, column)
    end = _offset(value, error.end_lineno or line, error.end_offset or column)
    if start >= len(value):
        end = len(value.rstrip())
        raise SyntaxFailure(max(0, end - 1), end, "the expression ends too early here")
    message = (error.msg or "invalid syntax").split(". Perhaps")[0]
    product = None
    if message.endswith("literal"):
        product = _PRODUCT.search(value)
    if product:
        written = f"{product[1]} * {product[2]}"
        said = f"'{product[0]}' is neither a number nor a name"
        advised = Advice(f"a product is written `{written}`", product[0], written)
        raise SyntaxFailure(product.start(), product.end(), said, advised)
    hint = ""
    if message.startswith("invalid ") and value[start] in _CHARACTERS:
        hint = _of_character(value, start)
    elif message.startswith("expected 'else'") or value.startswith(("if ", "if(")):
        hint = "write `x if condition else y`"
    if message.startswith("invalid syntax"):
        message = "this cannot be read as an expression"
    raise SyntaxFailure(start, max(end, start + 1), message, hint or None)


def _refuse_operators(value: str) -> None:
    for pattern, hint, word in _CONFUSIONS:
        match = re.search(pattern, value)
        if match and word is not None:
            hint = Advice(hint, match[0], _apart(word, value[: match.start()], value[match.end() :]))
        if match:
            raise SyntaxFailure(match.start(), match.end(), f"'{match[0].strip()}' is not an operator here", hint)


_GRAMMAR = ("and", "or", "not", "in", "if", "else", "for")
_KEYWORDS = "|".join(word for word in kwlist if word not in (*_GRAMMAR, "True", "False"))
_KEYWORD = re.compile(rf"(?<![\w'\"])(?:{_KEYWORDS})(?![\w'\"])")


def _refuse_keywords(value: str) -> None:
    """Refuse the first word of Python that no expression has; as a label it is quoted."""
    match = _KEYWORD.search(value)
    if match is None:
        return
    word = match[0]
    if word == "lambda" and ":" in value[match.end() :]:
        message, hint = _REFUSED["Lambda"]
        raise SyntaxFailure(match.start(), match.end(), message, hint, "E316")
    message = f"`{word}` is a word of Python, by whose grammar expressions are read"
    raise SyntaxFailure(
        match.start(), match.end(), message, Advice(f"a label is quoted: `'{word}'`", word, f"'{word}'")
    )


def _of_character(value: str, at: int) -> str:
    written = _CHARACTERS[value[at]]
    if "x" in written:
        return f"write {written}"
    word = " "
    if written != _SPACE:
        word = written.strip("`")
    return Advice(f"write {written}", value[at], _apart(word, value[:at], value[at + 1 :]))


def _apart(word: str, before: str, after: str) -> str:
    if word[:1].isalpha() and before[-1:].isalnum():
        word = f" {word}"
    if word[-1:].isalpha() and not after.startswith((" ", ")")):
        word = f"{word} "
    return word


def _offset(value: str, line: int, column: int) -> int:
    """Character offset of a 1-based line and column of the text wrapped in one bracket."""
    lines = value.split("\n")
    before = sum(len(text) + 1 for text in lines[: line - 1])
    return max(0, before + column - 1 - (1 if line == 1 else 0))


# Functions of other languages and libraries, and how the same is written here.

FOREIGN: Mapping[str, str] = {
    **{name.lower(): dist.signature for name, dist in DISTS.items()},
    "erlang": "Gamma(k, rate)", "lognormal": "exp(Normal(mean, std))",
    "laplace": "mean + Exponential(1 / scale) - Exponential(1 / scale)", "choice": "Uniform({a, b})",
    "choose": "Uniform({a, b})", "choices": "Categorical({a: p, b: 1 - p})", "sample": "Uniform({a, b})",
    "randint": "UniformInt(low, high)", "randrange": "UniformInt(low, high)", "integers": "UniformInt(low, high)",
    "rand": "Uniform(0, 1)", "random": "Uniform(0, 1)", "randn": "Normal(0, 1)", "standard_normal": "Normal(0, 1)",
    "gauss": "Normal(mean, std)", "gaussian": "Normal(mean, std)", "truncnorm": "TruncatedNormal(mean, std, low, high)",
    "expovariate": "Exponential(rate)", "shuffle": "x[Permutation(len(x))]", "int": "floor(x)", "float": "1.0 * x",
    "bool": "x != 0", "ceiling": "ceil(x)", "mod": "x % y", "remainder": "x % y", "pow": "x**y", "power": "x**y",
    "square": "x**2", "log2": "log(x) / log(2)", "log10": "log(x) / log(10)", "expm1": "exp(x) - 1",
    "factorial": "prod([i + 1 for i in range(n)])", "comb": "prod([(n - i) / (i + 1) for i in range(k)])",
    "relu": "max(x, 0)", "softmax": "exp(x) / sum(exp(x))", "sigmoid": "1 / (1 + exp(-x))", "arctan2": "atan2(y, x)",
    "arcsinh": "asinh(x)", "hypot": "sqrt(x**2 + y**2)", "mean": "sum(x) / len(x)", "average": "sum(x) / len(x)",
    "var": "norm2(x - sum(x) / len(x))**2 / len(x)", "std": "norm2(x - sum(x) / len(x)) / sqrt(len(x))",
    "norm": "norm2(x)", "sorted": "sort(x)", "reversed": "reverse(x)", "flip": "reverse(x)",
    "zip": "[x[i] + y[i] for i in range(len(x))]", "enumerate": "[i * x[i] for i in range(len(x))]", "length": "len(x)",
    "size": "len(x)", "maximum": "max(x, y)", "minimum": "min(x, y)", "concatenate": "concat(x, y)",
    "append": "concat(x, y)", "array": "[a, b]", "zeros": "[0 for i in range(n)]", "ones": "[1 for i in range(n)]",
    "arange": "[i for i in range(n)]", "linspace": "[low + (high - low) * i / (n - 1) for i in range(n)]",
    "logical_and": "c and d", "logical_or": "c or d", "logical_not": "not c", "xor": "c != d", "ite": "x if c else y",
    "ifelse": "x if c else y",
}  # fmt: skip
"""How a function is written here, by its name elsewhere in small letters."""


def advice(name: str, arguments: int) -> str | None:
    """Suggest a form for a function of another language that has so many arguments."""
    entry = FOREIGN.get(name.lower())
    if entry is None:
        return None
    same = re.fullmatch(r"(\w+)\((\w+(?:, \w+)*)\)", entry)
    if same is not None and same[2].count(",") + 1 == arguments:
        return Advice(f"write `{entry}`", name, same[1])
    return f"write `{entry}`"


# -- text -> Python's tree ----------------------------------------------------------------------------------------

PRIME = "\u02b9"
_OPENERS = "([{"
_CLOSERS = ")]}"

_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**",
}  # fmt: skip
_COMPARE: dict[type[ast.cmpop], str] = {
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.In: "in", ast.NotIn: "not in",
}  # fmt: skip
_UNARY: dict[type[ast.unaryop], str] = {ast.USub: "-", ast.UAdd: "+", ast.Not: "not"}

_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_DIGITS = re.compile(r"0|[1-9]\d{0,14}", re.ASCII)
TRUTHS = {"true": True, "false": False}
"""Truth values as YAML spells them; Python's own parser knows `True` and `False`."""


def parse(text: s.SourceText) -> s.Expr:
    """Parse one expression.

    Raises:
        SpecError: with one diagnostic at the place of the error.
    """
    try:
        return _parse(text)
    except SyntaxFailure as failure:
        place = s.Place(text, failure.start, failure.end)
        diagnostic = Diagnostic(failure.code, place.span, failure.message, failure.hint)
    raise SpecError((diagnostic,))


def parse_into(text: s.SourceText, collector: Collector) -> s.Expr | None:
    """Parse one expression; a syntax error goes to the collector, and None comes back."""
    try:
        return parse(text)
    except SpecError as error:
        for d in error.diagnostics:
            collector.add(d.code, d.span, d.message, d.hint)
        return None


def _parse(text: s.SourceText) -> s.Expr:
    place = s.Place(text, 0, len(text.value))
    if text.value in TRUTHS:
        return s.Boolean(TRUTHS[text.value], place)
    if _NAME.fullmatch(text.value) and not iskeyword(text.value):  # most cells of tables are a word or a number
        return s.Name(text.value, False, place)
    if _DIGITS.fullmatch(text.value):
        return s.Number(int(text.value), text.value, place)
    source, tree = _python(text.value, limits().characters)
    return _Reader(text, source).expr(tree)


@lru_cache(maxsize=4096)
def _python(value: str, most: int) -> tuple[str, ast.expr]:
    """Parse a text by Python's grammar; cached: between two keystrokes nearly all texts of a spec stay the same."""
    source = _prepare(value, most)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            tree = ast.parse("(" + source + "\n)", mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        explain(value, error)
    _bound_tree(value, tree.body)
    return source, tree.body


def _bound_tree(value: str, root: ast.AST) -> None:
    level: list[ast.AST] = [root]
    for _ in range(Limits.operators):  # levels of operators: `a + b + c` has two
        level = list(chain.from_iterable(map(ast.iter_child_nodes, level)))
        if not level:
            return
    raise SyntaxFailure(0, len(value), f"operators are nested more than {Limits.operators} deep", code="E314")


def _prepare(value: str, most: int) -> str:
    if len(value) > most:
        message = f"this expression has {len(value):,} characters; the limit is {most:,}"
        raise SyntaxFailure(0, 1, message, how_to_raise("characters", len(value)), "E314")
    if not value.strip():
        raise SyntaxFailure(0, max(1, len(value)), "an expression is missing here")
    out: list[str] = []
    brackets: list[int] = []
    position = 0
    while position < len(value):
        position = _scan(value, position, out, brackets)
    if brackets:
        raise SyntaxFailure(brackets[-1], brackets[-1] + 1, f"this '{value[brackets[-1]]}' is never closed")
    source = "".join(out)
    if not source.strip():
        raise SyntaxFailure(0, len(value), "an expression is missing here: this is only a comment")
    return source


def _scan(value: str, at: int, out: list[str], brackets: list[int]) -> int:
    """Copy one character (or one quoted word) from `value` to `out`; return the next position."""
    char = value[at]
    if char == "'" and at > 0 and (value[at - 1].isalnum() or value[at - 1] in "_'"):
        if value[at - 1] == "'":
            raise SyntaxFailure(at, at + 1, "only one prime: the next value is `x'`")
        out.append(PRIME)
        return at + 1
    if char in "'\"":
        end = value.find(char, at + 1)
        if end < 0:
            raise SyntaxFailure(at, at + 1, "this quote is never closed")
        out.append(value[at : end + 1])
        return end + 1
    if char == "#":
        end = value.find("\n", at)
        if end < 0:
            end = len(value)
        out.append(" " * (end - at))
        return end
    if char == PRIME or char == "\\":
        raise SyntaxFailure(at, at + 1, f"'{char}' does not belong in an expression")
    _balance(value, at, brackets)
    out.append(char)
    return at + 1


def _balance(value: str, at: int, brackets: list[int]) -> None:
    char = value[at]
    if char in _OPENERS:
        brackets.append(at)
        if len(brackets) > Limits.brackets:
            raise SyntaxFailure(at, at + 1, f"brackets are nested more than {Limits.brackets} deep", code="E314")
    elif char in _CLOSERS:
        if not brackets:
            raise SyntaxFailure(at, at + 1, f"this '{char}' closes nothing")
        opener = brackets.pop()
        if _OPENERS.index(value[opener]) != _CLOSERS.index(char):
            raise SyntaxFailure(at, at + 1, f"this '{char}' does not match the '{value[opener]}' before it")


_BITS = ("bit operators are not part of the language", "write `and`, `or`, `not`")
_REFUSED: dict[str, tuple[str, str | None]] = {
    "Lambda": ("`lambda` is not part of the language", "write a definition with arguments: `f(x): ...`"),
    "BitXor": ("`^` is not an operator here", Advice("a power is written `x**2`", "^", "**")),
    "BitAnd": (_BITS[0], Advice(_BITS[1], " & ", " and ")),
    "BitOr": (_BITS[0], Advice(_BITS[1], " | ", " or ")),
    "Invert": _BITS,
    "MatMult": ("`@` is not an operator here", "write `dot(a, b)`"),
    "Compare": ("`is` is not part of the language", "write `==`"),
    "JoinedStr": ("formatted strings are not part of the language", "compare values, not texts: `s == 1`"),
}


class _Reader:
    """Python's syntax tree -> surface syntax, refusing everything outside the subset."""

    def __init__(self, text: s.SourceText, source: str) -> None:
        self.text = text
        self.lines = ("(" + source + "\n)").split("\n")
        self.starts = [0]
        for line in self.lines:
            self.starts.append(self.starts[-1] + len(line) + 1)

    def offset(self, line: int, byte_column: int) -> int:
        """Characters before a place that Python gives as line and UTF-8 byte column."""
        text = self.lines[line - 1]
        column = byte_column
        if not text.isascii():
            column = len(text.encode()[:byte_column].decode())
        return self.starts[line - 1] + column - 1

    def place(self, node: ast.expr | ast.keyword | ast.Slice) -> s.Place:
        start = self.offset(node.lineno, node.col_offset)
        end = self.offset(node.end_lineno or node.lineno, node.end_col_offset or node.col_offset + 1)
        return s.Place(self.text, max(0, start), min(end, len(self.text.value)))

    def fail(self, node: ast.expr | ast.keyword, message: str, hint: str | None = None) -> NoReturn:
        place = self.place(node)
        raise SyntaxFailure(place.start, place.end, message, hint, "E316")

    def expr(self, node: ast.expr) -> s.Expr:  # noqa: C901, PLR0912
        place = self.place(node)
        match node:
            case ast.Constant():
                return self.constant(node, place)
            case ast.Name(id=name) if name in TRUTHS:
                return s.Boolean(TRUTHS[name], place)
            case ast.Name(id=name):
                return s.Name(name.rstrip(PRIME), name.endswith(PRIME), place)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                return s.Unary(_UNARY[type(op)], self.expr(operand), place)
            case ast.BinOp(left=left, op=op2, right=right) if type(op2) in _BINARY:
                return s.Binary(_BINARY[type(op2)], self.expr(left), self.expr(right), place)
            case ast.BoolOp(op=op3, values=values):
                word = "or"
                if isinstance(op3, ast.And):
                    word = "and"
                return s.Logical(word, self.exprs(values), place)
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(o) in _COMPARE for o in ops):
                rest = []
                for o, x in zip(ops, others, strict=True):
                    rest.append((_COMPARE[type(o)], self.expr(x)))
                return s.Compare(self.expr(left), tuple(rest), place)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return s.IfElse(self.expr(test), self.expr(body), self.expr(orelse), place)
            case ast.Call():
                return self.call(node, place)
            case ast.Subscript(value=value, slice=index):
                items = [index]
                if isinstance(index, ast.Tuple):
                    items = index.elts
                return s.Subscript(self.expr(value), tuple(map(self.index, items)), place)
            case ast.Tuple(elts=items) | ast.List(elts=items):
                return s.Vector(self.exprs(items), place)
            case ast.Set(elts=items):
                return s.SetOf(self.exprs(items), place)
            case ast.Dict(keys=keys, values=values):
                return self.weights(node, keys, values, place)
            case ast.SetComp() | ast.ListComp() | ast.GeneratorExp():
                return self.comprehension(node, place)
            case _:
                return self.refuse(node)

    def exprs(self, nodes: list[ast.expr]) -> tuple[s.Expr, ...]:
        return tuple(map(self.expr, nodes))

    def constant(self, node: ast.Constant, place: s.Place) -> s.Expr:
        match node.value:
            case bool(value):
                return s.Boolean(value, place)
            case int(value) | float(value):
                return s.Number(value, self.text.value[place.start : place.end], place)
            case str(value):
                return s.Quoted(value, place)
            case None:
                self.fail(
                    node,
                    "'None' is not a value of this language",
                    Advice("a label is quoted: `'None'`", "None", "'None'"),
                )
            case _:
                self.fail(node, f"'{ast.unparse(node)}' is not a value of this language")

    def call(self, node: ast.Call, place: s.Place) -> s.Call:
        if not isinstance(node.func, ast.Name):
            self.not_callable(node)
        if node.func.id.endswith(PRIME):
            self.fail(node.func, "a function has no next value")
        keywords = []
        for keyword in node.keywords:
            if keyword.arg is None:
                self.fail(keyword.value, "`**` cannot unpack arguments here")
            keywords.append((keyword.arg, self.expr(keyword.value)))
        return s.Call(node.func.id, self.exprs(node.args), tuple(keywords), place, self.place(node.func))

    def not_callable(self, node: ast.Call) -> NoReturn:
        """Something other than a name before a bracket: a method, or a forgotten `*`."""
        place = self.place(node.func)
        shown = self.text.value[place.start : place.end]
        if isinstance(node.func, ast.Attribute):
            name = node.func.attr
            hint = advice(name, 0) or "functions are written `f(x)`"
            if name in FUNCTIONS:
                hint = f"write `{FUNCTIONS[name].signature}`"
            self.fail(node.func, "methods and functions of modules (`x.f()`) are not part of the language", hint)
        what = "this"
        if len(shown) < 20:
            what = f"`{shown}`"
        message = f"{what} is not a function, but a bracket follows it"
        raise SyntaxFailure(place.start, place.end, message, "`*` multiplies")

    def index(self, node: ast.expr) -> s.Expr | s.Slice:
        if not isinstance(node, ast.Slice):
            return self.expr(node)
        bounds: list[s.Expr | None] = []
        for x in (node.lower, node.upper, node.step):
            if x is None:
                bounds.append(None)
            else:
                bounds.append(self.expr(x))
        start, stop, step = bounds
        return s.Slice(start, stop, step, self.place(node))

    def weights(self, node: ast.Dict, keys: list[ast.expr | None], values: list[ast.expr], place: s.Place) -> s.Weights:
        pairs = []
        for key, value in zip(keys, values, strict=True):
            if key is None:
                self.fail(value, "`**` cannot unpack a mapping here")
            pairs.append((self.expr(key), self.expr(value)))
        if not pairs:
            self.fail(node, "a distribution needs at least one `value: probability`")
        return s.Weights(tuple(pairs), place)

    def comprehension(self, node: ast.SetComp | ast.ListComp | ast.GeneratorExp, place: s.Place) -> s.Comprehension:
        clauses = tuple(map(self.clause, node.generators))
        return s.Comprehension(self.expr(node.elt), clauses, isinstance(node, ast.SetComp), place)

    def clause(self, node: ast.comprehension) -> s.Clause:
        target = node.target
        targets = [target]
        if isinstance(target, ast.Tuple):
            targets = target.elts
        for item in targets:
            if not isinstance(item, ast.Name) or item.id.endswith(PRIME) or item.id in TRUTHS:
                self.fail(item, "a comprehension binds plain names")
        names = tuple(item.id for item in targets if isinstance(item, ast.Name))
        return s.Clause(names, self.expr(node.iter), self.exprs(node.ifs))

    def refuse(self, node: ast.expr) -> NoReturn:
        match node:
            case ast.Attribute():
                self.fail(node, "attributes (`a.b`) are not part of the language")
            case ast.BinOp(op=part) | ast.UnaryOp(op=part):
                form = type(part).__name__
            case _:
                form = type(node).__name__
        message, hint = _REFUSED.get(form, (f"this form ({form}) is not part of the language", None))
        self.fail(node, message, hint)


def literal(value: bool | int | float, text: s.SourceText) -> s.Expr:
    """Convert a YAML number or boolean to an expression."""
    place = s.Place(text, 0, len(text.value))
    if isinstance(value, bool):
        return s.Boolean(value, place)
    if value < 0:
        return s.Unary("-", s.Number(-value, text.value.lstrip("-"), place), place)
    return s.Number(value, text.value, place)
