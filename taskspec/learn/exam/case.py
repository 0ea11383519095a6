"""Cases for learners: one task without what is withheld, a budget of steps, and answers about preferences."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args

import numpy as np

from taskspec.base.arrays import Array, part_at
from taskspec.base.diagnostics import TaskspecError
from taskspec.language.task.task import Task
from taskspec.learn.data.episodes import Demonstrations, demonstrations
from taskspec.learn.data.preferences import WORDS, Teacher, return_ends
from taskspec.learn.exam.behaviour import TrainingBehaviour
from taskspec.learn.exam.curves import EpisodeReturns, TrainingReturns
from taskspec.learn.exam.metered import Metered

if TYPE_CHECKING:
    from taskspec.learn.exam.metered_vector import MeteredVector


def withheld(task: Task, learns_from: Collection[str], sign: float = 0.0) -> Task:
    """Return a task without expert, claims, examples and measures, whose rewards are 0 where they are not granted.

    Demonstrations come from an expert who is never part of the task: who may see them sees so many, and no more.

    Args:
        task: the task.
        learns_from: what is granted.
        sign: what rewards are multiplied by that are not granted.
    """
    reward = task.process.reward
    absorbing_reward = task.process.absorbing_reward
    if "reward" not in learns_from:
        builder = task.new_builder()
        if sign == 0:
            reward = builder.scalar(0.0)
            absorbing_reward = builder.scalar(0.0)
        else:
            reward = builder.apply("mul", builder.scalar(sign), reward)
            absorbing_reward = builder.apply("mul", builder.scalar(sign), absorbing_reward)
    changed = f"{task.content_hash} for a learner from {', '.join(sorted(learns_from))}, {sign:g}"
    source = replace(task.source, content_hash=hashlib.sha256(changed.encode()).hexdigest())
    as_written = None
    if task.written_as is not None:
        as_written = withheld(task.written_as, learns_from, sign)
    bare = task.with_process(reward=reward, absorbing_reward=absorbing_reward, measures={})
    bare = bare.with_annotations(expert=None, memory=None, claims=(), examples=())
    return replace(bare, source=source, written_as=as_written)


# Preferences between trajectories, although the rewards of neither are shown.

Key = tuple[Hashable, Hashable, Hashable]
KEPT = 250_000
"""Different steps that are remembered at least, of which the latest count."""


RESEEDED = 10
"""Resets with a seed that was given before, at least, that are worth a flag."""


class _Resets:
    """Counts resets, and those with a seed that was given before."""

    def __init__(self) -> None:
        self.number = 0
        self.again = 0
        self.seeds: set[str] = set()

    def add(self, seed: Any) -> None:
        """Count a reset with a seed, or without one."""
        self.number += 1
        if seed is not None:
            self.again += str(seed) in self.seeds
            self.seeds.add(str(seed))

    @property
    def reseeded(self) -> float:
        """The share of resets with a seed that was given before; 0 where there are few of these."""
        if self.again < RESEEDED:
            return 0.0
        return self.again / self.number


class Oracle:
    """Remembers the rewards of the steps that a learner saw, and compares by them.

    A trajectory is recognised by its observations and actions: where two steps look alike and pay differently, the last one
    seen counts.
    """

    def __init__(self, task: Task, seed: int) -> None:
        self.task = task
        self.rng = np.random.default_rng([seed, 0x7EAC4])
        self.rewards: dict[Key, float] = {}
        self.older: dict[Key, float] = {}

    def keep(self, before: Any, actions: Any, after: Any, rewards: Array) -> None:
        """Remember steps; each argument is a batch of N. What was not seen for long is forgotten."""
        if len(self.rewards) >= KEPT:
            self.older = self.rewards
            self.rewards = {}
        for key, reward in zip(self._keys(before, actions, after), rewards.tolist(), strict=True):
            self.rewards[key] = reward

    def prefer(self, first: Any, second: Any, temperature: float) -> float:
        """1.0 for the first, 0.0 for the second, 0.5 for neither."""
        one = np.array([self._value(first)])
        other = np.array([self._value(second)])
        teacher = Teacher(boltzmann=temperature)
        words = self.rng.integers(0, 2**32, (WORDS, 1), dtype=np.uint32)
        if teacher.needs_range:
            ends = return_ends(self.task, len(first.acts))
        else:
            ends = (0.0, 0.0)
        return float(teacher.labels(one, other, (one, other), ends, words)[0])

    def _value(self, trajectory: Any) -> float:
        obs = trajectory.obs
        discount = self.task.discount
        before = part_at(obs, slice(-1))
        keys = self._keys(before, trajectory.acts, part_at(obs, slice(1, None)))
        try:
            rewards = [self.rewards[key] if key in self.rewards else self.older[key] for key in keys]
        except KeyError:
            message = (
                "`prefer` compares steps that `case.env()`, `case.make_vec()` or the demonstrations have shown, among the "
                f"latest {KEPT:,}"
            )
            raise ValueError(message) from None
        return sum(discount**t * reward for t, reward in enumerate(rewards))

    def _keys(self, before: Any, actions: Any, after: Any) -> Iterator[Key]:
        seen = self.task.observation_layout.form
        done = self.task.action_layout.form
        return zip(_each(before, seen), _each(actions, done), _each(after, seen), strict=True)


def _each(batch: Any, form: str) -> Iterator[Hashable]:
    if isinstance(batch, dict):
        yield from zip(*(_each(batch[name], "float64") for name in sorted(batch)), strict=True)
        return
    dtype = {"discrete": np.int64, "multi_discrete": np.int64, "float64": np.float64}.get(form, np.float32)
    array = np.ascontiguousarray(batch, dtype)
    if array.ndim == 1:
        yield from array.tolist()
        return
    for row in array:
        yield row.tobytes()


# The case: one task, its grants, and a budget of steps.

Source = Literal["reward", "demonstrations", "preferences"]
SOURCES: tuple[Source, ...] = get_args(Source)
"""What a learner may learn from."""


F = TypeVar("F", bound=Callable[..., Any])


def learns_from(*sources: Source) -> Callable[[F], F]:
    """Grant a learner what it is entitled to, as a decorator of `train`.

    Args:
        *sources: some of "reward", "demonstrations" and "preferences".

    Returns:
        The decorator.
    """

    def mark(train: F) -> F:
        train.learns_from = sources  # type: ignore[attr-defined]
        return train

    return mark


class NotGranted(TaskspecError, AttributeError):
    """A learner asked for something that it is not entitled to."""


class BudgetSpent(TaskspecError, RuntimeError):
    """A learner wants more steps than it has."""


@dataclass
class Spent:
    """The costs of a learner so far."""

    steps: int = 0
    demonstrations: int = 0
    comparisons: int = 0


@dataclass(frozen=True)
class ExamTerms:
    """Terms that are the same for every task of an exam.

    Args:
        steps: of the environment, that a learner may take on each task.
        learns_from: what it is granted.
        transitions: of the expert, that are demonstrated.
    """

    steps: int
    learns_from: tuple[Source, ...]
    transitions: int = 10_000


class Case:
    """One task for one learner, or for a block of seeds of it.

    Attributes:
        task: the task, for learners that compile its steps themselves; they tell how many they take by `count`. It has no
            expert, and its rewards are 0 where they are not granted.
        steps: the budget.
        seeds: of the block; `seed` is the first one.
        spent: what has been used of the budget, and how much else.
    """

    def __init__(self, task: Task, seeds: Iterable[int], terms: ExamTerms, negated: bool = False) -> None:
        """`negated`: rewards that are not granted are negated in `task`, and not 0, to see whether that makes a difference."""
        self.task = withheld(task, terms.learns_from, -1.0 if negated else 0.0)
        self.seeds = tuple(seeds)
        self.terms = terms
        self.spent = Spent()
        self.resets = _Resets()
        self._judge = task
        self._negated = negated
        self._made = 0
        self.curve: list[tuple[int, list[Any]]] = []
        """Policies, one for each seed, that the learner showed on its way, with the steps that it had taken."""
        self.training = TrainingReturns(terms.steps)
        """Returns, by the true reward, of the episodes in which the learner learned."""
        self.behaviour = TrainingBehaviour(task, terms.steps)
        """The actions that the learner took."""

    @property
    def seed(self) -> int:
        return self.seeds[0]

    @property
    def steps(self) -> int:
        return self.terms.steps

    @property
    def learns_from(self) -> tuple[Source, ...]:
        """Grants: some of "reward", "demonstrations", "preferences"."""
        return self.terms.learns_from

    @property
    def observation_space(self) -> Any:
        """Gymnasium's space: which class it is depends on the task."""
        return self.task.observation_space

    @property
    def action_space(self) -> Any:
        """The Gymnasium space of actions."""
        return self.task.action_space

    @cached_property
    def each(self) -> tuple[Case, ...]:
        """The case of each seed alone; each has the whole budget."""
        return tuple(Case(self._judge, (seed,), self.terms, self._negated) for seed in self.seeds)

    def training_of(self, i: int) -> list[list[float]]:
        """Look up the curve of training episodes of a seed.

        Args:
            i: number of the seed in the block.

        Returns:
            points of the curve; none where seeds share their environments.
        """
        if "each" in vars(self):
            return self.each[i].training.points
        if len(self.seeds) > 1:
            return []
        return self.training.points

    def behaviour_of(self, i: int) -> TrainingBehaviour | None:
        """Look up the actions that a seed took.

        Args:
            i: number of the seed in the block.

        Returns:
            counts; None where seeds share their environments.
        """
        if "each" in vars(self):
            return self.each[i].behaviour
        if len(self.seeds) > 1:
            return None
        return self.behaviour

    def shown_to(self, i: int) -> Demonstrations | None:
        """Look up the demonstrations that a seed has used.

        Args:
            i: number of the seed in the block.

        Returns:
            demonstrations; None if it used none.
        """
        known: Any = vars(self.each[i]) if "each" in vars(self) else {}
        return known.get("demonstrations", vars(self).get("demonstrations"))

    def spent_by(self, i: int) -> Spent:
        """Add up the budget that a seed has used: together with the others of the block, and alone.

        Args:
            i: number of the seed in the block.

        Returns:
            steps, comparisons and demonstrations.
        """
        if "each" in vars(self):
            alone = self.each[i].spent
        else:
            alone = Spent()
        return Spent(**{name: value + vars(alone)[name] for name, value in vars(self.spent).items()})

    def env(self) -> Metered:
        """Make an environment.

        Returns:
            an environment whose steps are counted; where the reward is not granted, it pays 0.
        """
        return Metered(self._judge, _Meter(self), self._next_seed())

    def make_vec(self, lanes: int, **options: Any) -> MeteredVector:
        """Make environments that are stepped together.

        Args:
            lanes: number of environments.
            options: those of `taskspec.make_vec`.

        Returns:
            a vector environment; a step of all counts once for each.
        """
        from taskspec.learn.exam.metered_vector import MeteredVector

        return MeteredVector(self._judge, lanes, _Meter(self), self._next_seed(), **options)

    def count(self, steps: int = 0, comparisons: int = 0) -> None:
        """Count steps and comparisons of each seed that were made elsewhere than in `env`, `make_vec` and `prefer`.

        Args:
            steps: of the environment.
            comparisons: of trajectories.

        Raises:
            BudgetSpent: when the steps are more than there are left.
        """
        if self.spent.steps + steps > self.steps:
            raise BudgetSpent(
                f"the budget of {self.steps:,} steps is spent: {self.spent.steps:,} were taken, and {steps:,} more requested; "
                "`case.steps` says how many there are, `case.spent.steps` how many were taken"
            )
        self.spent.steps += steps
        self.spent.comparisons += comparisons

    def _next_seed(self) -> int:
        self._made += 1
        return (self.seed + 1 << 32) + (self._made << 20)

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """Whole episodes of the expert, in the variant in which it acts. Rewards are 0 where they are not granted.

        Raises:
            NotGranted: when the learner is not entitled to them.
        """
        self._need("demonstrations")
        policy = "expert"
        if self._judge.annotations.expert is None:
            policy = "optimal"
        seed = (self.seed + 1 << 32) + (1 << 31)
        shown = demonstrations(self._judge, policy, transitions=self.terms.transitions, seed=seed)
        self.spent.demonstrations = len(shown)
        if "preferences" in self.learns_from:
            self._oracle.keep(shown.obs, shown.acts, shown.next_obs, shown.rews)
        assert shown.task is not None
        task = withheld(shown.task, self.learns_from)
        if "reward" in self.learns_from:
            return replace(shown, task=task)
        metadata = {name: value for name, value in shown.metadata.items() if name != "return"}
        return replace(shown, rews=np.zeros_like(shown.rews), task=task, metadata=metadata)

    def prefer(self, first: Any, second: Any, temperature: float = 0.0) -> float:
        """Compare two trajectories, or segments, by true return.

        Args:
            first, second: with `obs` (one more than steps) and `acts`, as `case.env()` or the demonstrations showed them.
            temperature: of a teacher who errs (Bradley-Terry), as a share of the exact range of returns.

        Returns:
            1.0 where the first is better, 0.0 the second, 0.5 neither.

        Raises:
            NotGranted: when the learner is not entitled to preferences.
            ValueError: for steps that were never taken.
        """
        self._need("preferences")
        self.spent.comparisons += 1
        return self._oracle.prefer(first, second, temperature)

    @property
    def judge(self) -> Task:
        """The task by whose rewards preferences go, for learners that compile it: they label pairs themselves, and `count` them.

        Raises:
            NotGranted: when the learner is not entitled to preferences.
        """
        self._need("preferences")
        return withheld(self._judge, SOURCES)

    @cached_property
    def _oracle(self) -> Oracle:
        return Oracle(self._judge, self.seed)

    def _need(self, wanted: Source) -> None:
        if wanted not in self.learns_from:
            granted = " and ".join(self.learns_from) or "nothing"
            raise NotGranted(
                f"this learner learns from {granted}, and not from {wanted}; "
                f'`@learns_from("{wanted}")` or `--learns-from {wanted}` grants it'
            )

    def show(self, *policies: Any) -> None:
        """Show the policies learned so far: a point of the learning curve, which costs no steps.

        Args:
            policies: one for each seed.

        Raises:
            ValueError: for another number of policies.
        """
        if len(policies) != len(self.seeds):
            raise ValueError(f"{len(policies)} policies for {len(self.seeds)} seeds")
        self.curve.append((self.spent.steps, list(policies)))


