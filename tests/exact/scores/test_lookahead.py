"""How much observations hide, and how far one has to look ahead, beside every episode of small tasks and the algorithm itself."""

import math
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from taskspec import load
from taskspec.exact.model.extract import extract
from taskspec.exact.scores.difficulty import difficulty
from taskspec.exact.scores.lookahead import Gorp, _Lookahead
from tests.shared.written_out import TABLES, Table, best_from

# -- what observations leave open ------------------------------------------------------------------------------------

BLURRED = """
observation:
  o: {value: "(1 if s == q0 else 2) if Bernoulli(3/4) or s == q1 else 0"}
  z: "Normal(0, 1)"
"""


@pytest.mark.parametrize("table", TABLES[:6])
def test_what_is_hidden_is_the_entropy_that_observations_leave(table: Table, tmp_path: Path) -> None:
    path = tmp_path / "random.yaml"
    path.write_text(table.spec(BLURRED), encoding="utf-8")
    often: dict[tuple[int, int], Fraction] = {}
    for p, steps in table.episodes():
        for state, *_ in steps:
            seen = 1 if state == 0 else 2
            clear = Fraction(1) if state == 1 else Fraction(3, 4)
            often[state, seen] = often.get((state, seen), Fraction(0)) + p * clear
            often[state, 0] = often.get((state, 0), Fraction(0)) + p * (1 - clear)
    assert difficulty(path, ["hidden_bits"])["hidden_bits"] == pytest.approx(left_open(often), abs=1e-12)


def left_open(often: dict[tuple[int, int], Fraction]) -> float:
    """H(S | O) of a joint distribution of states and observations."""
    whole = sum(often.values())
    seen: dict[int, Fraction] = {}
    for (_, o), p in often.items():
        seen[o] = seen.get(o, Fraction(0)) + p
    return -sum(float(p / whole) * math.log2(p / seen[o]) for (_, o), p in often.items() if p)


CHANNEL = """
taskspec: 1
name: Channel
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
def test_a_noisy_channel_keeps_what_it_can(seen: str, bits: float | None, tmp_path: Path) -> None:
    path = tmp_path / "channel.yaml"
    path.write_text(CHANNEL.replace("SEEN", seen), encoding="utf-8")
    found = difficulty(path, ["hidden_bits"])
    assert found["hidden_bits"] == (None if bits is None else pytest.approx(bits, abs=1e-12))
    assert ("infinitely many" in found.why_not.get("hidden_bits", "")) == (bits is None)


# -- lookahead -------------------------------------------------------------------------------------------------------


def action_values(table: Table, k: int, t: int, state: int) -> list[Fraction]:
    """The action values of random actions after k - 1 backups."""
    found = []
    for action in range(table.actions):
        total = Fraction(0)
        for after, p in table.leads[state, action].items():
            later = Fraction(0)
            if t + 1 < table.horizon and after not in table.ends:
                values = action_values(table, max(k - 1, 1), t + 1, after)
                later = max(values) if k > 1 else sum(values, Fraction(0)) / table.actions
            total += p * (table.pays[state, action, after] + table.discount * later)
        found.append(total)
    return found


def is_optimal(table: Table, k: int, t: int, state: int) -> bool:
    """Whether everything that is greedy after k - 1 backups is optimal from a state on."""
    values, best = (action_values(table, n, t, state) for n in (k, table.horizon))
    for action, value in enumerate(values):
        if value < max(values):
            continue
        if best[action] < max(best):
            return False
        leads = table.leads[state, action]
        if t + 1 < table.horizon and not all(is_optimal(table, k, t + 1, n) for n in leads if n not in table.ends):
            return False
    return True


@pytest.mark.parametrize("table", TABLES)
def test_lookahead_is_the_least_that_is_optimal(table: Table, tmp_path: Path) -> None:
    path = tmp_path / "random.yaml"
    path.write_text(table.spec(), encoding="utf-8")
    least = next(k for k in range(1, table.horizon + 1) if all(is_optimal(table, k, 0, s) for s in table.start))
    assert difficulty(path, ["lookahead"])["lookahead"] == least


def deterministic(seed: int) -> Table:
    rng = np.random.default_rng(seed)
    pairs = list(product(range(4), range(2)))
    leads = {pair: {int(rng.integers(4)): Fraction(1)} for pair in pairs}
    pays = {(*pair, n): int(rng.integers(3)) * int(rng.integers(2)) for pair, n in product(pairs, range(4))}
    return Table(4, 2, 5, Fraction(1), {0: Fraction(1)}, leads, pays, frozenset())


def play(table: Table, rng: np.random.Generator, state: int, t: int, actions: tuple[int, ...]) -> tuple[int, int]:
    """What some actions, and random ones after them, are paid until the end; and where the first one leads."""
    total = 0
    first = -1
    for i in range(t, table.horizon):
        action = actions[i - t] if i - t < len(actions) else int(rng.integers(table.actions))
        (after,) = table.leads[state, action]
        total += table.pays[state, action, after]
        state = after
        first = after if first < 0 else first
    return total, first


def gorp(table: Table, k: int, m: int, rng: np.random.Generator) -> int:
    """The return of greedy over random policy; of tied actions it takes each as often."""
    state = total = 0
    for t in range(table.horizon):
        judged = dict.fromkeys(range(table.actions), -1)
        for actions in product(range(table.actions), repeat=min(k, table.horizon - t)):
            found = sum(play(table, rng, state, t, actions)[0] for _ in range(m))
            judged[actions[0]] = max(judged[actions[0]], found)
        best = [a for a, found in judged.items() if found == max(judged.values())]
        action = best[int(rng.integers(len(best)))]
        (after,) = table.leads[state, action]
        total = total + table.pays[state, action, after]
        state = after
    return total


@pytest.mark.parametrize("seed", range(4))
def test_greedy_over_random_succeeds_as_often_as_it_does_when_played(seed: int, tmp_path: Path) -> None:
    table = deterministic(seed)
    rng = np.random.default_rng(seed)
    path = tmp_path / "random.yaml"
    path.write_text(table.spec(), encoding="utf-8")
    model = extract(load(str(path)))
    exact = Gorp(model, _Lookahead(model).optimal)
    best = best_from(table, 0)
    for k, m in ((1, 1), (1, 4), (2, 2), (3, 1)):
        wins = np.mean([gorp(table, k, m, rng) == best for _ in range(400)])
        assert exact.success(k, m) == pytest.approx(wins, abs=4 * math.sqrt(0.25 / 400))
    tried = [(k, m) for k in range(1, 6) for m in range(1, 33) if k + math.log2(m) <= 5]
    enough = [k + math.log2(m) for k, m in tried if exact.success(k, m) >= 0.5 - 1e-9]
    assert exact.horizon_in_steps() == pytest.approx(min(enough))


def test_the_effective_horizon_of_a_tree_is_that_worked_out_by_hand() -> None:
    """Of 81 leaves one pays. With k = 3 and m = 1 the first step is right with probability 1/3 + 2/9, and the others surely; with
    k = 2 it is with 1/9 + 8/27, and with k = 1 it takes nine episodes."""
    assert difficulty("derail/Branching?L=4&B=3", ["effective_horizon"])["effective_horizon"] == 3.0


def test_the_effective_horizon_of_one_step_with_two_certain_actions_is_one(tmp_path: Path) -> None:
    path = tmp_path / "once.yaml"
    path.write_text(CHANNEL.replace("Bernoulli(1/2)", "true").replace("SEEN", "bit"), encoding="utf-8")
    assert difficulty(path, ["effective_horizon"])["effective_horizon"] == 1
