"""Learned rewards, values and policies: how learners hand them over, how they are read, and what explains them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.exact.policies.adapters import Predictor, parameters
from taskspec.exact.policies.python_files import plain
from taskspec.exact.policies.values import are_probabilities, is_table
from taskspec.language.task.task import Task
from taskspec.learn.data.episodes import Demonstrations
from taskspec.learn.exam.behaviour import TrainingBehaviour
from taskspec.learn.exam.fingerprints import fits_of
from taskspec.learn.exam.judgement import Judgement, Run, judged
from taskspec.learn.exam.learned_values import MOVED, SMALL, LearnedValues, is_read
from taskspec.learn.exam.mistakes import MISTAKES, anchor
from taskspec.learn.exam.operators import GOOD
from taskspec.learn.exam.pairings import pairing_fields
from taskspec.learn.exam.results import Flag, Score
from taskspec.learn.exam.starc import reward_fields
from taskspec.learn.observed_policies import observation_rows, observed_probabilities


@dataclass(frozen=True, eq=False)
class Learned:
    """A policy, and what was learned with it.

    Args:
        policy: all that a learner may return alone; Q-values in a table (O, A) are read from it.
        reward: float64 (S, A, S) over the states and actions of `taskspec.data.tabular(task)`, or a function of (obs, action,
            next_obs), all (N, ...); `reward_distance` compares it with the true one.
        q: Q-values: a table (O, A) of the numbers of discrete observations, or a function from observations (N, ...) to (N, A).
        values: instead, the values of a critic under the policy: a table (O,), or a function from observations to (N,).
        discount: the gamma of the learner; that of the task, or of a model of Stable-Baselines3, unless given.
    """

    policy: Any
    reward: Any = None
    q: Any = None
    values: Any = None
    discount: float | None = None


NO_DISCOUNT = "the learner's discount is not known: return `Learned(policy, discount=...)`"
"""Why values were not compared with mistakes: a wrong discount looks like one."""

# -- reading ----------------------------------------------------------------------------------------------------------


def learned_fields(
    task: Task, learned: Any, sees_reward: bool, demonstrations: Demonstrations | None = None,
    behaviour: TrainingBehaviour | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return what is known of learned rewards, values and policies, as fields of a result.

    Args:
        learned: what the learner returned.
        sees_reward: whether it was granted the reward; else its values are not those of the true one.
        demonstrations: that it used; its policy is compared with them where it has nothing else to learn from.
        behaviour: the actions that it took.
    """
    fields: dict[str, Any] = {}
    counts = None
    if behaviour is not None:
        fields |= _behaviour_fields(task, learned, behaviour)
        counts = behaviour.total
    if demonstrations is not None and not sees_reward:
        policy = learned
        if isinstance(learned, Learned):
            policy = learned.policy
        fields |= pairing_fields(task, policy, demonstrations)
    if isinstance(learned, Learned) and learned.reward is not None:
        fields |= reward_fields(task, learned.reward)
        fields["apart"] = None  # visits are matched, not the actions of each observation
    if sees_reward:
        fields |= _value_fields(task, learned, counts)
    return fields


def _value_fields(task: Task, learned: Any, counts: Array | None) -> dict[str, Any]:
    values = learned_values(task, learned)
    fields: dict[str, Any] = {}
    if not values:
        return fields
    if values.get("discount") is None and task.discount == 1 and is_read(task):
        fields["unread"] = NO_DISCOUNT
    try:
        known = LearnedValues(task, **values)
        fits = fits_of(known)
        fields["operators"] = {name: fit.distance for name, fit in fits.items()}
        fields["told"] = {name: fit.values for name, fit in fits.items()}
        fields["value"] = known.of_first_states
        fields["explained"] = known.explained
        if counts is not None:
            fields["moved"] = known.moved(counts)
            errors = known.step_errors(counts)
            fields |= {"at_ends": errors.at_ends, "before_ends": errors.before_ends, "worst_step": errors.worst}
    except SpecError as error:
        was_given = isinstance(learned, Learned) and (learned.q is not None or learned.values is not None)
        if was_given and set(error.codes) != {"E712"}:
            raise
    return fields


def _behaviour_fields(task: Task, learned: Any, behaviour: TrainingBehaviour) -> dict[str, Any]:
    fields: dict[str, Any] = {"tried": behaviour.tried, "agrees": None}
    if behaviour.counts is not None:
        policy = learned
        if isinstance(learned, Learned):
            policy = learned.policy
        rows = observation_rows(task, policy)
        if rows is not None:
            fields["agrees"] = behaviour.agreement(rows)
    return fields


