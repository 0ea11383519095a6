"""Hostile and unlucky input: nothing in a spec, its file name or a call runs code, hangs, crashes or goes wrong in silence."""

from __future__ import annotations

import copy
import pickle
import re
import time
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import taskspec
from taskspec.appendix import scene
from taskspec.backends.actions import BadActionError
from taskspec.backends.interpreter import Interpreter
from taskspec.backends.select import engine
from taskspec.backends.vector import Options
from taskspec.diagnostics import SpecError
from taskspec.envs.errors import ActionError, StateError
from taskspec.exact import check, scores, soundness
from taskspec.source import read_text
from taskspec.task.build import build
from taskspec.task.task import Task

EVIL = 'x"""\nraise SystemExit("ran")\n"""\\'
BASE = """\
taskspec: 1
name: Walk
constants: {}
state:
  s: {type: int, low: 0, high: 9}
action:
  a: {type: int, low: 0, high: 1}
horizon: 10
initial: {s: 0}
dynamics:
  s': (s + a) % 10
reward: s'
"""


def written(text: str = BASE, name: str = "<test>", suite: str = "", **sections: str) -> Task:
    """A task, with some sections of the base spec replaced."""
    for section, value in sections.items():
        pattern = rf"^{section}:.*\n(  .*\n)*"
        text = re.sub(pattern, "", text, flags=re.MULTILINE) + f"{section}:{value}\n"
    return build(read_text(text, name), None, {}, suite)


# -- code from text ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [EVIL, "a\\", 'a"', "C:\\new\\u.yaml", "a\nb", "{x}", "%s"])
def test_file_names_and_suites_are_never_code(text: str) -> None:
    for task in (written(name=text, horizon=f" {20 + ord(text[-1])}"), written(suite=text)):
        env = task.make()
        env.reset(seed=0)
        assert env.step(1)[1] == 1


NAMES = ["exec", "np", "index", "alive", "past", "episodes", "kept", "o", "h0", "w1_0", "v1", "C0", "nan", "action", "self",
         "é", "λ", "変数", "x١", "a_0", "absorbed", "seen", "end"]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_names_do_not_meet_those_of_the_generated_code(name: str) -> None:
    """Components that are called like what the generated code calls its own."""
    text = BASE.replace("s'", f"{name}'").replace("s:", f"{name}:").replace("s +", f"{name} +")
    text = text.replace(f"constant{name}:", "constants:").replace(f"dynamic{name}:", "dynamics:")
    env: Any = written(text).make(ending="absorb", observe_time=True)
    env.reset(seed=0)
    assert env.step(1)[1] == 1
    assert set(env.state) >= {name}


def test_elements_of_actions_do_not_meet_other_actions() -> None:
    task = written(
        action="\n  x: {type: int, shape: 2, low: 0, high: 3}\n  x_0: {type: int, low: 0, high: 3}",
        dynamics=" {s': s}", reward=" 100 * x[0] + 10 * x[1] + x_0",
    )  # fmt: skip
    env = task.make()
    env.reset(seed=0)
    assert env.step(np.array([1, 2, 3]))[1] == 123


@pytest.mark.parametrize(
    "label",
    ["a b", 'c"d', "None", "if", "pi", "t", "T", "sum", "__import__('os').system('x')", "{x}", "%s", "x#y", "go-left",
     "x'", "é", "optimal", "s", "1"],
)  # fmt: skip
def test_labels_are_labels(label: str) -> None:
    quoted = '"' + label.replace('"', '\\"') + '"'
    task = written(
        state=f"\n  s: {{type: choice, values: [{quoted}, other]}}",
        initial=f"\n  s: {quoted}", dynamics=" {s': other}", reward=f"\n  by: s\n  rows: {{{quoted}: 1, other: 2}}",
    )  # fmt: skip
    env: Any = task.make()
    env.reset(seed=0, options={"state": {"s": label}})
    assert env.state == {"s": label}
    assert (env.step(0)[1], env.state) == (1, {"s": "other"})


# -- cost -------------------------------------------------------------------------------------------------------------

