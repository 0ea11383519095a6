"""Which maps of symmetries are proved, tested and refused, and the section of a spec."""

from itertools import product

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results, check
from taskspec.exact.abstraction.abstraction import SymmetryCheck, verify_symmetry
from taskspec.language.task.task import Task
from tests.exact.check.test_symmetries import task_of
from tests.programs.test_trajectories import walk_together
from tests.shared.diagnostics import refusal, with_code
from tests.shared.invariants import broken
from tests.shared.sections import build_text
from tests.shared.solved import returns

# -- what is proved -----------------------------------------------------------------------------------------------

BOX = """
state:
  v: {type: int, low: 0, high: [2, 2, 1], shape: [3]}
  w: {type: int, low: -1, high: 1}
action:
  i: {type: int, low: 0, high: 2}
  j: {type: int, low: 0, high: 2}
horizon: 3
initial: {v: [0, 1, 0], w: 0}
dynamics: {"w'": "clip(w + i - j, -1, 1)", "v'": "[v[1], v[0], v[2]]"}
reward: w' + v[0]
"""


def spec(symmetries: str, text: str = BOX) -> Task:
    return build_text(f"{text}symmetries: {symmetries}\n")


def found(symmetry: str, text: str = BOX) -> SymmetryCheck:
    task = spec(f"{{s: {symmetry}}}", text)
    return verify_symmetry(task, task.annotations.symmetries[0])


def clip(x: int, low: int, high: int) -> int:
    return min(max(x, low), high)


def test_maps_of_what_is_seen_are_proved_exactly_where_they_are_one_to_one() -> None:
    """Random maps, of whose values Python says whether any two are alike."""
    rng = np.random.default_rng(7)
    whole = {"v[0]": ["-v[0]", "v[0] + 2"], "v[1]": ["2 - v[1]", "v[1] + 3 * v[0]"], "v[2]": ["v[2] * v[2]", "v[2] - w"],
             "w": ["-w", "(w + 3) * (w + 3)"]}  # fmt: skip
    others = ["v[0] + v[1]", "abs(w)", "v[0] % 2", "clip(w, 0, 1)", "1", "max(w, v[2])", "v[1]"]
    told = []
    for _ in range(150):
        lines = []
        for element in rng.permutation(list(whole)):
            choices = [element, *whole[element]]
            if rng.random() < 0.15:
                choices = others
            lines.append(str(rng.choice(choices)))
        *vector, last = lines
        values = set()
        for v, w in product(product(range(3), range(3), range(2)), (-1, 0, 1)):
            values.add(eval(", ".join(lines), {"v": v, "w": w, "abs": abs, "clip": clip, "max": max}))
        result = found(f"{{observation: {{v: '[{', '.join(vector)}]', w: '{last}'}}}}")
        assert result.is_proved == (len(values) == 54), lines
        assert (result.problem is not None and "look alike" in result.problem) == (len(values) < 54)
        told.append(result.is_proved)
    assert 10 < sum(told) < 140


def test_maps_of_actions_are_proved_exactly_where_they_permute_them() -> None:
    rng = np.random.default_rng(8)
    pieces = ["i", "j", "2 - i", "2 - j", "(i + 1) % 3", "(i + j) % 3", "(i + 2 * j) % 3", "i * j", "i + 1", "clip(i + j, 0, 2)",
              "0"]  # fmt: skip
    told = []
    for _ in range(150):
        one = str(rng.choice(pieces))
        other = str(rng.choice(pieces))
        pairs = set(product(range(3), repeat=2))
        values = {eval(f"{one}, {other}", {"i": i, "j": j, "clip": clip}) for i, j in pairs}
        result = found(f"{{action: {{i: '{one}', j: '{other}'}}}}")
        assert result.is_proved == (values == pairs), (one, other, result.problem)
        told.append(result.is_proved)
    assert 10 < sum(told) < 140