def learned_values(task: Task, learned: Any) -> dict[str, Any]:
    """Return learned values as arguments of `fingerprint`; nothing where there are none."""
    if not isinstance(learned, Learned):
        return _values_of(task, learned)
    values = _values_of(task, learned.policy)
    if learned.q is not None:
        values = {"q": learned.q}
    elif learned.values is not None:
        values = {"values": learned.values, "policy": _probabilities(task, learned.policy)}
    if values and learned.discount is not None:
        values["discount"] = learned.discount
    return values


def _probabilities(task: Task, policy: Any) -> Any:
    if is_table(policy):
        return policy
    return observed_probabilities(policy, task)


def _values_of(task: Task, policy: Any) -> dict[str, Any]:
    """Return the values that a policy has itself: a table of Q-values, or a model of Stable-Baselines3."""
    if is_table(policy):
        table = np.asarray(policy)
        if table.dtype.kind != "f" or table.ndim != 2 or are_probabilities(table):
            return {}
        return {"q": table}
    actor = getattr(policy, "policy", None)
    if not hasattr(actor, "obs_to_tensor") or _normalises_rewards(policy):
        return {}
    values: dict[str, Any] = {"discount": getattr(policy, "gamma", None)}
    if hasattr(policy, "q_net"):
        return values | {"q": _network(task, policy, policy.q_net)}
    critic = getattr(actor, "predict_values", None)
    probabilities = observed_probabilities(policy, task)
    if critic is None or probabilities is None or "lstm_states" in parameters(critic):
        return {}
    return values | {"values": _network(task, policy, critic), "policy": probabilities}


def _normalises_rewards(model: Any) -> bool:
    wrapper = None
    if hasattr(model, "get_vec_normalize_env"):
        wrapper = model.get_vec_normalize_env()
    return bool(getattr(wrapper, "norm_reward", False))


def _network(task: Task, model: Any, network: Callable[[Any], Any]) -> Callable[[Any], Array]:
    normalise = Predictor(task, model).normalise

    def values(observations: Any) -> Array:
        model.policy.set_training_mode(False)
        outputs = network(model.policy.obs_to_tensor(normalise(observations))[0])
        return np.asarray(plain(outputs), np.float64)

    return values


# -- what explains them -----------------------------------------------------------------------------------------------

Kind = Literal["values", "reward", "policy"]
KINDS: dict[Kind, tuple[str, tuple[str, ...]]] = {
    "values": ("operators", GOOD),
    "reward": ("rewards", GOOD[:1]),
    "policy": ("pairings", GOOD[:1]),
}
"""What is explained: the field of a score with its distances, and names that are no mistake."""


@dataclass(frozen=True)
class Explanation:
    """An explanation of what a learner learned on several tasks and seeds.

    Attributes:
        judged: names in `MISTAKES`, and distances.
        task: the one where what is right is farthest.
    """

    kind: Kind
    judged: Judgement
    task: str

    @property
    def names(self) -> tuple[str, ...]:
        """Mistakes that explain it equally well, or a name that is none; empty if nothing known does."""
        return self.judged.names

    @property
    def is_mistake(self) -> bool:
        return bool(self.names) and self.names[0] not in KINDS[self.kind][1]

    @property
    def message(self) -> str:
        """The explanation in a sentence. A name is the nearest of those that are known, which need not be the right one."""
        distance = f"{self.judged.distance:.2f}"
        right = f"{self.judged.right:.2f}"
        if not self.names:
            text = f"no known mistake explains the learned {self.kind} (distance to the right {self.kind} {right}"
            nearest = [f"{name} {distance:.2f}" for name, distance in self.judged.nearest]
            if nearest:
                text += f"; nearer, but not near enough for a name: {', '.join(nearest)}"
            return f"{text})"
        learner = "a learner " + ", or ".join(MISTAKES[name].what for name in self.names)
        if not self.is_mistake:
            return f"nearest to the learned {self.kind}: {learner} (distance {distance})"
        distances = f"{self.kind} at distance {distance}, the right {self.kind} at {right}"
        return f"nearest known mistake: {learner} ({distances})."

    @property
    def advice(self) -> str:
        """The usual code of the mistakes, and what to do."""
        mistakes = [MISTAKES[name] for name in self.names]
        return " Or: ".join(f"{each.code}. {each.fix}" for each in mistakes)


UNLEARNED = 0.01
"""Learned values of the first states that are smaller, as a share of what can be earned, say nothing: too little exploration
looks like a mistake there."""
LEARNED_TO_ACT = 0.5
"""But for the score from which a policy has learned, which shows that its values should have."""


def _says_something(score: Score) -> bool:
    if score.get("unread"):
        return False
    value = score.get("value")
    return value is None or abs(value) >= UNLEARNED or (score["deterministic"] or 0) >= LEARNED_TO_ACT


