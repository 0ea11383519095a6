"""`taskspec diff` on pairs of specs that differ in one token, against brute force with the second interpreter."""

import itertools
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import yaml

from taskspec import load
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.tools.difference.relation import TaskRelation, compare
from tests.shared.for_each import for_each
from tests.verification.oracle.reference.model import Key, Model
from tests.verification.oracle.reference.task import Task

CORRIDOR = """\
taskspec: 1
name: Corridor
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: choice, values: {left: -1, right: 1}}}
horizon: 4
initial: {s: 0}
dynamics: {s': "clip(s + (a if Bernoulli(3/4) else 0), 0, 3)"}
reward: 2 * (s' == 3)
"""
CHOICE = """\
taskspec: 1
name: Choice
state: {s: {type: choice, values: [start, good, bad]}}
action: {a: {type: choice, values: [up, down]}}
horizon: 2
initial: {s: start}
dynamics:
  s':
    by: [s, a]
    rows:
      start: {up: good, down: bad}
      good: good
      bad: bad
reward: {by: [s'], rows: {start: 0, good: 1, bad: 0}}
terminal: s' == bad
"""
RING = """\
taskspec: 1
name: Ring
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 3
initial: {s: "Categorical([1/2, 1/2, 0])"}
dynamics: {s': (s + 1 + a) % 3}
reward: s' * (t + 1)
"""
BASES = {"corridor": CORRIDOR, "choice": CHOICE, "ring": RING}
EDITS = (
    ("corridor", "horizon: 4", "horizon: 3", "different"),
    ("corridor", "initial: {s: 0}", "initial: {s: 1}", "different"),
    ("corridor", "3/4", "1/2", "same optimal policy"),
    ("corridor", "3/4", "6/8", "same task"),
    ("corridor", "3/4", "0.75", "same task"),
    ("corridor", "2 * (s'", "3 * (s'", "scaled reward"),
    ("corridor", "2 * (s'", "-2 * (s'", "different"),
    ("corridor", "s' == 3", "s' > 2", "same task"),
    ("corridor", "s' == 3", "s' >= 2", "different"),
    ("corridor", "s' == 3", "s == 3", "different"),
    ("corridor", "else 0)", "else -1)", "same optimal policy"),
    ("corridor", "0, 3)", "0, 2)", "different"),
    ("corridor", "low: 0, high: 3", "low: 0, high: 4", "same task"),
    ("corridor", "left: -1, right: 1", "left: 1, right: -1", "renamed"),
    ("corridor", "reward: 2", "reward: 1 + 2", "shaped reward"),
    ("corridor", "reward: 2 * (s' == 3)", "reward: 2 * (s' == 3) + s' - s", "different"),
    ("choice", "up: good, down: bad", "up: bad, down: good", "renamed"),
    ("choice", "initial: {s: start}", "initial: {s: good}", "different"),
    ("choice", "good: 1, bad: 0", "good: 2, bad: 0", "scaled reward"),
    ("choice", "good: 1, bad: 0", "good: 1, bad: 1", "shaped reward"),
    ("choice", "good: 1, bad: 0", "good: 0, bad: 1", "different"),
    ("choice", "terminal: s' == bad", "terminal: s' == good", "different"),
    ("choice", "terminal: s' == bad", "terminal: s' == start", "different"),
    ("choice", "      good: good", "      good: bad", "same optimal policy"),
    ("choice", "{start: 0, good", "{start: 7, good", "same task"),
    ("ring", "1/2, 1/2, 0", "1/2, 0, 1/2", "different"),
    ("ring", "1/2, 1/2, 0", "4/8, 1/2, 0", "same task"),
    ("ring", "1 + a) % 3", "2 - a) % 3", "renamed"),
    ("ring", "(t + 1)", "(t + 2)", "same optimal policy"),
    ("ring", "(t + 1)", "(2 * t + 2)", "scaled reward"),
    ("ring", "(t + 1)", "max(t, 1)", "different"),
    ("ring", "s' * (t", "s * (t", "different"),
)


Row = dict[tuple[Any, ...], Fraction]
"""Probabilities of next states, rewards and ends."""


def reference(text: str) -> Model:
    return Model(Task(yaml.safe_load(text)))


