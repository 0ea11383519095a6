"""JAX computes in single floats: ints that come of its reals are bounded by what these may be, and not by float64."""

import numpy as np
import pytest
from gymnasium.spaces import Discrete

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.interval import single
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.types import REAL, Role
from tests.conftest import needs_vectors
from tests.shared.sections import build_text

pytestmark = needs_vectors()
SPEC = """
state: {{x: {{type: real, low: 0, high: {high}}}}}
action: {{a: {{type: int, low: 0, high: 1}}}}
observation: {{o: "{seen}"}}
horizon: 3
initial: {{x: {high}}}
dynamics: {{x': x}}
reward: "{reward}"
"""


@pytest.mark.parametrize(
    ("high", "reward"),
    [
        ("2147483646.9", "floor(x) + 1"),
        ("65535.999", "floor(x) * 32768"),
        ("46339.9999", "(floor(x) + 1) * (floor(x) + 1)"),
        ("715827882.5", "sum([floor(x) for i in range(3)])"),
        ("0.99999999", "floor(x * 2147483646.9) + 1"),
    ],
)
def test_ints_that_single_floats_make_too_wide_are_refused(high: str, reward: str) -> None:
    task = build_text(SPEC.format(high=high, reward=reward, seen="t"))
    VectorEnvironment(task, 1, backend="numpy")
    with pytest.raises(SpecError, match="E715"):
        VectorEnvironment(task, 1, backend="jax")


@pytest.mark.parametrize("backend", ["numpy", "jax"])
@pytest.mark.parametrize("seen", ["floor(x * 3)", "floor(x * 3) - 1", "ceil(-3 * x)"])
def test_the_space_of_observations_has_room_for_what_every_backend_shows(backend: str, seen: str) -> None:
    task = build_text(SPEC.format(high="0.99999999", reward=0, seen=seen))
    env = VectorEnvironment(task, 1, backend=backend)
    shown, _ = env.reset(seed=0)
    for _ in range(3):
        assert env.single_observation_space.contains(shown[0]), shown
        shown, *_ = env.step(np.zeros(1, int))


@pytest.mark.parametrize(
    ("seen", "values"),
    [("floor(x)", 2), ("ceil(x)", 2), ("floor(-x)", 2), ("floor(2 * x - 1)", 3), ("floor(max([x, -x]))", 3)],
)
def test_ends_that_single_floats_hold_give_no_room_for_more(seen: str, values: int) -> None:
    space = taskspec.make(build_text(SPEC.format(high="1", reward=0, seen=seen))).observation_space
    assert isinstance(space, Discrete) and space.n == values


def value(dtype: type[np.floating], columns: list[np.ndarray], expr: str) -> np.ndarray:
    x, y = np.array(columns, dtype)
    v = np.stack([x, y, x * y])
    return {"sum": v.sum(axis=0, dtype=dtype), "product": x * y - x, "shares": (x / (y + dtype(3))) * y}[expr]


@pytest.mark.parametrize("expr", ["sum", "product", "shares"])
@pytest.mark.parametrize(("low", "high"), [(0.0, 0.99999999), (-1.0, 1.0), (0.1, 16777217.0)])
def test_values_in_single_floats_are_within_their_bounds(expr: str, low: float, high: float) -> None:
    b = Builder()
    x = b.read(Role.STATE, "x", REAL, low, high)
    y = b.read(Role.STATE, "y", REAL, low, high)
    three: Node = b.structure("vector", [x, y, b.apply("mul", x, y)])
    node = {
        "sum": b.apply("sum", three),
        "product": b.apply("sub", b.apply("mul", x, y), x),
        "shares": b.apply("mul", b.apply("div", x, b.apply("add", y, b.scalar(3.0))), y),
    }[expr]
    least, most = single(node)
    ends = np.array([low, high, (low + high) / 2])
    points = np.concatenate([ends, np.random.default_rng(0).uniform(low, high, 1000)])
    columns = list(np.array(np.meshgrid(points, points)).reshape(2, -1))
    found = value(np.float32, columns, expr).astype(float)
    assert least <= found.min() and found.max() <= most