TABLE = "\n".join(f"    {i}: {i % 7}" for i in range(100_000))
COSTLY = {
    "power": {"reward": " 9**9**9"},
    "powers": {"reward": " (9**9)**(9**9)"},
    "fraction": {"reward": " 1/3**99999"},
    "digits": {"reward": f" s + {'9' * 5000}"},
    "sum": {"reward": f" {'s+' * 9000}s"},
    "brackets": {"reward": f" {'(' * 10_000}s{')' * 10_000}"},
    "minus": {"reward": f" {'-' * 5000}s"},
    "branches": {"reward": f" {'1 if s == 1 else ' * 300}0"},
    "box": {"reward": ' "s in {p[0] for p in box(-10**6, 10**6, 3)}"'},
    "range": {"reward": " sum([s for i in range(10**9)])"},
    "matrix": {"reward": ' "sum([sum([s + i*j for i in range(1000)]) for j in range(1000)])"'},
    "onehot": {"reward": ' "sum(onehot(s, 10**12))"'},
    "normal": {"reward": ' "sum(Normal(shape=10**12))"'},
    "poisson": {"reward": ' "Poisson(10**9)"'},
    "shape": {"state": "\n  s: {type: int, shape: 10**12}"},
    "bound": {"state": "\n  s: {type: int, low: 0, high: 10**100}"},
    "one hot": {"observation": " {o: s * 10**7, space: one_hot}"},
    "names": {"definitions": "\n  d0: s\n" + "".join(f"  d{i}: d{i - 1} * d{i - 1}\n" for i in range(1, 200)), "reward": " d199"},
    "calls": {
        "definitions": '\n  "f0(x)": x\n' + "".join(f'  "f{i}(x)": f{i - 1}(x) + f{i - 1}(x + 1)\n' for i in range(1, 40)),
        "reward": " f39(s)",
    },
    "table": {"reward": f"\n  by: s\n  rows:\n{TABLE}"},
    "tables": {"reward": f" {'{by: s, rows: {0: ' * 300}1{', else: 0}}' * 300}"},
    "aliases": {"constants": " &a [1, 1]\nname: [*a, *a]"},
}  # fmt: skip


@pytest.mark.parametrize("case", COSTLY)
def test_cost_is_refused_before_it_is_spent(case: str) -> None:
    start = time.process_time()
    with pytest.raises(SpecError) as caught:
        written(**COSTLY[case])
    assert time.process_time() - start < 4  # a second, and room for a busy machine
    assert {d.code for d in caught.value.diagnostics} <= {"E314", "E114", "E102", "E408", "E214"}


LONG = {
    "finite": {"initial": " {s: 'UniformInt(0, 9)'}", "horizon": " 2147483646"},
    "real": {"state": "\n  s: {type: real, low: 0, high: 9}", "dynamics": " {s': 9 - s}", "horizon": " 1000000"},
    "endless": {"state": "\n  s: {type: real, low: 0, high: 9}", "dynamics": " {s': 9 - s}", "horizon": " none"},
    "noisy": {"state": "\n  s: {type: bool, shape: [4, 4]}", "initial": " {s: 'Bernoulli(1/2, shape=[4, 4])'}",
              "dynamics": " {s': 'Bernoulli(1/2, shape=[4, 4])'}", "reward": " s[0, 0]"},
}  # fmt: skip


@pytest.mark.parametrize("case", LONG)
def test_returns_and_figures_that_cost_too_much_are_unknown(case: str) -> None:
    start = time.process_time()
    task = written(**LONG[case])
    found = scores(task, episodes=20)
    assert found.why_not_exact is not None
    assert (found.random is None) == (case != "noisy")
    assert (scene(task) is None) == (case != "finite")
    assert not check(task).errors
    assert time.process_time() - start < 15  # a few seconds, and room for a busy machine


@pytest.mark.parametrize("name", ["table", "weights"])
def test_long_tables_are_read_in_time(name: str) -> None:
    start = time.process_time()
    n = 5000
    rows = "".join(f"    {i}: {i % 7}\n" for i in range(n))
    state = {"state": f"\n  s: {{type: int, low: 0, high: {n - 1}}}"}
    if name == "table":
        task = written(**state, dynamics=f" {{s': (s + a) % {n}}}", reward=f"\n  by: s\n  rows:\n{rows}")
    else:
        task = written(**state, dynamics=f"\n  s': {{{', '.join(f'{i}: 1/{n}' for i in range(n))}}}")
    task.make().reset(seed=0)
    assert time.process_time() - start < 4


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


@pytest.mark.parametrize(("form", "action"), MISUSED, ids=repr)
def test_what_is_no_action_is_refused_and_changes_nothing(form: str, action: Any) -> None:
    env: Any = written(action=NOT_ACTIONS[form][0], dynamics=" {s': (s + 1) % 10}").make()
    env.reset(seed=0)
    with pytest.raises(ActionError, match="E706"):
        env.step(action)
    assert env.state == {"s": 0}
    env.action_space.seed(0)
    assert env.step(env.action_space.sample())[1] == 1


@pytest.mark.parametrize("action", [[1, 0], (1, 0), np.array([1, 0]), np.array([True, False]), np.array([1, 0], np.uint8),
                                    np.array([1, 0], np.float16), [np.float32(1), 0], [True, False]], ids=repr)  # fmt: skip