def histories(model: Model, actions: tuple[int, ...]) -> dict[tuple[Any, ...], Fraction]:
    """The probability of each history of states, rewards and ends under a sequence of actions."""
    found: dict[tuple[Any, ...], Fraction] = {(key,): p for key, p in model.start().items()}
    for t, action in enumerate(actions):
        longer: dict[tuple[Any, ...], Fraction] = {}
        for history, p in found.items():
            if history[-1] == "end":
                longer[history] = longer.get(history, Fraction(0)) + p
                continue
            for o in model.row(history[-1], action, t):
                then = (*history, Fraction(o.reward), o.state, *(("end",) if o.terminated else ()))
                longer[then] = longer.get(then, Fraction(0)) + p * o.probability
        found = longer
    return found


def shortest(one: Model, other: Model) -> int | None:
    """The number of actions after which some sequence tells two tasks apart; None where none does."""
    horizon = min(one.task.horizon or 0, other.task.horizon or 0)
    for k in range(horizon + 1):
        for actions in itertools.product(range(len(one.actions)), repeat=k):
            if histories(one, actions) != histories(other, actions):
                return k
    return None if one.task.horizon == other.task.horizon else horizon


def rows(model: Model) -> dict[tuple[int, Key, int], dict[tuple[Any, ...], Fraction]]:
    found = {}
    for t, layer in enumerate(model.layers()):
        for key in layer:
            for a in range(len(model.actions)):
                row = model.row(key, a, t)
                found[t, key, a] = {(o.state, Fraction(o.reward), o.terminated): o.probability for o in row}
    return found


def renamed(row: Row, to: Mapping[Key, Key]) -> Row:
    return {(to[state], reward, ends): p for (state, reward, ends), p in row.items()}


def mean_reward(row: Row) -> Fraction:
    return sum((p * reward for (_, reward, _), p in row.items()), Fraction(0))


def is_renamed(one: Model, other: Model) -> bool:
    """Whether some bijections of all states and actions map one task to the other."""
    mine = rows(one)
    theirs = rows(other)
    if one.task.horizon != other.task.horizon or len(one.states) != len(other.states):
        return False
    for order in itertools.permutations(range(len(one.actions))):
        for image in itertools.permutations(other.states):
            to = dict(zip(one.states, image, strict=True))
            if {to[k]: p for k, p in one.start().items()} != other.start():
                continue
            if all(renamed(row, to) == theirs.get((t, to[key], order[a])) for (t, key, a), row in mine.items()):
                return len(mine) == len(theirs)
    return False


def values(model: Model) -> dict[tuple[int, Key], list[Fraction]]:
    """Q-values of all states and times, by recursion."""
    horizon = model.task.horizon or 0

    @cache
    def q(t: int, key: Key) -> tuple[Fraction, ...]:
        found = []
        for a in range(len(model.actions)):
            total = Fraction(0)
            for o in model.row(key, a, t):
                later = Fraction(0) if o.terminated or t + 1 == horizon else max(q(t + 1, o.state))
                total += o.probability * (Fraction(o.reward) + later)
            found.append(total)
        return tuple(found)

    return {(t, key): list(q(t, key)) for t, layer in enumerate(model.layers()) for key in layer}


def potential(one: Model, other: Model) -> tuple[bool, bool]:
    """Whether the rewards are proportional, and whether they are so up to a potential, by least squares.

    Unknown are a factor c > 0 and a potential F(t, s) with E[r'] = c E[r] + E[F(t + 1, s')] - F(t, s).
    """
    mine = rows(one)
    theirs = rows(other)
    if moves(mine) != moves(theirs) or one.start() != other.start() or one.task.horizon != other.task.horizon:
        return False, False
    places = {at: i for i, at in enumerate(sorted({(t, key) for t, key, _ in mine}))}
    matrix = np.zeros((len(mine), 1 + len(places)))
    b = np.zeros(len(mine))
    for i, ((t, key, a), outcomes) in enumerate(mine.items()):
        matrix[i, 0] = float(mean_reward(outcomes))
        b[i] = float(mean_reward(theirs[t, key, a]))
        matrix[i, 1 + places[t, key]] -= 1
        for (to, _, ends), p in outcomes.items():
            if not ends and (t + 1, to) in places:
                matrix[i, 1 + places[t + 1, to]] += float(p)
    proportional = np.linalg.lstsq(matrix[:, :1], b, rcond=None)[0]
    is_proportional = bool(np.allclose(matrix[:, :1] @ proportional, b) and proportional[0] > 0)
    x = np.linalg.lstsq(matrix, b, rcond=None)[0]
    return is_proportional, bool(np.allclose(matrix @ x, b, atol=1e-9) and x[0] > 1e-9)