def explanations(scores: Sequence[Score]) -> Iterator[Explanation]:
    """Yield what explains the values, rewards and policies that were learned in an exam, where they are known."""
    for kind, (entry, good) in KINDS.items():
        runs = []
        for score in scores:
            distances = score.get(entry)
            if distances and score["peek"] is None and (kind != "values" or _says_something(score)):
                runs.append(Run(score["task"], cast(dict[str, float], distances), score.get("told") or {}))
        if not runs:
            continue
        explanation = judged(runs, good, is_finished=kind == "policy")
        if "constant" in explanation.names:
            explanation = replace(explanation, names=("constant",))  # others are constant, too, where they are as near
        farthest = max(runs, key=lambda run: run.distances[good[0]])
        yield Explanation(kind, explanation, farthest.task)


DOUBTFUL = 3
"""Tasks that are trained longer to see which, at most."""
HALFWAY = 0.5
"""The score up to which a learner without rewards may be at random for want of time."""


def unfinished(scores: Sequence[Score]) -> list[str]:
    """Return the tasks whose results may not be finished: longer training shows whether they stay.

    First are tasks with errors of learned values, whose episodes end for certain after some step; then those whose values hardly
    move; then those on which a learner without rewards is nearest to random. None where a known mistake explains what it learned.
    """
    if any(each.is_mistake for each in explanations(scores)):
        return []
    errors: dict[str, list[float]] = defaultdict(list)
    moved: dict[str, list[float]] = defaultdict(list)
    shown: dict[str, list[float]] = defaultdict(list)
    for score in scores:
        task = score["task"]
        if score["peek"] is not None or score["twin"] is not None:
            continue
        if score.get("moved") is not None:
            moved[task].append(score["moved"] or 0.0)
        elif score["demonstrations"] + score["comparisons"] > 0 and score["steps"] > 0:
            shown[task].append(score["stochastic"] or 0.0)
        if score.get("at_ends") is not None:
            errors[task].append(_errors(score))
    mean_errors = {task: float(np.mean(each)) for task, each in errors.items()}
    wrong = [task for task in sorted(errors, key=lambda task: -mean_errors[task]) if mean_errors[task] > SMALL]
    unmoved = [task for task in moved if task not in wrong and np.mean(moved[task]) < MOVED]
    from_random = {task: abs(float(np.mean(each))) for task, each in shown.items()}
    at_random = [task for task in sorted(shown, key=from_random.__getitem__) if from_random[task] < HALFWAY]
    return [*wrong, *unmoved, *at_random][:DOUBTFUL]


def compare_with_extended(scores: Sequence[Score]) -> None:
    """Add the share of the errors that longer training leaves, to the scores of the same task and seed.

    Errors count that both have: steps that go on are only some of those before an end, or none, where a policy never takes them.
    """
    extended = {}
    for score in scores:
        if score["peek"] == "extended":
            extended[score["task"], score["seed"]] = score
    for score in scores:
        later = extended.get((score["task"], score["seed"]))
        if later is None or score["peek"] is not None or score["twin"] is not None:
            continue
        before = _errors(score, later)
        if before > 0 and later["steps"] >= 2 * score["steps"]:
            score["left"] = _errors(later, score) / before


def _errors(score: Score, other: Score | None = None) -> float:
    """Return the sum of the errors of learned values; with another score, of those that it has as well."""
    counted = []
    if (other or score).get("at_ends") is not None:
        counted.append(score.get("at_ends") or 0.0)
    if (other or score).get("before_ends") is not None:
        counted.append(score.get("before_ends") or 0.0)
    return sum(counted)


def learned_flags(scores: Sequence[Score]) -> list[Flag]:
    """Return a flag for values, a reward and a policy, each where a known mistake is nearest."""
    raised = []
    for each in explanations(scores):
        if each.is_mistake:
            flag = Flag(kind=each.kind, task=each.task, message=each.message, effect=None, low=None, high=None)
            raised.append(flag | {"advice": each.advice})
    return raised


def learned_notes(scores: Sequence[Score], is_wrong: bool) -> list[str]:
    """Return lines about what was learned without a known mistake, where known ones are explained, and what was not compared.

    Args:
        is_wrong: whether something else is wrong; then what is right is not said.
    """
    notes = []
    for each in explanations(scores):
        if each.is_mistake:
            commands = ", ".join(f"`taskspec explain {anchor(name)}`" for name in each.names)
            notes.append(f"an example and its repair: {commands}")
        elif not (each.names and is_wrong):
            note = each.message
            if each.advice.strip(" ."):
                note += f". {each.advice}"
            notes.append(note)
    tasks = dict.fromkeys(score["task"] for score in scores)
    unread = {score["task"]: score["unread"] for score in scores if score.get("unread")}
    for why, number in Counter(unread.values()).items():
        notes.append(f"learned values were not compared with known mistakes on {number} of {len(tasks)} tasks: {why}")
    return notes
