"""Draws that lines of `initial` share, and draws of which little matters: listed by what is told apart, not one by one.

What is expected is worked out here, by going through all outcomes of independent draws, or by counting.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exact import extract, soundness
from taskspec.exact.model.extract import MANY
from taskspec.exact.model.transitions import Steps
from taskspec.exact.solve import solve
from taskspec.language.task.task import Task
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text

SPEC = """
state:
  k: {type: int, low: 0, high: 99}
action:
  a: {type: int, low: 0, high: 2}
noise:
  one: Bernoulli(1/5)
  order: Permutation(16)
  chosen: Subset(5, 2)
constants: {v: [0, 1, 2, 3]}
initial: {k: 0}
dynamics:
  k': NEXT
reward: k'
horizon: 3
"""


def task(following: str) -> Task:
    return build_text(SPEC.replace("NEXT", f'"{following}"'))


def flags(*chances: float | Fraction) -> Iterator[tuple[tuple[bool, ...], Fraction]]:
    """All outcomes of independent conditions, and their probabilities."""
    for outcome in itertools.product((False, True), repeat=len(chances)):
        yield outcome, math.prod(Fraction(p) if b else 1 - Fraction(p) for b, p in zip(outcome, chances, strict=True))


def law(chances: list[Fraction], value: Callable[..., int]) -> np.ndarray:
    """The probability of each value below 100."""
    law = np.zeros(100)
    for outcome, p in flags(*chances):
        law[int(value(outcome))] += float(p)
    return law


def next_k(made: Task, k: int, a: int) -> np.ndarray:
    """The law of the next k by the exact model."""
    row: np.ndarray = extract(made).step(0).P[[a * 100 + k]].toarray()[0]
    return row


T = Fraction(1, 3)
Q = Fraction(1, 4)
COUNTED: list[tuple[str, list[Fraction], Callable[..., int], int]] = [
    ("sum(Bernoulli(1/3, shape=6))", [T] * 6, sum, 7),
    ("count(Bernoulli((1/3, 1/4, 1, 0)))", [T, Q, Fraction(1), Fraction(0)], sum, 5),
    ("count([Bernoulli(1/4) and i <= a for i in range(5)])", [Q] * 3, sum, 6),
    ("count([Bernoulli(1/4) or i == a for i in range(5)])", [Q] * 4, lambda b: 1 + sum(b), 6),
    ("sum([1 - Bernoulli(1/4) > 0 for i in range(3)])", [Q] * 3, lambda b: 3 - sum(b), 4),
    ("count([i < a if Bernoulli(1/3) else i == 4 for i in range(5)])", [T] * 3, lambda b: b[0] + b[1] + (not b[2]), 6),
    ("5 * any(Bernoulli(1/3, shape=5))", [T] * 5, lambda b: 5 * any(b), 6),
    ("all(Bernoulli(1/3, shape=4) or v == a)", [T] * 3, all, 5),
    ("count(Bernoulli(1/3, shape=4) and v != a)", [T] * 3, sum, 5),
    ("count([Bernoulli(1/4), Bernoulli(1/3), a == 2])", [Q, T], lambda b: 1 + sum(b), 4),
    ("count([Bernoulli(1/4), Bernoulli(1/3)])", [Q, T], sum, 3),
    ("count([Bernoulli(1/4), a == 2])", [Q], lambda b: 1 + b[0], 2),
    ("count([one and Bernoulli(1/4) for i in range(3)])", [Fraction(1, 5), Q, Q, Q], lambda b: b[0] * sum(b[1:]), 8),
    ("count([Bernoulli(1/4), Bernoulli(UniformInt(0, 1) / 3)])", [Q, Fraction(1, 2), T], lambda b: b[0] + (b[1] and b[2]), 6),
    ("2 * any([count([Bernoulli(1/4) for i in range(2)]) == 2, Bernoulli(1/3)])", [Q, Q, T],
     lambda b: 2 * ((b[0] and b[1]) or b[2]), 6),
]  # fmt: skip
"""Expressions, chances of independent conditions, the value of k' for a = 2, and how many outcomes are listed."""