def moves(rows: dict[tuple[int, Key, int], Row]) -> dict[tuple[Any, ...], Fraction]:
    """Probabilities of next states and ends, whatever they pay."""
    found: dict[tuple[Any, ...], Fraction] = {}
    for place, row in rows.items():
        for (state, _, ends), p in row.items():
            move = (place, state, ends)
            found[move] = found.get(move, Fraction(0)) + p
    return found


def labels(model: Model) -> list[tuple[Any, ...]]:
    """The values of each action."""
    return [tuple(value.data for value in action.values()) for action in model.actions]


def best_actions(model: Model) -> dict[tuple[int, Key], list[bool]]:
    """Which actions are best, in all states and times."""
    return {at: [x == max(q) for x in q] for at, q in values(model).items()}


def best_return(model: Model) -> float:
    q = values(model)
    return float(sum(p * max(q[0, key]) for key, p in model.start().items()))


def truth(one: Model, other: Model) -> str:
    """The relation, by brute force."""
    if labels(one) == labels(other) and shortest(one, other) is None:
        return "same task"
    if is_renamed(one, other):
        return "renamed"
    is_proportional, is_shaped = potential(one, other)
    if is_proportional:
        return "scaled reward"
    if is_shaped:
        return "shaped reward"
    return "same optimal policy" if best_actions(one) == best_actions(other) else "different"


def found_for(one: str, other: str) -> TaskRelation:
    return compare(build(source.read_text(one)), build(source.read_text(other)))


@for_each(("base", "old", "new", "relation"), EDITS)
def test_one_token_is_told_as_brute_force_has_it(base: str, old: str, new: str, relation: str) -> None:
    first = BASES[base]
    second = first.replace(old, new)
    assert first != second
    found = found_for(first, second)
    models = reference(first), reference(second)
    assert found.relation == truth(*models) == relation
    if found.relation == "same task":
        assert found.difference is None
        return
    assert found.difference is not None and found.new_version
    assert len(found.difference.actions) == shortest(*models)
    if found.returns is not None:
        assert list(found.returns.values()) == pytest.approx(list(map(best_return, models)))


def test_there_are_thirty_pairs() -> None:
    assert len(set(EDITS)) >= 30


def test_labels_and_observations_are_part_of_the_meaning() -> None:
    found = found_for(CORRIDOR, CORRIDOR.replace("left:", "lift:"))
    assert found.relation == "renamed" and "a = left is a = lift" in found.words
    seen = CORRIDOR + 'observation: {o: {value: "min(s, 2)", low: 0, high: 3}}\n'
    found = found_for(seen, seen.replace("min(s, 2)", "min(s, 1)"))
    assert found.relation == "different" and found.difference is not None
    assert found.difference.actions == ("a = right", "a = right") and found.difference.action is None
    found = found_for(seen, seen.replace("high: 3}}\n", "high: 4}}\n"))
    assert found.relation == "same task" and "the observation space is another one" in found.words
    assert found.new_version


ENDS = (
    CORRIDOR
    + """\
terminal: s' == 3
absorbing_reward: 1/2
measures: {cost: a == right}
"""
)


