"""Modifiers one at a time: what each does to a small walk, how they are written, and what is said of wrong ones."""

from itertools import permutations
from typing import Any

import gymnasium
import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results, extract
from taskspec.language.modifiers import MODIFIERS, sentences
from taskspec.language.task.task import Task
from tests.programs.test_trajectories import walk_together
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each
from tests.shared.invariants import broken
from tests.shared.sections import build_text
from tests.shared.solved import returns
from tests.shared.sparse import sparse

WALK = """
state: {s: {type: int, low: -9, high: 9}}
action: {a: {type: choice, values: {left: -1, stay: 0, right: 1}}}
horizon: 6
initial: {s: 0}
dynamics: {s': "clip(s + a, -9, 9)"}
reward: s'
terminal: s' == 3
absorbing_reward: 1
expert: right
claims: [optimal == 1]
"""


def walk(*modifiers: Any) -> Task:
    return taskspec.modify(build_text(WALK), *modifiers)


def episode(task: Task, actions: list[int], seed: int = 0) -> tuple[list[Any], list[float], int]:
    """States, rewards and the number of steps of an episode."""
    env = taskspec.make(task)
    env.reset(seed=seed)
    states = []
    rewards = []
    for action in actions:
        _, reward, over, out, _ = env.step(action)
        states.append(env.state["s"])
        rewards.append(reward)
        if over or out:
            break
    return states, rewards, len(states)


LEFT = 0
STAY = 1
RIGHT = 2


def test_sticky_repeats_the_action_that_was_executed_last() -> None:
    assert episode(walk("sticky=1"), [LEFT, RIGHT, RIGHT, STAY])[0] == [-1, -2, -3, -4]
    assert episode(walk("sticky=0"), [LEFT, RIGHT, RIGHT, STAY])[0] == [-1, 0, 1, 1]
    often = walk("sticky=0.25")
    share = [episode(often, [LEFT, RIGHT], seed)[0] == [-1, -2] for seed in range(400)]
    assert abs(np.mean(share) - 0.25) < 0.09


def test_actions_that_are_all_random_make_all_policies_alike() -> None:
    best, random, worst = returns(Results(walk("random_actions=1")))
    assert best == pytest.approx(random) == pytest.approx(worst)
    assert Results(walk()).optimal.value > random > Results(walk()).worst.value  # type: ignore[union-attr]


def test_permuted_actions_do_what_others_did() -> None:
    ways = set()
    for seed in range(40):
        task = walk(f"permuted_actions={seed}")
        ways.add(tuple(episode(task, [action])[0][0] for action in range(3)))
    assert ways == set(permutations((-1, 0, 1))) - {(-1, 0, 1)}  # one that changes nothing is none
    expert = Results(walk("permuted_actions=3")).expert
    assert expert is not None and expert.value == Results(walk()).expert.value  # type: ignore[union-attr]
    task = walk("permuted_actions=1,per_state=true")
    moves = extract(task).step(0).P.toarray().reshape(3, 19, 19).argmax(axis=2) - np.arange(19)
    assert np.unique(moves[:, 3:15], axis=1).shape[1] > 2


def test_later_rewards_are_the_same_ones() -> None:
    actions = [RIGHT, RIGHT, LEFT, RIGHT, RIGHT]
    assert episode(walk(), actions)[1] == [1, 2, 1, 2, 3]
    assert episode(walk("delay=2"), actions)[1] == [0, 0, 1, 2, 1 + 2 + 3]
    assert episode(walk("delay=9"), actions)[1] == [0, 0, 0, 0, 9]
    assert episode(walk("reward_at_end"), actions)[1] == [0, 0, 0, 0, 9]
    assert episode(walk("reward_at_end"), [LEFT] * 6)[1] == [0] * 5 + [-21]  # at the horizon, too
    assert walk("delay=2").is_finite and walk("reward_at_end").is_finite
    assert not walk("reward_noise=1", "delay=2").is_finite  # such rewards are too many to be told apart


