"""Parameters that differ between lanes of JAX programs, beside one task for each value."""

from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import SpecError, load
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text
from tests.shared.sparse import sparse

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402

from taskspec.programs.jax import Functional  # noqa: E402

SLIPPERY = """
taskspec: 1
name: Slippery
parameters:
  L: {type: int, default: 3, low: 1, high: 9}
  slip: {type: real, default: 0.5, low: 0, high: 1}
  pay: {type: int, default: 2, low: 0}
  scale: {type: real, default: 1}
  gamma: {type: real, default: 0.9, low: 0, high: 1}
  fast: {type: bool, default: true}
  require:
    - {condition: pay >= scale - 100, message: it must pay}
constants:
  double: 2 * scale
  places: [1, 2, 3, 4]
noise:
  late: Bernoulli(slip)
state:
  s: {type: int, low: 0, high: L}
  hot: {type: bool}
action:
  a: {type: choice, values: {left: -1, right: 1}}
observation: {s: s, hot: hot, late: late, p: slip}
horizon: 2 * L
discount: gamma
initial: {s: "UniformInt(0, 1)", hot: late}
dynamics:
  s': "clip(s + (0 if late else a), 0, L)"
  hot': "Bernoulli(1 - slip)"
reward: pay * (s' == L) + double * hot'
terminal: s' == L
expert: {a: right}
claims: [optimal_return > 0]
"""
SLIPS = [0.0, 0.25, 0.5, 0.75, 1.0]
PAYS = [0, 1, 2, 3, 7]
SCALES = [1.0, -0.5, 2.0, 0.25, 8.0]
STEPS = 14


def slippery(**given: Any) -> Task:
    return build(read_text(SLIPPERY), parameters=given)


def alone(seed: int, actions: Any, **given: Any) -> list[Any]:
    """What a scalar environment with these parameters gives, episode after episode."""
    env: Any = taskspec.make(slippery(**given))
    found = [env.reset(seed=seed)[0]]
    ended = False
    for action in actions:
        seen, reward, terminated, truncated, _ = env.step(action)
        found += [reward, terminated, truncated]
        ended = terminated or truncated
        found.append(env.reset()[0] if ended else seen)
    return found


def test_each_lane_is_as_the_task_with_its_parameters() -> None:
    functions = Functional(slippery(), varying=["slip", "scale", "pay"])
    actions = np.random.default_rng(0).integers(0, 2, (STEPS, 5))

    @jax.jit
    def play(key: Any, params: Any, chosen: Any) -> Any:
        def one(state: Any, action: Any) -> Any:
            seen, state, reward, _, info = functions.step(state, action, params)
            return state, (seen, reward, info["terminated"], info["truncated"])

        first, state = functions.reset(key, params)
        return first, jax.lax.scan(one, state, chosen)[1]

    params = jax.vmap(lambda p, n, x: functions.default_params.replace(slip=p, pay=n, scale=x))(
        jnp.array(SLIPS), jnp.array(PAYS), jnp.array(SCALES)
    )
    keys = jax.vmap(jax.random.key)(jnp.arange(11, 16))
    first, (seen, reward, terminated, truncated) = jax.vmap(play, in_axes=(0, 0, 1))(keys, params, actions)
    for i in range(5):
        found = alone(11 + i, actions[:, i], slip=SLIPS[i], pay=PAYS[i], scale=SCALES[i])
        np.testing.assert_array_equal(first[i], found[0])
        for t in range(STEPS):
            expected = found[1 + 4 * t : 5 + 4 * t]
            assert [float(reward[i, t]), bool(terminated[i, t]), bool(truncated[i, t])] == expected[:3]
            np.testing.assert_array_equal(seen[i, t], expected[3])


def test_lanes_last_take_arrays_of_parameters() -> None:
    functions = Functional(slippery(), varying=("slip",))
    params = functions.default_params.replace(slip=jnp.array([0.0, 1.0]))
    seen, state = functions.lanes_reset(jnp.zeros((2, 2), jnp.uint32), params)
    for _ in range(3):
        seen, state, _ = functions.lanes_step(state, jnp.array([1, 1]), params)
    assert np.asarray(seen)[[2, 3]].tolist() == [[0, 1], [0, 1]]
    assert np.asarray(seen)[0, 0] != np.asarray(seen)[0, 1]


def test_without_params_a_program_has_those_of_its_task() -> None:
    task = slippery(scale=3.0, slip=0.0)
    functions = Functional(task, varying=["scale"])
    fixed = Functional(task)
    assert functions.default_params._asdict() == {"max_steps_in_episode": 6, "scale": 3.0}
    state, other = (f.reset(jax.random.key(4))[1] for f in (functions, fixed))
    assert float(functions.step(state, 1)[2]) == float(fixed.step(other, 1)[2])


@pytest.mark.parametrize("one_hot", sparse([True, False], 2))
def test_gymnax_takes_parameters(one_hot: bool) -> None:
    task = build_text(SLIPPERY.replace(", p: slip", ""))
    env = Functional(task, varying=["scale", "slip"]).gymnax(one_hot=one_hot)
    params = jax.vmap(lambda x: env.default_params.replace(scale=x, slip=0.0))(jnp.array(SCALES))
    assert params.max_steps_in_episode.tolist() == [6] * 5
    key = jax.random.split(jax.random.key(0), 5)
    seen, state = jax.vmap(env.reset)(key, params)
    _, _, reward, *_ = jax.vmap(env.step)(key, state, jnp.zeros(5, jnp.int32), params)
    assert reward.tolist() == [2 * x for x in SCALES]
    assert seen.shape == (5, 8 if one_hot else 3)


