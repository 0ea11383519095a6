"""Labels in arithmetic and ints as labels: by position, or by the value that a label stands for."""

import random
from typing import Any

import pytest

import taskspec
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text

TURTLE = """
state:
  x: {type: int, low: 0, high: 4}
  y: {type: int, low: 0, high: 4}
  dir: {type: choice, values: [north, east, south, west]}
  tide: {type: choice, values: {ebb: -1, flood: 1}}
  odd: {type: choice, values: {three: 3, one: 1, nine: 9}}
  level: {type: choice, values: {two: 2, four: 4, six: 6}}
action:
  a: {type: choice, values: [left, ahead, right]}
constants:
  ways: [[0, 1], [1, 0], [0, -1], [-1, 0]]
initial: {x: 0, y: 0, dir: "UniformInt(0, 3)", tide: 1, odd: 1, level: 2}
dynamics:
  dir': (dir + a - 1) % 4
  x': clip(x + ways[dir, 0], 0, 4) if a == ahead else x
  y': clip(y + ways[dir, 1], 0, 4) if a == ahead else y
  tide': -tide
  odd': 3 * odd if odd < nine else one
  level': {by: dir, rows: {north: 2 + level % 6, else: level}}
reward: level' * tide
horizon: 30
"""


def test_turns_and_steps() -> None:
    """Beside a few lines of Python."""
    env: Any = taskspec.make(build_text(TURTLE))
    rng = random.Random(1)
    labels = ["north", "east", "south", "west"]
    for seed in range(20):
        env.reset(seed=seed)
        assert env.state | {"dir": ""} == {"x": 0, "y": 0, "dir": "", "tide": "flood", "odd": "one", "level": "two"}
        x = 0
        y = 0
        tide = 1
        odd = 1
        level = 2
        dir_ = labels.index(env.state["dir"])
        for _ in range(30):
            a = rng.randrange(3)
            _, reward, *_ = env.step(a)
            level = {2: 4, 4: 6, 6: 2}[level] if dir_ == 0 else level
            assert reward == level * tide
            if a == 1:
                dx, dy = [(0, 1), (1, 0), (0, -1), (-1, 0)][dir_]
                x = min(max(x + dx, 0), 4)
                y = min(max(y + dy, 0), 4)
            dir_ = (dir_ + a - 1) % 4
            tide = -tide
            odd = {1: 3, 3: 9, 9: 1}[odd]
            names = {1: "one", 3: "three", 9: "nine"}
            expected = {"x": x, "y": y, "dir": labels[dir_], "tide": {1: "flood", -1: "ebb"}[tide]}
            assert env.state == expected | {"odd": names[odd], "level": {2: "two", 4: "four", 6: "six"}[level]}


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_backends_number_labels_alike(backend: Any) -> None:
    pytest.importorskip(backend)
    Agreement(build_text(TURTLE), backend, 5, "SameStep", one=ReferenceEnv).run(40)


@pytest.mark.parametrize("values", ["{low: 1, also_low: 1}", "{up: [0, 1], down: [1, 0]}", "{half: 0.5, one: 1}"])
def test_numbers_that_say_no_label(values: str) -> None:
    text = TURTLE.replace("{three: 3, one: 1, nine: 9}", values).replace(
        "odd: 1,", f"odd: {values[1:].partition(':')[0]},"
    )
    lines = ["  odd': 1" if line.startswith("  odd'") else line for line in text.splitlines()]
    if "one: 1}" in values:  # a literal that is one label's value needs no arithmetic
        lines = [line.replace("odd': 1", "odd': 0 + x") for line in lines]
    found = refusal(build_text, "\n".join(lines))
    assert found.codes == ["E306"]
    assert "a table gives each number its label" in (found.diagnostics[0].hint or "")


PAIRS = """
state:
  s: {type: choice, values: [w, x, y]}
  q: {type: choice, values: [y, z]}
  n: {type: int, low: 0, high: 2}
action:
  a: {type: choice, values: [stay, go]}
initial: {s: "Uniform({0, 1, 2})", q: "Uniform({0, 1})", n: "UniformInt(0, 2)"}
dynamics: {s': s, q': q, n': n}
horizon: 1
reward: REWARD
"""