class _Meter:
    """Counts the steps of an environment of a case, withholds its rewards, and keeps the returns of its episodes."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.episodes = EpisodeReturns(case.task.discount)
        self.total = 0.0
        self.weight = 1.0

    def begin(self, lanes: int, seed: Any) -> None:
        self.case.resets.add(seed)
        self.episodes.begin(lanes)
        self.total = 0.0
        self.weight = 1.0

    def follow_one(self, reward: float, is_over: bool) -> None:
        self.total += self.weight * reward
        self.weight *= self.episodes.discount
        if is_over:
            self.case.training.add(self.case.spent.steps, self.total, 1)
            self.total = 0.0
            self.weight = 1.0

    def follow(self, rewards: Array, is_over: Array, takes_part: Array) -> None:
        returns = self.episodes.step(rewards, is_over, takes_part)
        if len(returns):
            self.case.training.add(self.case.spent.steps, float(returns.sum()), len(returns))

    def spend(self, steps: int) -> None:
        self.case.count(steps)

    def paid(self, before: Any, actions: Any, after: Any, rewards: Array) -> Array:
        self.case.behaviour.add(self.case.spent.steps, before, actions)
        if "preferences" in self.case.learns_from:
            self.case._oracle.keep(before, actions, after, rewards)
        if "reward" in self.case.learns_from:
            return rewards
        return np.zeros_like(rewards)
