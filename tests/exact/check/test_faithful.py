"""Abstractions: proved where every step can be looked at, without effect elsewhere, refused where they differ from the task."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec import exact
from taskspec.base.diagnostics import Collector
from taskspec.exact.abstraction import verify as verification
from taskspec.exact.abstraction.abstraction import Abstraction, abstraction
from taskspec.exact.abstraction.verify import verify
from taskspec.exact.model.factor import Dependence, LinearForms, dependence
from taskspec.exact.rules.claim_verdicts import verdicts
from taskspec.exact.scores.returns import Results
from taskspec.language import source
from taskspec.language.expressions.check import Checker
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.parse import parse_into
from taskspec.language.expressions.syntax import SourceText
from taskspec.language.expressions.types import Role
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.diagnostics import codes, statuses, with_code
from tests.shared.sections import build_text
from tests.shared.specs import spec_file

ROOT = Path(__file__).parents[3]


def shipped(name: str, variant: str | None = None, **parameters: Any) -> Task:
    return build(source.read_file(ROOT / "tasks" / "derail" / f"{name}.yaml"), variant, parameters, "derail")


def found(given: Task) -> Abstraction:
    result = abstraction(given)
    assert result is not None
    return result


def decided(text: str, *claims: str) -> list[str]:
    return statuses(verdicts(build_text(f"{text}claims: {list(claims)}\n")))


def test_what_has_too_many_steps_to_compare_is_not_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    given = found(shipped("sort"))
    assert verify(given).is_proved
    monkeypatch.setattr(verification, "MOST", 100)
    check = verify(given)
    assert check.problem is None and check.why_not == "there are too many steps to compare"


SHIPPED = [
    ("sort", None, {}),
    ("sort", None, {"L": 3}),
    ("sort", "seals", {}),
    ("proc_goal", None, {}),
    ("proc_goal", "seals", {}),
]


@pytest.mark.parametrize(("name", "variant", "parameters"), SHIPPED)
def test_shipped_abstractions_are_proved_with_their_experts(name: str, variant: str | None, parameters: Any) -> None:
    check = verify(found(shipped(name, variant, **parameters)))
    assert check.is_proved and check.has_expert, check


WALK = """
state:
  x: {type: int, doc: place}
  goal: {type: int}
action:
  a: {type: int, low: -1, high: 1}
noise:
  slip: Bernoulli(1/2)
