"""What a learner is given: one task, what it may learn from, and a budget of steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import TaskspecError
from taskspec.data import Demonstrations, demonstrations
from taskspec.envs.metered import Metered
from taskspec.exam.oracle import Oracle
from taskspec.exam.withheld import withheld
from taskspec.task.task import Task

if TYPE_CHECKING:
    from taskspec.envs.metered import MeteredVector

Source = Literal["reward", "demonstrations", "preferences"]
SOURCES: tuple[Source, ...] = get_args(Source)
"""What a learner may learn from."""


F = TypeVar("F", bound=Callable[..., Any])


def learns_from(*sources: Source) -> Callable[[F], F]:
    """Say what a learner is entitled to, as a decorator of `train`: some of "reward", "demonstrations" and "preferences"."""

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
    """What a learner has used so far."""

    steps: int = 0
    demonstrations: int = 0
    comparisons: int = 0


@dataclass(frozen=True)
class ExamTerms:
    """What holds for every task of an exam.

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
        self._judge = task
        self._negated = negated
        self._made = 0
        self.curve: list[tuple[int, list[Any]]] = []
        """Policies, one for each seed, that the learner showed on its way, with the steps that it had taken."""

    # -- what it is ---------------------------------------------------------------------------------------------------

    @property
    def seed(self) -> int:
        return self.seeds[0]

    @property
    def steps(self) -> int:
        return self.terms.steps

    @property
    def learns_from(self) -> tuple[Source, ...]:
        """What is granted: some of "reward", "demonstrations", "preferences"."""
        return self.terms.learns_from

    @property
    def observation_space(self) -> Any:
        """Gymnasium's space: which class it is depends on the task."""
        return self.task.observation_space

    @property
    def action_space(self) -> Any:
        """As before."""
        return self.task.action_space

    @cached_property
    def each(self) -> tuple[Case, ...]:
        """The case of each seed alone; each has the whole budget."""
        return tuple(Case(self._judge, (seed,), self.terms, self._negated) for seed in self.seeds)

    def spent_by(self, i: int) -> Spent:
        """What one seed of the block has used: what all of them did together, and what it did alone."""
        alone = self.each[i].spent if "each" in vars(self) else Spent()
        return Spent(**{name: value + vars(alone)[name] for name, value in vars(self.spent).items()})

    # -- steps --------------------------------------------------------------------------------------------------------

    def env(self) -> Metered:
        """An environment. Its steps are counted; where the reward is not granted, it pays 0."""
        return Metered(self._judge, self._meter, self._next_seed())

    def make_vec(self, lanes: int, **options: Any) -> MeteredVector:
        """Environments that are stepped together, as `taskspec.make_vec` makes them; a step of all counts once for each."""
        from taskspec.envs.metered import MeteredVector

        return MeteredVector(self._judge, lanes, self._meter, self._next_seed(), **options)

    def count(self, steps: int = 0, comparisons: int = 0) -> None:
        """Tell of steps, and of comparisons, that were made elsewhere than in `env`, `make_vec` and `prefer`: of each seed.

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
        """Seeds of environments are far apart from each other, and from those that policies are scored on."""
        self._made += 1
        return (self.seed + 1 << 32) + (self._made << 20)

    @cached_property
    def _meter(self) -> _Meter:
        return _Meter(self)

    # -- what is learned from -----------------------------------------------------------------------------------------

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """Whole episodes of the expert, where the spec says that it acts. Rewards are 0 where they are not granted.

        Raises:
            NotGranted: when the learner is not entitled to them.
        """
        self._need("demonstrations")
        policy = "optimal" if self._judge.expert is None else "expert"
        seed = (self.seed + 1 << 32) + (1 << 31)
        found = demonstrations(self._judge, policy, transitions=self.terms.transitions, seed=seed)
        self.spent.demonstrations = len(found)
        if "preferences" in self.learns_from:
            self._oracle.keep(found.obs, found.acts, found.next_obs, found.rews)
        assert found.task is not None
        task = withheld(found.task, self.learns_from)
        if "reward" in self.learns_from:
            return replace(found, task=task)
        metadata = {name: value for name, value in found.metadata.items() if name != "return"}
        return replace(found, rews=np.zeros_like(found.rews), task=task, metadata=metadata)

    def prefer(self, first: Any, second: Any, temperature: float = 0.0) -> float:
        """Which of two trajectories, or segments, is better by true return: 1.0 the first, 0.0 the second, 0.5 neither.

        Args:
            first, second: with `obs` (one more than steps) and `acts`, as `case.env()` or the demonstrations showed them.
            temperature: of a teacher who errs (Bradley-Terry), as a share of the exact range of returns.

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

    # -- on the way ---------------------------------------------------------------------------------------------------

    def show(self, *policies: Any) -> None:
        """Show what has been learned so far, a policy for each seed: a point of the learning curve. Costs no steps."""
        if len(policies) != len(self.seeds):
            raise ValueError(f"{len(policies)} policies for {len(self.seeds)} seeds")
        self.curve.append((self.spent.steps, list(policies)))


@dataclass
class _Meter:
    """Counts the steps of a case, and withholds its rewards."""

    case: Case
    pays: bool = field(init=False)
    keeps: bool = field(init=False)

    def __post_init__(self) -> None:
        self.pays = "reward" in self.case.learns_from
        self.keeps = "preferences" in self.case.learns_from

    def spend(self, steps: int) -> None:
        self.case.count(steps)

    def paid(self, before: Any, actions: Any, after: Any, rewards: Array) -> Array:
        if self.keeps:
            self.case._oracle.keep(before, actions, after, rewards)
        return rewards if self.pays else np.zeros_like(rewards)