def test_rewards_are_changed_by_numbers() -> None:
    actions = [RIGHT, RIGHT, LEFT]
    assert episode(walk("reward_scale=-1/2"), actions)[1] == [-0.5, -1, -0.5]
    assert episode(walk("reward_shift=0.5"), actions)[1] == [1.5, 2.5, 1.5]
    assert episode(walk("potential=s * s"), actions)[1] == [1 + 1, 2 + 3, 1 - 3]
    assert episode(walk("discount=0.5", "potential=s"), actions)[1] == [1 + 0.5, 2 + 0, 1 - 1.5]
    noise = walk("reward_noise=2")
    noisy = [episode(noise, [RIGHT], seed)[1][0] for seed in range(400)]
    assert abs(np.mean(noisy) - 1) < 0.5 and abs(np.std(noisy) - 2) < 0.3


def test_episodes_are_longer_shorter_or_absorbed() -> None:
    assert episode(walk("horizon=2"), [STAY] * 9)[2] == 2
    assert episode(walk("horizon=8"), [STAY] * 9)[2] == 8
    assert episode(walk("absorbing"), [RIGHT] * 9)[1] == [1, 2, 3, 1, 1, 1]
    assert walk("discount=0.5").discount == 0.5


def test_observations_hide_and_add() -> None:
    def seen(*modifiers: Any) -> Any:
        return taskspec.make(walk(*modifiers)).reset(seed=1)[0]

    assert seen("dropout=1", "time_observed").tolist() == [0, 0]
    assert seen("distractors=3,kind=uniform").shape == (4,)
    assert seen("time_observed", "hidden=s") == 0
    assert seen("observation_noise=1") != 0
    labels = [int(taskspec.make(walk("relabelled=5")).reset(options={"state": {"s": s}})[0]) for s in range(-9, 10)]
    assert sorted(labels) == list(range(19)) != labels


def test_the_order_of_modifiers_means_something() -> None:
    one = walk("reward_shift=1", "reward_scale=2")
    other = walk("reward_scale=2", "reward_shift=1")
    assert episode(one, [RIGHT])[1] == [4] and episode(other, [RIGHT])[1] == [3]
    assert one != other and list(map(str, one.modifiers)) == ["reward_shift=1", "reward_scale=2"]
    assert [text.split("$")[1] for _, text in sentences(one)] == ["1", "2"]


def test_what_is_said_of_the_task_as_written_goes() -> None:
    assert walk().annotations.claims and walk("absorbing").annotations.claims
    assert not walk("sticky=0.1").annotations.claims
    assert walk("sticky=0.1").annotations.expert is None and walk("reward_scale=2").annotations.expert is not None
    assert walk("reward_scale=-2").annotations.expert is None


MIXED = """
state:
  v: {type: int, shape: 2, low: [0, -1], high: [2, 3]}
  r: {type: real}
  u: {type: int}
  on: {type: bool}
action:
  a: {type: int, shape: 2, low: [0, -1], high: [1, 1]}
  b: {type: bool}
  c: {type: choice, values: [x, y, z]}
observation: {v: v, f: on, q: u}
horizon: 5
initial: {v: [1, 0], r: Normal(), u: 0, on: false}
dynamics: {v': "clip(v + a, [0, -1], [2, 3])", u': "u + (2 if c == y else 1)", on': b}
reward: u' + (1 if c == z else 0)
expert: {a: [1, 1], b: true, c: z}
symmetries:
  turned:
    observation: {v: reverse(v), f: not f, q: 3 - q}
    action: {a: "[1 - a[0], -a[1]]", b: not b, c: {by: c, rows: {x: y, y: z, z: x}}}
"""


