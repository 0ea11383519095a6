"""Programs beside the reference interpreter: what fails or differs is reported, and all that a program shows is compared."""

import re
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

from taskspec import exact
from taskspec.language.task.task import Task
from taskspec.programs import array_form
from taskspec.programs.agreement import EVERY, QUICK, ProgramChecks
from taskspec.programs.lane_form import LaneEmitter
from taskspec.programs.numpy import NumpyEngine, compile_numpy
from taskspec.programs.scalar import compile_scalar, module
from taskspec.programs.vector_program import Buffers, Masks
from tests.shared.sections import build_text

SPEC = """
taskspec: 1
name: Lift
parameters: {top: {type: int, default: 6, low: 2, high: 40}}
info: [old_state, new_state]
measures: {cost: abs(a - level)}
state: {level: {type: int, low: 0, high: top}}
action: {a: {type: int, low: 0, high: top}}
legal: a <= level + 1
horizon: 5
initial: {level: {0: 1/2, 2: 1/2}}
dynamics: {level': "clip(a + (1 if Bernoulli(1/2) else 0), 0, top)"}
reward: level'
terminal: level' == top
"""


def lift() -> Task:
    return build_text(SPEC)


@pytest.fixture
def fresh() -> None:
    """Programs are generated anew."""
    compile_scalar.cache_clear()
    compile_numpy.cache_clear()
    yield
    compile_scalar.cache_clear()
    compile_numpy.cache_clear()


def test_programs_are_run_at_every_setting() -> None:
    report = exact.check(lift())
    assert not report.errors
    assert report.coverage.programs == dict.fromkeys(QUICK, 1 + len(report.coverage.cases))
    assert not report.coverage.left_out


def test_a_statement_after_the_last_is_refused() -> None:
    lane = LaneEmitter({}, {}, lambda node: (0, 0))
    name = lane.named("1 + 1")
    assert lane.finish(results=[name]) == [f"{name} = 1 + 1"]
    with pytest.raises(AssertionError, match="after the last"):
        lane.named("2 + 2")


