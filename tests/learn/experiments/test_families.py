"""The families of tasks: learners can be raced on their instances, whatever their spaces are."""

import itertools
from typing import Any

import numpy as np
import pytest

from taskspec.base.limits import written
from taskspec.exam import Case, learns_from
from taskspec.learn.exam.examinee import Examinee
from taskspec.tools.separation.races import family_of, race, rounds
from tests.shared.sparse import sparse

SHIPPED = ("aliased", "chains", "delays", "grids", "levers", "marks", "measured", "tables", "trees")
INSTANCES = 6


class AnyTable:
    """Q-values by observation, of any space, and by action: all of them, or five values of each real."""

    def __init__(self, case: Case) -> None:
        space: Any = case.action_space
        self.actions: list[Any]
        if hasattr(space, "n"):
            self.actions = list(range(space.start, space.start + space.n))
        elif hasattr(space, "nvec"):
            self.actions = list(itertools.product(*map(range, space.nvec)))
        else:
            self.actions = list(itertools.product(np.linspace(-1, 1, 5), repeat=space.shape[0]))
        self.rows: dict[bytes, Any] = {}

    def __getitem__(self, obs: Any) -> Any:
        return self.rows.setdefault(np.asarray(obs, float).tobytes(), np.zeros(len(self.actions)))

    def act(self, index: int) -> Any:
        action = self.actions[index]
        return action if isinstance(action, int) else np.array(action)

    def predict(self, observations: Any) -> Any:
        return np.array([self.act(int(self[obs].argmax())) for obs in observations])


def learn(case: Case, sign: float) -> AnyTable:
    env = case.env()
    rng = np.random.default_rng(case.seed)
    table = AnyTable(case)
    obs, _ = env.reset()
    for _ in range(case.steps):
        greedy = rng.random() < 0.7
        index = int(table[obs].argmax() if greedy else rng.integers(len(table.actions)))
        after, reward, terminated, truncated, _ = env.step(table.act(index))
        later = 0.0 if terminated else 0.95 * table[after].max()
        table[obs][index] += 0.1 * (sign * float(reward) + later - table[obs][index])
        obs = env.reset()[0] if terminated or truncated else after
    return table


@learns_from("reward")
def right(case: Case) -> AnyTable:
    return learn(case, 1.0)


@learns_from("reward")
def negated(case: Case) -> AnyTable:
    return learn(case, -1.0)


@pytest.mark.parametrize("name", sparse(SHIPPED, 4))
def test_instances_of_a_family_tell_learners_apart(name: str) -> None:
    """A right learner of tables wins instances on which one of the negative reward loses."""
    instances = next(rounds(family_of(f"families/{name}"), 0))
    assert len({each.id for each in instances}) == len(instances)
    pair = [Examinee("right", ("reward",), right), Examinee("negated", ("reward",), negated)]
    scores = []
    for instance in instances[:INSTANCES]:
        good, bad = race(instance, pair, (0,), 3000, written())
        if good is not None and bad is not None:
            scores.append((good[0], bad[0]))
    goods, bads = np.transpose(scores)
    assert len(scores) >= INSTANCES / 2
    assert np.sum((goods >= 0.5) & (bads < 0.3)) >= 2


def test_a_suite_is_a_family() -> None:
    (instances,) = rounds(family_of("probes"), 3)
    assert "probes/EndInPlace-v0" in {each.task for each in instances}
