"""Random expressions over every operator, typed as the language types them: numbers, conditions, vectors, sets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st

from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import Notation, nowhere, symbol
from tests.verification.printed import algebra as al

PLACE = s.Place(nowhere(""), 0, 0)
SCALARS = ("x", "y", "a", "b", "i", "j", "theta", "L")
KEYS = ("k", "n")  # small numbers, which tables look at
VECTORS = ("v", "w", "p", "s", "h")  # two unknown ones, two of known lengths, one that only its axes tell
POINTWISE = ("abs", "floor", "sqrt", "sin", "min", "max", "clip")  # of vectors, element by element
LABELS = {"up": "U", "go_left": "go left"}
ONE = ("abs", "floor", "ceil", "round", "sign", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "f", "Bernoulli", "Poisson",
       "Exponential", "Permutation")  # fmt: skip
TWO = ("min", "max", "atan2", "g", "Normal", "UniformInt", "Uniform")
OF_VECTORS = ("sum", "prod", "norm1", "norm2", "argmax", "argmin", "min", "max", "len")
ARITHMETIC = ("+", "-", "*", "/", "//", "%", "**")
RELATIONS = ("==", "!=", "<", "<=", ">", ">=")

LENGTHS = {"p": parse(nowhere("n + 1")), "s": parse(nowhere("2 * L"))}
NOTATION = Notation(
    symbols={name: symbol(name) for name in (*SCALARS, *KEYS, "f", "g", "move", "h")},
    lengths=LENGTHS,
    axes=dict.fromkeys((*SCALARS, *KEYS, "move"), 0) | dict.fromkeys(VECTORS, 1),
    labels={"move": {"up": m.Ident("U")}},
)


def names(point: int) -> dict[str, al.Value]:
    """Values of all names, primed ones too, by what they are called in specs."""
    found = {name + prime: al.mixed(name, prime, point) for name in (*SCALARS, "move", *LABELS) for prime in ("", "'")}
    found |= {name + prime: al.mixed("vector", name, prime, point) for name in VECTORS for prime in ("", "'")}
    found |= {name + prime: al.mixed(name, prime, point) % 4 for name in KEYS for prime in ("", "'")}
    return found


def printed(values: dict[str, al.Value]) -> dict[str, al.Value]:
    """The same by what they are called on paper."""
    letters = {"theta": "θ", "theta'": "θ'", **LABELS}
    return {letters.get(name, name): value for name, value in values.items()} | {"true": 1, "false": 0}


def number(text: str) -> s.Number:
    return s.Number(float(text) if set(text) & set(".e") else int(text), text, PLACE)


def name(written: str) -> s.Name:
    return s.Name(written.rstrip("'"), written.endswith("'"), PLACE)


def call(function: str, *args: s.Expr) -> s.Call:
    return s.Call(function, args, (), PLACE, PLACE)


NUMERALS = st.sampled_from(["0", "1", "2", "3", "10", "0.5", "1e-3", "2.5e6"]).map(number)
SCALAR = st.one_of(st.sampled_from([*SCALARS, *KEYS]), st.sampled_from(["x'", "y'", "theta'", "k'"])).map(name)
VECTOR = st.sampled_from([*VECTORS, "s'"]).map(name)


@st.composite
def numbers(draw: Callable[..., Any], depth: int = 4) -> s.Expr:
    """An expression whose value is a number."""
    if depth == 0 or draw(st.integers(0, 5)) == 0:
        return draw(NUMERALS | SCALAR | st.booleans().map(lambda b: s.Boolean(b, PLACE)))
    less = depth - 1

    def x() -> s.Expr:
        return draw(numbers(less))

    match draw(st.integers(0, 16)):
        case 0 | 1 | 2 | 3 | 4:
            return s.Binary(draw(st.sampled_from(ARITHMETIC)), x(), x(), PLACE)
        case 5 | 6:
            return s.Unary(draw(st.sampled_from(("-", "-", "+"))), x(), PLACE)
        case 7:
            return call(draw(st.sampled_from(ONE)), x())
        case 8:
            return call(draw(st.sampled_from(TWO)), x(), x())
        case 9:
            return draw(conditions(less))
        case 10:
            return s.IfElse(draw(conditions(less)), x(), x(), PLACE)
        case 11:
            return call("where", draw(conditions(less)), x(), x())
        case 12:
            return draw(tables(less))
        case 13:
            return call(draw(st.sampled_from(OF_VECTORS)), draw(vectors(less)))
        case 14:
            return s.Subscript(
                draw(VECTOR | vectors(less)), tuple(draw(st.lists(numbers(less), min_size=1, max_size=2))), PLACE
            )
        case 15:
            return draw(sums(less))
        case _:
            return call("dot", draw(VECTOR), draw(VECTOR)) if draw(st.booleans()) else call("clip", x(), x(), x())


@st.composite
def sums(draw: Callable[..., Any], depth: int) -> s.Expr:
    """A sum over a range, or of conditions."""
    total = draw(st.sampled_from(("sum", "prod")))
    match draw(st.integers(0, 2)):
        case 0:
            clause = s.Clause(("q",), call("range", draw(numbers(depth))), ())
            body = s.Binary(draw(st.sampled_from(ARITHMETIC)), name("q"), draw(numbers(depth)), PLACE)
            if draw(st.booleans()):  # a list of lists
                inner = s.Binary("*", body, name("r"), PLACE)
                body = s.Comprehension(inner, (s.Clause(("r",), call("range", draw(numbers(0))), ()),), False, PLACE)
            return call(total, s.Comprehension(body, (clause,), False, PLACE))
        case 1:
            return call("count", draw(conditions_of_vectors(depth)))
        case _:
            return call(total, draw(conditions_of_vectors(depth)))


@st.composite
def conditions(draw: Callable[..., Any], depth: int = 4) -> s.Expr:
    """An expression whose value is a truth value."""
    if depth == 0 or draw(st.integers(0, 6)) == 0:
        return s.Compare(draw(SCALAR), ((draw(st.sampled_from(RELATIONS)), draw(SCALAR)),), PLACE)
    less = depth - 1
    match draw(st.integers(0, 9)):
        case 0 | 1:
            return s.Unary("not", draw(conditions(less) | numbers(less)), PLACE)
        case 2 | 3:
            operands = draw(st.lists(conditions(less) | SCALAR, min_size=2, max_size=3))
            return s.Logical(draw(st.sampled_from(("and", "or"))), tuple(operands), PLACE)
        case 4 | 5:
            links = draw(st.lists(st.tuples(st.sampled_from(RELATIONS), numbers(less)), min_size=1, max_size=2))
            return s.Compare(draw(numbers(less)), tuple(links), PLACE)
        case 6:
            link = (draw(st.sampled_from(("in", "not in"))), draw(sets(less)))
            return s.Compare(draw(numbers(less)), (link,), PLACE)
        case 7:
            remainder = s.Binary("%", draw(numbers(less)), draw(numbers(less)), PLACE)
            return s.Compare(remainder, ((draw(st.sampled_from(("==", "!="))), number("0")),), PLACE)
        case 8:
            return s.Compare(name("move"), ((draw(st.sampled_from(("==", "!="))), draw(labels())),), PLACE)
        case _:
            some = st.lists(conditions(less), min_size=1, max_size=2).map(lambda i: s.Vector(tuple(i), PLACE))
            return call(draw(st.sampled_from(("any", "all"))), draw(conditions_of_vectors(less) | some))


@st.composite
def labels(draw: Callable[..., Any]) -> s.Expr:
    return s.Quoted("go_left", PLACE) if draw(st.booleans()) else name("up")


@st.composite
def conditions_of_vectors(draw: Callable[..., Any], depth: int) -> s.Expr:
    """Conditions on elements, alone or joined."""
    less = max(depth - 1, 0)
    link = (draw(st.sampled_from(RELATIONS)), draw(vectors(less) | numbers(less)))
    found = s.Compare(draw(vectors(less)), (link,), PLACE)
    match draw(st.integers(0, 5)) if depth > 0 else 0:
        case 4:
            return s.Unary("not", draw(conditions_of_vectors(less)), PLACE)
        case 5:
            other = draw(conditions_of_vectors(less) | conditions(less) | VECTOR)
            return s.Logical(draw(st.sampled_from(("and", "or"))), tuple(draw(st.permutations((found, other)))), PLACE)
        case _:
            return found


@st.composite
def vectors(draw: Callable[..., Any], depth: int = 3) -> s.Expr:
    """An expression whose value is a vector, made element by element, by a function, or as a slice."""
    if depth == 0 or draw(st.integers(0, 2)) == 0:
        return draw(VECTOR)
    less = depth - 1
    match draw(st.integers(0, 8)):
        case 0:
            return call(draw(st.sampled_from(("sort", "argsort", "cumsum", "reverse"))), draw(vectors(less)))
        case 1:
            parts = [draw(st.none() | numbers(0)) for _ in range(2)]
            return s.Subscript(draw(VECTOR), (s.Slice(*parts, None, PLACE),), PLACE)
        case 2:
            return s.Unary("-", draw(vectors(less)), PLACE)
        case 3 | 4:
            return draw(pointwise(less))
        case 5:
            return s.IfElse(draw(conditions(less)), draw(vectors(less)), draw(vectors(less) | numbers(less)), PLACE)
        case _:
            pair = [draw(vectors(less)), draw(vectors(less) | numbers(less))]
            return s.Binary(draw(st.sampled_from(ARITHMETIC)), *draw(st.permutations(pair)), PLACE)


@st.composite
def pointwise(draw: Callable[..., Any], depth: int) -> s.Expr:
    """A function of elements; single numbers among its arguments stay as they are."""
    function = draw(st.sampled_from(POINTWISE))
    count = {"min": 2, "max": 2, "clip": 3}.get(function, 1)
    others = [draw(vectors(depth) | numbers(depth)) for _ in range(count - 1)]
    return call(function, *draw(st.permutations([draw(vectors(depth)), *others])))


@st.composite
def sets(draw: Callable[..., Any], depth: int) -> s.Expr:
    inner = numbers(depth)
    match draw(st.integers(0, 4)):
        case 0 | 1:
            return s.SetOf(tuple(draw(st.lists(inner, min_size=1, max_size=3))), PLACE)
        case 2:
            return call("range", *draw(st.lists(inner, min_size=1, max_size=2)))
        case 3:
            return call("box", draw(inner), draw(inner), draw(inner))
        case _:
            conditions = [s.Compare(name("q"), ((">", draw(inner)),), PLACE)] if draw(st.booleans()) else []
            body = name("q") if draw(st.booleans()) else s.Binary("+", name("q"), draw(inner), PLACE)
            clause = s.Clause(("q",), call("range", draw(inner)), tuple(conditions))
            return s.Comprehension(body, (clause,), True, PLACE)


@st.composite
def tables(draw: Callable[..., Any], depth: int) -> s.Expr:
    """Values by cases as YAML writes them: lists, tables with one or two columns, probabilities."""
    inner = numbers(depth)
    match draw(st.integers(0, 3)):
        case 0:
            pairs = draw(st.lists(st.tuples(conditions(depth), inner), min_size=1, max_size=3))
            return s.Piecewise(tuple(pairs), draw(inner), PLACE)
        case 1:
            return s.Table((name("k"),), draw(rows(depth, None)), PLACE)
        case 2:
            return s.Table((name("k"), name("n")), draw(rows(depth, depth)), PLACE)
        case _:
            pairs = draw(st.lists(st.tuples(inner, inner), min_size=1, max_size=3))
            return s.Weights(tuple(pairs), PLACE)


@st.composite
def rows(draw: Callable[..., Any], depth: int, deeper: int | None) -> tuple[s.TableRow, ...]:
    keys: list[s.Expr | None] = [number(str(k)) for k in sorted(draw(st.sets(st.integers(0, 3), max_size=3)))]
    bodies = [
        draw(numbers(depth) if deeper is None or draw(st.booleans()) else rows(depth, None)) for _ in (*keys, None)
    ]
    return tuple(s.TableRow(key, body, PLACE) for key, body in zip((*keys, None), bodies, strict=True))