def test_a_failure_is_an_error_with_the_parameters_that_show_it(fresh: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mask as it was once written, before the elements of long vectors have their names."""

    def mask(task: Task, lane: LaneEmitter) -> list[str]:
        lane.emit(task.mask)
        lines = list(lane._lines)
        result = f"return array(({', '.join(lane.atoms(task.mask[0]))},), int8)"
        return ["def mask():", *(f"    {line}" for line in [*lines, result])]

    monkeypatch.setattr(module.interface, "mask", mask)
    (error,) = exact.check(lift()).errors
    assert (error.code, error.span.line) == ("E801", 3)
    assert error.message.startswith("the scalar program fails: NameError: name 'v")
    assert error.notes == ("parameters: top = 40",)


def test_a_wrong_operator_is_found(fresh: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(array_form.UFUNCS, "({0} + {1})", "subtract")
    (error,) = exact.check(lift()).errors
    assert error.code == "E801"
    assert re.match(r"the numpy program differs from the interpreter: after \d steps?, ", error.message)


def spoiled(array: str) -> Callable[[Buffers], None]:
    def spoil(b: Buffers) -> None:
        held = getattr(b, array)
        arrays = [held]
        if array in ("seen", "state", "measures"):
            arrays = getattr(held, "parts", held)
        for each in arrays:
            change = np.logical_xor if each.dtype == bool else np.add
            change(each, 1, each)

    return spoil


@pytest.mark.parametrize(
    ("array", "name"),
    [
        ("seen", "the first observation"), ("reward", "the reward"), ("terminated", "`terminated`"), ("truncated", "`truncated`"),
        ("measures", "the measure 'cost'"), ("state", "'level'"),
    ],
)  # fmt: skip
def test_all_that_a_step_gives_is_compared(array: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spoil = spoiled(array)
    step = NumpyEngine.step

    def spoiled_step(engine: NumpyEngine, actions: Any) -> int:
        ended = step(engine, actions)
        spoil(engine.buffers)
        return ended

    monkeypatch.setattr(NumpyEngine, "step", spoiled_step)
    (error,) = ProgramChecks(["numpy"]).problems(lift())
    assert re.search(rf"after \d steps?, {name} is ", error.message)


def test_masks_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Masks, "__call__", lambda masks: np.zeros((2, 7), np.int8))
    (error,) = ProgramChecks(["numpy"]).problems(lift())
    assert "after reset(), the mask of legal actions is [0 0 0 0 0 0 0], not [1, 1, 1, 1, 0, 0, 0]" in error.message


GROWING = """
state: {x: {type: real, low: 0, high: 10}}
action: {a: {type: bool}}
horizon: 20
initial: {x: 0}
dynamics: {x': x + 0.1}
reward: "1 if x' >= 0.300000001 else 0"
"""


def test_what_single_precision_decides_otherwise_is_no_error() -> None:
    pytest.importorskip("jax")
    checks = ProgramChecks(["scalar", "jax"])
    assert not checks.problems(build_text(GROWING))
    assert checks.settings == {"scalar": 1}
    assert list(checks.left_out) == [("jax", "in single precision, a real may decide otherwise")]


SEVENS = """
state: {x: {type: int, low: 0, high: 100}, b: {type: int, low: 0, high: 20}}
action: {a: {type: int, low: 1, high: 2}}
horizon: 60
initial: {x: 0, b: 0}
dynamics: {x': "min(x + a, 100)", b': ceil(x / 7)}
reward: (x / 7 == x // 7) + (x / 10 >= 0.35)
"""


def test_a_product_with_the_reciprocal_is_no_quotient(monkeypatch: pytest.MonkeyPatch) -> None:
    """42 times 1 / 7 is above 6 in float32, which rounding does not excuse: 42, 7 and 6 are held exactly."""
    pytest.importorskip("jax")
    from taskspec.programs.jax.library import JaxRuntime

    assert not ProgramChecks(EVERY).problems(build_text(SEVENS))
    monkeypatch.setattr(JaxRuntime, "div", lambda rt, a, b: a * (1 / b))
    (error,) = ProgramChecks(["jax"]).problems(build_text(SEVENS.replace("60", "61")))
    assert "the jax program differs from the interpreter: after 28 steps, the observation is [44. 7.]" in error.message


SIZES = """
info: [old_state, new_state]
measures: {m: "v[0] + 0.5"}
state:
  v: {type: KIND, low: 0, high: 3, shape: [N]}
  b: {type: bool, shape: [N]}
  c: {type: int, low: 0, high: 20}
action: ACTION
horizon: 4
initial:
  v: Uniform(0, 3, shape=N)
  b: "[Bernoulli(1/2) for i in range(N)]"
  c: 3
dynamics:
  v': "clip(v[::-1] + MOVE, 0, 3)"
  b': "[b[i] == (c > 3) for i in range(N)]"
  c': (c + 5) % 21
reward: sum(v') + c'
terminal: c' == 20
observation: {v: v, b: b, c: c, space: SPACE}
"""
ACTIONS = {
    "{a: {type: int, low: 0, high: N}}\nlegal: a <= c": "(a % 2)",
    "{a: {type: int, low: -1, high: 1, shape: [N]}}": "a",
    "{a: {type: real, low: -1, high: 1, shape: [N]}, k: {type: int, low: 2, high: 5}}": "[floor(a[i]) for i in range(N)]",
}


@pytest.mark.parametrize("size", [16, 17, 33])
def test_long_vectors_in_every_place(size: int) -> None:
    """Up to 16 elements, vectors are written out element by element; up to 32, they wait as tuples."""
    spaces = ("box", "dict", "multi_discrete", "one_hot")
    for space, kind, (action, move) in product(spaces, ("int", "real"), ACTIONS.items()):
        if kind == "real" and space in ("multi_discrete", "one_hot"):
            continue
        text = SIZES.replace("ACTION", action).replace("MOVE", move).replace("KIND", kind).replace("SPACE", space)
        if kind == "int":
            text = text.replace("Uniform(0, 3, shape=N)", '"[UniformInt(0, 3) for i in range(N)]"')
        task = build_text(text.replace("N", str(size)))
        assert not ProgramChecks(QUICK).problems(task), text