@pytest.mark.parametrize(("expression", "chances", "value", "listed"), COUNTED)
def test_conditions_that_are_counted_are_one_draw(
    expression: str, chances: list[Fraction], value: Callable[..., int], listed: int
) -> None:
    made = task(expression)
    assert Steps(made).branching == listed
    assert next_k(made, 0, 2) == pytest.approx(law(chances, value), abs=1e-14)


APART: list[tuple[str, list[Fraction], Callable[..., int]]] = [
    ("sum(Bernoulli(1/3, shape=3) * (1, 2, 4))", [T] * 3, lambda b: b[0] + 2 * b[1] + 4 * b[2]),  # weights tell them apart
    ("count([one, one, Bernoulli(1/2)])", [Fraction(1, 5), Fraction(1, 2)], lambda b: 2 * b[0] + b[1]),  # one draw twice
    ("count([one and i < 2 for i in range(3)]) + one", [Fraction(1, 5)], lambda b: 3 * b[0]),
    ("count(cumsum(Bernoulli(1/3, shape=3)) >= 1)", [T] * 3, lambda b: sum(map(any, (b[:1], b[:2], b)))),  # of all before it
    ("count([Bernoulli(1/4) and i < UniformInt(0, 2) for i in range(2)])", [Q, 2 * T, Q, T],
     lambda b: (b[0] and b[1]) + (b[2] and b[3])),  # the last draw comes after the conditions
]  # fmt: skip


@pytest.mark.parametrize(("expression", "chances", "value"), APART)
def test_conditions_that_matter_one_by_one_stay_apart(
    expression: str, chances: list[Fraction], value: Callable[..., int]
) -> None:
    assert next_k(task(expression), 0, 2) == pytest.approx(law(chances, value), abs=1e-14)


def test_a_hundred_conditions_are_solved_in_rationals() -> None:
    """The binomial law, which nothing here adds up."""
    made = task("sum(Bernoulli(1/2, shape=90))")
    assert taskspec.exact.scores(made).optimal.value == pytest.approx(3 * 45, rel=1e-15)
    found = next_k(made, 0, 0)
    for k in range(100):
        assert found[k] == pytest.approx(math.comb(90, k) / 2**90, rel=1e-13)


# -- parts of permutations ----------------------------------------------------------------------------------------

