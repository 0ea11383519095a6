"""Soundness: each kind of mistake is found, at its place, with a counterexample; sound tasks stay silent."""

from pathlib import Path

import pytest

from taskspec.base.diagnostics import Diagnostic
from taskspec.base.limits import also
from taskspec.exact.check.report import set_aside
from taskspec.exact.soundness import places
from taskspec.exact.soundness.phases import entries, phases
from taskspec.exact.soundness.soundness import check_ranges, examine, soundness
from taskspec.language.task.task import Task
from tests.shared.diagnostics import codes, with_code
from tests.shared.sections import build_text, text
from tests.shared.sparse import sparse
from tests.shared.specs import EVERY, specs, tasks, tasks_of

ROOT = Path(__file__).parents[3]

FINITE = """
parameters:
  n: {type: int, default: 4, low: 1, high: 9}
state:
  s: {type: int, low: 0, high: n}
  m: {type: choice, values: [near, far]}
action:
  a: {type: int, low: 0, high: 1}
horizon: 20
initial:
  s: INITIAL
  m: near
dynamics:
  s': DYNAMICS
  m': MODE
reward: REWARD
terminal: TERMINAL
observation:
  o: OBSERVATION
expert:
  a: EXPERT
"""
SOUND = {
    "INITIAL": "0", "DYNAMICS": "min(s + a, n)", "MODE": "m", "REWARD": "s' == n", "TERMINAL": "False",
    "OBSERVATION": "s", "EXPERT": "1",
}  # fmt: skip


def written(**parts: str) -> Task:
    text = FINITE
    for name, value in (SOUND | parts).items():
        text = text.replace(name, value)
    return build_text(text)


def only(task: Task) -> Diagnostic:
    found = soundness(task)
    assert len(found) == 1, found
    return found[0]


def excerpt(found: Diagnostic) -> str:
    assert found.span is not None
    line = found.span.origin.line(found.span.line)
    return line[found.span.column - 1 : found.span.end_column - 1]


MISTAKES = [
    ({"DYNAMICS": "s + a"}, "E403", "from s = 4 with a = 1, the next s is 5; it must be between 0 and 4", "s + a"),
    ({"DYNAMICS": "s + a if a == 1 else s"}, "E403", "the next s is 5", "s + a"),
    ({"INITIAL": "UniformInt(3, 5)"}, "E404", "s starts at 5; it must be between 0 and 4", "UniformInt(3, 5)"),
    ({"REWARD": "1 / s"}, "E406", "in s = 0, the reward is inf", "1 / s"),
    ({"REWARD": "1 / s'"}, "E406", "in s = 0 with a = 0, the reward is inf", "1 / s'"),
    ({"OBSERVATION": "log(s - 1)"}, "E405", "in s = 0, o is nan, which is not a finite number", "log(s - 1)"),
    ({"EXPERT": "s"}, "E409", "in s = 2, the expert's a is 2; it must be between 0 and 1", "s"),
    ({"MODE": "{near: s / 4, far: 1/2}"}, "E401", "the sum of the probabilities is 0.5, not 1", None),
    (
        {"MODE": "{by: [a], rows: {0: [{if: s > 2, then: {near: s / 4, far: 1/2}}, {else: m}], 1: m}}"},
        "E401",
        "the sum of the probabilities is 1.25, not 1",
        None,
    ),
    ({"REWARD": "Bernoulli(s / 3)"}, "E402", "in s = 4, 'p' of Bernoulli is 1.33333", "s / 3"),
    ({"REWARD": "Normal(mean=0, std=s - 1)"}, "E408", "in s = 0, 'std' of Normal is -1", "s - 1"),
    ({"REWARD": "Exponential(rate=s)"}, "E408", "in s = 0, 'rate' of Exponential is 0", "s"),
    ({"REWARD": "UniformInt(s, 3)"}, "E408", "in s = 4, 'high' - 'low' of UniformInt is -1", "UniformInt(s, 3)"),
    (
        {"REWARD": "sum([[Bernoulli(s * k / 3) for k in range(2)][j] for j in range(2)])"},
        "E402",
        "in s = 4, 'p' of Bernoulli is 1.33333",
        "s * k / 3",
    ),
    (
        {"REWARD": "sum([UniformInt(k, s) for k in range(2)])"},
        "E408",
        "in s = 0, 'high' - 'low' of UniformInt is -1",
        None,
    ),
    (
        {"REWARD": "Bernoulli(UniformInt(0, s) / 3)"},
        "E402",
        "in s = 4, 'p' of Bernoulli is 1.33333",
        "UniformInt(0, s) / 3",
    ),
]


@pytest.mark.parametrize(("parts", "code", "message", "part"), MISTAKES, ids=lambda x: str(x)[:40])
def test_a_mistake_is_shown_by_a_counterexample(
    parts: dict[str, str], code: str, message: str, part: str | None
) -> None:
    found = only(written(**parts))
    assert found.code == code
    assert message in found.message
    assert part is None or excerpt(found) == part
    assert "parameters: n = 4" in found.notes


