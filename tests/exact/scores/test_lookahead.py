"""How much observations hide, and how far one has to look ahead, beside every episode of small tasks and the algorithm itself."""

import math
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from scipy.stats import entropy

from taskspec.exact.model.extract import extract
from taskspec.exact.scores.difficulty import difficulty
from taskspec.exact.scores.lookahead import Gorp, _Lookahead
from tests.shared.sections import build_text
from tests.shared.written_out import TABLES, Table, Value

# -- what observations leave open ------------------------------------------------------------------------------------

BLURRED = """
observation:
  o: {value: "(1 if s == q0 else 2) if Bernoulli(3/4) or s == q1 else 0"}
  z: "Normal(0, 1)"
"""


@pytest.mark.parametrize("table", TABLES[:6])
def test_what_is_hidden_is_the_entropy_that_observations_leave(table: Table) -> None:
    joint = np.zeros((table.states, 3))
    for p, steps in table.episodes():
        for state, *_ in steps:
            clear = 1.0 if state == 1 else 0.75
            joint[state, 1 if state == 0 else 2] += p * clear
            joint[state, 0] += p * (1 - clear)
    hidden = entropy(joint.ravel(), base=2) - entropy(joint.sum(axis=0), base=2)
    assert difficulty(table.task(BLURRED), ["hidden_bits"])["hidden_bits"] == pytest.approx(hidden, abs=1e-12)


CHANNEL = """
state:
  bit: {type: bool}
action:
  guess: {type: bool}
observation:
  heard: SEEN
horizon: 1
initial:
  bit: Bernoulli(1/2)
dynamics:
  bit': bit
reward: guess == bit
"""


@pytest.mark.parametrize(("seen", "bits"), [
    ("bit", 0.0),
    ("bit != Bernoulli(1/10)", -(0.1 * math.log2(0.1) + 0.9 * math.log2(0.9))),
    ("Bernoulli(1/2)", 1.0),
    ("bit and t > 0", 1.0),
    ("bit + Normal(0, 1)", None),
])  # fmt: skip
def test_a_noisy_channel_keeps_what_it_can(seen: str, bits: float | None) -> None:
    found = difficulty(build_text(CHANNEL.replace("SEEN", seen)), ["hidden_bits"])
    assert found["hidden_bits"] == (None if bits is None else pytest.approx(bits, abs=1e-12))
    assert ("infinitely many" in found.why_not.get("hidden_bits", "")) == (bits is None)


# -- lookahead -------------------------------------------------------------------------------------------------------


def after_backups(table: Table, k: int) -> Value:
    """The value of random actions after k backups."""
    if k == 0:
        return table.random

    def value(state: int, t: int) -> Fraction:
        if table.is_over(state, t):
            return Fraction(0)
        return max(table.action_values(state, t, after_backups(table, k - 1)))

    return value


def is_optimal(table: Table, k: int, state: int, t: int = 0) -> bool:
    """Whether everything that is greedy after k - 1 backups is optimal from a state on."""
    if table.is_over(state, t):
        return True
    values = table.action_values(state, t, after_backups(table, k - 1))
    best = table.action_values(state, t, table.best)
    for action in np.flatnonzero(np.array(values) == max(values)).tolist():
        if best[action] < max(best) or not all(is_optimal(table, k, n, t + 1) for n in table.leads[state, action]):
            return False
    return True


@pytest.mark.parametrize("table", TABLES)
def test_lookahead_is_the_least_that_is_optimal(table: Table) -> None:
    least = 1
    while not all(is_optimal(table, least, state) for state in table.start):
        least += 1
    assert difficulty(table.task(), ["lookahead"])["lookahead"] == least


def deterministic(seed: int) -> Table:
    rng = np.random.default_rng(seed)
    leads = {}
    pays = {}
    for pair in product(range(4), range(2)):
        leads[pair] = {int(rng.integers(4)): Fraction(1)}
    for s, a, n in product(range(4), range(2), range(4)):
        pays[s, a, n] = int(rng.integers(3)) * int(rng.integers(2))
    return Table(4, 2, 5, Fraction(1), {0: Fraction(1)}, leads, pays, frozenset())


def play(table: Table, rng: np.random.Generator, state: int, t: int, actions: tuple[int, ...]) -> int:
    """The return of some actions, and of random ones after them until the end."""
    total = 0
    for i in range(t, table.horizon):
        action = actions[i - t] if i - t < len(actions) else int(rng.integers(table.actions))
        (after,) = table.leads[state, action]
        total += table.pays[state, action, after]
        state = after
    return total


def gorp(table: Table, k: int, m: int, rng: np.random.Generator) -> int:
    """The return of greedy over random policy; of tied actions it takes each as often."""
    state = 0
    total = 0
    for t in range(table.horizon):
        judged = np.full(table.actions, -1)
        for actions in product(range(table.actions), repeat=min(k, table.horizon - t)):
            returns = sum(play(table, rng, state, t, actions) for _ in range(m))
            judged[actions[0]] = max(judged[actions[0]], returns)
        action = int(rng.choice(np.flatnonzero(judged == judged.max())))
        (after,) = table.leads[state, action]
        total += table.pays[state, action, after]
        state = after
    return total


@pytest.mark.parametrize("seed", range(4))
def test_greedy_over_random_succeeds_as_often_as_it_does_when_played(seed: int) -> None:
    table = deterministic(seed)
    rng = np.random.default_rng(seed)
    model = extract(table.task())
    exact = Gorp(model, _Lookahead(model).optimal)
    best = table.best(0)
    for k, m in ((1, 1), (1, 4), (2, 2), (3, 1)):
        wins = np.mean([gorp(table, k, m, rng) == best for _ in range(400)])
        assert exact.success(k, m) == pytest.approx(wins, abs=4 * math.sqrt(0.25 / 400))
    enough = []
    for k, m in product(range(1, 6), range(1, 33)):
        steps = k + math.log2(m)
        if steps <= 5 and exact.success(k, m) >= 0.5 - 1e-9:
            enough.append(steps)
    assert exact.horizon_in_steps() == pytest.approx(min(enough))


def test_the_effective_horizon_of_a_tree_is_that_worked_out_by_hand() -> None:
    """Of 81 leaves one pays. With k = 3 and m = 1 the first step is right with probability 1/3 + 2/9, and the others surely; with
    k = 2 it is with 1/9 + 8/27, and with k = 1 it takes nine episodes."""
    assert difficulty("derail/Branching?L=4&B=3", ["effective_horizon"])["effective_horizon"] == 3.0


def test_the_effective_horizon_of_one_step_with_two_certain_actions_is_one() -> None:
    task = build_text(CHANNEL.replace("Bernoulli(1/2)", "true").replace("SEEN", "bit"))
    assert difficulty(task, ["effective_horizon"])["effective_horizon"] == 1
