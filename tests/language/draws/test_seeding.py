"""Which words a draw is given, as `docs/reference/seeding.md` says it.

No word or variate that is expected here comes from taskspec. Every case of ORDER is a spec whose draws are probes: the value of a
probe is the upper part of its word, so that what a component holds says which word it was given.
"""

import json
import re
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import taskspec
from taskspec.language import draws
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.programs.reference import ReferenceProgram
from tests.seeding_page import CODE, RESET, STEP, words
from tests.shared.conformance import Agreement
from tests.shared.for_each import for_each

U = "UniformInt(0, 1048575)"
SEED = 2**40 + 7
STEPS = 4


# ------------------------------------------------------------------------------ words and real variates

word = st.integers(0, 2**32 - 1) | st.sampled_from([0, 1, 255, 2**31 - 1, 2**31, 2**32 - 1])


@given(st.integers(0, 2**70), st.integers(0, 2**32 - 1), st.integers(0, 7))
def test_words(seed: int, n: int, count: int) -> None:
    assert tuple(words(seed, STEP, n, count)) == draws.words(seed, draws.STEP, n, count)
    assert tuple(words(seed, RESET, n, count)) == draws.words(seed, draws.RESET, n, count)


@given(st.lists(word, min_size=9, max_size=9), st.floats(2**-10, 100, width=32))
def test_reals(w: list[int], alpha: float) -> None:
    array = np.array(w + w[::-1], np.uint32)
    assert draws.exponentials(array)[0] == CODE["exponential"](w[0])
    assert tuple(draws.normals(array[:2], 2).tolist()) == CODE["normals"](w[0], w[1])
    assert draws.dirichlets(array, (alpha, 1.0)).tolist() == list(CODE["dirichlet"](w + w[::-1], (alpha, 1.0)))


# ------------------------------------------------------------------------------ which word a draw is given


class Order(NamedTuple):
    """Sections of a spec, and for components the number of the word each holds after a step, and after a reset."""

    sections: str
    step: dict[str, int]
    reset: dict[str, int] = {}  # noqa: RUF012


