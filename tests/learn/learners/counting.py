"""Learners that the exam is tried on: right ones, and ones with bugs that people make."""

import os
import signal
import time
from pathlib import Path

import numpy as np

import taskspec
from taskspec.exam import Case


def clone(case: Case) -> np.ndarray:
    """Behavioural cloning by counting."""
    return _most_frequent(case, case.demonstrations.obs)


def clone_off_by_one(case: Case) -> np.ndarray:
    """The state after a step is paired with the action before it."""
    return _most_frequent(case, case.demonstrations.next_obs)


def _most_frequent(case: Case, seen: np.ndarray) -> np.ndarray:
    """The action that was most frequent; where nothing was seen, the one that is most frequent everywhere."""
    counts = np.zeros((case.observation_space.n, case.action_space.n))
    np.add.at(counts, (seen, case.demonstrations.acts), 1)
    return (counts + counts.mean(axis=0) / len(seen)).argmax(axis=1)


def indifferent(case: Case) -> np.ndarray:
    """A network that was never trained: all actions are worth the same."""
    return np.zeros((case.observation_space.n, case.action_space.n))


def q_learning(case: Case) -> np.ndarray:
    """Tabular Q-learning from a table of zeros."""
    return _q(case, 1.0)


def q_wrong_sign(case: Case) -> np.ndarray:
    """Punished for what it should be paid for."""
    return _q(case, -1.0)


def q_peeking(case: Case) -> np.ndarray:
    """Looks for the reward in an environment that it makes itself of the task."""
    env = taskspec.make(case.task)
    totals = np.zeros(case.action_space.n)
    for action in range(case.action_space.n):
        for episode in range(100):
            env.reset(seed=episode)
            over = False
            while not over:
                _, reward, terminated, truncated, _ = env.step(action)
                totals[action] += reward
                over = terminated or truncated
    return np.full(case.observation_space.n, totals.argmax())


def _q(case: Case, sign: float) -> np.ndarray:
    env = case.env()
    rng = np.random.default_rng(case.seed)
    q = np.zeros((case.observation_space.n, case.action_space.n))
    seen = env.reset()[0]
    over = False
    for _ in range(case.steps):
        greedy = rng.random() < 0.7
        action = rng.choice(np.flatnonzero(q[seen] == q[seen].max())) if greedy else rng.integers(len(q[seen]))
        after, reward, over, cut, _ = env.step(int(action))
        q[seen, action] += 0.1 * (sign * reward + (0 if over else q[after].max()) - q[seen, action])
        seen = env.reset()[0] if over or cut else after
    return q


def greedy_for_steps(case: Case) -> None:
    """Takes more steps than it has."""
    env = case.env()
    env.reset()
    for _ in range(case.steps + 1):
        if any(env.step(0)[2:4]):
            env.reset()


def ends_badly(case: Case) -> np.ndarray:
    """Seed 1 ends its process, 2 never ends, 3 forks, 4 asks for all memory, 5 is killed as for want of memory."""
    case.count(case.seed)
    if case.seed == 1:
        os._exit(3)
    while case.seed == 2:
        time.sleep(0.1)
    if case.seed == 3:
        os.fork()
    if case.seed == 4:
        bytearray(2**60)
    if case.seed == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return indifferent(case)


def takes_notes(case: Case) -> np.ndarray:
    """Writes down which seeds it was asked about."""
    with Path(os.environ["NOTES"]).open("a", encoding="utf-8") as notes:
        notes.write(f"{case.seed}\n")
    time.sleep(0.3)
    return indifferent(case)


def fails_on_seed_1(case: Case) -> np.ndarray:
    if case.seed == 1:
        raise KeyError("no such thing")
    return clone(case)


clone.learns_from = clone_off_by_one.learns_from = fails_on_seed_1.learns_from = ("demonstrations",)
indifferent.learns_from = q_peeking.learns_from = ("demonstrations",)
q_learning.learns_from = q_wrong_sign.learns_from = ("reward",)
