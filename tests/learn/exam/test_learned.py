"""Learned values and rewards in exams: how they are read, and the mistakes that they show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exam import Case, Learned, examine, learns_from
from taskspec.learn.exam.card import card
from taskspec.learn.exam.card_text import print_exams
from taskspec.learn.exam.learned import learned_fields, learned_values
from taskspec.learn.exam.mistakes import MISTAKES
from taskspec.learn.exam.report import page
from taskspec.learn.exam.starc import REWARDS, RewardMdp
from tests.learn.exam.test_fingerprints import GAMMA, TASKS, learned_q

pytestmark = pytest.mark.usefixtures("warm")

Array = np.ndarray[Any, Any]


# -- values -----------------------------------------------------------------------------------------------------------


def examined(mistake: str, form: Callable[[Array], Any], tasks: Sequence[str] = TASKS[:2]) -> Any:
    """Return the exam of a learner with a mistake."""

    @learns_from("reward")
    def learner(case: Case) -> Any:
        task = TASKS[0] if case.task.name == "EndInPlace" else TASKS[1]
        return form(learned_q(task, mistake, case.seed))

    return examine(learner, tasks=list(tasks), seeds=5, twins=0)


def test_a_mistake_is_flagged_with_its_code_and_its_fix(capsys: pytest.CaptureFixture[str]) -> None:
    found = examined("limit is an end", lambda q: Learned(q, discount=GAMMA))
    (flag,) = [each for each in found["flags"] if each["kind"] == "values"]
    assert "for which the time limit ends the world (values at distance 0." in flag["message"]
    assert "done = terminated or truncated. Mask V(s') by terminated alone" in flag["advice"]
    of_walk = [score["operators"] for score in found["scores"] if "CoinWalk" in score["task"]]
    assert of_walk and all(each["limit is an end"] < each["right"] for each in of_walk)
    print_exams({"one": found})
    assert "time limit ends the world" in " ".join(capsys.readouterr().out.split())
    assert "time limit ends the world" in page(card(found))


def test_right_values_are_one_line_and_no_flag(capsys: pytest.CaptureFixture[str]) -> None:
    found = examined("right", lambda q: Learned(q, discount=GAMMA), TASKS[1:2])
    assert not found["flags"]
    print_exams({"one": found})
    line = "nearest to the learned values: a learner without a known mistake (distance 0.0"
    assert line in " ".join(capsys.readouterr().out.split())
    assert line in page(card(found))


def test_values_are_not_compared_with_a_reward_that_is_withheld() -> None:
    learned = Learned(np.ones((4, 2)), q=np.ones((4, 2)), discount=GAMMA)
    assert learned_fields(taskspec.load("derail/RiskyPath"), learned, sees_reward=False) == {}
    assert learned_fields(taskspec.load("derail/RiskyPath"), learned, sees_reward=True)["operators"]


def test_values_of_a_wrong_shape_are_refused_only_where_a_learner_names_them() -> None:
    task = taskspec.load("derail/RiskyPath")
    with pytest.raises(SpecError, match="E713"):
        learned_fields(task, Learned(np.ones((4, 2)), q=np.ones((3, 2)), discount=GAMMA), sees_reward=True)
    assert "operators" not in learned_fields(task, np.ones((3, 2)), sees_reward=True)
    assert learned_fields(taskspec.load("derail/NoisyObs"), Learned(None, q=np.ones((4, 2))), sees_reward=True) == {}


def test_values_without_a_discount_are_named_nothing_and_said_so() -> None:
    """Right values at a discount of 0.9 are far from those at 1."""
    found = examined("limit is an end", lambda q: q)
    assert [flag for flag in found["flags"] if flag["kind"] == "values"] == []
    (note,) = card(found).notes
    assert "not compared with known mistakes on 2 of 2 tasks" in note and "discount=" in note


def test_resets_with_the_same_seed_are_flagged() -> None:
    @learns_from("reward")
    def learner(case: Case) -> Array:
        env = case.env()
        for episode in range(40):
            env.reset(seed=case.seed if case.seed else episode)
        return np.zeros(case.observation_space.n, int)

    kinds = []
    for seeds in ([0], [0, 1]):
        found = examine(learner, tasks=["Echo"], suite="probes", seeds=seeds, twins=0)
        kinds.append([flag["kind"] for flag in found["flags"]])
    assert kinds == [[], ["seeds"]]


@pytest.mark.parametrize("table", [np.array([0, 1, 0, 1]), np.full((4, 2), 0.5), np.zeros((5, 4, 2))])
def test_tables_of_actions_or_probabilities_are_no_values(table: Array) -> None:
    assert learned_values(taskspec.load("derail/RiskyPath"), table) == {}


# -- models of Stable-Baselines3, by stand-ins with the same attributes -----------------------------------------------


class Tensor:
    """What is used of a tensor."""

    def __init__(self, array: Array) -> None:
        self.array = array

    def detach(self) -> Tensor:
        return self

    def cpu(self) -> Tensor:
        return self

    def numpy(self) -> Array:
        return self.array


class Categorical:
    """What is used of a distribution."""

    def __init__(self, probs: Tensor) -> None:
        self.probs = probs


class Actor:
    """What is used of a policy of Stable-Baselines3."""

    distribution: Categorical

    def obs_to_tensor(self, observations: Any) -> tuple[Any, bool]:
        return observations, True

    def set_training_mode(self, mode: bool) -> None:
        assert not mode


class Deep:
    """What is used of a model of Stable-Baselines3: DQN."""

    gamma = GAMMA

    def __init__(self, q: Array) -> None:
        self.policy = Actor()
        self.q_net = lambda observations: Tensor(q[observations])


class Critic(Actor):
    """What is used of an actor-critic policy."""

    def __init__(self, values: Array, pi: Array) -> None:
        self.values = values
        self.pi = pi

    def get_distribution(self, observations: Any) -> Critic:
        self.distribution = Categorical(Tensor(self.pi[observations]))
        return self

    def predict_values(self, observations: Any) -> Tensor:
        return Tensor(self.values[observations][:, None])


class ActorCritic:
    """What is used of a model of Stable-Baselines3: PPO or A2C."""

    gamma = GAMMA

    def __init__(self, values: Array, pi: Array, norm_reward: bool = False) -> None:
        self.policy = Critic(values, pi)
        self.norm_reward = norm_reward

    def predict(self, observations: Any, deterministic: bool = False) -> Any:
        return self.policy.pi[observations].argmax(axis=1), None

    def get_vec_normalize_env(self) -> Any:
        return self if self.norm_reward else None

    def normalize_obs(self, observations: Any) -> Any:
        return observations


def test_the_network_of_dqn_is_read_as_a_table_of_the_same_values_is() -> None:
    task = taskspec.load(TASKS[1])
    q = learned_q(TASKS[1], "limit is an end", 1, steps=3000)
    assert learned_fields(task, Deep(q), True) == learned_fields(task, Learned(q, discount=GAMMA), True) != {}


@pytest.mark.parametrize(("value", "explained"), [(5.0, 1.0), (4.0, 0.8), (0.0, 0.0), (-5.0, -1.0)])
def test_an_exam_says_how_much_a_critic_explains(value: float, explained: float) -> None:
    """Work pays 1/2 in each step, and goes on."""

    @learns_from("reward")
    def learner(case: Case) -> Learned:
        return Learned(np.array([[1.0, 0.0]]), values=np.array([value]), discount=GAMMA)

    found = examine(learner, tasks=["probes/EndInPlace"], seeds=1, twins=0)
    (score,) = found["scores"]
    assert score["explained"] == pytest.approx(explained, abs=1e-3)


def test_a_critic_is_read_with_the_probabilities_of_its_actor() -> None:
    task = taskspec.load(TASKS[1])
    rng = np.random.default_rng(0)
    values = rng.normal(size=4)
    pi = rng.dirichlet(np.ones(2), size=4)
    given = learned_fields(task, Learned(pi, values=values, discount=GAMMA), True)
    assert learned_fields(task, ActorCritic(values, pi), True) == given != {}
    assert learned_fields(task, ActorCritic(values, pi, norm_reward=True), True) == {}


# -- rewards ----------------------------------------------------------------------------------------------------------


def explained(reward: Callable[[RewardMdp], Array], task: str = TASKS[1]) -> list[dict[str, Any]]:
    def learner(case: Case) -> Learned:
        return Learned(lambda observation: 0, reward=reward(RewardMdp(taskspec.load(task))))

    found = examine(learner, tasks=[task], seeds=5, twins=0, learns_from=["reward"])
    return [flag for flag in found["flags"] if flag["kind"] == "reward"]


APART = {"rewards clipped": "derail/RiskyPath", "action unseen": TASKS[0]}
"""Tasks on which rewards differ that are nearly the true one on CoinWalk."""


@pytest.mark.parametrize("name", [name for name in REWARDS if name != "right"])
def test_a_reward_that_is_learned_by_mistake_is_named(name: str) -> None:
    (flag,) = explained(lambda mdp: REWARDS[name](mdp) * 3, APART.get(name, TASKS[1]))
    assert MISTAKES[name].what in flag["message"] and MISTAKES[name].fix in flag["advice"]


def test_the_true_reward_on_a_scale_of_its_own_is_no_mistake() -> None:
    assert explained(lambda mdp: mdp.true * 7) == []


def test_rewards_that_say_nothing_known_are_no_flag() -> None:
    assert explained(lambda mdp: np.random.default_rng(1).normal(size=mdp.true.shape)) == []


def test_the_reward_of_the_step_before_is_that_of_episodes() -> None:
    """On CoinWalk, against the mean of simulated random episodes."""
    env = taskspec.make(TASKS[1])
    rng = np.random.default_rng(0)
    paid: list[list[float]] = [[], [], [], []]
    for episode in range(3000):
        obs, _ = env.reset(seed=episode)
        for _ in range(9):
            obs, reward, *_ = env.step(int(rng.integers(2)))
            paid[int(obs)].append(float(reward))
    mdp = RewardMdp(taskspec.load(TASKS[1]))
    found = REWARDS["reward before"](mdp)[:, 0]
    assert found[:4] == pytest.approx([np.mean(each) for each in paid], abs=0.1)