ORDER = {
    "components, not lines": Order("dynamics: {y': U, x': U}", {"x": 0, "y": 1}),
    "a next value where it is needed": Order("dynamics: {x': y' * 0 + U, y': U}", {"y": 0, "x": 1}),
    "a noise where it is needed": Order(
        "noise: {n: U, m: U}\ndynamics: {x': m, y': U}\nreward: n + 0 * m", {"x": 0, "y": 1, "reward": 2}
    ),
    "a noise through a definition": Order(
        "noise: {n: U}\ndefinitions: {d: n + 0}\ndynamics: {x': U + 0 * d, y': n}", {"x": 0, "y": 1}
    ),
    "a noise inside a noise": Order("noise: {n: m * 0 + U, m: U}\ndynamics: {x': n, y': m}", {"y": 0, "x": 1}),
    "a noise that nothing names": Order("noise: {n: U}\ndynamics: {x': U, y': U}", {"x": 0, "y": 1}),
    "a noise in the observation": Order(
        "noise: {n: U, m: U, k: U}\ndynamics: {x': m, y': U + 0 * k}\nobservation: {p: U, q: n, r: U, z: k}",
        {"x": 0, "y": 1, "z": 2, "p": 3, "q": 4, "r": 5},
        {"z": 0, "p": 1, "q": 2, "r": 3},
    ),
    "sections": Order(
        "dynamics: {x': U}\nreward: U\nterminal: U + 0 * y < -1\nobservation: {p: U, x: x}", {"x": 0, "reward": 1, "p": 3}
    ),
    "lines of initial": Order("initial: {y: U, x: U}\ndynamics: {x': U}", {"x": 0}, {"y": 0, "x": 1}),
    "a value is drawn once": Order("initial: {x: U, y: x}\ndynamics: {x': U, y': x'}", {"x": 0, "y": 0}, {"x": 0, "y": 0}),
    "left to right": Order('dynamics: {x\': "min(U + 0, [U, U, U][2] * 2**20 + U, U + 2**20)", y\': U}', {"x": 0, "y": 6}),
    "condition, then, else": Order("dynamics: {x': U if U < a * 2**30 else U, y': U}", {"x": 1, "y": 3}),
    "conditions, then values": Order(
        "dynamics: {x': [{if: U < 0, then: U}, {if: U < a * 2**30, then: U}, {else: U}], y': U}", {"x": 3, "y": 5}
    ),
    "value, then index": Order("dynamics: {x': '[U, U, U][U * 0 + a]', y': U}", {"x": 1, "y": 4}),
    "comprehensions": Order("dynamics: {x': '[U + 0 * i for i in range(4) if i != 1][1]', y': U}", {"x": 1, "y": 3}),
    "arguments of a definition": Order(
        'definitions: {"f(p, q)": q}\ndynamics: {x\': "f(U, U)", y\': "f(U, 0) + U"}', {"x": 1, "y": 3}
    ),
    "arguments of a distribution": Order("dynamics: {x': 'UniformInt(U * 0, U * 0 + 1048575)', y': U}", {"x": 2, "y": 3}),
    "keywords as they are given": Order(
        "dynamics: {x': 'UniformInt(high=U * 0 + 1048575, low=U * 0)', y': U}", {"x": 2, "y": 3}
    ),
    "sides of a comparison": Order("dynamics: {x': 'U < U <= U < 2**30', y': U}", {"y": 3}),
    "elements of a set": Order("dynamics: {x': 'Uniform({U * 0 + 3, U * 0 + 4})', y': U}", {"y": 3}),
    "membership": Order("dynamics: {x': 'U in {U, U, 7}', y': U}", {"y": 3}),
    "values, probabilities, the draw": Order("dynamics: {x': {U: U / 2**40, U + 0 * a: 1}, y': U}", {"y": 4}),
    "one outcome": Order("dynamics: {x': {U: 1}, y': U}", {"x": 0, "y": 2}),
    "a table without chance": Order(
        "dynamics: {x': {by: a, rows: {true: U, false: {U: 1}}}, y': U}", {"x": 0, "y": 2}
    ),
    "a table": Order(
        "dynamics: {x': {by: [a, U < 5], rows: {true: {false: U, else: {U: 1/2, U + a: 1/2}},"
        " false: {else: {U: 1/3, 7: 2/3}}}}, y': U}",
        {"x": 1, "y": 6},
    ),
    "a branch that no value leads to": Order(
        "parameters: {K: {type: int, default: 3}}\ndynamics: {x': U if K < 3 else U, y': U}", {"x": 1, "y": 2}
    ),
    "a branch that bounds rule out": Order("dynamics: {x': 'U if U < 2**20 else U', y': U}", {"x": 1, "y": 3}),
    "nothing of it matters": Order("dynamics: {x': '(False and U < 5) * len([U, U]) * U**0', y': U}", {"y": 4}),
    "a vector": Order("dynamics: {v': 'UniformInt(0, 1048575, shape=[2, 2])', x': \"v'[1, 0]\", y': U}", {"x": 2, "y": 4}),
    "normals are even": Order("dynamics: {x': '0 * ceil(sum(Normal(0, 1, shape=3)))', y': U}", {"y": 4}),
    "one normal": Order("dynamics: {x': '0 * ceil(Normal(0, 1))', y': U}", {"y": 2}),
    "permutations": Order("dynamics: {x': 'sum(Permutation(3, shape=2)[0])', y': U}", {"y": 6}),
    "shares": Order("dynamics: {x': '0 * ceil(sum(Dirichlet((1, 2))))', y': U}", {"y": 18}),
    "a constant rate": Order("dynamics: {x': 'Poisson(300)', y': U}", {"y": 1}),
    "a rate that changes": Order("dynamics: {x': 'Poisson(clip(x / 1000, 0, 129))', y': U}", {"y": 3}),
    "a rate in a reset": Order(
        "dynamics: {x': x}\nobservation: {o: 'Poisson(clip(x / 1000, 0, 129))', p: U}", {"p": 3}, {"p": 3}
    ),
    "rates": Order("dynamics: {x': 'sum(Poisson([x / 2**20, 70 * y / 2**20]))', y': U}", {"y": 10}),
}  # fmt: skip


