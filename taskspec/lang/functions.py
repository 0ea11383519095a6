"""The functions and infix operators that authors write: names, arguments, meaning in core nodes, mathematics.

Part of the operator table: an entry either names one core operator or composes several. The parser's known names,
the printers, the language reference and a test for every (function, sample, backend) follow from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taskspec.lang.builder import Builder
from taskspec.lang.ir import Const, Node
from taskspec.lang.types import INT, Kind, Refused, Type

Build = Callable[[Builder, list[Node]], Node]


@dataclass(frozen=True, slots=True)
class Function:
    """A function of the language.

    `arguments` are names for the reference and for messages; the last may be `*rest`. `latex` is a template over
    `{0}`, `{1}`, ...; `{*}` stands for all arguments with commas. `static` arguments must be constants; `indices` are
    arguments that say where in the first one.
    """

    name: str
    arguments: tuple[str, ...]
    build: Build
    doc: str
    latex: str
    samples: tuple[tuple[Any, ...], ...]
    static: tuple[int, ...] = ()
    indices: tuple[int, ...] = ()

    @property
    def signature(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"

    def accepts(self, count: int) -> bool:
        if self.arguments[-1].startswith("*"):
            return count >= len(self.arguments) - 1  # `*rest` may be empty
        return count == len(self.arguments)


def _op(name: str) -> Build:
    return lambda b, args: b.apply(name, *args)


def _extreme(two: str, many: str) -> Build:
    def build(b: Builder, args: list[Node]) -> Node:
        if len(args) == 1:
            return b.apply(many, args[0])
        result = args[0]
        for arg in args[1:]:
            result = b.apply(two, result, arg)
        return result

    return build


def _clip(b: Builder, args: list[Node]) -> Node:
    x, low, high = args
    return b.apply("min2", b.apply("max2", x, low), high)


def _product(b: Builder, args: list[Node]) -> Node:
    for arg in args:
        if len(arg.type.shape) != 1:
            raise Refused(f"`dot` needs two vectors, not {arg.type}")
    return b.apply("sum", b.apply("mul", *args))


def _norm1(b: Builder, args: list[Node]) -> Node:
    return b.apply("sum", b.apply("abs", args[0]))


def _norm2(b: Builder, args: list[Node]) -> Node:
    return b.apply("sqrt", b.apply("sum", b.apply("mul", args[0], args[0])))


def _need_vector(name: str, node: Node) -> int:
    if node.type.is_scalar:
        raise Refused(f"`{name}` needs a vector, not a single {node.type}")
    return node.type.shape[0]


def _need_index(name: str, node: Node) -> Node:
    if not node.type.is_scalar or node.type.kind is Kind.REAL:
        raise Refused(f"`{name}` needs an int as index, not {node.type}", hint="`floor(x)` gives an int")
    return node


def at(b: Builder, name: str, x: Node, index: Node) -> Node:
    """An index into the first axis of x, brought into range."""
    return b.position(b.cast(_need_index(name, index), Kind.INT), _need_vector(name, x))


def _reverse(b: Builder, args: list[Node]) -> Node:
    n = _need_vector("reverse", args[0])
    return b.structure("slice", args, (n - 1, n, -1)) if n else args[0]


def _concat(b: Builder, args: list[Node]) -> Node:
    parts = [b.structure("reshape", [a], (1,)) if a.type.is_scalar else a for a in args]
    if len({a.type.shape[1:] for a in parts}) > 1:
        raise Refused("the parts of `concat` have different row shapes", "E307")
    return b.structure("concat", parts)


def _put(b: Builder, args: list[Node]) -> Node:
    x, index, value = args
    i = at(b, "put", x, index)
    value = b.stretch(value, x.type.shape[1:])
    if value.type.shape != x.type.shape[1:]:
        raise Refused(f"`put` cannot place {value.type} in {x.type}", "E307")
    kind = max(x.type.kind, value.type.kind)
    return b.structure("put", [b.cast(x, kind), i, b.cast(value, kind)])


def _swap(b: Builder, args: list[Node]) -> Node:
    x, i, j = args
    return b.structure("swap", [x, at(b, "swap", x, i), at(b, "swap", x, j)])


def _onehot(b: Builder, args: list[Node]) -> Node:
    index, n = args
    assert isinstance(n, Const)
    if n.type != INT or n.value < 1:
        raise Refused("`onehot` needs a positive int as length")
    b.check_size((n.value,))
    positions = b.const(tuple(range(n.value)), Type(Kind.INT, (n.value,)))
    return b.cast(b.apply("eq", positions, _need_index("onehot", index)), Kind.INT)


def _len(b: Builder, args: list[Node]) -> Node:
    return b.scalar(_need_vector("len", args[0]))


_V3, _W3 = (3, -1, 2), (0.5, -2.0, 1.5)

FUNCTIONS: dict[str, Function] = {
    f.name: f
    for f in (
        Function("abs", ("x",), _op("abs"), "Absolute value.", r"\lvert {0} \rvert", ((-3,), (2.5,), (_V3,))),
        Function("min", ("x", "*rest"), _extreme("min2", "min"), "Smallest of the arguments, or of one vector's elements.",
                 r"\min({*})", ((3, 2), (1.5, -2, 4), (_V3,), (_W3,))),
        Function("max", ("x", "*rest"), _extreme("max2", "max"), "Largest of the arguments, or of one vector's elements.",
                 r"\max({*})", ((3, 2), (1.5, -2, 4), (_V3,), (_W3,))),
        Function("floor", ("x",), _op("floor"), "Rounded down to an int.", r"\lfloor {0} \rfloor", ((2.7,), (-2.1,), (_W3,))),
        Function("ceil", ("x",), _op("ceil"), "Rounded up to an int.", r"\lceil {0} \rceil", ((2.2,), (-2.9,))),
        Function("round", ("x",), _op("round"), "Nearest int, halves to even.", r"\operatorname{round}({0})", ((2.5,), (-2.6,))),
        Function("sign", ("x",), _op("sign"), "-1, 0 or 1.", r"\operatorname{sign}({0})", ((-3,), (0,), (2.5,))),
        Function("sqrt", ("x",), _op("sqrt"), "Square root.", r"\sqrt{{0}}", ((2.0,), (9,), (-1.0,))),
        Function("exp", ("x",), _op("exp"), "Exponential.", r"e^{{0}}", ((0.5,), (1000.0,))),
        Function("log", ("x",), _op("log"), "Natural logarithm.", r"\log({0})", ((0.5,), (0.0,))),
        Function("sin", ("x",), _op("sin"), "Sine, in radians.", r"\sin({0})", ((0.5,), (-2.0,))),
        Function("cos", ("x",), _op("cos"), "Cosine, in radians.", r"\cos({0})", ((0.5,), (-2.0,))),
        Function("tan", ("x",), _op("tan"), "Tangent, in radians.", r"\tan({0})", ((0.5,), (-2.0,))),
        Function("tanh", ("x",), _op("tanh"), "Hyperbolic tangent.", r"\tanh({0})", ((0.5,), (-2.0,))),
        Function("atan2", ("y", "x"), _op("atan2"), "Angle of the point (x, y), in radians.",
                 r"\operatorname{atan2}({0}, {1})", ((0.5, -1.0),)),
        Function("clip", ("x", "low", "high"), _clip, "x moved into [low, high].", r"\operatorname{clip}({0}, {1}, {2})",
                 ((5, 0, 3), (-1.5, 0, 3), (_W3, -1, 1))),
        Function("where", ("condition", "x", "y"), _op("where"), "x where the condition holds, else y; element by element.",
                 r"\begin{cases}{1} & \text{if } {0}\\ {2} & \text{otherwise}\end{cases}",
                 ((True, 1, 2.5), ((True, False, True), _V3, 0))),
        Function("sum", ("x",), _op("sum"), "Sum of all elements.", r"\textstyle\sum {0}", ((_V3,), (_W3,), ((True, False),))),
        Function("prod", ("x",), _op("prod"), "Product of all elements.", r"\textstyle\prod {0}", ((_V3,), (_W3,))),
        Function("any", ("x",), _op("any"), "Whether some element holds.", r"\exists\,{0}", (((True, False),),)),
        Function("all", ("x",), _op("all"), "Whether every element holds.", r"\forall\,{0}", (((True, False),), ((True, True),))),
        Function("count", ("x",), _op("count"), "How many elements hold.", r"\#\{{0}\}", (((True, False, True),),)),
        Function("sort", ("x",), _op("sort"), "Elements in ascending order.", r"\operatorname{sort}({0})", ((_V3,), (_W3,))),
        Function("argsort", ("x",), _op("argsort"), "Indices that sort the vector.", r"\operatorname{argsort}({0})",
                 ((_V3,), (_W3,), ((1, 0, 1, 0),))),
        Function("argmin", ("x",), _op("argmin"), "Index of the smallest element, the first of equals.",
                 r"\operatorname{arg\,min}({0})", ((_V3,), ((1, 0, 0),))),
        Function("argmax", ("x",), _op("argmax"), "Index of the largest element, the first of equals.",
                 r"\operatorname{arg\,max}({0})", ((_V3,), ((0, 1, 1),))),
        Function("cumsum", ("x",), _op("cumsum"), "Running sums.", r"\operatorname{cumsum}({0})", ((_V3,), (_W3,))),
        Function("dot", ("x", "y"), _product, "Inner product.", r"{0} \cdot {1}", ((_V3, _W3),)),
        Function("norm1", ("x",), _norm1, "Sum of absolute values.", r"\lVert {0} \rVert_1", ((_V3,), (_W3,))),
        Function("norm2", ("x",), _norm2, "Euclidean length.", r"\lVert {0} \rVert_2", ((_V3,), (_W3,))),
        Function("concat", ("x", "*rest"), _concat, "Vectors (or single values) laid end to end.", r"({*})",
                 ((_V3, _V3), (_V3, 7), (1.5, _V3))),
        Function("reverse", ("x",), _reverse, "Elements in the opposite order.", r"\operatorname{reverse}({0})", ((_V3,),)),
        Function("swap", ("x", "i", "j"), _swap, "The vector with elements i and j exchanged.",
                 r"\operatorname{swap}_{{1},{2}}({0})", ((_V3, 0, 2), (_W3, 1, 1), (_V3, 1, 9)), indices=(1, 2)),
        Function("put", ("x", "i", "value"), _put, "The vector with element i replaced.",
                 r"{0}[{1} \leftarrow {2}]", ((_V3, 1, 9), (_W3, 0, 9), (_V3, 7, 0.5)), indices=(1,)),
        Function("onehot", ("i", "n"), _onehot, "Zeros of length n with a 1 at i; all zeros when i is outside.",
                 r"e_{{0}}", ((1, 3), (5, 3)), static=(1,)),
        Function("len", ("x",), _len, "Number of rows, a constant.", r"\lvert {0} \rvert", ((_V3,),)),
    )
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Infix:
    """An infix or prefix operator: its precedence (higher binds tighter) and its mathematics over `{0}`, `{1}`."""

    symbol: str
    op: str
    precedence: int
    latex: str
    doc: str


INFIX: dict[str, Infix] = {
    i.symbol: i
    for i in (
        Infix("or", "or", 1, r"{0} \lor {1}", "Either condition holds."),
        Infix("and", "and", 2, r"{0} \land {1}", "Both conditions hold."),
        Infix("not", "not", 3, r"\lnot {0}", "The condition does not hold."),
        Infix("==", "eq", 4, "{0} = {1}", "Equal; comparisons can be chained."),
        Infix("!=", "ne", 4, r"{0} \neq {1}", "Different."),
        Infix("<", "lt", 4, "{0} < {1}", "Less."),
        Infix("<=", "le", 4, r"{0} \leq {1}", "Less or equal."),
        Infix(">", "gt", 4, "{0} > {1}", "Greater."),
        Infix(">=", "ge", 4, r"{0} \geq {1}", "Greater or equal."),
        Infix("in", "in", 4, r"{0} \in {1}", "Equal to one of the values written out."),
        Infix("not in", "not in", 4, r"{0} \notin {1}", "Equal to none of the values written out."),
        Infix("+", "add", 5, "{0} + {1}", "Sum."),
        Infix("-", "sub", 5, "{0} - {1}", "Difference."),
        Infix("*", "mul", 6, r"{0} \cdot {1}", "Product."),
        Infix("/", "div", 6, r"\frac{{0}}{{1}}", "Real division; two ints give an exact fraction."),
        Infix("//", "floordiv", 6, r"\left\lfloor {0} / {1} \right\rfloor", "Division rounded down."),
        Infix("%", "mod", 6, r"{0} \bmod {1}", "Remainder, with the sign of the divisor."),
        Infix("**", "pow", 8, "{0}^{{1}}", "Power."),
    )
}
