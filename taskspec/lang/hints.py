"""Advice for texts that cannot be parsed, and for functions of other languages and libraries."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import NoReturn

from taskspec.lang.dists import DISTS

_CONFUSIONS = (
    (r"&&", "write `and`"),
    (r"\|\|", "write `or`"),
    (r"(?<![=!<>])=(?!=)", "`==` compares; `=` is only for keyword arguments"),
    (r"!(?!=)", "write `not x`"),
    (r"\?", "write `x if condition else y`"),
)
_CHARACTERS = {
    "−": "`-`", "–": "`-`", "×": "`*`", "·": "`*`", "⋅": "`*`", "÷": "`/`", "≤": "`<=`", "≥": "`>=`", "≠": "`!=`", "∧": "`and`",
    "∨": "`or`", "¬": "`not`", "∈": "`in`", "∞": "`inf`", "′": "`'`", "’": "`'`", "‘": "`'`", "“": '`"`', "”": '`"`', "„": '`"`',
    "²": "`**2`", "√": "`sqrt(x)`", "∑": "`sum(x)`", "∏": "`prod(x)`", "‖": "`norm2(x)`", "π": "`pi`",
    **dict.fromkeys("\u00a0\u2002\u2003\u2009\u200a\u202f\u3000", "an ordinary space"),
}  # fmt: skip
"""What to write for characters of mathematics and of typography, the likeliest ones."""
_INVISIBLE = "\u00ad\u200b\u200c\u200d\u2060\ufeff"
_PRODUCT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)([^\W\d]\w*)")
_PERCENT = re.compile(r"(?<![\w.])(\d{1,15}(?:\.\d{1,15})?)\s*%(?=\s*(?:$|[)\]},*/%<>=]|(?:and|or|if|else|for)\b))")
"""A number of per cent, with nothing behind the sign that it could be divided by."""
_WORDS = re.compile(r"\s*\w+(\s+\w+)+\s*")


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
    for pattern, hint in _CONFUSIONS:
        found = re.search(pattern, value)
        if found:
            raise SyntaxFailure(found.start(), found.end(), f"'{found[0]}' is not an operator here", hint)
    percent = _PERCENT.search(value)
    if percent:
        share = Fraction(percent[1]) / 100
        hint = f"write `{share}`: `%` is the remainder of a division"
        raise SyntaxFailure(percent.start(), percent.end(), f"'{percent[0]}' is not a number here", hint)
    if not isinstance(error, SyntaxError):
        raise SyntaxFailure(0, len(value), "this expression is nested too deeply", code="E314")
    if "integer string conversion" in (error.msg or ""):
        raise SyntaxFailure(0, len(value), "a number in this expression has too many digits", code="E314")
    start = _offset(value, error.lineno or 1, error.offset or 1)
    end = _offset(value, error.end_lineno or error.lineno or 1, error.end_offset or error.offset or 1)
    if start >= len(value):
        raise SyntaxFailure(
            max(0, len(value.rstrip()) - 1),
            len(value.rstrip()),
            "the expression ends too early here",
        )
    message = (error.msg or "invalid syntax").split(". Perhaps")[0]
    product = _PRODUCT.search(value) if message.endswith("literal") else None
    if product:
        hint = f"a product is written `{product[1]} * {product[2]}`"
        raise SyntaxFailure(product.start(), product.end(), f"'{product[0]}' is neither a number nor a name", hint)
    if message.startswith("invalid syntax"):
        message = "this cannot be read as an expression"
    advice = "a label of several words needs its own quotes" if _WORDS.fullmatch(value) else None
    if message.startswith("expected 'else'") or value.startswith(("if ", "if(")):
        advice = "write `x if condition else y`"
    if value.startswith("|"):
        advice = "write `abs(x)`"
    if message.startswith("invalid ") and value[start] in _CHARACTERS:
        advice = f"write {_CHARACTERS[value[start]]}"
    if message.startswith("invalid ") and value[start] in _INVISIBLE:
        advice = "delete this character, which cannot be seen"
    raise SyntaxFailure(start, max(end, start + 1), message, advice)


def _offset(value: str, line: int, column: int) -> int:
    """Character offset of a 1-based line and column of the text wrapped in one bracket."""
    lines = value.split("\n")
    before = sum(len(text) + 1 for text in lines[: line - 1])
    return max(0, before + column - 1 - (1 if line == 1 else 0))


# Functions of other languages and libraries, and how the same is written here.

MODULES = frozenset(
    {"np", "numpy", "random", "math", "rng", "scipy", "stats", "jnp", "jax", "torch", "tf", "itertools"}
)
"""What others write before the dot of a function."""

_OURS: Mapping[str, str] = {
    name.lower(): f"{name}({', '.join(argument.name for argument in dist.arguments)})" for name, dist in DISTS.items()
}
_DRAWN: Mapping[str, str] = {
    **_OURS,
    "erlang": "Gamma(k, rate)",
    "chisquare": "Gamma(k / 2, 1 / 2)",
    "inversegamma": "1 / Gamma(a, rate)",
    "geom": "Geometric(p)",
    "lognormal": "exp(Normal(mean, std))",
    "laplace": "mean + Exponential(1 / scale) - Exponential(1 / scale)",
    "choice": "Uniform({a, b})",
    "choose": "Uniform({a, b})",
    "choices": "Categorical({a: p, b: 1 - p})",
    "sample": "Uniform({a, b})",
    "discrete": "Categorical({a: p, b: 1 - p})",
    "randint": "UniformInt(low, high)",
    "randrange": "UniformInt(low, high)",
    "integers": "UniformInt(low, high)",
    "discreteuniform": "UniformInt(low, high)",
    "rand": "Uniform(0, 1)",
    "random": "Uniform(0, 1)",
    "randn": "Normal(0, 1)",
    "standard_normal": "Normal(0, 1)",
    "gauss": "Normal(mean, std)",
    "gaussian": "Normal(mean, std)",
    "truncnorm": "TruncatedNormal(mean, std, low, high)",
    "truncnormal": "TruncatedNormal(mean, std, low, high)",
    "expovariate": "Exponential(rate)",
    "shuffle": "x[Permutation(len(x))]",
}
_WORKED_OUT: Mapping[str, str] = {
    "int": "floor(x)",
    "float": "1.0 * x",
    "bool": "x != 0",
    "ceiling": "ceil(x)",
    "mod": "x % y",
    "remainder": "x % y",
    "floor_divide": "x // y",
    "pow": "x**y",
    "power": "x**y",
    "square": "x**2",
    "log2": "log(x) / log(2)",
    "log10": "log(x) / log(10)",
    "log1p": "log(1 + x)",
    "expm1": "exp(x) - 1",
    "factorial": "prod([i + 1 for i in range(n)])",
    "comb": "prod([(n - i) / (i + 1) for i in range(k)])",
    "relu": "max(x, 0)",
    "softmax": "exp(x) / sum(exp(x))",
    "isclose": "abs(x - y) < 1e-9",
    "sigmoid": "1 / (1 + exp(-x))",
    "arctan2": "atan2(y, x)",
    "arcsinh": "asinh(x)",
    "hypot": "sqrt(x**2 + y**2)",
    "mean": "sum(x) / len(x)",
    "average": "sum(x) / len(x)",
    "var": "norm2(x - sum(x) / len(x))**2 / len(x)",
    "std": "norm2(x - sum(x) / len(x)) / sqrt(len(x))",
    "norm": "norm2(x)",
    "sorted": "sort(x)",
    "reversed": "reverse(x)",
    "flip": "reverse(x)",
    "zip": "[x[i] + y[i] for i in range(len(x))]",
    "enumerate": "[i * x[i] for i in range(len(x))]",
    "length": "len(x)",
    "size": "len(x)",
    "maximum": "max(x, y)",
    "minimum": "min(x, y)",
    "concatenate": "concat(x, y)",
    "append": "concat(x, y)",
    "array": "[a, b]",
    "zeros": "[0 for i in range(n)]",
    "ones": "[1 for i in range(n)]",
    "arange": "[i for i in range(n)]",
    "linspace": "[low + (high - low) * i / (n - 1) for i in range(n)]",
    "logical_and": "c and d",
    "logical_or": "c or d",
    "logical_not": "not c",
    "logical_xor": "c != d",
    "xor": "c != d",
    "ite": "x if c else y",
    "ifelse": "x if c else y",
}
_WEIGHTS = frozenset({"p", "probs", "probabilities", "weights"})
"""Keyword arguments by which a choice of others is not uniform."""
FOREIGN: Mapping[str, str] = {**_DRAWN, **_WORKED_OUT}
"""How a function is written here, by its name elsewhere in small letters."""
ATTRIBUTES: Mapping[str, str] = {
    "pi": "pi", "inf": "inf", "e": "exp(1)", "shape": "len(x)", "size": "len(x)", "T": "m[j, i]",
}  # fmt: skip
"""What others write behind a dot without calling it, and how the same is written here."""


def advice(name: str, keywords: Iterable[str] = ()) -> str | None:
    """Return what to write for a function of another language, given its keyword arguments; None where nothing is known of it."""
    found = FOREIGN.get(name.lower())
    if found == _DRAWN["choice"] and not _WEIGHTS.isdisjoint(keywords):
        found = _DRAWN["choices"]
    if found is None:
        return None
    return f"write `{found}`" + (", which includes both ends" if found.startswith("UniformInt") else "")