@for_each(("old", "new", "words"), [
    ("1/2", "2/4", ""), ("1/2", "1/3", "absorbing"), ("1/2", "s / 6", ""), ("1/2", "t / 8", "absorbing"),
    ("1/2", "1/2 if s == 3 else 7", ""), ("\nabsorbing_reward: 1/2", "", "absorbing"),
    ("cost: a == right", "cost: s == 0", "cost"),
    ("cost: a == right", "cost: a == left", "cost"), ("cost:", "price:", "measures"), ("a == right", "a != left", ""),
])  # fmt: skip
def test_what_stands_beside_the_steps_is_part_of_a_task(old: str, new: str, words: str) -> None:
    """Each of these has the same outcomes; what an end that absorbs pays, or a measure, asks for a new version."""
    found = found_for(ENDS, ENDS.replace(old, new))
    assert found.relation in ("same task", "identical")
    assert found.new_version == bool(words)
    assert words in found.words and ("; but" in found.words) == bool(words)


@for_each(("old", "new", "words"), [
    ("{left: -1, right: 1}", "{right: 1, left: -1}", "only the order of the actions differs"),
    ("2 * (s' == 3)", "2 * (s' == 3) + (s == 2) / 10**12", "the expected reward is the same up to 1e-09"),
    ("2 * (s' == 3)", "2 * (s' == 3) * (1 + 1/10**6)", "the expected reward is the same times 1.000001"),
    ("2 * (s' == 3)", "1 / 3 * (s' == 3)", "the expected reward is the same times 0.166666667"),
    ("2 * (s' == 3)", "4 * (s' == 3) * Bernoulli(1/2)", "the expected reward is the same"),
])  # fmt: skip
def test_words_are_true(old: str, new: str, words: str) -> None:
    found = found_for(CORRIDOR, CORRIDOR.replace(old, new))
    assert found.words == words
    assert found.difference is not None
    assert found.difference.first != found.difference.second


WALK = """\
taskspec: 1
name: Walk
state: {x: {type: real, low: -9, high: 9}}
action: {a: {type: real, low: -1, high: 1}}
horizon: 5
initial: {x: 0}
dynamics: {x': x + a}
reward: -abs(x')
"""


@pytest.mark.parametrize(
    ("old", "new", "relation", "length"),
    [
        ("-abs(x')", "-abs(0 + x')", "no difference found", None),
        ("-abs(x')", "-abs(x)", "different", 1),
        ("-abs(x')", "-abs(x') if t < 3 else 0", "different", 4),
        ("x + a", "x - a", "different", 1),
        ("initial: {x: 0}", "initial: {x: 1}", "different", 0),
        ("horizon: 5", "horizon: 6", "different", None),
        ("low: -1", "low: -2", "different", None),
    ],
)
def test_other_tasks_are_compared_in_episodes(old: str, new: str, relation: str, length: int | None) -> None:
    found = found_for(WALK, WALK.replace(old, new))
    assert found.relation == relation
    assert (found.difference and len(found.difference.actions)) == length


@pytest.mark.parametrize(
    ("first", "second", "relation", "words"),
    [
        ("derail/NoisyObs?M=4", "derail/NoisyObs?M=4&L=21", "different", "the observation space is another one"),
        ("derail/Parabola", "derail/Sort", "different", "other components"),
        ("derail/ProcGoal", "derail/ProcGoal?D=5", "different", "the horizon or the discount is another one"),
    ],
)
def test_tasks_of_the_suite_are_compared(first: str, second: str, relation: str, words: str) -> None:
    found = compare(load(first), load(second))
    assert found.relation == relation and words in found.words


@pytest.mark.parametrize("name", ["RiskyPath", "Branching", "InitShiftExpert", "EarlyTermNeg"])
def test_twins_of_finite_tasks_are_renamed(name: str) -> None:
    task = load(f"derail/{name}")
    found = compare(task, load(task.instance_id, modifiers=["permuted_actions=1"]))
    assert found.relation in ("renamed", "same task"), found.words


def test_legal_actions_are_part_of_a_task() -> None:
    """A condition that allows everything changes nothing; one that does not is shown where it first forbids something."""
    plain = build(source.read_text(CORRIDOR))
    open_ = build(source.read_text(CORRIDOR + "legal: s >= 0\n"))
    walled = build(source.read_text(CORRIDOR + "legal: a != left or s != 1\n"))
    assert compare(plain, open_).relation == "same task"
    found = compare(plain, walled)
    assert found.relation == "different" and found.new_version
    assert found.difference is not None
    assert (found.difference.state, found.difference.action) == ("s = 1", None)
    assert found.difference.second == "legal actions a = right"
