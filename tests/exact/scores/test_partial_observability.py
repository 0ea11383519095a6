"""The best that those can earn who see observations only, beside trees of histories and lists of policies without bounds."""

from __future__ import annotations

import itertools
import random
from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec import load
from taskspec.base import limits
from taskspec.exact import PomdpBounds, Results, check, extract, pomdp_bounds
from taskspec.exact.scores.difficulty import SEARCHES, best_observing
from taskspec.exact.solve.enclosure import Enclosure
from taskspec.language.modifiers import keeps_observers
from taskspec.language.task.task import Task
from tests.exact.policies.test_memory import TURNS, tiger
from tests.language.modifiers.test_modifiers import OBSERVED, small
from tests.shared.diagnostics import statuses
from tests.shared.sections import build_text
from tests.shared.specs import spec_file

Look = Callable[[dict[str, Any], int], object]


def look_of(seed: int) -> Look:
    """What is seen in the task with this number."""
    parts: list[Callable[[int], int]] = [lambda s: s // 2, lambda s: s % 3, lambda s: s // 3]
    return lambda state, t: (parts[seed % 3](state["s"]), seed % 2 == 0 and t > 1)


def drawn(seed: int, horizon: int = 4, claims: str = "[]") -> Task:
    """A task with random tables: six states, of which two or three look alike."""
    rng = random.Random(seed)

    def row() -> dict[int, str]:
        weights = [rng.choice((0, 0, 1, 2, 3)) for _ in range(6)]
        weights[rng.randrange(6)] += 1
        chances = {}
        for s in np.flatnonzero(weights).tolist():
            chances[s] = f"{weights[s]}/{sum(weights)}"
        return chances

    moves = {}
    pays = {}
    for s in range(6):
        moves[s] = {0: row(), 1: row()}
    for s in range(6):
        pays[s] = {0: rng.randint(-9, 9), 1: rng.randint(-9, 9)}
    return build_text(f"""
state: {{s: {{type: int, low: 0, high: 5}}}}
action: {{a: {{type: int, low: 0, high: 1}}}}
horizon: {horizon}
discount: {rng.choice(("1", "3/4"))}
initial: {{s: {row()}}}
dynamics: {{s': {{by: [s, a], rows: {moves}}}}}
reward: {{by: [s, a], rows: {pays}}}
terminal: {rng.choice(("s' == 5", "false"))}
observation: {{o: s {("// 2", "% 3", "// 3")[seed % 3]}, late: {("t > 1", "false")[seed % 2]}}}
claims: {claims}
""")


class Tables:
    """A task as dense arrays and what is seen, for brute force in floats."""

    def __init__(self, task: Task, look: Look) -> None:
        model = extract(task)
        assert task.horizon is not None
        self.horizon = task.horizon
        self.discount = task.discount
        self.start = model.start
        a = model.n_actions
        n = model.n_states
        self.going = []
        self.reward = []
        self.looks = []
        for t in range(self.horizon):
            self.going.append(model.step(t).P.toarray().reshape(a, n, n))
            self.reward.append(model.step(t).R.reshape(a, n))
            self.looks.append([repr(look(model.state(i), t)) for i in range(n)])

    def split(self, t: int, weights: Any) -> list[Any]:
        parts: dict[str, Any] = defaultdict(lambda: np.zeros(len(weights)))
        for i, w in enumerate(weights):
            if w:
                parts[self.looks[t][i]][i] = w
        return list(parts.values())

    def remembering(self) -> float:
        def best(t: int, weights: Any) -> float:
            if t == self.horizon:
                return 0.0
            total = 0.0
            for part in self.split(t, weights):
                returns = []
                for reward, going in zip(self.reward[t], self.going[t], strict=True):
                    returns.append(part @ reward + self.discount * best(t + 1, part @ going))
                total += max(returns)
            return total

        return best(0, self.start)

    def memoryless(self) -> float:
        names = sorted(set(itertools.chain(*self.looks)))
        best = -np.inf
        for chosen in itertools.product(range(len(self.reward[0])), repeat=len(names)):
            policy = dict(zip(names, chosen, strict=True))
            weights = self.start
            total = 0.0
            factor = 1.0
            for t in range(self.horizon):
                after = np.zeros(len(weights))
                for i, w in enumerate(weights):
                    a = policy[self.looks[t][i]]
                    total += factor * w * self.reward[t][a][i]
                    after += w * self.going[t][a][i]
                weights = after
                factor = factor * self.discount
            best = max(best, total)
        return best


@lru_cache
def found(seed: int) -> tuple[PomdpBounds, Tables]:
    task = drawn(seed)
    told = pomdp_bounds(Results(task))
    assert told is not None
    return told, Tables(task, look_of(seed))


def holds(bounds: Enclosure | None, truth: float) -> bool:
    assert bounds is not None
    low, high = bounds.ends
    return low - 1e-9 <= truth <= high + 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_values_are_those_of_brute_force(seed: int) -> None:
    told, tables = found(seed)
    for bounds, truth in ((told.remembering, tables.remembering()), (told.memoryless, tables.memoryless())):
        assert bounds is not None
        assert bounds.value == pytest.approx(truth, rel=1e-9, abs=1e-9)
        assert bounds.error <= 1e-9 * max(1.0, abs(truth))


def test_tiger_is_as_in_a_tree_of_histories() -> None:
    text = (spec_file("tiger")).read_text().replace("horizon: 20", "horizon: 5")
    task = build_text(text)
    told = pomdp_bounds(Results(task))
    tables = Tables(task, lambda state, t: state["heard"])
    assert told is not None
    assert told.remembering is not None and told.remembering.value == pytest.approx(tables.remembering(), rel=1e-9)
    assert told.memoryless is not None and told.memoryless.value == pytest.approx(tables.memoryless(), rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_without_time_the_bounds_are_wide_and_hold(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    _, tables = found(seed)
    results = Results(drawn(seed))
    assert results.model is not None
    with limits.also("seconds=0"):
        told = pomdp_bounds(results)
    assert told is not None
    assert holds(told.remembering, tables.remembering()) and holds(told.memoryless, tables.memoryless())
    assert told.remembering is not None and told.remembering.low < told.remembering.high


def bandit(odds: str, most: int, horizon: int) -> Task:
    """Two arms with odds that depend on a hidden state."""
    return build_text(f"""
state: {{p: {{type: int, low: 0, high: {most}}}, last: {{type: int, low: 0, high: 1}}, paid: {{type: bool}}}}
action: {{a: {{type: int, low: 0, high: 1}}}}
noise: {{hit: "Bernoulli({odds})"}}
observation: {{last: last, paid: paid}}
horizon: {horizon}
initial: {{p: "UniformInt(0, {most})", last: 0, paid: false}}
dynamics: {{last': a, paid': hit}}
reward: hit
""")


def test_a_second_is_enough_for_a_bandit_of_twelve_pulls() -> None:
    results = Results(bandit("(1 + p) / 10 if a == 0 else (1 + 3 * p % 7) / 8", 7, 12))
    with limits.also("seconds=1"):
        told = pomdp_bounds(results)
    assert told is not None and told.remembering is not None
    assert told.remembering.error <= 1e-10 * told.remembering.value


def test_the_limit_holds_where_numbers_are_long() -> None:
    """It took eight times its seconds: rationals grow with the horizon."""
    results = Results(bandit("0.7 if a == p else 0.35", 1, 25))
    assert results.model is not None
    with limits.also("seconds=1"):
        told = pomdp_bounds(results)
    assert told is not None and told.remembering is not None and told.remembering.error > 0


def test_claims_are_about_them() -> None:
    claims = "[optimal_return >= remembering_return, remembering_return >= memoryless_return, memoryless_return > 1000]"
    verdicts = check(drawn(3, claims=claims), ranges=False).verdicts
    assert statuses(verdicts) == ["proved", "proved", "false"]


def test_what_is_all_seen_has_no_such_bounds() -> None:
    assert pomdp_bounds(Results(load("derail/RiskyPath"))) is None
    assert pomdp_bounds(Results(load(spec_file("catch")))) is None  # the board shows all


NOISY = """
state: {place: {type: int, low: 0, high: 1}STATE}
action: {a: {type: int, low: 0, high: 1}}
noise: {coin: Bernoulli(1/3), hum: Bernoulli(1/4)}
observation: {SEEN}
horizon: 4
initial: {place: "UniformInt(0, 1)"FIRST}
dynamics: {place': "1 - place if coin else place"LATER}
reward: a == place
"""
STORED = {
    "a draw of its own": ["Bernoulli((1 + place) / 5)"],
    "first something else": ["2 if t == 0 else place + hum"],
    "noise of the dynamics": ["coin"],
    "noise seen twice": ["(place == 1) != hum", "hum"],
    "noise that tells nothing": ["hum"],
}
"""Random observations."""


def noisy(seen: list[str], stored: bool) -> Task:
    """A task with random observations, as they are or kept in the state by hand."""
    parts = dict.fromkeys(("SEEN", "STATE", "FIRST", "LATER"), "")
    for i, value in enumerate(seen):
        if stored:
            before = value.replace("t == 0", "true")
            after = value.replace("t == 0", "false").replace("place", "place'")
            parts["SEEN"] += f"o{i}: k{i},"
            parts["STATE"] += f", k{i}: {{type: int, low: 0, high: 2}}"
            parts["FIRST"] += f', k{i}: "0 + ({before})"'
            parts["LATER"] += f', k{i}\': "0 + ({after})"'
        else:
            parts["SEEN"] += f'o{i}: "{value}",'
    text = NOISY
    for name, part in parts.items():
        text = text.replace(name, part)
    return build_text(text)


@pytest.mark.parametrize("name", STORED)
def test_a_random_observation_counts_as_part_of_the_state(name: str) -> None:
    told = pomdp_bounds(Results(noisy(STORED[name], stored=False)))
    assert (told is None) == (name == "noise seen twice")  # both together show the place
    assert told is None or told.remembering is not None
    assert told == pomdp_bounds(Results(noisy(STORED[name], stored=True)))


def test_what_is_seen_at_random_has_finitely_many_values() -> None:
    told = pomdp_bounds(Results(noisy(["place + Normal()"], stored=False)))
    assert told is not None and told.remembering is None
    assert told.why_not == "the observation 'o0' is random and may have infinitely many values"


# -- what modifiers leave to those who see observations alone ------------------------------------------------------------


@pytest.mark.parametrize("written", sorted(OBSERVED))
def test_what_is_said_of_those_who_see_observations_alone_is_so(written: str) -> None:
    """A task that pays for alternation: who remembers what was done earns all of it, and who does not, less."""
    task = build_text(TURNS)
    assert keeps_observers(task, written)
    twin = Results(taskspec.modify(task, written))
    for which in SEARCHES:
        assert best_observing(twin, which) == best_observing(Results(task), which)


def test_a_permutation_for_each_state_is_kept_from_those_who_do_not_see_the_state() -> None:
    anew = "permuted_actions=2,per_state=true"
    assert keeps_observers(small("derail/RiskyPath-v0"), anew)
    assert not keeps_observers(tiger(), anew)
    twin = taskspec.modify(tiger(), anew)
    assert best_observing(Results(tiger()), "remembering") != best_observing(Results(twin), "remembering")
    assert not any(keeps_observers(tiger(), each) for each in ("sticky=0.25", "observation_noise=1", "time_observed"))