PARTS: list[tuple[str, int, Callable[[int, int], float]]] = [
    ("order[0]", 16, lambda k, n: 1 / 16),
    ("order[3] // 4", 4, lambda k, n: 1 / 4),
    ("count(order[:3] < 2)", 7, lambda k, n: math.comb(2, k) * math.comb(14, 3 - k) / math.comb(16, 3)),
    ("argmax(order == 0)", 16, lambda k, n: 1 / 16),
    ("argmax(Subset(7, 1))", 7, lambda k, n: 1 / 7),
    ("2 * order[1] + (order[0] < order[1])", 240, lambda k, n: (k // 2 if k % 2 else 15 - k // 2) / 240),
]


@pytest.mark.parametrize(("expression", "most", "chance"), PARTS)
def test_a_permutation_costs_what_is_looked_at(expression: str, most: int, chance: Callable[[int, int], float]) -> None:
    made = task(expression)
    assert Steps(made).branching == most
    found = next_k(made, 0, 0)
    assert found.sum() == pytest.approx(1)
    for k in np.flatnonzero(found):
        assert found[k] == pytest.approx(chance(int(k), most), rel=1e-13)


def mines(n: int, k: int, how: str) -> Task:
    return build_text(f"""
state: {{mine: {{type: bool, shape: {n}}}, at: {{type: int, low: 0, high: {n - 1}}}}}
action: {{a: {{type: int, low: 0, high: {n - 1}}}}}
initial: {{mine: "{how.format(n=n, k=k)}", at: 0}}
dynamics: {{"at'": a}}
reward: mine[a]
horizon: 1
""")


@pytest.mark.parametrize("how", ["Subset({n}, {k})", "Permutation({n}) < {k}"])
def test_a_subset_has_as_many_outcomes_as_there_are_choices(how: str) -> None:
    """12 places of which 2 are chosen: 66 starts, not 12 factorial; and check lists all of them."""
    made = mines(12, 2, how)
    model = extract(made, reachable=True)
    assert np.flatnonzero(model.start).size == math.comb(12, 2)
    assert model.start[model.start > 0] == pytest.approx(1 / math.comb(12, 2))
    assert soundness(made) == []
    assert float(taskspec.exact.scores(made).random.value) == pytest.approx(2 / 12)


def test_models_leave_out_states_where_episodes_enter_few_of_them() -> None:
    """Boards of 16 places with 2 mines are 120 of 65,536; with any number of mines they are all."""
    few = mines(16, 2, "Subset({n}, {k})")
    every = mines(10, 5, "[Bernoulli(1/2) for i in range({n})]")
    assert extract(few).n_states == math.comb(16, 2) * 16
    assert extract(every).n_states == 2**10 * 10 >= MANY
    whole = extract(mines(12, 2, "Subset({n}, {k})"), reachable=False)
    part = extract(mines(12, 2, "Subset({n}, {k})"))
    assert (whole.n_states, part.n_states) == (2**12 * 12, math.comb(12, 2) * 12)
    assert whole.start @ solve.best(whole).value == pytest.approx(part.start @ solve.best(part).value)


# -- draws that lines of `initial` share --------------------------------------------------------------------------

APART = """
parameters: {n: {type: int, default: 6, low: 2}}
noise:
  order: Permutation(n)
  late: order[0] + UniformInt(0, 3)
  shift: UniformInt(0, 9)
state:
  s: {type: int, low: 0, high: n - 1}
  goal: {type: int, low: 0, high: n - 1}
  far: {type: int, low: 0, high: n + 3}
action: {a: {type: int, low: 0, high: 2}}
initial: {s: "order[0]", goal: "order[1]", far: late}
observation: {s: s, goal: goal, far: far, order: order, shift: shift}
dynamics:
  s': (s + a + (shift > 4)) % n
  goal': order[1] if s' == goal else goal
reward: s' == goal
horizon: 8
"""


def test_lines_of_initial_share_a_noise() -> None:
    env = taskspec.make(build_text(APART))
    starts = set()
    for seed in range(300):
        seen, _ = env.reset(seed=seed)
        s, goal, far, *order = map(int, seen[:9])
        assert sorted(order) == list(range(6))
        assert (s, goal) == (order[0], order[1])  # the observation of a reset sees the same draw
        assert 0 <= far - s <= 3
        starts.add((s, goal))
    assert starts == set(itertools.permutations(range(6), 2))


def test_a_noise_of_the_start_is_drawn_anew_in_steps() -> None:
    env = taskspec.make(build_text(APART))
    first, _ = env.reset(seed=1)
    orders = {tuple(env.step(0)[0][3:9]) for _ in range(8)} | {tuple(first[3:9])}
    assert len(orders) == 9


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_backends_share_draws_alike(backend: Any) -> None:
    pytest.importorskip(backend)
    Agreement(build_text(APART), backend, 5, "SameStep", one=ReferenceEnv).run(20)


def test_the_start_is_solved_by_counting() -> None:
    made = build_text(APART.replace("default: 6", "default: 16").replace("  far: {type: int, low: 0, high: n + 3}\n", "")
                           .replace(", far: late", "").replace(", far: far, order: order, shift: shift", "")
                           .replace("  late: order[0] + UniformInt(0, 3)\n", ""))  # fmt: skip
    model = extract(made, reachable=True)
    assert np.flatnonzero(model.start).size == 16 * 15
    assert model.start[model.start > 0] == pytest.approx(1 / 240)


@pytest.mark.parametrize("noise", ["Bernoulli(s / 9)", "UniformInt(0, a)", "Bernoulli(1 / (t + 2))"])
def test_a_noise_of_a_step_cannot_begin_an_episode(noise: str) -> None:
    text = APART.replace("shift: UniformInt(0, 9)", f'shift: "{noise}"').replace("far: late", "far: 0 * shift")
    found = refusal(build_text, text.replace(", shift: shift}", "}"))
    assert found.codes == ["E302"]
    assert "an episode begins before any step" in str(found)