def test_numbers_of_any_kind_are_real_actions(action: Any) -> None:
    env = written(action=REAL_ACTION, dynamics=" {s': s}", reward=" u[0]").make()
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
    env, lanes = task.make(), engine(task, 3, backend, Options())
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
    env, lanes = task.make(), vector.VectorEnvironment(task, 3, backend=backend)
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


@pytest.mark.parametrize("options", OPTIONS, ids=repr)
def test_wrong_options_of_reset_are_refused(options: Any) -> None:
    with pytest.raises(StateError, match=r"E709|E713"):
        written().make().reset(seed=0, options=options)


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**63, 2**64 - 1, np.int64(5), np.uint32(7)], ids=repr)
def test_seeds(seed: Any) -> None:
    task = written(initial=" {s: 'UniformInt(0, 9)'}")
    first = [task.make().reset(seed=seed)[0] for _ in range(2)]
    assert first[0] == first[1] == task.make().reset(seed=int(seed))[0]


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, "x", [1], np.int32(-3), float("nan")], ids=repr)
def test_wrong_seeds_are_refused(seed: Any) -> None:
    with pytest.raises((gym.error.Error, ValueError), match=r"[Ss]eed"):
        written().make().reset(seed=seed)


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
        written().make(**options)


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
    env: Any = written().make()
    env.reset(seed=0)
    with pytest.raises(StateError, match="E709"):
        env.state = state


def test_a_variant_is_named_by_a_text() -> None:
    with pytest.raises(SpecError, match="E211"):
        taskspec.load("RiskyPath", 3)  # type: ignore[arg-type]


# -- observations outside their space ---------------------------------------------------------------------------------


def test_what_a_one_hot_vector_cannot_show_shows_nothing() -> None:
    observation = "\n  o: {value: s, low: 1, high: 3}\n  b: s > 4\n  space: one_hot"
    task = written(observation=observation)
    env = task.make()
    env.reset(seed=0, options={"state": {"s": 0}})
    shown = [env.step(1)[0].argmax() for _ in range(3)]
    assert shown == [0, 1, 2]
    assert env.step(1)[0].tolist() == [0, 0, 0, 1, 0]
    assert {d.code for d in soundness(task)} == {"E405"}


@pytest.mark.parametrize(
    "observation", ["{o: x, space: box}", "{o: x, p: v, space: dict}", "{p: v}", "{o: x, u: 0}", "{o: x, p: v}"]
)
def test_reals_beyond_float32_are_seen_as_infinite(observation: str) -> None:
    task = written(state="\n  x: {type: real}\n  v: {type: real, shape: [2]}", initial=' {x: 1e30, v: "(1, 1e30)"}',
                   dynamics='\n  x\': x * 1e30\n  v\': v * 1e20', observation=f" {observation}", reward=" 1")  # fmt: skip
    env: Any = task.make()
    env.reset(seed=0, options={"state": {"x": 1e300}})
    seen = env.step(0)[0]
    assert np.isinf(np.hstack([*seen.values()] if isinstance(seen, dict) else [seen])).any()


# -- large numbers ----------------------------------------------------------------------------------------------------


def steps(task: Task, count: int) -> list[Any]:
    """Rewards, the same in the interpreter."""
    env, reference = task.make(), Interpreter(task, 0)
    env.reset(seed=0)
    reference.reset()
    rewards = []
    for _ in range(count):
        rewards.append(env.step(1)[1])
        assert np.array_equal(rewards[-1], reference.step([(1,)])[1], equal_nan=True)
    return rewards


def test_ints_without_bounds_stop() -> None:
    task = written(state="\n  s: {type: int}", dynamics=" {s': 's * s + 3'}", horizon=" none")
    assert steps(task, 50)[-1] == 2**31 - 1
    assert soundness(task) == []


def test_a_counter_that_cannot_get_far_is_not_stopped() -> None:
    task = written(state="\n  s: {type: int}", dynamics=" {s': s + a}", horizon=" 200")
    assert str(2**31 - 1) not in task.make()._program.source  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "reward",
    ["(s + 2**62) * 4", "(s + 2**200) // 2**199", "(s * 6364136223846793005 + 1) % 10",
     "prod([s + 10 for k in range(40)])",
     "sum((s + 2**62, 2**62, 2**62))", "(s + 3)**16 * (s + 100)**10", "(2**70, 1)[a] // 2**69"],
)  # fmt: skip
def test_ints_that_may_leave_64_bits_are_refused(reward: str) -> None:
    with pytest.raises(SpecError, match="E318"):
        written(reward=f" {reward}")


def test_reals_go_to_infinity_and_soundness_says_so() -> None:
    task = written(
        state="\n  s: {type: real}", dynamics=" {s': 's * s + 3'}", observation=" {o: [s, 0]}", horizon=" 200"
    )
    assert steps(task, 20)[-1] == float("inf")
    assert {d.code for d in soundness(task)} >= {"E403", "E406"}
