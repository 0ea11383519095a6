"""Claims: every form, the statuses, and the messages of those that fail."""

import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from scipy.special import softmax

from taskspec import exact
from taskspec.exact.rules.claim_rules import FUNCTIONS, MODELS, RESULTS
from taskspec.exact.rules.claim_verdicts import Verdict, verdicts
from taskspec.language import registry
from tests.shared.diagnostics import statuses, with_code
from tests.shared.for_each import for_each
from tests.shared.sections import build_text
from tests.shared.sparse import sparse
from tests.shared.specs import EVERY, specs, tasks_of

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("path", sparse(specs(*EVERY), 3), ids=lambda path: path.stem)
def test_every_claim_of_every_task_holds(path: Path) -> None:
    for task in tasks_of(path):
        for verdict in verdicts(task):
            assert verdict.holds, (task.id, verdict.claim.text, verdict.detail)


PATH = """
taskspec: 1
name: Path
parameters:
  n: {type: int, default: 3, low: 1, high: 9}
state:
  s: {type: int, low: 0, high: n}
  side: {type: choice, values: [left, right]}
action:
  a: {type: choice, values: [stay, go]}
  idle: {type: int, low: 0, high: 1}
horizon: 2 * n
initial:
  s: 0
  side: left
dynamics:
  s': min(s + (a == go), n)
reward: s' == n
measures: {steps: 1}
terminal: s' == n
expert: {a: go, idle: 0}
claims:
  - CLAIM
"""
SIMULATED = """
state:
  x: {type: real, low: 0, high: 1}
action:
  a: {type: int, low: 0, high: 1}
horizon: 1
initial:
  x: Uniform(0, 1)
dynamics:
  x': x
reward: x < 1/4
expert: {a: 1}
claims:
  - CLAIM
"""


def verdict(claim: str, text: str = PATH) -> Verdict:
    (found,) = verdicts(build_text(text.replace("CLAIM", claim)))
    return found


PROVED = [
    "optimal_return == 1",
    "expert_return == optimal_return and worst_return == 0",
    "0 < random_return < optimal_return",
    "random_return == 1 - (1 + 6 + 15) / 2**6",
    "probability(s == n) == random_return",
    "probability(s == n, under=optimal) == 1",
    "probability(s == n, expert) == 1",
    "probability(s == 1, under=uniform) == 1 - 2**-6",
    "states == n + 1",
    "actions == 4",
    "reachable(s == n)",
    "not reachable(side == right)",
    "not reachable(s == 2 and side == right)",
    "prefers(optimal, a == go, at=s + 6 - t == n)",
    "prefers(soft(n), a == go, at=s == n - 1 and t == T - 1)",
    "prefers(maxent, a == stay, at=s == 2 and t == 2) or prefers(maxent, a == go, at=s == 2 and t == 2)",
    "not prefers(uniform, a == go)",
    "prefers(zero_terminal_value(-1), a == go, at=s == 2)",
    "prefers(zero_terminal_value(1), a == stay, at=s == 2 and t < T - 1)",
    "influences(a, s)",
    "not influences(idle, s)",
    "not influences(a, side)",
    "abs(random_return - 0.65625) < 1e-9",
    "optimal_return > 1/3 + 1/3",
    "worst_return != optimal_return",
]


@for_each("claim", PROVED)
def test_statements_that_hold(claim: str) -> None:
    found = verdict(claim)
    assert found.status == "proved", found.detail


FALSE = [
    ("optimal_return == 2", "optimal_return is 1"),
    ("optimal_return < 1", "optimal_return is 1"),
    ("random_return >= 1", "random_return is 0.65625"),
    ("random_return / 9 == 1", "random_return / 9 is 0.07291666667"),
    ("reachable(side == right)", "no episode is ever in such a state"),
    ("prefers(optimal, a == stay, at=s == 2)", "it takes a = go"),
    ("prefers(optimal, a == go, at=s == n)", "no episode acts where this is asked"),
    ("prefers(uniform, a == go)", "it is indifferent in s = 0"),
    ("influences(idle, s)", "the next s does not depend on idle"),
    ("optimal_return == 1 and states == 1", "states is 4"),
]


@pytest.mark.parametrize(("claim", "message"), FALSE)
def test_statements_that_do_not_hold(claim: str, message: str) -> None:
    found = verdict(claim)
    assert found.status == "false"
    assert found.diagnostic is not None
    assert found.diagnostic.code == "E601"
    assert message in found.diagnostic.message
    span = found.diagnostic.span
    assert span is not None
    assert span.line == PATH[: PATH.index("CLAIM")].count("\n") + 1


