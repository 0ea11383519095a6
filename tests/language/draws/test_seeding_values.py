"""What a draw makes of its words, as docs/reference/seeding.md says it: its tables, read literally, and `seeding.py` there."""

import json
import math
import zlib
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from itertools import accumulate
from typing import Any

import numpy as np

import taskspec
from taskspec.language.task.task import Task
from taskspec.programs.reference import ReferenceProgram
from tests.seeding_page import CODE, CONSTANT, STEP, words
from tests.shared.for_each import for_each
from tests.shared.scripts import DOCS
from tests.shared.sections import build_text

SEED = 2**40 + 7
F = np.float32
Words = Sequence[int]


@cache
def thresholds(p: tuple[Fraction | float, ...]) -> list[int]:
    *sums, total = accumulate(map(Fraction, p))
    return [round(2**32 * s / total) for s in sums]


def outcome(w: int, p: Sequence[Fraction | float]) -> int:
    return sum(t <= w for t in thresholds(tuple(p)))


def uniform(w: int) -> F:
    return F((w >> 8) * 2**-24)


def running(w: int, p: Sequence[float]) -> int:
    sums = np.cumsum(np.maximum(np.array(p, F), 0), dtype=F)
    return int(np.sum(sums[:-1] <= uniform(w) * sums[-1]))


def poisson(w: int, rate: float) -> int:
    """Of a constant rate, as the page says it."""
    weights = {math.floor(rate): 1.0}
    k = math.floor(rate)
    while k > 0 and weights[k] * (k / rate) >= 2.0**-80:
        weights[k - 1] = weights[k] * (k / rate)
        k -= 1
    k = math.floor(rate) + 1
    while weights[k - 1] * (rate / k) >= 2.0**-80:
        weights[k] = weights[k - 1] * (rate / k)
        k += 1
    counts = sorted(weights)
    return counts[outcome(w, list(map(weights.__getitem__, counts)))]


def counted(w: int, rate: float, bound: float) -> int:
    """Of a rate that changes, by one of its words."""
    parts = max(1, math.ceil(bound / 64))
    x = min(max(F(rate), F(0)), F(bound)) / F(parts)
    term = F(1)
    total = F(1)
    totals = [total]
    for k in range(1, poisson(2**32 - 1, bound / parts) + 1):
        term = term * x / F(k)
        total = total + term
        totals.append(total)
    return int(np.sum(np.array(totals[:-1]) <= uniform(w) * total))


THIRDS = [Fraction(1, 3), Fraction(1, 2), Fraction(1, 6)]
ROWS = np.array([[Fraction(1, 7)] * 7, np.arange(1, 8) * Fraction(1, 28)])
NEAR = [-20, -11, -10, -9, -2, -1, 0, 1, 2, 9, 10, 11, 20]
STEPS_DOWN = [0, -1, -2, -3, 9, 8, 7, 18, 17]
VALUES: dict[str, Callable[[Words, int], Any]] = {
    "UniformInt(-3, 11)": lambda w, y: -3 + (w[0] * 15 >> 32),
    "UniformInt(0, y)": lambda w, y: w[0] * (y + 1) >> 32,
    "UniformInt(y, 2)": lambda w, y: y + (w[0] * max(1, 3 - y) >> 32),
    "Uniform({5, 3, 5, 8})": lambda w, y: [5, 3, 8][w[0] * 3 >> 32],
    "sum(Uniform({p for p in box(-2, 2, 2) if norm1(p) <= 2}) * (10, 1))": lambda w, y: NEAR[w[0] * 13 >> 32],
    "Uniform({10 * i - j for i in range(3) for j in range(4) if j >= i})": lambda w, y: STEPS_DOWN[w[0] * 9 >> 32],
    "Categorical([1/3, 1/2, 1/6])": lambda w, y: outcome(w[0], THIRDS),
    "sum(Categorical([1/3, 1/2, 1/6], shape=2) * (3, 1))": lambda w, y: (
        3 * outcome(w[0], THIRDS) + outcome(w[1], THIRDS)
    ),
    "Categorical([0.3, 0.3, 0.4])": lambda w, y: outcome(w[0], [0.3, 0.3, 0.4]),
    "Categorical({4: 0, 6: 1, 9: 0})": lambda w, y: 6,
    "Categorical(rows[y % 2])": lambda w, y: outcome(w[0], ROWS[y % 2]),
    "Categorical([y, 1, 2] / (y + 3))": lambda w, y: running(w[0], [y / (y + 3), 1 / (y + 3), 2 / (y + 3)]),
    "Bernoulli(1/3)": lambda w, y: w[0] < round(Fraction(2**32, 3)),
    "Bernoulli(y / 40)": lambda w, y: uniform(w[0]) < F(y / 40),
    "Bernoulli([0, 1/10])[1]": lambda w, y: w[1] < round(Fraction(2**32, 10)),
    "sum(Permutation(4) * (1, 10, 100, 1000))": lambda w, y: int(np.argsort(w[:4], kind="stable") @ [1, 10, 100, 1000]),
    "Poisson(0)": lambda w, y: 0,
    "Poisson(1/4)": lambda w, y: poisson(w[0], 0.25),
    "Poisson(31.5)": lambda w, y: poisson(w[0], 31.5),
    "Poisson(900)": lambda w, y: poisson(w[0], 900.0),
    "Poisson(clip(y / 2, 0, 20))": lambda w, y: counted(w[0], y / 2, 20),
    "Poisson(min(3 * y, 150))": lambda w, y: counted(w[0], 3 * y, 120) + counted(w[1], 3 * y, 120),
    "Poisson(min(y / 1.0, 200))": lambda w, y: sum(counted(w[k], y, 200) for k in range(4)),
    "z: Uniform(-2, 5)": lambda w, y: -2 + 7 * float(uniform(w[0])),
    "z: Normal(y, 3)": lambda w, y: y + 3 * float(CODE["normals"](w[0], w[1])[0]),
    "z: Normal(0, 1, shape=3)[2]": lambda w, y: float(CODE["normals"](w[2], w[3])[0]),
    "z: Exponential(4)": lambda w, y: float(CODE["exponential"](w[0])) / 4,
}


