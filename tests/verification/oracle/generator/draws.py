"""Random draws, of every distribution."""

from __future__ import annotations

from tests.verification.oracle.generator import scalars
from tests.verification.oracle.generator.terms import INFINITE, Context, Term, call, drawn, infix, joined, number

FRACTIONS = ("1/2", "1/3", "1/4", "2/3", "1/10", "0.25", "0.5", "3/4", "1/7")


def probability(c: Context, depth: int) -> Term:
    """A probability: a fraction, or something that is moved into [0, 1]."""
    known = [n for n in c.names if n.text.startswith("chance_")]
    if known and c.chance(0.3):
        return c.rng.choice(known)
    if c.chance(0.75):
        return Term(c.rng.choice(FRACTIONS), "real", level=6)
    x = scalars.real(c.without_draws(), depth)
    if not x.finite:
        return Term("1/2", "real", level=6)
    return call("clip", [x, number(0), number(1)], "real", size=1)


def flag(c: Context, depth: int) -> Term:
    return drawn(call("Bernoulli", [probability(c, depth)], "bool", size=1), 2)


def integer(c: Context, depth: int) -> Term:
    kinds = (
        "UniformInt",
        "UniformInt",
        "Categorical",
        "weights",
        "set",
        "Permutation",
        "Binomial",
        "Poisson",
        "tally",
        "Geometric",
    )
    which = c.rng.choice(kinds)
    if which == "Poisson" and not c.bounded:
        rate = Term(c.rng.choice(("1", "0.5", "3", "7/2")), "real", level=6)
        if c.chance(0.3):
            inside = scalars.integer(c.without_draws(), 1)
            rate = infix(call("clip", [inside, number(0), number(5)], "int", size=5), "+", number(0.5), "real", size=6)
        return drawn(call("Poisson", [rate], "int", size=2**31), INFINITE)  # as far as 32 bits go
    if which == "Permutation":
        return drawn(Term(f"Permutation({c.rng.randint(2, 3)})[{c.rng.randint(0, 1)}]", "int", level=9, size=3), 6)
    if which == "Geometric" and not c.bounded:
        p = Term(c.rng.choice(("1/2", "0.7", "9/10", "1/3")), "real", level=6)
        if c.chance(0.3):
            p = call("clip", [scalars.real(c.without_draws(), 1), number(0.3), number(1)], "real", size=1)
        return drawn(call("Geometric", [p], "int", size=200), INFINITE)
    if which == "tally":
        return tally(c)
    if which == "Binomial":
        n = c.rng.randint(1, 3)
        return drawn(Term(f"Binomial({n}, {c.rng.choice(FRACTIONS)})", "int", size=n), n + 1)
    if which == "set":
        return from_set(c, depth)
    if which == "Categorical":
        return listed(c, "int", depth)
    if which == "weights":
        return drawn(Term(c.rng.choice(("Categorical((1/2, 1/4, 1/4))", "Categorical((0.3, 0.7))")), "int", size=3), 3)
    return uniform_int(c, depth)


def tally(c: Context) -> Term:
    """How many of some conditions hold, each with a draw of its own."""
    n = c.rng.randint(2, 3)
    p = probability(c.without_draws(), 0)
    reduction = c.rng.choice(("count", "count", "sum", "any", "all"))
    if c.chance(0.5):
        text = joined(f"{reduction}(Bernoulli({p.text}, shape={n}))", "int", (p,), size=n)
    else:
        limit = scalars.integer(c.without_draws(), 1)
        text = joined(
            f"{reduction}([Bernoulli({p.text}) and i < {limit.at(5)} for i in range({n})])", "int", (p, limit), size=n
        )
    number = text if reduction in ("count", "sum") else infix(text, "+", Term("0", "int"), "int", size=2)
    return drawn(number, 2**n)


def uniform_int(c: Context, depth: int) -> Term:
    if c.chance(0.3):
        low = scalars.integer(c.without_draws(), min(depth, 1))
        width = c.rng.randint(0, 2)
        high = infix(low, "+", number(width), "int", size=low.size + width)
        return drawn(call("UniformInt", [low, high], "int", size=low.size + width), width + 1)
    low_end = c.rng.randint(-1, 1)
    n = c.rng.randint(1, 4)
    text = f"UniformInt({low_end}, {low_end + n - 1})"
    if c.chance(0.1):
        text = f"UniformInt(high={low_end + n - 1}, low={low_end})"
    return drawn(Term(text, "int", size=5), n)