BROKEN = [
    ("optimal_return", "a claim is a statement"),
    ("optimal_retrun == 1", "is not defined here"),
    ("s == 1", "depends on the state"),
    ("reachable()", "reachable needs 'condition'"),
    ("reachable(a == go)", "about states alone"),
    ("reachable(s)", "a condition on states and actions is needed"),
    ("prefers(clever, a == go)", "a decision model is one of optimal, soft(beta)"),
    ("prefers(optimal, a == go, at=a == go)", "it says where, so it cannot depend on the action"),
    ("prefers(optimal, a == go, when=s == 1)", "prefers has no argument 'when'"),
    ("influences(s, s)", "an action component is needed here: a, idle"),
    ("reachable(s == up)", "is not defined here"),
    ("Normal(mean=0, std=1) > 0", "a claim is a statement about exact results"),
]


@pytest.mark.parametrize(("claim", "message"), BROKEN)
def test_what_is_not_a_claim(claim: str, message: str) -> None:
    found = verdict(claim)
    assert found.status == "broken"
    assert found.diagnostic is not None
    assert found.diagnostic.code == "E603"
    assert message in found.diagnostic.message


def test_everything_in_the_vocabulary_is_understood() -> None:
    for name in RESULTS:
        assert verdict(f"{name} > -1").status == "proved"
    examples = {
        "reachable": "reachable(s == 1)",
        "probability": "probability(s == 1, under=expert) == 1",
        "prefers": "prefers(optimal, a == go, at=s == 2 and t == T - 1)",
        "influences": "influences(a, s)",
        "measure": "measure(steps, under=expert) == n",
        "abs": "abs(0 - optimal_return) == 1",
    }
    assert examples.keys() == FUNCTIONS.keys()
    for claim in examples.values():
        assert verdict(claim).status == "proved"
    for word in MODELS.values():
        for written in word.written.split(", "):
            model = written.replace("beta", "2").replace("shift", "1/2")
            assert verdict(f"probability(s == n, under={model}) <= 1").status == "proved"


def test_claims_by_simulation() -> None:
    found = verdict("random_return == 1/4", SIMULATED)
    assert (found.status, found.episodes) == ("tested", 1000)
    found = verdict("{claim: abs(random_return - 1/4) < 0.02, episodes: 20000}", SIMULATED)
    assert (found.status, found.episodes) == ("tested", 20000)
    found = verdict("random_return > 1/2", SIMULATED)
    assert found.diagnostic is not None
    assert found.diagnostic.code == "E604"
    assert "1,000 episodes contradict this claim at 99.9% confidence" in found.diagnostic.message
    found = verdict("optimal_return == 1", SIMULATED)
    assert found.diagnostic is not None
    assert found.diagnostic.code == "E602"
    assert "'x' has infinitely many values" in found.diagnostic.message
    assert verdict("not influences(a, x)", SIMULATED).status == "proved"


def test_cases_and_tolerance() -> None:
    text = PATH.replace("CLAIM", "{claim: states == n + 1, for: [{n: 1}, {n: 5}, {n: 9}]}")
    found = list(verdicts(build_text(text)))
    assert statuses(found) == ["proved"] * 3
    for each, n in zip(found, (1, 5, 9), strict=True):
        assert each.parameters == {"n": n}
    text = PATH.replace("CLAIM", "{claim: states == 6, for: [{n: 5}, {n: 6}, {n: 99}]}")
    found = list(verdicts(build_text(text)))
    assert statuses(found) == ["proved", "false", "broken"]
    assert found[1].diagnostic is not None
    assert found[1].diagnostic.notes == ("for n = 6",)
    assert verdict("{claim: random_return == 0.6, tolerance: 0.1}").status == "proved"
    assert verdict("{claim: random_return == 0.6, tolerance: 0.01}").status == "false"


def test_under_names_the_decision_model() -> None:
    """`prefers(...)` and `under:` say the same."""
    found = verdict("{claim: probability(s == n) == 1, under: optimal}")
    assert found.status == "proved"
    found = verdict("{claim: 'prefers(a == go, at=s + 6 - t == n)', under: soft(50)}")
    assert found.status == "proved"


@pytest.mark.parametrize(
    ("claim", "status"),
    [
        ("optimal_return == 1 - 0.9e-9", "proved"),
        ("optimal_return == 1 - 1.1e-9", "false"),
        ("1000 * optimal_return == 1000 + 0.9e-6", "proved"),
        ("1000 * optimal_return == 1000 + 1.1e-6", "false"),
    ],
)
def test_numbers_are_equal_within_a_billionth_of_their_size(claim: str, status: str) -> None:
    assert verdict(claim).status == status


@pytest.mark.parametrize(("ahead", "status"), [(2e-10, "false"), (3e-10, "proved")])
@pytest.mark.parametrize("chance", ["{p!r}", "exp(log({p!r}) - s)"])
def test_actions_that_are_as_frequent_within_a_billionth_are_tied(ahead: float, status: str, chance: str) -> None:
    """Frequencies 1/2 + d and 1/2 - d differ by 4 d of their size; once as rationals, and once as floats with errors."""
    drawn = f"Bernoulli({chance.format(p=0.5 + ahead)})"
    text = PATH.replace("CLAIM", "prefers(expert, a == go, at=s == 0)")
    text = re.sub(r"(?m)^expert:.*$", f"expert: {{a: 'go if {drawn} else stay', idle: 0}}", text)
    (found,) = verdicts(build_text(text))
    assert found.status == status, found.detail


