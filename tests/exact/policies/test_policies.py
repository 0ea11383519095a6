"""What a policy is scored as: what it is by itself unless asked otherwise, and exact only where nothing was sampled.

The true values are worked out by hand: InitShift is a tree of two choices, RiskyPath a chain of four states.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exact import Expert, normalised, score
from taskspec.exact.scores.returns import Results
from taskspec.language.task.task import Task
from tests.shared.sections import build_text

RISKY = taskspec.load("RiskyPath")
TREE = """
state: {s: {type: int, low: 0, high: 6}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 2
initial: {s: 0}
dynamics: {s': "2 * s + 1 + a if s <= 2 else s"}
reward: {by: s', rows: {3: 1, 4: -1, 5: -1, 6: 2, else: 0}}
expert: soft(1)
"""
CLOCKED = TREE.replace("expert: soft(1)", "observation: {time: t}")


def tree(text: str = TREE) -> Task:
    return build_text(text)


def soft_return() -> float:
    """Of the causal maximum-entropy policy at temperature 1 on the tree, by hand."""
    e = np.exp
    left = np.log(e(1) + e(-1))
    right = np.log(e(-1) + e(2))
    go_left = e(left) / (e(left) + e(right))
    at_left = (e(1) - e(-1)) / (e(1) + e(-1))
    at_right = (-e(-1) + 2 * e(2)) / (e(-1) + e(2))
    return float(go_left * at_left + (1 - go_left) * at_right)


class Policy:
    """A policy that takes action 1 with probability p, and knows or does not know the flag `deterministic`."""

    def __init__(self, p: float, obeys: bool = True) -> None:
        self.p = p
        self.obeys = obeys
        self.rng = np.random.default_rng(0)

    def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
        if deterministic and self.obeys:
            return np.full(len(observation), int(self.p > 0.5)), None
        return (self.rng.random(len(observation)) < self.p).astype(int), None


class Telling(Policy):
    """One that also tells its probabilities."""

    def action_probabilities(self, observation: Any) -> Any:
        return np.tile([1 - self.p, self.p], (len(observation), 1))


def risky_return(p: float) -> float:
    """Of RiskyPath for five steps, where action 1 is taken with probability p in every state: powers of its matrix."""
    move = np.array([[0, 1 - p, p / 2, p / 2], [0, p, 1 - p, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    at = np.array([1.0, 0, 0, 0])
    total = 0.0
    for _ in range(5):
        at = at @ move
        total += at[2] - 100 * at[3]
    return float(total)


def test_a_soft_expert_is_scored_as_the_stochastic_policy_that_it_is() -> None:
    task = tree()
    assert soft_return() == pytest.approx(1.5457, abs=1e-4)
    found = score(task, Expert(task))
    assert found.value.exact
    assert found.value.value == pytest.approx(soft_return(), abs=1e-9)
    assert found.normalised == pytest.approx(1)
    assert found.asked == "probabilities"
    assert Results(task).expert.value == pytest.approx(soft_return(), abs=1e-9)  # type: ignore[union-attr]


def test_the_deterministic_version_of_a_soft_expert_is_another_policy() -> None:
    found = score(tree(), Expert(tree()), deterministic=True, episodes=20)
    assert found.value.value == 2
    assert found.asked == "samples"
    assert not found.value.exact


def test_integers_are_actions_and_returns_have_a_keyword() -> None:
    assert score(RISKY, [1, 1, 1, 1]).value.value == -247.5
    assert score(RISKY, returns=[1, 1, 1, 1]).value.value == 1
    with pytest.raises(SpecError, match=r"returns=\[\.\.\.\]"):
        score(RISKY, [1.0, 1.0, 1.0, 1.0])
    for wrong in (
        {},
        {"policy": [0, 0, 0, 0], "returns": [1.0]},
        {"returns": []},
        {"returns": ["a"]},
        {"returns": [[1.0]]},
    ):
        with pytest.raises(SpecError, match="E713"):
            score(RISKY, **wrong)  # type: ignore[arg-type]
    with pytest.raises(SpecError, match="E713"):
        score(RISKY, 3)


@pytest.mark.parametrize("p", [0.0, 0.3, 0.8, 1.0])
def test_probabilities_that_a_policy_tells_are_used_exactly(p: float) -> None:
    found = score(RISKY, Telling(p))
    assert found.asked == "probabilities"
    assert found.value.exact
    assert found.value.value == pytest.approx(risky_return(p), abs=1e-9)
    best = score(RISKY, Telling(p), deterministic=True)
    assert best.asked == "actions"
    assert best.value.value == pytest.approx(risky_return(float(p > 0.5)), abs=1e-9)


@pytest.mark.parametrize("deterministic", [None, False, True])
@pytest.mark.parametrize("obeys", [True, False])
def test_what_was_sampled_is_never_called_exact(obeys: bool, deterministic: bool | None) -> None:
    found = score(RISKY, Policy(0.3, obeys), deterministic=deterministic, episodes=4000)
    if deterministic and obeys:
        assert (found.asked, found.value.exact, found.value.value) == ("actions", True, 4)
        return
    assert found.asked == "samples"
    assert not found.value.exact
    low, high = found.value.interval(0.9999)
    assert low <= risky_return(0.3) <= high


def test_a_policy_that_may_explore_now_and_then_is_simulated_unless_asked_not_to() -> None:
    class Explores(Policy):
        def predict(self, observation: Any, deterministic: bool = False) -> tuple[Any, None]:
            return np.full(len(observation), int(not deterministic and self.rng.random() < 0.001)), None

    assert score(RISKY, Explores(0), episodes=50).asked == "samples"
    assert score(RISKY, Explores(0), deterministic=True).value.exact


def test_a_function_that_varies_is_simulated() -> None:
    rng = np.random.default_rng(0)
    found = score(RISKY, lambda state, t: {"a": (rng.random(state["s"].shape) < 0.3).astype(int)}, episodes=4000)
    assert found.asked == "samples"
    low, high = found.value.interval(0.9999)
    assert low <= risky_return(0.3) <= high
    assert score(RISKY, lambda state, t: {"a": 0}).asked == "actions"


class Counting:
    """A recurrent policy: left in the first step, right in the second, whatever it sees."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> Any:
        steps = np.zeros(len(observation), int) if state is None else np.where(episode_start, 0, state)
        return steps % 2, steps + 1


def test_a_recurrent_policy_keeps_its_memory_from_step_to_step() -> None:
    found = score(tree(), Counting(), episodes=10)
    assert found.value.value == -1  # 0 -> 1 -> 4
    assert found.asked == "samples"


def test_a_policy_that_sees_the_time_is_tabulated_for_each_time() -> None:
    class Clock:
        def predict(self, observation: Any) -> Any:
            return np.asarray(observation) % 2

    found = score(tree(CLOCKED), Clock())
    assert (found.asked, found.value.exact, found.value.value) == ("actions", True, -1)


def test_a_policy_trained_behind_normalisation_sees_normalised_observations() -> None:
    class Wrapper:
        def normalize_obs(self, seen: Any) -> Any:
            return seen - 100

    class Trained:
        """Safe on what it saw in training, risky elsewhere."""

        def get_vec_normalize_env(self) -> Wrapper:
            return Wrapper()

        def predict(self, observation: Any, deterministic: bool = False) -> Any:
            return (np.asarray(observation) > -50).astype(int), None

    assert score(RISKY, Trained()).value.value == 4


def test_answers_of_the_wrong_size_are_refused() -> None:
    class One:
        def predict(self, observation: Any) -> Any:
            return np.zeros(1, int), None

    class Rows(Policy):
        def action_probabilities(self, observation: Any) -> Any:
            return np.full((len(observation), 2), 0.4)

    for policy in (One(), Rows(0.5)):
        with pytest.raises(SpecError, match="E713"):
            score(RISKY, policy)


def test_a_return_that_is_no_number_has_no_score_not_the_lowest() -> None:
    assert math.isnan(normalised(math.nan, 0.0, 2.0))
    with pytest.raises(SpecError, match=r"E713.*return number 2 of 2 is nan"):
        score("RiskyPath", returns=[1.0, math.nan])


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("optimal", "`Expert(task, 'optimal')`"),
        ("soft(1)", "`Expert(task, 'soft(1)')`"),
        ("random", "a table, a function"),
    ],
)
def test_a_name_is_no_policy_and_what_it_may_stand_for_is_said(name: str, hint: str) -> None:
    with pytest.raises(SpecError, match="str is not a policy") as error:
        score("derail/RiskyPath", name)
    assert hint in str(error.value.diagnostics[0].hint)