horizon: 60
initial: {x: "UniformInt(-50, 50)", goal: x + 2}
dynamics: {x': x if slip else x + a, goal': goal}
reward: x' == goal
terminal: abs(x' - goal) == 5
expert: sign(goal - x)
abstraction:
  state: {d: {type: int, low: -5, high: 5}}
  map: {d: goal - x}
  initial: {d: 2}
  dynamics: {d': "d if SLIPS else clip(d - a, -5, 5)"}
  reward: d' == 0
  terminal: abs(d') == 5
  expert: sign(d)
"""
FAITHFUL = WALK.replace("SLIPS", "slip")
WRONG = {
    "weights": ("SLIPS", "Bernoulli(99/100)"),
    "rare weights": ("SLIPS", "Bernoulli(1/2 + 1e-12)"),
    "reward": ("reward: d' == 0", "reward: d' == 1"),
    "rare reward": ("reward: d' == 0", "reward: \"(d' == 0) + (d' == -4)\""),
    "late reward": ("reward: d' == 0", "reward: \"(d' == 0) * (t < 55)\""),
    "end": ("terminal: abs(d') == 5", "terminal: d' == 5"),
    "start": ("d: 2}\n  dynamics", "d: 1}\n  dynamics"),
    "expert": ("expert: sign(d)", "expert: -sign(d)"),
    "late expert": ("expert: sign(d)", 'expert: "sign(d) if t < 59 else 0"'),
}  # fmt: skip


def test_a_faithful_abstraction_is_proved() -> None:
    assert verify(found(build_text(FAITHFUL))).is_proved
    assert decided(FAITHFUL, "optimal_return > 1", "expert_return == optimal_return", "not reachable(d == 5)") == [
        "proved", "proved", "false",
    ]  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_no_difference_goes_unnoticed_where_every_step_is_looked_at(what: str) -> None:
    old, new = WRONG[what]
    text = WALK.replace(old, new).replace("SLIPS", "slip")
    assert text != FAITHFUL
    given = build_text(text)
    problem = verify(found(given)).problem
    assert problem is not None
    assert codes(exact.check(given).errors) == ["E604"]
    assert decided(text, "optimal_return > 0", "probability(d == 0) > 0") == ["undecided", "undecided"]
    assert Results(given).optimal is None
    random = Results(given).random
    assert random is not None and random.episodes


REAL = """
state:
  x: {type: real, low: 0, high: 4}
action:
  a: {type: int, low: 0, high: 1}
noise:
  up: Bernoulli(1/2)
horizon: 20
initial: {x: "Uniform(0, 1)"}
dynamics: {x': "x + 1 if up and x < 3 else x - floor(x)"}
reward: floor(x') == 1
expert: floor(x) % 2
abstraction:
  state: {n: {type: int, low: 0, high: 4}}
  map: {n: floor(x)}
  initial: {n: 0}
  dynamics: {n': "n + 1 if up and n < 3 else 0"}
  reward: n' == 1
  expert: n % 2
"""


def test_what_cannot_be_proved_gives_no_exact_results() -> None:
    """Results are those of episodes of the task itself, and a warning says why."""
    text = REAL + "claims: [random_return > 0, optimal_return > 0]\n"
    report = exact.check(build_text(text))
    (warning,) = with_code(report.warnings, "W522")
    assert "neither linear" in warning.message or "no whole number" in warning.message
    assert statuses(report.verdicts) == ["tested", "undecided"]
    assert report.results is not None and report.results.model is None
    random = report.results.random
    assert random is not None and random.status == "estimated"


LOOK = FAITHFUL.replace("expert: sign(goal - x)", "expert: sign(goal - x) if x > -1000 else 0")


def test_an_expert_that_looks_at_more_than_the_abstraction_is_simulated() -> None:
    results = Results(build_text(LOOK))
    assert results.abstraction_check is not None and results.abstraction_check.is_proved
    assert results.optimal is not None and results.optimal.exact
    assert results.expert is not None and results.expert.status == "estimated"


def test_a_finite_task_is_compared_state_by_state() -> None:
    text = """
state: {s: {type: int, low: 0, high: 7}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 9
initial: {s: "UniformInt(0, 7)"}
dynamics: {s': "(2 * (s // 2 + a) + UniformInt(0, 1)) % 8"}
reward: s' // 2 == 3
abstraction:
  state: {k: {type: int, low: 0, high: 3}}
  map: {k: s // 2}
  initial: {k: "UniformInt(0, 3)"}
  dynamics: {k': "(k + a) % 4"}
  reward: k' == 3
"""
    assert verify(found(build_text(text))).is_proved
    assert verify(found(build_text(text.replace("reward: s' // 2 == 3", "reward: s' == 7")))).problem is not None


TIED = """
state: {s: {type: real, shape: [3], low: 0, high: 1}}
action: {i: {type: int, low: 0, high: 2}}
horizon: 4
initial: {s: START}
dynamics: {s': NEXT}
reward: PAID
abstraction:
  state: {s: {type: int, shape: [3], low: 0, high: 2}}
  map: {s: argsort(argsort(s))}
  initial: {s: Permutation(3)}
"""


@pytest.mark.parametrize(
    ("start", "following", "paid", "proved"),
    [
        ("Uniform(0, 1, shape=3)", "swap(s, 0, i)", "s[0] < s[1]", True),
        ("Uniform(0, 1, shape=3) / 2", "reverse(s)", "argmax(s) == i", True),
        ("Uniform(0, 1, shape=3)", "sort(s) if i == 0 else s", "s'[0] == min(s)", True),
        ("Uniform(0, 1, shape=3)", "put(s, i, s[0])", "s[0] < s[1]", False),
        ("Uniform(0, 1, shape=3)", "swap(s, 0, i)", "s[0] < 1/2", False),
        ("Uniform(0, 1, shape=3)", "swap(s, 0, i)", "s[0] - s[1] < 0", False),
        ("Uniform(0, 1) + [0, 0, 0]", "swap(s, 0, i)", "s[0] < s[1]", False),
    ],
)
def test_ranks_stand_for_numbers_where_only_their_order_matters(
    start: str, following: str, paid: str, proved: bool
) -> None:
    text = TIED.replace("START", f'"{start}"').replace("NEXT", f'"{following}"').replace("PAID", f'"{paid}"')
    check = verify(found(build_text(text)))
    assert check.is_proved is proved, check


# -- the two lemmas ---------------------------------------------------------------------------------------------------


ANY = """
state: {x: {type: int}, y: {type: int}, v: {type: real, shape: [4]}}
action: {a: {type: int, low: 0, high: 3}}
horizon: 1
initial: {x: 0, y: 0, v: "[0, 0, 0, 0]"}
dynamics: {x': x, y': y, v': v}
reward: 0
"""


class Written:
    """Expressions over two ints, a vector of reals and an action, as nodes of one task."""

    def __init__(self) -> None:
        self.task = build_text(ANY)
        self.builder = self.task.new_builder()

    def node(self, text: str) -> Node:
        parsed = parse_into(SourceText(text, lambda start, end: None), Collector())
        assert parsed is not None
        value = Checker(self.builder, Collector()).check(parsed, self.task.source.surface.scopes["reward"])
        assert value is not None
        return value.node


SAME = [
    ("x - y", "-(y - x)"), ("x + a - (x - y)", "y + a"), ("x < y", "0 < y - x"),
    ("min(x, x + a) - x", "min(0, a)"), ("(x if a == 0 else x + y) - x", "0 if a == 0 else y"), ("max(x - 1, x) == x", "0 == 0"),
    ("2 * x - x", "x"), ("3 * (x - y) + 3 * y", "3 * x"),
    ("[x, y][a // 2] - x + x", "[x, y][a // 2]"),
]  # fmt: skip


@pytest.mark.parametrize(("one", "other"), SAME)
def test_normal_forms_of_whole_numbers(one: str, other: str) -> None:
    written = Written()
    normal = LinearForms(written.builder)
    first, second = normal.form([written.node(one), written.node(other)])
    assert first is second
    rng = np.random.default_rng(0)
    for _ in range(50):
        reads = {
            (Role.STATE, "x"): (int(rng.integers(-9, 9)),),
            (Role.STATE, "y"): (int(rng.integers(-9, 9)),),
            (Role.ACTION, "a"): (int(rng.integers(0, 4)),),
        }
        assert (
            evaluate([first], reads) == evaluate([written.node(one)], reads) == evaluate([written.node(other)], reads)
        )


ORDERED = {
    "v[0] < v[a]": Dependence.INVARIANT, "count(v == sort(v))": Dependence.INVARIANT,
    "argsort(argsort(v))[a]": Dependence.INVARIANT,
    "argmax(v) + a": Dependence.INVARIANT, "min(v) == v[2]": Dependence.INVARIANT,
    "(sort(v)[1] if v[0] < v[1] else v[a]) < v[2]": Dependence.INVARIANT,
    "max(v[0], v[1]) <= v[2]": Dependence.INVARIANT,
    "v[0]": Dependence.SELECTION, "sum(v)": None, "v[0] < 0": None, "v[0] - v[1]": None, "v[0] < x": None,
    "abs(v[0]) < abs(v[1])": None,
    "-v[0] < -v[1]": None, "floor(v[0])": None,
}  # fmt: skip


@pytest.mark.parametrize("text", ORDERED)
def test_what_depends_on_order_alone(text: str) -> None:
    """What is said to be invariant is so under random increasing functions, and selections go with them."""
    given = Written().node(text)
    how = dependence([given], "v")[0]
    assert how == ORDERED[text]
    rng = np.random.default_rng(1)
    for _ in range(100):
        numbers = np.array([-2.0, -1.0, 0.0, 0.5, 1.0, 3.0])
        values = rng.choice(numbers, 4)
        increasing = np.cumsum(rng.uniform(0.1, 2, 6)) - 4
        others = increasing[np.searchsorted(numbers, values)]
        rest = {(Role.STATE, "x"): (1,), (Role.STATE, "y"): (2,), (Role.ACTION, "a"): (int(rng.integers(0, 4)),)}
        (one,) = evaluate([given], rest | {(Role.STATE, "v"): tuple(values.tolist())})
        (other,) = evaluate([given], rest | {(Role.STATE, "v"): tuple(others.tolist())})
        if how is Dependence.INVARIANT:
            assert one == other
        elif how is Dependence.SELECTION:
            assert np.array_equal(increasing[np.searchsorted(numbers, one)], other)


def test_a_stand_in_that_starts_outside_its_states_gives_no_results() -> None:
    sort = spec_file("sort").read_text(encoding="utf-8")
    assert sort.count("low: 0, high: L - 1, doc: rank") == 1
    text = sort.replace("low: 0, high: L - 1, doc: rank", "low: 1, high: L - 1, doc: rank")
    found = set(exact.check(build_text(text)).codes)
    assert found == {"E602", "W522"}