@for_each("modifier", [*MODIFIERS, "horizon=9"])
def test_vectors_conditions_choices_and_ints_without_ends(modifier: Any) -> None:
    task = build_text(MIXED)
    if modifier in MODIFIERS:
        modifier = {modifier: MODIFIERS[modifier].sample(task)}
    task = taskspec.modify(task, modifier)
    assert not list(broken(task))
    walk_together(taskspec.make(task), 3, 30)  # also that what is observed is in its space
    Agreement(task, "numpy", 3, "SameStep", one=ReferenceEnv, states=True).run(12)


# -- how they are written -----------------------------------------------------------------------------------------


def test_texts_mappings_and_modifiers_mean_the_same() -> None:
    task = walk("distractors=3,kind=uniform", "sticky=1/4", "time_observed")
    assert task == walk({"distractors": {"count": 3, "kind": "uniform"}}, {"sticky": 0.25}, {"time_observed": None})
    assert task == walk(*task.modifiers) == walk(*map(str, task.modifiers))
    assert walk("distractors=3,kind=normal") == walk("distractors=3")
    env = gymnasium.make("derail/RiskyPath-v0", modifiers=["sticky=0.25", {"delay": 2}])
    assert env.unwrapped.task.modifiers == walk("sticky=0.25", "delay=2").modifiers  # type: ignore[attr-defined]
    named = taskspec.load("RiskyPath", modifiers=["potential=2 * (s == goal) + 1", "distractors=3,kind=uniform"])
    assert taskspec.load(named.instance_id) == named == gymnasium.make(named.instance_id).unwrapped.task  # type: ignore[attr-defined]
    envs = taskspec.make_vec("RiskyPath", num_envs=2, modifiers=["sticky=0.25"], ending="absorb")
    assert list(map(str, envs.task.modifiers)) == ["sticky=0.25", "absorbing"]


@for_each(
    ("written", "code", "part", "hint"),
    [
        ("stiky=0.25", "E718", "no modifier 'stiky'", "sticky"),
        (3, "E718", "not a modifier: 3", "sticky=0.25"),
        ({"sticky": 0.1, "delay": 2}, "E718", "not a modifier", "sticky=0.25"),
        ("sticky", "E719", "'probability' is missing", "a number from 0 to 1"),
        ("sticky=2", "E719", "'probability' is a number from 0 to 1, not '2'", None),
        ("sticky=often", "E719", "'probability' is a number from 0 to 1", None),
        ("delay=1.5", "E719", "'steps' is an int", None),
        ({"delay": True}, "E719", "'steps' is an int", None),
        ("distractors=3,knd=normal", "E719", "no argument 'knd'", "kind"),
        ("distractors=3,normal", "E719", "'normal' is not of the form name=value", None),
        ("distractors=3,kind=cauchy", "E719", "normal or uniform", None),
        ("absorbing=1", "E719", "it has no arguments", None),
        ("hidden=z", "E720", "'z' is not observed", "s"),
        ("hidden=s", "E720", "'s' is the only observed component", None),
        ("potential=s +", "E301", "", None),
        ("potential=zz", "E302", "'zz' is not defined here", None),
        ("potential=a", "E302", "'a' cannot be used in a potential", None),
        ("potential=Bernoulli(0.5)", "E311", "a potential is a function of the state", None),
    ],
)
def test_wrong_ones_are_refused_with_a_code(written: Any, code: str, part: str, hint: str | None) -> None:
    (diagnostic,) = refusal(walk, written).diagnostics
    assert diagnostic.code == code, diagnostic
    assert part in diagnostic.message
    assert hint is None or hint in (diagnostic.hint or "")


def test_a_horizon_that_others_stand_on_is_not_changed() -> None:
    endless = build_text(WALK.replace("horizon: 6", "horizon: none"))
    for task in (walk(), endless):
        for earlier in ("delay=2", "reward_at_end", "potential=s"):
            with pytest.raises(SpecError, match=f"'{earlier}' depends on when episodes end"):
                taskspec.modify(task, earlier, "horizon=3")
        later = taskspec.modify(task, "horizon=3", "delay=2")
        assert episode(later, [RIGHT, STAY, STAY])[1] == [0, 0, 3]
    assert taskspec.modify(endless, "reward_noise=0", "horizon=3").horizon == 3
    with pytest.raises(SpecError, match="depends on the time"):
        walk("time_observed", "horizon=3")