def test_gymnasiums_functional_environment_takes_them_too() -> None:
    functional = pytest.importorskip("taskspec.envs.functional")
    env = functional.TaskFuncEnv(slippery(), varying=["scale", "slip"])
    params = env.get_default_params(scale=5.0, slip=0.0)
    state = env.initial(jax.random.key(1), params)
    after = env.transition(state, 0, None, params)
    assert float(env.reward(state, 0, after, None, params)) == 10.0


@pytest.mark.parametrize(
    ("names", "code", "message"),
    [
        (["L"], "E713", "parameter L cannot differ between lanes: 'high' must be a constant"),
        (["gamma"], "E713", "parameter gamma cannot differ between lanes: the discount must be a constant"),
        (["slip", "L"], "E713", "all of the parameters L, slip cannot differ between lanes: 'high' must be a constant"),
        (["fast"], "E713", "parameter fast is not a number, and cannot differ between lanes"),
        (["speed"], "E702", "Slippery has no parameter 'speed'"),
    ],
)
def test_what_cannot_vary_is_said(names: list[str], code: str, message: str) -> None:
    found = refusal(Functional, slippery(), varying=names)
    assert (found.diagnostics[0].code, found.diagnostics[0].message) == (code, message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pay * (s' == L)", "places[pay]", "an index must be a constant where it depends on parameters"),
        ("pay * (s' == L)", "sum([1 for i in range(pay)])", "an argument of `range` must be a constant"),
        ("pay * (s' == L)", "0", "parameter pay has no effect on what a step gives, and cannot differ between lanes"),
        ("UniformInt(0, 1)", "UniformInt(0, min(pay, 2))", None),
    ],
)
def test_counts_and_places_are_fixed(old: str, new: str, message: str | None) -> None:
    task = build_text(SLIPPERY.replace(old, new))
    if message is None:
        Functional(task, varying=["pay"]).reset(jax.random.key(0))
        return
    found = refusal(Functional, task, varying=["pay"])
    assert found.diagnostics[0].code == "E713"
    assert found.diagnostics[0].message.endswith(message)


def test_values_are_checked_where_they_are_known() -> None:
    params = Functional(slippery(), varying=["slip", "pay"]).default_params
    wrong = [{"slip": 1.5}, {"pay": 0.5}, {"slip": float("nan")}, {"slip": jnp.array([0.5, -1])}]
    for changes, code in (
        *((each, "E703") for each in wrong),
        ({"L": 5}, "E713"),
        ({"max_steps_in_episode": 9}, "E713"),
    ):
        assert refusal(params.replace, **changes).diagnostics[0].code == code
    assert params.replace(max_steps_in_episode=6) == params
    for name, told in (
        ("L", r"L is bound when the task is loaded(.|\n)*load\(task, L=\.\.\.\)"),
        ("max_steps_in_episode", "max_steps_in_episode is the horizon of the task"),
        ("slipp", r"E702(.|\n)*the task has no parameter 'slipp'(.|\n)*slip"),
    ):
        with pytest.raises(SpecError, match=told):
            params.replace(**{name: 9})


def test_a_task_with_modifiers_is_refused() -> None:
    with pytest.raises(SpecError, match="E713"):
        Functional(load("Parabola", modifiers=["delay=2"]), varying=["dx"])


TOGETHER = SLIPPERY.replace("pay >= scale - 100, message: it must pay", "slip + scale <= pay, message: it must pay")


def test_conditions_on_several_parameters_are_checked_for_every_lane() -> None:
    """Where a scalar environment is refused, so are these values; in a compiled program, the lane is paid nan."""
    functions = Functional(build_text(TOGETHER), varying=["slip", "scale", "pay"])
    params = functions.default_params
    slips = jnp.array([0.25, 0.75, 1.0])
    pays = jnp.array([1, 1, 2])
    scales = jnp.array([0.75, 0.5, 1.0])  # 1 <= 1, 1.25 > 1, 2 <= 2
    alone = refusal(build, read_text(TOGETHER), parameters={"slip": 0.75, "scale": 0.5, "pay": 1})
    assert alone.diagnostics[0].code == "E704"
    give = [
        lambda: params.replace(slip=0.75, scale=0.5, pay=1),
        lambda: params.replace(slip=slips, scale=scales, pay=pays),
        lambda: jax.vmap(lambda x, y, n: params.replace(slip=x, scale=y, pay=n))(slips, scales, pays),
        lambda: jax.vmap(lambda x: jax.vmap(lambda n: params.replace(slip=x, scale=0.5, pay=n))(pays))(slips),
    ]
    for each in give:
        with pytest.raises(SpecError, match="it must pay") as found:
            each()
        assert found.value.diagnostics[0].code == "E704"
    with pytest.raises(SpecError, match=r"slip=0\.75"):
        give[1]()
    with pytest.raises(SpecError, match="E703"):
        jax.vmap(lambda x: params.replace(slip=x))(jnp.array([0.5, 1.5]))

    @jax.jit
    def paid(slip: Any, scale: Any, pay: Any) -> Any:
        given = params.replace(slip=slip, scale=scale, pay=pay)
        _, state = functions.lanes_reset(jnp.zeros((2, 3), jnp.uint32), given)
        return functions.lanes_step(state, jnp.array([1, 1, 1]), given)[2].reward

    assert np.isnan(paid(slips, scales, pays)).tolist() == [False, True, False]
    assert np.isnan(paid(jnp.array([0.5, -0.5, 1.5]), scales, jnp.array([9, 9, 9]))).tolist() == [False, True, True]
