"""Functions of other languages and libraries, and how the same is written here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from taskspec.lang.dists import DISTS

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
    """What to write for a function of another language, given its keyword arguments; None where nothing is known of it."""
    found = FOREIGN.get(name.lower())
    if found == _DRAWN["choice"] and not _WEIGHTS.isdisjoint(keywords):
        found = _DRAWN["choices"]
    if found is None:
        return None
    return f"write `{found}`" + (", which includes both ends" if found.startswith("UniformInt") else "")
