"""The draws of every backend have the distributions that they should, and are independent of each other.

Seeds are fixed, so a test gives the same answer every time. A test fails where something has a probability below 1e-4
under the hypothesis that all is well; where it looks at several p-values, their least is multiplied by their number
(Bonferroni). There are about 40 tests for each backend, all of them on about the same words: a fresh choice of seeds
would fail one in 200 times or less.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
from scipy import stats

from taskspec.envs.env import Environment
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.expressions.dists import CATEGORICAL, DISTS
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.sparse import sparse

BACKENDS = ("scalar", "numpy", *(pytest.param(backend, marks=pytest.mark.slow) for backend in ("numba", "jax")))
"""JAX compiles for half a minute, and its draws are compared to the bit in `test_backends_jax`."""
STEPS = 24
LANES = {"scalar": 60, "numpy": 2000, "numba": 2000, "jax": 2000}
RARE = 1e-4
MANY = [k + 1 for k in range(20)]
ROWS = "[[1, 0, 0], [1/3, 1/3, 1/3], [0, 1/2, 1/2], [1/4, 0, 3/4]]"
WEIGHTS = [[1, 0, 0], [1 / 3, 1 / 3, 1 / 3], [0, 1 / 2, 1 / 2], [1 / 4, 0, 3 / 4]]
Law = Any  # a frozen distribution of SciPy, or the probabilities of outcomes

# Each component: its type, its draw, and its law given m, which runs through 1, 2, 3.
COMPONENTS: dict[str, tuple[str, str, Callable[[int], Law]]] = {
    "unit": ("real", "Uniform(0, 1)", lambda m: stats.uniform(0, 1)),
    "uniform": ("real", "Uniform(-1, 3)", lambda m: stats.uniform(-1, 4)),
    "uniform_m": ("real", "Uniform(-m, m)", lambda m: stats.uniform(-m, 2 * m)),
    "normal": ("real 3", "Normal(mean=1, std=2, shape=3)", lambda m: stats.norm(1, 2)),
    "normal_m": ("real", "Normal(mean=m, std=m)", lambda m: stats.norm(m, m)),
    "exponential": ("real", "Exponential(rate=2)", lambda m: stats.expon(scale=1 / 2)),
    "exponential_m": ("real", "Exponential(rate=m)", lambda m: stats.expon(scale=1 / m)),
    "bernoulli": ("bool", "Bernoulli(0.3)", lambda m: {0: 0.7, 1: 0.3}),
    "bernoulli_m": ("bool", "Bernoulli(m / 3)", lambda m: {0: 1 - m / 3, 1: m / 3}),
    "never": ("bool", "Bernoulli(0)", lambda m: {0: 1, 1: 0}),
    "always": ("bool", "Bernoulli(1)", lambda m: {0: 0, 1: 1}),
    "integer": ("int", "UniformInt(-2, 5)", lambda m: dict.fromkeys(range(-2, 6), 1 / 8)),
    "integer_m": ("int", "UniformInt(-m, m)", lambda m: dict.fromkeys(range(-m, m + 1), 1 / (2 * m + 1))),
    "member": ("int", "Uniform({k * k for k in range(12)})", lambda m: {k * k: 1 / 12 for k in range(12)}),
    "compared": ("int", "Categorical([1/2, 1/3, 0, 1/6])", lambda m: {0: 1 / 2, 1: 1 / 3, 2: 0, 3: 1 / 6}),
    "searched": ("int", f"Categorical({MANY} / 210)", lambda m: {k: p / 210 for k, p in enumerate(MANY)}),
    "mapping": ("int", "Categorical({7: 1/4, -3: 3/4})", lambda m: {7: 1 / 4, -3: 3 / 4}),
    "row": ("int", "Categorical(rows[m])", lambda m: dict(enumerate(WEIGHTS[m]))),
    "weighted": ("int", "Categorical([m, 0, 1, 2] / (m + 3))", lambda m: dict(enumerate(np.array([m, 0, 1, 2]) / (m + 3)))),
    "binomial": ("int", "Binomial(9, 0.3)", lambda m: stats.binom(9, 0.3)),
    "binomial_m": ("int", "Binomial(7, m / 4)", lambda m: stats.binom(7, m / 4)),
    "gamma": ("real", "Gamma(2.5, 2)", lambda m: stats.gamma(2.5, scale=0.5)),
    "gamma_m": ("real 2", "Gamma([m / 4, m])", lambda m: [stats.gamma(m / 4), stats.gamma(m)]),
    "geometric": ("int", "Geometric(1/3)", lambda m: stats.geom(1 / 3)),
    "geometric_m": ("int", "Geometric(m / 4)", lambda m: stats.geom(m / 4)),
    "truncated": ("real", "TruncatedNormal(1, 2, 0, 2)", lambda m: stats.truncnorm(-1 / 2, 1 / 2, 1, 2)),
    "truncated_m": ("real", "TruncatedNormal(0, 1, m, 9)", lambda m: stats.truncnorm(m, 9)),
    "beta": ("real", "Beta(2, 0.5)", lambda m: stats.beta(2, 0.5)),
    "beta_m": ("real", "Beta(m, 2 * m)", lambda m: stats.beta(m, 2 * m)),
    "poisson": ("int", "Poisson(rate=4)", lambda m: stats.poisson(4)),
    "poisson_0": ("int", "Poisson(rate=0)", lambda m: {0: 1}),
    "poisson_large": ("int", "Poisson(rate=300)", lambda m: stats.poisson(300)),
    "poisson_m": ("int", "Poisson(rate=m / 2)", lambda m: stats.poisson(m / 2)),
    "poisson_large_m": ("int", "Poisson(rate=50 * m)", lambda m: stats.poisson(50 * m)),
    "dirichlet": ("real 3", "Dirichlet(alpha=[0.5, 1, 2])", lambda m: [stats.beta(a, 3.5 - a) for a in (0.5, 1, 2)]),
    "dirichlet_m": ("real 2", "Dirichlet(alpha=[m / 2, 1])", lambda m: [stats.beta(m / 2, 1), stats.beta(1, m / 2)]),
    "permutation": ("int 4", "Permutation(4)", lambda m: dict.fromkeys(range(4), 1 / 4)),
    "permutations": ("int 2x3", "Permutation(3, shape=2)", lambda m: dict.fromkeys(range(3), 1 / 3)),
    "subset": ("bool 5", "Subset(5, 2)", lambda m: {0: 3 / 5, 1: 2 / 5}),
}  # fmt: skip
TIED = {"dirichlet", "dirichlet_m", "permutation", "permutations", "subset"}
"""Their elements depend on each other."""
CONSTANT = {"never", "always", "poisson_0"}


def spec() -> str:
    def declared(type_: str) -> str:
        kind, _, shape = type_.partition(" ")
        return f"{{type: {kind}" + (f", shape: [{shape.replace('x', ', ')}]" if shape else "") + "}"

    lines = ["taskspec: 1", "name: Sample", "summary: Every distribution.", "horizon: none", "reward: 0"]
    lines += ["action:", "  a: {type: int, low: 0, high: 1}", "constants:", f"  rows: {ROWS}"]
    lines += ["state:", "  m: {type: int, low: 1, high: 3}"]
    lines += [f"  {name}: {declared(type_)}" for name, (type_, _, _) in COMPONENTS.items()]
    lines += ["initial:", "  m: 1"]
    first = {name: re.sub(r"\bm\b", "1", text) for name, (_, text, _) in COMPONENTS.items()}
    lines += [f"  {name}: {text!r}" for name, text in first.items()]
    lines += ["dynamics:", "  m': 1 + m % 3"]
    lines += [f"  {name}': {text!r}" for name, (_, text, _) in COMPONENTS.items()]
    return "\n".join(lines)


# -- samples ------------------------------------------------------------------------------------------------------


def walked(task: Task, backend: str) -> tuple[np.ndarray, np.ndarray]:
    """Observations of STEPS resets, and of STEPS steps: (STEPS, lanes, size) both."""
    lanes = LANES[backend]
    if backend == "scalar":
        env = Environment(task)
        rows = []
        for seed in range(lanes):
            resets = [env.reset(seed=seed)[0], *(env.reset()[0] for _ in range(STEPS - 1))]
            rows.append((resets, [env.step(0)[0] for _ in range(STEPS)]))
        resets, steps = np.moveaxis(np.array(rows), 0, 2)
        return resets, steps
    vector = VectorEnvironment(task, lanes, backend=backend, autoreset_mode="Disabled")
    resets = [vector.reset(seed=0)[0], *(vector.reset()[0] for _ in range(STEPS - 1))]
    steps = [vector.step(np.zeros(lanes, np.int64))[0] for _ in range(STEPS)]
    return np.stack(resets), np.stack(steps)


Sample = dict[str, np.ndarray]


@lru_cache(maxsize=4)
def drawn(backend: str) -> tuple[Sample, Sample]:
    """What resets and steps draw, by component: (STEPS, lanes, size)."""
    if backend != "scalar":
        pytest.importorskip(backend)
    task = build(read_text(spec()), None, {}, "")
    ends = np.cumsum([c.type.size for c in task.state])
    resets, steps = (np.split(part.astype(float), ends[:-1], axis=-1) for part in walked(task, backend))
    names = [c.name for c in task.state]
    return dict(zip(names, resets, strict=True)), dict(zip(names, steps, strict=True))


def given(m: int) -> slice:
    """The steps whose draws had this m: the first has 1."""
    return slice(m - 1, None, 3)


# -- distributions ------------------------------------------------------------------------------------------------


def p_value(values: np.ndarray, law: Law) -> float:
    """How probable values as far from the law as these are: Kolmogorov-Smirnov for reals, else chi-square."""
    if hasattr(law, "pdf"):
        return float(stats.kstest(values, law.cdf).pvalue)
    if hasattr(law, "pmf"):
        low, high = (int(law.ppf(q)) for q in (10 / values.size, 1 - 10 / values.size))
        values = np.clip(values, low, high)  # tails in one cell each
        probabilities = law.pmf(range(low, high + 1))
        probabilities[0] = law.cdf(low)
        probabilities[-1] = law.sf(high - 1)
        law = dict(zip(range(low, high + 1), probabilities, strict=True))
    counts = {outcome: np.count_nonzero(values == outcome) for outcome in law}
    assert sum(counts.values()) == values.size
    assert not any(counts[outcome] for outcome, p in law.items() if p == 0)
    found, expected = np.array([(counts[outcome], p * values.size) for outcome, p in law.items() if p]).T
    return float(stats.chisquare(found, expected).pvalue) if len(found) > 1 else 1.0


@pytest.mark.parametrize("name", sparse(COMPONENTS, 4))
@pytest.mark.parametrize("backend", BACKENDS)
def test_distributions(backend: str, name: str) -> None:
    law = COMPONENTS[name][2]
    resets, steps = drawn(backend)
    samples = [(resets[name], law(1)), *((steps[name][given(m)], law(m)) for m in (1, 2, 3))]
    found = []
    for values, expected in samples:
        laws = expected if isinstance(expected, list) else [expected] * values.shape[-1]
        found += [p_value(values[..., k].ravel(), each) for k, each in enumerate(laws)]
    assert min(found) * len(found) > RARE


def test_every_distribution_is_here() -> None:
    text = " ".join(text for _, text, _ in COMPONENTS.values())
    assert all(f"{name}(" in text for name in (*DISTS, CATEGORICAL.name))


@pytest.mark.parametrize("backend", BACKENDS)
def test_orders(backend: str) -> None:
    """All orders of a permutation, and all pairs of orders of two, are equally probable."""
    for sample in drawn(backend):
        of_four = sample["permutation"].reshape(-1, 4) @ [1, 4, 16, 64]
        of_three = sample["permutations"].reshape(-1, 6) @ [1, 3, 9, 27, 81, 243]
        for codes, count in ((of_four, 24), (of_three, 36)):
            _, counts = np.unique(codes, return_counts=True)
            assert len(counts) == count
            assert stats.chisquare(counts).pvalue * 4 > RARE


# -- independence -------------------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def classes(backend: str) -> tuple[Sample, Sample]:
    """Every element of every component as one of at most four classes, for each m on its own: (STEPS, lanes)."""
    resets, steps = drawn(backend)
    names = [(name, k) for name in COMPONENTS.keys() - CONSTANT for k in range(steps[name].shape[-1])]
    of_resets = {f"{name} {k}": quarters(resets[name][..., k]) for name, k in names}
    of_steps = {f"{name} {k}": np.empty(steps[name].shape[:2], int) for name, k in names}
    for (name, k), m in product(names, (1, 2, 3)):
        of_steps[f"{name} {k}"][given(m)] = quarters(steps[name][given(m), :, k])
    return of_resets, of_steps


def quarters(values: np.ndarray) -> np.ndarray:
    limits = np.unique(np.quantile(values, [1 / 4, 1 / 2, 3 / 4]))
    return np.searchsorted(limits, values, side="right")


def dependence(a: np.ndarray, b: np.ndarray) -> float:
    """How probable classes as dependent as these are."""
    table = np.bincount((4 * a + b).ravel(), minlength=16).reshape(4, 4)
    table = table[table.any(1)][:, table.any(0)]
    return float(stats.chi2_contingency(table, correction=False).pvalue) if min(table.shape) > 1 else 1.0


def pairs(backend: str, between: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Classes to be compared: those of resets, and of the steps with m = 2, since some depend on m."""
    resets, steps = classes(backend)
    names = sorted(steps)
    match between:
        case "sites":
            for a, b in combinations(names, 2):
                if a.split()[0] != b.split()[0] or a.split()[0] not in TIED:
                    yield steps[a][given(2)], steps[b][given(2)]
                    yield resets[a], resets[b]
        case "steps":
            for a, b in product(names, names):
                yield steps[a][given(2)], steps[b][given(3)]
                yield resets[a][:-1], resets[b][1:]
        case "lanes":
            for a, b in product(names, names):
                yield steps[a][given(2), :-1], steps[b][given(2), 1:]
                yield resets[a][:, :-1], resets[b][:, 1:]
        case "phases":
            yield from ((resets[a][given(2)], steps[b][given(2)]) for a, b in product(names, names))
        case "far":
            for name in names:
                these = steps[name][given(2)]
                half = LANES[backend] // 2
                yield these[:, :half], these[:, half : 2 * half]
                yield these[: STEPS // 6], these[STEPS // 6 :]


@pytest.mark.parametrize("between", sparse(["sites", "steps", "lanes", "phases", "far"], 3))
@pytest.mark.parametrize("backend", BACKENDS)
def test_independence(backend: str, between: str) -> None:
    """Any two draws, of one step, of steps or lanes side by side, of the n-th reset and the n-th step, and far apart."""
    found = [dependence(a, b) for a, b in pairs(backend, between)]
    assert min(found) * len(found) > RARE


def test_dependence_is_noticed() -> None:
    _, steps = classes("numpy")
    tied = steps["dirichlet 0"], steps["dirichlet 1"]
    assert dependence(*tied) < RARE / 10_000
    flipped = np.where(np.random.default_rng(0).random(tied[0].shape) < 0.1, steps["unit 0"], steps["normal 0"])
    assert dependence(steps["unit 0"], flipped) < RARE / 10_000