def spec(sections: str) -> Task:
    """A task with components x and y, a matrix v, an action, and the sections given, in which U is a probe."""
    number = {"type": "int", "low": 0, "high": 2**22}
    data: dict[str, Any] = {
        "taskspec": 1,
        "name": "Order",
        "state": {"x": number, "y": number, "v": number | {"shape": [2, 2]}},
        "action": {"a": {"type": "bool"}},
        "horizon": 100,
        "initial": {"x": 0, "y": 0, "v": 0},
        "dynamics": {},
        "reward": 0,
    }
    given = probed(yaml.safe_load(sections))
    if "initial" in given:
        given["initial"].setdefault("v", 0)
    return build(read_text(json.dumps(data | given)))


def probed(value: Any) -> Any:
    match value:
        case dict():
            return dict(map(probed, value.items()))
        case list() | tuple():
            return list(map(probed, value))
        case str():
            return re.sub(r"\bU\b", U, value)
        case _:
            return value


def check_words(
    expected: dict[str, int], task: Task, program: ReferenceProgram, seen: Any, reward: float, given: list[int]
) -> None:
    """Components of the state and of the observation, and the reward, hold the words with the numbers that are expected."""
    components = (*task.observation.components, *task.state)
    values = {"reward": reward}
    for component, value in zip(components, (*seen, *program.state), strict=True):
        values[component.name] = value[0]
    for name, number in expected.items():
        assert values[name] == given[number] >> 12, name


@for_each("name", ORDER)
def test_order(name: str) -> None:
    case = ORDER[name]
    task = spec(case.sections)
    program = ReferenceProgram(task, SEED)
    seen = program.reset()
    check_words(case.reset, task, program, seen, 0, words(SEED, RESET, 0, 40))
    for n in range(STEPS):
        seen, reward, *_ = program.step([(1,)])
        check_words(case.step, task, program, seen, reward, words(SEED, STEP, n, 40))


@for_each("name", ORDER)
def test_order_in_environments(name: str) -> None:
    """The scalar environment gives every draw the words that the interpreter gives it, and NumPy those of the scalar one."""
    task = spec(ORDER[name].sections)
    program = ReferenceProgram(task, SEED)
    env = taskspec.make(task)
    seen = program.reset()
    (first, _) = env.reset(seed=SEED)
    for _ in range(STEPS):
        assert np.array_equal(np.ravel(first), np.concatenate(seen).astype(np.float32))
        seen, reward, terminal, _ = program.step([(1,)])
        first, *rest = env.step(1)
        assert rest[:2] == [reward, terminal]
    Agreement(task, "numpy", 2, "SameStep", SEED).run(5)


DROPPED = """
parameters: {K: {type: int, default: 3}}
noise: {n: U, m: U if K > 9 else 0}
initial: {v: U, x: "U if K > 9 else U", y: U}
dynamics: {x': U if n < 2**20 else m, y': U * 0 if K > 9 else U}
observation: {p: "U if y < 5 else m", q: n, r: "len([U, U]) * U"}
"""


@pytest.mark.parametrize("backend", ["numba", "jax"])
def test_order_on_compiled_backends(backend: str) -> None:
    """With draws that no value needs, in resets, steps and observations."""
    pytest.importorskip(backend)
    Agreement(spec(DROPPED), backend, 3, "SameStep").run(5)