REALS = """
state:
  p: {type: real, low: -1, high: 1, shape: [2]}
  q: {type: real, low: 0, high: 1}
  n: {type: int, low: 0, high: 3000000}
action:
  a: {type: real, low: -1, high: 1}
  b: {type: real, low: 0, high: 3}
horizon: 3
initial: {p: "Uniform(-1, 1, shape=2)", q: "Uniform(0, 1)", n: 7}
dynamics: {"p'": "clip([p[0] + a, p[1] - b], -1, 1)"}
reward: p'[0] + q
"""


@pytest.mark.parametrize(
    ("symmetry", "status"),
    [
        ("{observation: {p: '[-p[1], p[0]]'}}", "proved"),  # exact in floats
        ("{observation: {p: reverse(p), q: -q}}", "proved"),
        ("{observation: {o: 'concat(p, [q])'}}", "proved"),
        ("{observation: {q: 1 - q}}", "tested"),  # 1 - q of a float below 2**-54 is 1
        ("{observation: {p: '[0.5 * p[0] - sqrt(0.75) * p[1], sqrt(0.75) * p[0] + 0.5 * p[1]]'}}", "tested"),  # a sixth of a turn
        ("{action: {a: -a}}", "proved"),
        ("{observation: {n: 5 - n}}", "proved"),  # with what is observed still a whole number of 24 bits
        ("{observation: {n: 16777000 - n}}", "tested"),  # and beyond it
    ],
)  # fmt: skip
def test_what_rounds_is_tested_and_no_more(symmetry: str, status: str) -> None:
    result = found(symmetry, REALS)
    assert result.problem is None
    assert result.is_proved == (status == "proved")


@pytest.mark.parametrize(
    ("symmetry", "problem"),
    [
        ("{observation: {p: '[p[0], p[0]]'}}", "p = [0, 0], q = 0"),
        ("{observation: {p: '[abs(p[0]), p[1]]'}}", "does not return to itself"),
        ("{observation: {p: 2 * p}}", "does not return to itself"),
        ("{observation: {p: '[p[0] + q, p[1]]', q: q}}", "does not return to itself"),
        ("{observation: {q: (q + 1e15) - 1e15}}", "does not return to itself"),  # what it adds rounds on the way
        ("{observation: {n: (n + 1e17) - 1e17}}", "does not return to itself"),
        ("{observation: {o: 'p[0] + q'}}", "other things than p, q"),
        ("{observation: {n: 1e300 * n}}", "does not return to itself"),
        ("{observation: {n: inf}}", "a value that is not finite"),
        ("{action: {a: a / 2}}", "more than to move elements about"),
        ("{action: {b: -b}}", "becomes b = -3"),
        ("{action: {a: b, b: a}}", "becomes"),
        ("{action: {b: 0}}", "becomes b = 0"),
    ],
)  # fmt: skip
def test_what_is_no_symmetry_is_told_with_a_counterexample(symmetry: str, problem: str) -> None:
    task = spec(f"{{s: {symmetry}}}", REALS)
    told = with_code(check(task).diagnostics, "E605")
    if problem.startswith("p = [0"):
        assert len(told) == 1 and "look alike" in told[0].message
    else:
        assert len(told) == 1 and problem in told[0].message, told


def test_a_wrong_symmetry_makes_no_twin() -> None:
    for symmetry in ("{observation: {w: abs(w)}}", "{action: {i: j}}", "{action: {i: i + 1}}"):
        with pytest.raises(SpecError, match="one-to-one"):
            taskspec.modify(spec(f"{{s: {symmetry}}}"), "symmetry=s")


# -- twins of finite tasks ----------------------------------------------------------------------------------------