@pytest.mark.parametrize(
    ("low", "high"), [(9.5e307, 1.7e308), (5e-324, 1e-323), (1.0, 1.0000000000000002), (-1.7e308, 1.7e308)]
)
def test_rewards_that_are_paid_later_are_told_apart_to_the_last_digit(low: float, high: float) -> None:
    task = build_text(WALK.replace("reward: s'", f"reward: {high!r} if a == right else {low!r}"))
    later = taskspec.modify(task, "delay=1")
    assert later.is_finite
    assert episode(later, [LEFT, RIGHT, LEFT])[1] == [0, low, high]


# -- names that modifiers make ------------------------------------------------------------------------------------

PLAIN = """
parameters: {PARAMETER: {type: int, default: 1, low: 1, high: 3}}
state:
  STATE: {type: int, low: 0, high: 3}
  OTHER: {type: int, low: 0, high: 3}
action:
  ACTION: {type: int, low: 0, high: 1}
  SECOND: {type: int, low: 0, high: 1}
observation: {SEEN: STATE, FURTHER: OTHER}
horizon: 4
initial: {STATE: 0, OTHER: 1}
dynamics: {STATE': "(STATE + ACTION) % 4", OTHER': "(OTHER + SECOND + PARAMETER) % 4"}
reward: STATE' + OTHER'
terminal: STATE' == 3
memory: {MEMORY: {type: int, low: 0, high: 3, initial: SEEN, next: "(MEMORY + ACTION) % 4"}}
expert: {ACTION: 1 if MEMORY < 2 else 0, SECOND: 1}
symmetries: {turned: {observation: {SEEN: 3 - SEEN}}}
"""
PLACES = ("PARAMETER", "STATE", "OTHER", "ACTION", "SECOND", "SEEN", "FURTHER", "MEMORY")
OWN = [place.lower() for place in PLACES]


def named(*names: str) -> Task:
    """The plain task with its names replaced, in the order of `PLACES`."""
    text = PLAIN
    for place, name in zip(PLACES, names, strict=False):
        text = text.replace(place, name)
    return build_text(text)


def names_made(task: Task) -> set[str]:
    """The names that a task has and its spec does not have, lower case."""
    names = {c.name.lower() for c in (*task.state, *task.observation.components)}
    return names.difference(OWN)


ONCE = ("hidden", "horizon")
"""Modifiers that make no names, and cannot be given twice here."""


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("name", sparse(MODIFIERS, 4))
def test_names_that_a_modifier_makes_are_new_whatever_a_spec_calls_its_own(name: str, times: int) -> None:
    """Specs whose names are those that the modifier would choose, at each place of the spec in turn."""

    def changed(names: list[str]) -> Task:
        task = named(*names)
        for _ in range(times):
            task = taskspec.modify(task, {name: MODIFIERS[name].sample(task)})
        return task

    if name in ONCE:
        times = 1
    calm = changed(OWN)
    hostile = ["last_a", "a", "a_"]
    for each in names_made(calm) - {"t"}:  # `t` is reserved
        hostile += [each, f"{each}_"]
    hostile.sort()
    for start in range(len(hostile)):
        turned = [*hostile[start:], *hostile[:start], *OWN]
        chosen = list(dict.fromkeys(turned))[: len(PLACES)]
        task = changed(chosen)
        assert not list(broken(task)), chosen
        walk_together(taskspec.make(task), 3, 20)
        Agreement(task, "numpy", 2, "SameStep", one=ReferenceEnv, states=True).run(6)
        if task.is_finite:
            assert returns(Results(task)) == returns(Results(calm)), chosen