@pytest.mark.parametrize(
    ("reward", "holds"),
    [
        ("(s, n) in {(x, 1), (y, 2)}", lambda s, q, n: (s, n) in {("x", 1), ("y", 2)}),
        ("(s, q) in ((y, y), (w, z))", lambda s, q, n: (s, q) in {("y", "y"), ("w", "z")}),
        ("(s, q) not in {(y, y)}", lambda s, q, n: (s, q) != ("y", "y")),
        ("all((s, q) == (y, y))", lambda s, q, n: (s, q) == ("y", "y")),
        ("any((y, n) != (q, n))", lambda s, q, n: q != "y"),
        ("(s, n) in {(a, k) for a in {x, y} for k in range(1)}", lambda s, q, n: s in ("x", "y") and n == 0),
        ("(q, n) not in {(y, k) for k in range(5) if k > 0}", lambda s, q, n: q != "y" or n == 0),
        ("q in {a for a in {y, z} if a == y}", lambda s, q, n: q == "y"),
        ("((s, n), (q, 1)) in {((x, 1), (y, 1))}", lambda s, q, n: (s, q, n) == ("x", "y", 1)),
    ],
)
def test_labels_inside_vectors_are_those_of_their_choice(reward: str, holds: Any) -> None:
    env: Any = taskspec.make(build_text(PAIRS.replace("REWARD", f'"{reward}"')))
    seen = set()
    for seed in range(60):
        env.reset(seed=seed)
        state = env.state
        _, paid, *_ = env.step(0)
        assert paid == holds(**state)
        seen.add(paid)
    assert seen == {0.0, 1.0}


def test_labels_of_one_name_in_two_choices_are_not_compared_by_position() -> None:
    text = TURTLE.replace("action:", "  side: {type: choice, values: [left, right]}\naction:", 1)
    text = text.replace("initial: {", "initial: {side: left, ")
    found = refusal(build_text, text.replace("level' * tide", "a == side"))
    assert "labels of one choice" in found.diagnostics[0].message
    chosen = build_text(text.replace("level' * tide", "a == (left if side == left else right)"))
    env = ReferenceEnv(chosen)
    env.reset(seed=0)
    assert [env.step(a)[1] for a in (0, 1, 2)] == [1, 0, 0]


VECTOR = """
state:
  pay: {type: choice, values: {low: 0.25, high: 0.5}, shape: [2]}
  door: {type: choice, values: [high, none, low], shape: [2]}
  key: {type: choice, values: [red, blue]}
action:
  a: {type: int, low: 0, high: 1}
initial: {key: blue, pay: VALUE, door: VALUE}
dynamics: {pay': "[pay[1], pay[0]]", door': "[door[i] if i == a else none for i in range(2)]"}
horizon: 4
reward: pay[a]
"""


@pytest.mark.parametrize(
    "value",
    [
        "[low, high]", '"(low, high)"', '"[low if i == 0 else high for i in range(2)]"', "[{low: 1}, high]",
        '"[Uniform({low}), high]"',
    ],
)  # fmt: skip
def test_elements_of_a_vector_of_labels_are_labels_of_its_choice(value: str) -> None:
    env: Any = taskspec.make(build_text(VECTOR.replace("VALUE", value)))
    env.reset(seed=0)
    assert [env.state[name].tolist() for name in ("pay", "door")] == [[0, 1], [2, 0]]
    assert env.step(0)[1] == 0.25
    assert [env.state[name].tolist() for name in ("pay", "door")] == [[1, 0], [2, 1]]
    assert env.step(0)[1] == 0.5


@pytest.mark.parametrize("value", ["[red, blue]", '"[key, key]"', '"[blue for i in range(2)]"'])
def test_vectors_of_labels_of_another_choice_are_refused(value: str) -> None:
    found = refusal(build_text, VECTOR.replace("pay: VALUE, door: VALUE", f"pay: [low, low], door: {value}"))
    assert set(found.codes) == {"E306" if "key" in value else "E313"}


@pytest.mark.parametrize(
    ("pay", "door", "expected"),
    [
        ("reverse(pay)", "reverse(door)", [[1, 0], [0, 2]]),
        ("swap(pay, 0, 1)", "put(door, a, high)", [[1, 0], [0, 0]]),
        ("where(a == 0, (high, high), pay)", "concat(door[1:], none)", [[1, 1], [0, 1]]),
        ("put(pay, 1, low)", "reshape(door, 2)", [[0, 0], [2, 0]]),
    ],
)
def test_elements_that_are_moved_stay_labels(pay: str, door: str, expected: list[list[int]]) -> None:
    text = VECTOR.replace("VALUE", "[low, high]").replace("[pay[1], pay[0]]", pay)
    text = text.replace("[door[i] if i == a else none for i in range(2)]", door)
    text = text.replace(
        "reward: pay[a]", "reward: 10 * (pay[1] == high) + count(reverse(door) == low) + (high == door[1])"
    )
    env: Any = taskspec.make(build_text(text))
    env.reset(seed=0)
    assert env.step(0)[1] == 12
    assert [env.state[name].tolist() for name in ("pay", "door")] == expected


@pytest.mark.parametrize(
    ("door", "reward", "code"),
    [
        ("concat(key, key)", "0", "E306"),
        ("door", "any(reverse(door) == red)", "E313"),
        ("door", "door[a] == key", "E306"),
        ("door", "all(reverse(door) == pay)", "E306"),
    ],
)
def test_labels_of_another_choice_are_no_elements(door: str, reward: str, code: str) -> None:
    text = VECTOR.replace("VALUE", "[low, high]").replace("[door[i] if i == a else none for i in range(2)]", door)
    found = refusal(build_text, text.replace("reward: pay[a]", f"reward: {reward}"))
    assert found.codes == [code]