def test_a_listed_permutation_of_actions_is_undone() -> None:
    """`(i + j) % 3` with `j` kept: what the twin executes is found in a table."""
    task = spec("{s: {action: {i: '(i + j) % 3'}}}")
    twin = taskspec.modify(task, "symmetry=s")
    for i, j in product(range(3), repeat=2):
        one = taskspec.make(task)
        other = taskspec.make(twin)
        one.reset(seed=0), other.reset(seed=0)
        one.step([i, j]), other.step([(i + j) % 3, j])
        assert str(one.state) == str(other.state)
    assert returns(Results(twin)) == pytest.approx(returns(Results(task)))


def test_twins_stand_on_other_modifiers_and_others_on_them() -> None:
    task = task_of("derail/NoisyObs-v0")
    twin = "symmetry=among_noise"
    orders = (
        ["time_observed", twin], [twin, "time_observed"], [twin, "dropout=0.5"], ["sticky=0.25", twin], ["dropout=0.5", twin],
    )  # fmt: skip
    for order in orders:
        both = taskspec.modify(task, *order)
        assert not list(broken(both))
        walk_together(taskspec.make(both), 5, 20)
    with pytest.raises(SpecError, match="no longer observed as the symmetry expects"):
        taskspec.modify(task, "observation_noise=1", "symmetry=among_noise")
    with pytest.raises(SpecError, match="declares no symmetry 'mirror'"):
        taskspec.modify(task, "symmetry=mirror")
    with pytest.raises(SpecError, match="it declares no symmetries"):
        taskspec.modify(taskspec.load("derail/RiskyPath"), "symmetry=mirror")


def test_an_observation_keeps_to_the_space_that_the_spec_asks_for() -> None:
    hot = BOX + "observation: {space: one_hot, v: v, w: w}\n"
    twin = taskspec.modify(spec("{s: {observation: {w: -w}}}", hot), "symmetry=s")
    assert twin.observation_space == spec("{}", hot).observation_space
    walk_together(taskspec.make(twin), 5, 10)
    with pytest.raises(SpecError, match="holds no reals"):
        taskspec.modify(spec("{s: {observation: {w: w / 3}}}", hot), "symmetry=s")


# -- the section --------------------------------------------------------------------------------------------------


def test_variants_change_and_remove_symmetries() -> None:
    text = f"""{BOX}
symmetries: {{one: {{observation: {{w: -w}}}}, two: {{action: {{i: 2 - i}}}}}}
variants:
  other:
    symmetries:
      one: {{action: {{j: 2 - j}}}}
      two: null
      three: {{doc: both, observation: {{w: -w}}}}
"""
    one, two = build_text(text).annotations.symmetries
    assert (one.name, two.name) == ("one", "two")
    one, three = build_text(text, "other").annotations.symmetries
    assert (one.name, one.doc, bool(one.observation), bool(one.action)) == ("one", None, False, True)
    assert (three.name, three.doc, bool(three.observation), bool(three.action)) == ("three", "both", True, False)
    assert build_text(text).content_hash != spec("{one: {observation: {w: -w}}}").content_hash


@pytest.mark.parametrize(
    ("symmetries", "code", "message"),
    [
        ("{s: {doc: nothing}}", "E203", "maps nothing"),
        ("{s: {observation: {w: -q}}}", "E302", "'q'"),
        ("{s: {observation: {w: i}}}", "E302", "not part of this"),
        ("{s: {action: {i: w}}}", "E302", "not part of this"),
        ("{s: {action: {k: i}}}", "E216", "'k'"),
        ("{s: {action: {i: 0.5 * i}}}", "E306", "real"),
        ("{s: {observation: {w: 'UniformInt(0, 1)'}}}", "E311", "symmetry"),
        ("{s: {observations: {w: w}}}", "E202", "observations"),
    ],
)  # fmt: skip
def test_mistakes_in_a_symmetry_have_a_code_and_a_place(symmetries: str, code: str, message: str) -> None:
    error = refusal(spec, symmetries)
    assert error.codes == [code] and message in error.diagnostics[0].message, error
    assert error.diagnostics[0].span is not None