def test_labels_appear_by_name() -> None:
    found = only(written(DYNAMICS="s + (m == near)"))
    assert found.message.startswith("from s = 4, m = near with a = 0, the next s is 5")


def test_a_table_row_is_the_place() -> None:
    table = "{by: [m, a], rows: {near: {0: s, 1: s + 1}, far: s}}"
    assert excerpt(only(written(DYNAMICS=table))) == "s + 1"


def test_what_parts_mean_is_known_from_the_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """Branches, rows and distributions are found without checking anything again."""

    def again(*args: object) -> None:
        raise AssertionError("a part is checked once more")

    monkeypatch.setattr(places, "Checker", again)
    table = "{by: [m, a], rows: {near: {0: s, 1: s + 1}, far: s}}"
    assert excerpt(only(written(DYNAMICS=table))) == "s + 1"
    assert excerpt(only(written(DYNAMICS="s + a if a == 1 else s"))) == "s + a"
    assert excerpt(only(written(REWARD="False if s <= 3 else Bernoulli(s / 3)"))) == "s / 3"
    drawn = "{by: m, rows: {near: {1: s / 4, 0: 1/2}, far: 0}}"
    assert only(written(REWARD=drawn)).code == "E401"


def test_probabilities_in_a_branch_that_is_not_taken_do_not_matter() -> None:
    for drawn in ("Bernoulli(s / 3)", "sum([Bernoulli(s / 3) if k > 0 else 0 for k in range(2)])"):
        assert soundness(written(REWARD=f"{drawn} if s <= 3 else False")) == []
    assert soundness(written(REWARD="sum([Bernoulli(s / 3) if s <= 3 else False for k in range(2)])")) == []
    found = only(written(REWARD="False if s <= 3 else Bernoulli(s / 3)"))
    assert (found.code, excerpt(found)) == ("E402", "s / 3")


def test_a_state_that_ends_the_episode_needs_no_dynamics() -> None:
    assert soundness(written(DYNAMICS="s + a", TERMINAL="s' == n")) == []
    assert only(written(DYNAMICS="s + a", TERMINAL="s' == n and a == 0")).code == "E403"


def test_a_state_that_no_episode_acts_in_is_declared_all_the_same() -> None:
    found = only(written(DYNAMICS="s + 1 if s == 4 else s"))
    assert found.code == "E403"
    assert "no episode takes an action in this state" in "\n".join(found.notes)


def test_the_counterexample_is_one_that_episodes_meet() -> None:
    found = only(written(DYNAMICS="1 if s == 0 else s", INITIAL="UniformInt(0, 1)", REWARD="1 / (s - 1) / (s - 3)"))
    assert found.message.startswith("in s = 1, the reward is")


def test_time_is_looked_at_where_it_matters() -> None:
    found = only(written(REWARD="1 / (t - 7)"))
    assert "at t = 7" in found.message


@pytest.mark.parametrize("expert", ["(t + s - s) // 10", "[0 for i in range(20)][t] + s - s"])
def test_nobody_asks_the_expert_when_the_episode_is_over(expert: str) -> None:
    """It was asked after the last step as well, where what looks up the time has no element."""
    assert soundness(written(EXPERT=f'"{expert}"', TERMINAL="s' == n")) == []


def test_the_method_is_stated() -> None:
    assert str(examine(written()).method) == "by bounds"
    method = examine(written(DYNAMICS="s + a * (s < n)")).method
    assert method.exact
    assert (method.points, method.states) == (20, 10)
    assert not examine(written(DYNAMICS="s + a * (s < n)"), limit=5).method.exact


CONTINUOUS = """
state:
  x: {type: real, low: -1, high: 1}
action:
  a: {type: real, low: -1, high: 1}
horizon: 5
initial:
  x: Uniform(-1, 1)
dynamics:
  x': DYNAMICS
reward: REWARD
"""


@pytest.mark.parametrize(
    ("dynamics", "reward", "expected", "proved"),
    [
        ("clip(x + a, -1, 1)", "-x**2", [], True),
        ("x + 0.01 * a", "-x**2", ["E403"], False),
        ("x * abs(a)", "sqrt(x)", ["E406"], False),
        ("x * cos(10 * a)", "exp(x * a)", [], True),
    ],
)
def test_reals_are_proved_by_bounds_or_sampled(dynamics: str, reward: str, expected: list[str], proved: bool) -> None:
    text = CONTINUOUS.replace("DYNAMICS", dynamics).replace("REWARD", reward)
    found = examine(build_text(text))
    assert codes(found.diagnostics) == expected
    assert found.method.exact is proved


LONG_WAY = """
state: {x: {type: KIND, low: -100000000, high: 100000000}}
action: {a: {type: int, low: 1, high: 3}}
horizon: HORIZON
initial: {x: 0}
terminal: x' >= END
dynamics: {x': x + a}
observation: {seen: {value: x, low: -100000000, high: SEEN}}
reward: -1
"""


WIDE = 10**8 - 10


