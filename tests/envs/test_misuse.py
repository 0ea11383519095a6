"""Wrong actions, options, seeds, states and names: what environments and `load` refuse, and in which words."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.envs.options import ActionError, StateError
from taskspec.programs.backend_table import engine
from taskspec.programs.vector_program import BadActionError, Options
from tests.shared.for_each import for_each
from tests.shared.walks import written

# -- misuse of environments -------------------------------------------------------------------------------------------

REAL_ACTION = "\n  u: {type: real, shape: 2, low: -1, high: 1}"
SEVERAL = "\n  i: {type: int, low: 1, high: 3}\n  b: {type: bool}"
NOT_ACTIONS: dict[str, tuple[str, list[Any]]] = {
    "discrete": ("\n  a: {type: int, low: 0, high: 1}", [
        -1, 2, 1.0, np.float32(1), None, "1", [1], (1,), {}, float("nan"), 10**30, np.array([1]), np.array(7), 1j, b"1",
    ]),
    "box": (REAL_ACTION, [
        0.5, [0.5], None, "ab", ["x", "y"], [None, 0], [[0, 0]], np.array([2.0, 0]), np.array([np.nan, 0]), {}, [10**400, 0],
        np.array([np.inf, 0]), np.array(["1", "0"]), np.array([1j, 0]), np.array([1, 0], object), np.zeros((2, 1)), np.zeros(0),
    ]),
    "multi_discrete": (SEVERAL, [
        1, None, "ab", [1], [1, 1, 1], [[1, 1]], [3, 0], [-1, 0], [1.0, 0], [1, float("nan")], [10**30, 0], np.ones(2),
        np.ones(2, bool), np.array([1, 0], object), np.array(["1", "0"]),
    ]),
}  # fmt: skip
MISUSED = [(form, action) for form, (_, actions) in NOT_ACTIONS.items() for action in actions]


@for_each(("form", "action"), MISUSED)
def test_what_is_no_action_is_refused_and_changes_nothing(form: str, action: Any) -> None:
    env: Any = taskspec.make(written(action=NOT_ACTIONS[form][0], dynamics=" {s': (s + 1) % 10}"))
    env.reset(seed=0)
    with pytest.raises(ActionError, match="E706"):
        env.step(action)
    assert env.state == {"s": 0}
    env.action_space.seed(0)
    assert env.step(env.action_space.sample())[1] == 1


@pytest.mark.parametrize("action", [[1, 0], (1, 0), np.array([1, 0]), np.array([True, False]), np.array([1, 0], np.uint8),
                                    np.array([1, 0], np.float16), [np.float32(1), 0], [True, False]], ids=repr)  # fmt: skip
def test_numbers_of_any_kind_are_real_actions(action: Any) -> None:
    env = taskspec.make(written(action=REAL_ACTION, dynamics=" {s': s}", reward=" u[0]"))
    env.reset(seed=0)
    reward = env.step(action)[1]
    assert (reward, type(reward)) == (1.0, float)


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_every_point_of_a_box_is_an_action(backend: str) -> None:
    pytest.importorskip(backend)
    action = "\n  u: {type: real, low: 0, high: 1}\n  i: {type: int, low: -2, high: 2, shape: 2}\n  b: {type: bool}"
    action += "\n  c: {type: choice, values: [x, y, z]}\n  n: {type: int}"
    task = written(action=action, dynamics=" {s': s}", horizon=" 1000",
                   reward=" u + 10 * i[0] + 100 * i[1] + 1000 * b + 10000 * (c == z) + 100000 * n")  # fmt: skip
    env = taskspec.make(task)
    lanes = engine(task, 3, backend, Options())
    env.reset(seed=0)
    lanes.seed(np.zeros(3, np.uint64))
    lanes.reset()
    env.action_space.seed(0)
    for _ in range(200):
        point = env.action_space.sample()
        u, i, j, b, c, n = point.tolist()
        paid = u + 10 * round(i) + 100 * round(j) + 1000 * round(b) + 10000 * (round(c) == 2) + 100000 * round(n)
        assert env.step(point)[1] == pytest.approx(paid)
        lanes.step(np.stack([point] * 3))
        assert lanes.buffers.reward.tolist() == pytest.approx([paid] * 3)
    for wrong in ([0, 2.4, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1e10]):
        with pytest.raises(ActionError, match="E706"):
            env.step(np.array(wrong))
        with pytest.raises(BadActionError):
            lanes.step(np.array([wrong] * 3))


@pytest.mark.parametrize("backend", ["numpy", "numba"])
@pytest.mark.parametrize("action", ["a: {type: int, low: -9007199254740995, high: 9007199254740995}",
                                    "a: {type: int, low: 0, high: 1099511627776}\n  u: {type: real, low: 0, high: 1}",
                                    "a: {type: int, low: 0, high: 4503599627370496}", "a: {type: int}"])  # fmt: skip
def test_whatever_is_sampled_is_taken(action: str, backend: str) -> None:
    pytest.importorskip(backend)
    vector = pytest.importorskip("taskspec.envs.vector", exc_type=SpecError)
    task = written(action=f"\n  {action}", dynamics=" {s': s}", reward=" a % 7", horizon=" 1000")
    env = taskspec.make(task)
    lanes = vector.VectorEnvironment(task, 3, backend=backend)
    for each in (env, lanes):
        each.reset(seed=0)
        each.action_space.seed(0)
        for _ in range(50):
            each.step(each.action_space.sample())
    space = env.action_space
    if isinstance(space, gym.spaces.Box) and space.is_bounded("both"):
        env.step(space.high), env.step(space.low)


OPTIONS = [5, "x", [("state", {})], {"stat": {}}, {"state": 5}, {"state": [1]}, {"state": {"x": 1}}, {"state": {"s": None}},
           {"state": {"s": 1.5}}, {"state": {"s": 10}}, {"state": {"s": "a"}}, {"state": {"s": [1]}}, {"state": {1: 1}},
           {"state": {"s": float("nan")}}, {"state": {"s": 10**30}}, {"state": {"s": 1j}}]  # fmt: skip


@for_each("options", OPTIONS)
def test_wrong_options_of_reset_are_refused(options: Any) -> None:
    with pytest.raises((StateError, SpecError), match=r"E709|E713"):
        taskspec.make(written()).reset(seed=0, options=options)


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**63, 2**64 - 1, np.int64(5), np.uint32(7)], ids=repr)
def test_seeds(seed: Any) -> None:
    task = written(initial=" {s: 'UniformInt(0, 9)'}")
    first = [taskspec.make(task).reset(seed=seed)[0] for _ in range(2)]
    assert first[0] == first[1] == taskspec.make(task).reset(seed=int(seed))[0]


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, "x", [1], np.int32(-3), float("nan")], ids=repr)
def test_wrong_seeds_are_refused(seed: Any) -> None:
    with pytest.raises((gym.error.Error, ValueError), match=r"[Ss]eed"):
        taskspec.make(written()).reset(seed=seed)


@pytest.mark.parametrize(
    "name", [5, None, b"a.yaml", "", "tests", "a\0.yaml", "a\0", "a" * 5000, "nofile.yaml"], ids=repr
)
def test_what_names_no_task_is_refused(name: Any) -> None:
    with pytest.raises(SpecError, match="E7"):
        taskspec.load(name)


def test_wrong_keywords_of_gym_make() -> None:
    cases: list[tuple[str, dict[str, Any]]] = [
        ("derail/Branching-v0", {"foo": 1}), ("derail/Branching-v0", {"L": "3"}), ("derail/Branching-v0", {"L": [3]}),
        ("derail/Branching-v0", {"L": float("nan")}), ("derail/Branching-v0", {"L": True}), ("taskspec/Spec-v0", {}),
        ("taskspec/Spec-v0", {"path": "nofile.yaml"}), ("taskspec/Spec-v0", {"path": "a.yaml", "task": "derail/Sort-v0"}),
    ]  # fmt: skip
    for task_id, options in cases:
        with pytest.raises(SpecError, match="E7"):
            gym.make(task_id, **options)
    assert gym.make("derail/Branching-v0", L=np.int64(3)).reset(seed=0)[0] == 0


WRONG_OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"ending": "absorbed"}, r"'terminate', 'absorb', not 'absorbed'(.|\n)*mean 'absorb'"),
    ({"ending": None}, "E713.*ending must be one of 'terminate', 'absorb', not None"),
    ({"render_mode": "rgb"}, r"'rgb_array', 'rgb_array_list', 'human', not 'rgb'(.|\n)*mean 'rgb_array'"),
    ({"render_mode": 3}, "E713.*render_mode must be one of"),
]
WRONG_VECTOR_OPTIONS: list[tuple[dict[str, Any], str]] = [
    *WRONG_OPTIONS[:2], ({"render_mode": "human"}, "E713.*render_mode must be one of 'ansi', 'rgb_array', not"),
    ({"autoreset_mode": "nextstep"}, r"'NextStep', 'SameStep', 'Disabled', not 'nextstep'(.|\n)*mean 'NextStep'"),
    ({"autoreset_mode": None}, "E713.*autoreset_mode"), ({"backend": "nunba"}, r"numpy, numba, jax(.|\n)*mean 'numba'"),
    ({"backend": None}, "E713.*there is no backend None"), ({"num_envs": 0}, "E713.*num_envs must be a positive int, not 0"),
    ({"num_envs": 2.0}, "E713.*not 2.0"), ({"num_envs": True}, "E713"), ({"num_envs": "3"}, "E713.*not '3'"),
    ({"num_threads": 0}, "E713.*num_threads must be a positive int"), ({"num_threads": None}, "E713.*not None"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "message"), WRONG_OPTIONS, ids=repr)
def test_wrong_options_of_environments_say_what_is_allowed(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        taskspec.make(written(), **options)


@pytest.mark.parametrize(("options", "message"), WRONG_VECTOR_OPTIONS, ids=repr)
def test_wrong_options_of_vector_environments_say_what_is_allowed(options: dict[str, Any], message: str) -> None:
    vector = pytest.importorskip("taskspec.envs.vector", exc_type=SpecError)
    with pytest.raises(SpecError, match=message):
        vector.VectorEnvironment(written(), **options)


@pytest.mark.parametrize("call", [{"seed": -1}, {"seed": 1.5}, {"seed": "x"}, {"seed": [1]}, {"seed": [1, 2.5]}, {"seed": True},
                                  {"options": 5}, {"options": {"state": {"s": 1}}}, {"options": {"reset_mask": [True, False]}},
                                  {"options": {"reset_mask": np.ones(3, bool)}}], ids=repr)  # fmt: skip
def test_wrong_resets_of_vector_environments_are_refused(call: dict[str, Any]) -> None:
    vector = pytest.importorskip("taskspec.envs.vector", exc_type=SpecError)
    lanes = vector.VectorEnvironment(written(), 2, backend="numpy")
    lanes.reset(seed=0)
    with pytest.raises(SpecError, match="E713"):
        lanes.reset(**call)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_lanes_are_not_copied(copied: Any) -> None:
    vector = pytest.importorskip("taskspec.envs.vector", exc_type=SpecError)
    lanes = vector.VectorEnvironment(written(), 2, backend="numpy")
    with pytest.raises(TypeError, match="make another, and reset it with the same seed"):
        copied(lanes)


@pytest.mark.parametrize("state", ["x", None, 5, [1]])
def test_a_state_is_a_mapping(state: Any) -> None:
    env: Any = taskspec.make(written())
    env.reset(seed=0)
    with pytest.raises(StateError, match="E709"):
        env.state = state


def test_a_variant_is_named_by_position_or_keyword() -> None:
    for make in (taskspec.load, taskspec.make, taskspec.make_vec):
        named: Any = make("Branching", variant="seals")
        found = named if make is taskspec.load else named.task
        assert found == taskspec.load("Branching", "seals")


def test_a_variant_is_named_by_a_text() -> None:
    with pytest.raises(SpecError, match="E211"):
        taskspec.load("RiskyPath", ["seals"])  # type: ignore[arg-type]
    with pytest.raises(SpecError, match=r"E211.*\n.*`num_envs=3`"):
        taskspec.make_vec("RiskyPath", 3)  # type: ignore[arg-type]


@pytest.mark.parametrize("maker", [gym.make, gym.make_vec, taskspec.make, taskspec.make_vec])
def test_an_unknown_keyword_is_a_type_error_in_the_words_of_python(maker: Any) -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'") as caught:
        maker("derail/RiskyPath-v0", frameskip=1)
    assert isinstance(caught.value, SpecError)
    assert caught.value.codes == ["E702"]
    assert pickle.loads(pickle.dumps(caught.value)).diagnostics == caught.value.diagnostics
