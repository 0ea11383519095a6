"""Expressions: what is written of the tables of operators and functions, and what stands in the places of the operands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from taskspec.language.expressions.operators import FUNCTIONS, INFIX

KINDS = "bir"
SHAPES = (0, 3, 40)  # a number; a vector that is written out; one that is looped over, and too wide for Python numbers
POINTS = {
    "b": ("False", "True"),
    "i": ("0", "1", "-1", "2", "-7", "5", "1000"),
    "r": (
        "0.0", "-0.0", "1.0", "-1.0", "0.5", "2.5", "-2.5", "1/10", "1/5", "inf", "-inf", "0/0", "1e9", "-1e300", "1e-300",
    ),
}  # fmt: skip
"""What operands take turns to be."""
SINGLE = 12
"""So many of the reals are the same, or nearly, in float32, and small enough for sine and cosine in kernels."""


def _functions() -> Iterator[tuple[str, str]]:
    """Every function, as a template over its operands; those that take more and more arguments with one to three."""
    fixed = {"onehot": "onehot({0}, 5)", "len": "len({0})"}
    for name, function in FUNCTIONS.items():
        most = len(function.arguments) + 1 if function.arguments[-1].startswith("*") else len(function.arguments)
        for count in range(1, most + 1):
            if function.accepts(count):
                places = ", ".join(f"{{{i}}}" for i in range(count))
                yield f"{name} of {count}", fixed.get(name, f"{name}({places})")


def _operators() -> Iterator[tuple[str, str]]:
    for symbol in INFIX:
        if symbol == "not":
            yield symbol, "not {0}"
        else:
            yield symbol, "{0} in {{{1}, {2}}}".replace("in", symbol) if "in" in symbol else f"{{0}} {symbol} {{1}}"


MORE = (
    "-{0}", "+{0}", "{1} if {0} else {2}", "{0} <= {1} < {2}", "{0} == {1} != {2}", "[{0}]", "[{0}, {1}]",
    "[{0} + j for j in range(3)]", "{0}[1:]", "{0}[::-2]", "{0}[1]", "{0}[-1]", "{0}[{1}]", "[{0}, {0}][{1}]",
    "{0} ** 2", "{0} ** 5", "{0} ** -1", "{0} ** 0.5", "{0} ** 0", "{0} + 0", "0 + {0}", "{0} - 0", "0 - {0}",
    "{0} * 1", "{0} * 0", "{0} / 1", "{0} + 0.0", "1.0 * {0}", "{0} - {0}", "{0} / {0}", "{0} / 0", "1 / {0}",
    "{0} // 0", "{0} % 0", "{0} % 3", "{0} // 3", "{0} % -3", "{0} // -3", "{0} // 2.5", "{0} % 2.5", "{0} % inf",
    "clip({0}, 0, 1)", "clip({0}, -0.0, 0.0)", "clip({0}, -1, inf)", "max({0}, 0)", "min(0.0, {0})",
    "1 / max({0}, -0.0)", "1 / sort({0})",
    "(1/10 if {0} else 1/5) + (1/5 if {0} else 1/10)", "1 / (0 * {0})", "sum({0}[:1])", "prod({0}[:1])", "cumsum({0})[:2]",
    "swap({0}, 0, {1})", "put({0}, {1}, 0)", "put({0}, 1, {1})", "{0}[sign({1})]", "any({0} < {1})",
    "where({0} < {1}, {0}, {1})", "(0/0 if {0} else {1})", "floor({0} / {1})",
)  # fmt: skip
"""Identities that the builder may know, constants that templates may be short for, and mixtures."""
FORMS = {**dict(_operators()), **dict(_functions()), **{text: text for text in MORE}}
LAST_DIGIT = ("exp", "log", "sin", "cos", "tan", "tanh", "atan2", "**")
"""Where these stand, backends may differ in the last digit."""


def arity(template: str) -> int:
    return 1 + max(i for i in range(3) if f"{{{i}}}" in template)


ORIGINS = ("const", "read", "kept", "next", "view", "joined", "drawn", "later")
PLAIN = ("const", "read", "view", "drawn", "later")
"""Those that need no components but the ones read."""


def operand(origin: str, kind: str, shape: int, number: int) -> str:
    """An operand as it is written: a constant, a component, something made of one, or a draw."""
    suffix = str(shape) if shape else ""
    points = f"P{kind}"
    many = f", shape={shape}" if shape else ""
    match origin:
        case "const":
            return f"K{kind}{shape}" if shape else f"{points}[{number % len(POINTS[kind][:SINGLE])}]"
        case "read":
            return f"x{kind}{suffix}"
        case "kept":  # does not change in an episode
            return f"f{kind}{suffix}"
        case "next":
            return f"x{kind}{suffix}'"
        case "view":
            return f"reverse(x{kind}{suffix})" if shape else f"x{kind}3[k % 3]"
        case "joined":
            return f"concat(x{kind}{suffix}[1:], x{kind})" if shape else f"x{kind}40[k]"
        case "drawn":  # depends on chance alone
            return f"{points}[UniformInt(0, len({points}) - 1{many})]"
        case _:  # drawn in a way that depends on the state
            return f"{points}[UniformInt(0, {'k % 2' if kind == 'b' else 'k'}{many})]"


def expressions(template: str, origins: Sequence[str], shapes: Sequence[int]) -> list[str]:
    """The template over operands of all kinds and shapes that go together, with origins going round."""
    count = arity(template)
    found = []
    for kinds, sizes in product(product(KINDS, repeat=count), product(shapes, repeat=count)):
        for turn in range(2 if count == 1 else 1):
            number = len(found) + turn
            chosen = [origins[(number + a * (3 + number // len(origins))) % len(origins)] for a in range(count)]
            places = zip(chosen, kinds, sizes, strict=True)
            found.append(template.format(*(operand(*place, number + n) for n, place in enumerate(places))))
    return list(dict.fromkeys(found))