def from_set(c: Context, depth: int) -> Term:
    if c.chance(0.3):
        return drawn(Term("Uniform({i * i for i in range(-1, 3) if i != 0})", "int", size=4), 3)
    members = [str(c.rng.randint(-2, 5)) for _ in range(c.rng.randint(1, 4))]
    return drawn(Term(f"Uniform({{{', '.join(members)}}})", "int", size=5), len(members))


def listed(c: Context, kind: str, depth: int) -> Term:
    """`Categorical({value: probability, ...})`, values that may read the state."""
    first, second = (scalars.term(c.without_draws(), kind, (), min(depth, 1)) for _ in range(2))
    if kind == "int":  # two conditions would make a condition
        second = infix(second, "+", number(0), "int", size=second.size)
    p = probability(c.without_draws(), 1)
    rest = infix(number(1), "-", p, "real", size=1)
    text = f"Categorical({{{first.at(0)}: {p.text}, {second.at(0)}: {rest.text}}})"
    return drawn(joined(text, kind, (first, p, second, rest), size=max(first.size, second.size)), 2)


def real(c: Context, depth: int) -> Term:
    which = c.rng.choice(
        ("Uniform", "Normal", "Exponential", "Dirichlet", "Beta", "Gamma", "TruncatedNormal", "listed")
    )
    match which:
        case "Uniform":
            low = scalars.real(c.without_draws(), min(depth, 1))
            if not low.finite or c.chance(0.5):
                return drawn(Term("Uniform(-1, 2)", "real", size=2), INFINITE)
            high = infix(low, "+", number(1.5), "real", size=low.size + 2)
            return drawn(call("Uniform", [low, high], "real", size=low.size + 2), INFINITE)
        case "Normal":
            mean = scalars.real(c.without_draws(), min(depth, 1))
            mean = mean if mean.finite else number(0.5)
            options = ([], [mean], [mean, number(0.25)])
            args = options[c.rng.randrange(3)]
            return drawn(call("Normal", args, "real", size=mean.size + 10), INFINITE)
        case "Exponential":
            return drawn(
                Term(c.rng.choice(("Exponential()", "Exponential(2)", "Exponential(1/3)")), "real", size=70), INFINITE
            )
        case "Dirichlet":
            return drawn(Term("Dirichlet((1, 0.5, 2))[1]", "real", level=9), INFINITE)
        case "Gamma":
            return drawn(
                Term(c.rng.choice(("Gamma(2.5, 2)", "Gamma(1/3)", "Gamma(1, rate=0.5)")), "real", size=100), INFINITE
            )
        case "TruncatedNormal":
            mean = scalars.real(c.without_draws(), min(depth, 1))
            mean = mean if mean.finite else number(0.5)
            ends = c.rng.choice((("-1", "1.5"), ("0", "9"), ("0.25", "0.5")))
            text = f"TruncatedNormal({mean.text}, 2, {', '.join(ends)})"
            return drawn(joined(text, "real", (mean,), size=9), INFINITE)
        case "Beta":
            return drawn(Term(c.rng.choice(("Beta(2, 0.5)", "Beta(1/3, 4)")), "real"), INFINITE)
    return listed(c, "real", depth)


def vector(c: Context, kind: str, n: int, depth: int) -> Term:
    """Several independent draws at once."""
    small = n if n <= 3 else 40
    if kind == "bool" and c.chance(0.3):
        return drawn(Term(f"Subset({n}, {c.rng.randint(0, n)})", "bool", (n,)), 6 if n <= 3 else INFINITE)
    if kind == "bool":
        p = probability(c.without_draws(), 0)
        return drawn(call("Bernoulli", [p], "bool", shape=(n,), size=1, extra=f"shape={n}"), 2**small)
    if kind == "int":
        if c.chance(0.3):
            return drawn(Term(f"Permutation({n})", "int", (n,), size=n), 6 if n <= 3 else INFINITE)
        return drawn(Term(f"UniformInt(0, 2, shape={n})", "int", (n,), size=2), 3**small)
    if c.bounded:
        return drawn(Term(f"Uniform({{({'0.5, ' * n}), ({'1.5, ' * n})}})", "real", (n,), size=2), 2)
    text = c.rng.choice((f"Normal(0, 1, shape={n})", f"Uniform(-1, 1, shape=[{n}])", f"Exponential(shape={n})"))
    return drawn(Term(text, "real", (n,), size=70), INFINITE)