DISCOUNTED = """
state:
  s: {type: int, low: 0, high: 2}
action:
  a: {type: int, low: 0, high: 1}
horizon: 2
discount: 1/2
initial: {s: 0}
dynamics: {s': s + a}
reward: a
claims:
  - claim: CLAIM
    tolerance: 1e-12
"""


def test_returns_of_trajectories_are_discounted() -> None:
    """Going on twice has the weight exp(1 + 1/2) among exp(0), exp(1), exp(1/2) and its own."""
    expected = softmax([0, 1, 1 / 2, 3 / 2]).item(-1)
    found = verdict(f"probability(s == 2, under=maxent) == {expected!r}", DISCOUNTED)
    assert found.status == "proved", found.detail


def test_parameters_given_at_build_reach_the_claims() -> None:
    values: dict[str, Any] = {"n": 7}
    text = PATH.replace("CLAIM", "states == 8")
    (found,) = verdicts(build_text(text, **values))
    assert found.status == "proved"


@pytest.mark.parametrize("discount", ["1/2", "0.999999999", "1"])
@pytest.mark.parametrize("horizon", [1, 6, 40])
def test_returns_of_episodes_that_never_terminate_are_known_to_the_last_step(discount: str, horizon: int) -> None:
    """What all episodes are paid is no more, and no less, than the rewards of their steps."""
    text = SIMULATED.replace("reward:", "discount: {d}\nreward: 1  #").replace("{d}", discount)
    text = re.sub(r"(?m)^horizon: .*$", f"horizon: {horizon}", re.sub(r"(?m)^terminal:.*\n", "", text))
    total = sum(Fraction(float(Fraction(discount))) ** i for i in range(horizon))
    assert verdict(f"random_return == {float(total)!r}", text).status == "tested"
    assert verdict(f"random_return == {float(total) * (1 + 1e-6)!r}", text).status == "contradicted"
    assert verdict(f"random_return > {float(total + 1)!r}", text).status == "contradicted"
    assert verdict(f"random_return < {float(total - 1)!r}", text).status == "contradicted"


ENDING = """
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 5
initial: {s: 0}
dynamics: {s': "min(s + [1, 1][a], 2)"}
reward: a if t < 2 else 1 - a
terminal: END
claims:
  - CLAIM
"""


def test_what_is_preferred_after_every_episode_has_ended_is_not_asked() -> None:
    """The states of the last steps would prefer the other action at a time when no episode is in them."""
    text = ENDING.replace("END", "s' == 2")
    assert verdict("prefers(optimal, a == 1)", text).status == "proved"
    assert verdict("prefers(optimal, a == 1)", text.replace("s' == 2", "false")).status == "false"


def test_an_action_that_decides_only_about_the_end_influences_no_component() -> None:
    text = ENDING.replace("END", "a == 1")
    assert verdict("not influences(a, s)", text).status == "proved"
    assert verdict("influences(a, s)", text).status == "false"


def test_a_report_is_about_its_task_and_says_of_numbers_only_what_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "risky.yaml"
    path.write_text(
        (registry.tasks_root() / "derail/risky_path.yaml")
        .read_text(encoding="utf-8")
        .replace("optimal_return == 4", "optimal_return == 4.50")
    )
    found = exact.check(path)
    assert found.task.name == "RiskyPath"
    (wrong,) = with_code(found.diagnostics, "E601")
    assert "optimal_return is 4" in wrong.message and "4.50 is" not in wrong.message


LATE = """
state: {s: {type: int, low: 0, high: 4}}
action: {a: {type: choice, values: [left, right]}}
horizon: 9
initial: {s: 0}
definitions: {arrived: s == 4}
dynamics: {s': "clip(s + (a == right) - (a == left), 0, 4)"}
reward: s' == 4
terminal: s' == 4
claims: [optimal_return == 3]
"""


@pytest.mark.parametrize(
    ("old", "new", "section"),
    [
        ("terminal: s'", "terminal: s", "terminal"),
        ("terminal: s' == 4", "terminal: arrived", "terminal"),
        ("reward: s'", "reward: s", "reward"),
        ("reward: s' == 4", "reward: s == 4 and a == right", None),
        ("terminal: s' == 4", "terminal: t == 8", None),
        ("optimal", "random", None),
    ],
)
def test_a_false_claim_names_what_reads_the_state_left(old: str, new: str, section: str | None) -> None:
    """Where the end, or the reward, may be meant for the state that a step reaches."""
    report = exact.check(build_text(LATE.replace(old, new)))
    (wrong,) = with_code(report.diagnostics, "E601")
    hint = section and f"`{section}` reads `s`, the state that a step leaves; `s'` is the state that it reaches"
    assert wrong.hint == hint
