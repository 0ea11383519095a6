"""Policies of learners from demonstrations: which pairing of observations and actions they show."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.exam import Case, Learned, examine, learns_from
from taskspec.learn.exam.case import ExamTerms
from taskspec.learn.exam.mistakes import MISTAKES
from taskspec.learn.exam.pairings import PAIRINGS, pairing_fields
from tests.shared.exams import flags
from tests.shared.sparse import sparse

pytestmark = pytest.mark.usefixtures("warm")

Array = np.ndarray[Any, Any]
Pairs = Iterator[tuple[int, int]]
TASKS = ["probes/SecondThought", "probes/Echo", "probes/Slip", "probes/Patience"]


def _episodes(case: Case) -> Iterator[tuple[list[int], list[int]]]:
    """Yield the observations, the last one included, and the actions of each episode, as plain lists."""
    shown = case.demonstrations
    for begin, end in zip(shown.starts, [*shown.starts[1:], len(shown.acts)], strict=True):
        yield [*map(int, shown.obs[begin:end]), int(shown.next_obs[end - 1])], list(map(int, shown.acts[begin:end]))


def _cloned(case: Case, pairs: Pairs) -> Array:
    """Return how often each action follows each observation; equal shares where there is none."""
    counts = np.zeros((case.observation_space.n, case.action_space.n))
    for obs, act in pairs:
        counts[obs, act] += 1
    counts[counts.sum(axis=1) == 0] = 1
    return counts / counts.sum(axis=1, keepdims=True)


def _right(case: Case) -> Pairs:
    for obs, acts in _episodes(case):
        yield from zip(obs, acts, strict=False)


def _stale(case: Case) -> Pairs:
    for obs, acts in _episodes(case):
        yield from zip(obs[1:], acts, strict=True)


def _after(case: Case) -> Pairs:
    for obs, acts in _episodes(case):
        yield from zip(obs, acts[1:], strict=False)


def _shuffled(case: Case) -> Pairs:
    seen, done = zip(*_right(case), strict=True)
    rng = np.random.default_rng(case.seed)
    return zip(seen, map(int, rng.permutation(done)), strict=True)


def _reversed(case: Case) -> Pairs:
    for obs, acts in _episodes(case):
        yield from zip(obs, reversed(acts), strict=False)


def _without_last(case: Case) -> Pairs:
    for obs, acts in _episodes(case):
        yield from zip(obs, acts[:-1], strict=False)


MISTAKEN: dict[str, Callable[[Case], Pairs]] = {
    "stale action": _stale, "action after": _after, "shuffled": _shuffled, "order reversed": _reversed,
    "last steps missing": _without_last,
}  # fmt: skip


def _examined(policy: Callable[[Case], Any]) -> Any:
    return examine(learns_from("demonstrations")(policy), tasks=TASKS, seeds=3, transitions=400, twins=1)


@pytest.mark.parametrize("name", sparse(MISTAKEN, 2))
def test_a_pairing_that_is_wrong_is_named(name: str) -> None:
    found = _examined(lambda case: _cloned(case, MISTAKEN[name](case)))
    (flag,) = flags(found, "policy")
    assert MISTAKES[name].what in flag["message"] and MISTAKES[name].fix in flag["advice"]


def test_policies_that_avoid_the_expert_or_know_nothing_are_named() -> None:
    def avoids(case: Case) -> Array:
        pi = 1 - _cloned(case, _right(case))
        return pi / pi.sum(axis=1, keepdims=True)

    def knows_nothing(case: Case) -> Array:
        return np.full_like(_cloned(case, _right(case)), 1 / case.action_space.n)

    for learner, name in ((avoids, "avoided"), (knows_nothing, "at random")):
        (flag,) = flags(_examined(learner), "policy")
        assert MISTAKES[name].what in flag["message"]


def test_a_right_clone_and_its_noise_are_no_flag() -> None:
    def noisy(case: Case) -> Learned:
        pi = _cloned(case, _right(case))
        return Learned(0.9 * pi + 0.1 / case.action_space.n)

    found = _examined(noisy)
    assert flags(found, "policy") == []
    for score in found["scores"]:
        if score["peek"] is None:
            assert score["pairings"]["right"] == pytest.approx(0.05, abs=1e-9)


def test_learners_that_were_shown_nothing_have_no_pairing() -> None:
    found = _examined(lambda case: np.zeros(case.observation_space.n, int))
    for score in found["scores"]:
        assert score["pairings"] is None


def test_the_first_episode_alone_explains_what_others_would_have_shown() -> None:
    task = taskspec.load("probes/CoinToss")
    case = Case(task, (0,), ExamTerms(1, ("demonstrations",), 400))
    obs, acts = next(_episodes(case))
    found = pairing_fields(task, _cloned(case, zip(obs, acts, strict=False)), case.demonstrations)["pairings"]
    assert found is not None and found.keys() <= PAIRINGS.keys()
    assert found.get("first episode", found["right"]) <= found["right"]