def valued(written: str) -> Task:
    target = "z" if written.startswith("z: ") else "x"
    text = json.dumps(written.removeprefix("z: "))
    return build_text(f"""
constants: {{rows: [[1/7, 1/7, 1/7, 1/7, 1/7, 1/7, 1/7], "[k / 28 for k in range(1, 8)]"]}}
state: {{y: {{type: int, low: 0, high: 40}}, x: {{type: int}}, z: {{type: real}}}}
action: {{a: {{type: bool}}}}
horizon: none
initial: {{y: 0, x: 0, z: 0}}
dynamics: {{{target}': {text}, y': (y + 7) % 41}}
reward: 0
""")


@for_each("written", VALUES)
def test_values(written: str) -> None:
    task = valued(written)
    program = ReferenceProgram(task, SEED)
    env = taskspec.make(task)
    program.reset(), env.reset(seed=SEED)
    for n in range(60):
        y = program.state[0][0]
        program.step([(1,)]), env.step(1)
        name = "z" if written.startswith("z: ") else "x"
        expected = VALUES[written](words(SEED, STEP, n, 16), y)
        assert dict(zip("yxz", program.state, strict=True))[name] == (expected,)
        assert env.state[name] == expected


def test_dirichlet() -> None:
    task = build_text("""
state: {d: {type: real, shape: 3}}
action: {a: {type: bool}}
horizon: 9
initial: {d: 0}
dynamics: {d': "Dirichlet((0.5, 1, 4))"}
reward: 0
""")  # fmt: skip
    program = ReferenceProgram(task, SEED)
    program.reset()
    for n in range(9):
        program.step([(1,)])
        w = words(SEED, STEP, n, 27)
        assert program.state[0] == tuple(map(float, CODE["dirichlet"](w, (0.5, 1, 4))))


def test_constants_of_an_instance() -> None:
    """Each has words of its own, whichever of them needs which."""
    task = build_text("""
parameters: {instance_seed: {type: int, default: 1099511627783}}
constants:
  late: "early + UniformInt(0, 1048575)"
  early: "UniformInt(0, 1048575) if 1 > 2 else UniformInt(0, 1048575)"
  größe: "UniformInt(0, 1048575, shape=3)"
state: {x: {type: int}, y: {type: int}, v: {type: int, shape: 3}}
action: {a: {type: bool}}
horizon: 9
initial: {x: early, y: late, v: größe}
dynamics: {}
reward: 0
""")  # fmt: skip
    program = ReferenceProgram(task, 0)
    program.reset()

    def probes(name: str) -> list[int]:
        return (np.array(words(SEED, CONSTANT, zlib.crc32(name.encode()), 3)) >> 12).tolist()

    early = probes("early")[1]
    assert program.state == [(early,), (early + probes("late")[0],), tuple(probes("größe"))]


def test_rows_that_stay_the_same_are_exact() -> None:
    """The word of this step lies between 2**32 / 3 and what float32 makes of it."""
    task = build_text("""
constants: {rows: [[1/3, 2/3], [1/2, 1/2]]}
state: {k: {type: int, low: 0, high: 1}, x: {type: int}}
action: {a: {type: bool}}
horizon: 1
initial: {k: 0, x: 9}
dynamics: {x': "Categorical(rows[k])"}
reward: 0
""")  # fmt: skip
    seed = 9063343
    (w,) = words(seed, STEP, 0, 1)
    assert uniform(w) < F(1 / 3) < Fraction(w, 2**32) + Fraction(1, 2**24)
    program = ReferenceProgram(task, seed)
    env = taskspec.make(task)
    program.reset(), env.reset(seed=seed)
    program.step([(1,)]), env.step(1)
    assert outcome(w, [Fraction(1, 3), Fraction(2, 3)]) == 1
    assert program.state[1][0] == env.state["x"] == 1


def test_the_page_has_the_known_answers() -> None:
    page = (DOCS / "reference/seeding.md").read_text(encoding="utf-8")
    first = words(seed=0, phase=STEP, n=0, count=2)
    assert first == [0x6B200159, 0x99BA4EFE]
    for answer in (*map(hex, first), *map(str, CODE["normals"](*first))):
        assert answer in page