@pytest.mark.parametrize(("kind", "horizon", "end", "seen", "expected", "proved"), [
    ("int", "100000", WIDE, WIDE // 2, ["W526"], False),  # a declared state fails, and no episode that was tried gets there
    ("real", "100000", WIDE, WIDE // 2, ["W526"], False),
    ("int", "200", WIDE, 600, [], True),  # by how far episodes get
    ("real", "200", WIDE, 600, [], True),
    ("real", "none", 10, 11, ["E405"], False),  # the last state of an episode is seen, too
    ("int", "none", 10, 12, [], False),  # only steps that end episodes enter 10, 11 and 12, and none enters more
])  # fmt: skip
def test_without_a_model_only_what_fails_where_episodes_are_is_an_error(
    kind: str, horizon: str, end: int, seen: int, expected: list[str], proved: bool
) -> None:
    text = (
        LONG_WAY.replace("KIND", kind).replace("HORIZON", horizon).replace("END", f"{end}").replace("SEEN", f"{seen}")
    )
    found = examine(build_text(text))
    assert codes(found.diagnostics) == expected
    assert found.method.exact is proved


@pytest.mark.parametrize(
    ("kind", "high", "expected"), [("real", 13, []), ("real", 11, ["E403"]), ("int", 12, []), ("int", 11, ["E403"])]
)
def test_states_that_only_ended_episodes_reach_are_not_where_a_step_starts(
    kind: str, high: int, expected: list[str]
) -> None:
    """From 10 and more, where no episode acts, the next state would lie outside."""
    text = LONG_WAY.replace("KIND, low: -100000000, high: 100000000", f"{kind}, low: 0, high: {high}")
    text = text.replace("HORIZON", "none").replace("END", "10").replace("observation", "# ")
    if kind == "int":  # with a million other states, so that they are not all looked at
        text = text.replace("action:", "  y: {type: int, low: 0, high: 10000000}\naction:").replace(
            "{x: 0}", "{x: 0, y: 0}"
        )
        text = text.replace("state: {x", "state:\n  x").replace(f"{high}}}}}", f"{high}}}")
    found = examine(build_text(text))
    assert codes(found.diagnostics) == expected
    assert not found.method.exact


def test_parameters_are_tried_at_the_ends_of_their_ranges() -> None:
    task = written(REWARD="1 / (n - 2)", DYNAMICS="min(s + a, 4)")
    ranges = check_ranges(task)
    assert ranges.cases == ({"n": 1}, {"n": 9}) and not ranges.untried
    found = with_code(ranges.diagnostics, "E403")
    assert "parameters: n = 1" in found[0].notes[-1]


def test_what_cannot_be_built_for_other_parameters_names_them() -> None:
    ranges = check_ranges(written(REWARD="max([i for i in range(n - 1)]) * s'"))
    assert [each.notes[-1] for each in with_code(ranges.diagnostics, "E407")] == ["parameters: n = 1"]
    ranges = check_ranges(written(INITIAL="sum(Uniform({p for p in box(0, 5, n)})) % 2"))
    assert [each.message.partition(":")[0] for each in ranges.diagnostics] == ["this is not checked at n = 9"]
    assert ranges.untried == 1


def test_settings_share_the_expressions_that_one_task_may_have() -> None:
    """The large end is refused, the value closer to the default stands in for it, and small ends that follow are tried."""
    parameters = "{n: {type: int, default: 4, low: 1, high: 900}, m: {type: int, default: 4, low: 1, high: 9}}"
    task = build_text(text(parameters=parameters, reward="sum([s * i for i in range(n)]) + m"))
    with also("expressions=2000"):
        ranges = check_ranges(task)
    assert ranges.cases[:4] == ({"n": 1}, {"n": 15}, {"m": 1}, {"m": 9})
    (problem,) = ranges.diagnostics
    assert problem.message == "this is not checked at n = 900: all settings together have more than 2,000 expressions"
    assert ranges.untried == 1


@pytest.mark.parametrize("path", sparse(specs(*EVERY), 10), ids=lambda path: path.stem)
def test_every_task_is_sound(path: Path) -> None:
    for task in tasks_of(path):
        assert soundness(task) == []
        if task.name != "RandomMDP":
            left, _ = set_aside(task, check_ranges(task).diagnostics)
            assert left == []


def test_noise_is_drawn_even_where_nothing_uses_it() -> None:
    weights = "(s / (s + a), a / (s + a))"
    noise = f"\nnoise: {{pick: 'Categorical({weights})'}}"
    found = soundness(written(EXPERT=f"1{noise}", DYNAMICS="pick if s + a > 0 else s"))
    assert codes(found) == ["E401", "E402"]
    for each in found:
        assert "give `pick` a value there, `pick: ... if CONDITION else VALUE`" in each.notes[-1]
    guarded = noise.replace(")'}", ") if s + a > 0 else 0'}")
    assert not soundness(written(EXPERT=f"1{guarded}", DYNAMICS="pick"))


def test_every_check_has_a_place() -> None:
    looked_at = 0
    for task in tasks(*EVERY):
        if task.process.legal is None and task.annotations.memory is None:
            continue
        looked_at += 1
        for phase in phases(task, 1000):
            for check in phase.checks:
                named = [name for name, _ in entries(task, check.section) if name in (check.entry, None)]
                assert check.place is not None or named, (task, check)
    assert looked_at > 10
