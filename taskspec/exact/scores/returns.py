"""Expected returns: exact where the task has an exact model, otherwise estimated from episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import NormalDist
from typing import Literal, TypeAlias

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError
from taskspec.base.display import InNotebooks
from taskspec.exact.abstraction.abstraction import Abstraction, abstraction
from taskspec.exact.abstraction.verify import AbstractionCheck, verify
from taskspec.exact.model.extract import extract, with_reward
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.rollout.rollout import EPISODES, Choose, at_random, by_expert, is_bounded, return_range, simulate
from taskspec.exact.solve.backward import Greedy, Plan, Rule, Uniform, rule_of
from taskspec.exact.solve.enclosure import CONFIDENCE, Enclosure, NoNumber, mean_interval, rounded
from taskspec.exact.solve.plans import tables
from taskspec.exact.solve.solve import Solvers, expectation, why_endless
from taskspec.language.modifiers.core import informative, storing_observations
from taskspec.language.registry import load
from taskspec.language.task.parts import Soft
from taskspec.language.task.questions import is_random
from taskspec.language.task.task import Task, TaskLike

Given: TypeAlias = Literal["optimal"] | Soft | None

OfClaim = Literal["proved", "tested", "undecided", "false", "contradicted", "broken"]
OfNumber = Literal["exact", "estimated"]


@dataclass(frozen=True, slots=True)
class Status:
    """A word with its meaning, the words for it on a page, and the code of the error that it is (None: it is none)."""

    word: str
    doc: str
    shown: str
    code: str | None = None


CLAIMS: dict[OfClaim, Status] = {
    "proved": Status(
        "proved", "It holds by exact results whose error is computed, or by the form of the equations.", "proved"),
    "tested": Status(
        "tested", "Simulated episodes do not contradict it.", "tested in {episodes} episodes"),
    "undecided": Status(
        "undecided", "It is neither proved nor contradicted: the task has no exact model, or error bounds leave it open.",
        "not decided", "E602"),
    "false": Status("false", "Exact results contradict it.", "does not hold", "E601"),
    "contradicted": Status(
        "contradicted", "Simulated episodes contradict it at 99.9 % confidence, whatever the distribution of their returns.",
        "does not hold", "E604"),
    "broken": Status("broken", "It is not a valid claim.", "does not hold", "E603"),
}  # fmt: skip

NUMBERS: dict[OfNumber, Status] = {
    "exact": Status("exact", "Computed from an exact model, with a computed error bound.", ""),
    "estimated": Status("estimated", "The mean of simulated episodes, with a 95 % confidence interval.",
                        "from {episodes} episodes"),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Return:
    """An expected return.

    Attributes:
        error: the standard error of an estimate; 0 for a value computed from a model.
        episodes: of an estimate; 0 for a value computed from a model.
        bound: the largest possible rounding error of a value computed from a model.
    """

    value: float
    error: float = 0.0
    episodes: int = 0
    bound: float = field(default=0.0, repr=False)

    @property
    def status(self) -> OfNumber:
        if self.episodes:
            return "estimated"
        return "exact"

    @property
    def exact(self) -> bool:
        """True where it was computed from an exact model."""
        return not self.episodes

    def interval(self, confidence: float = CONFIDENCE) -> tuple[float, float]:
        """Bound the return.

        Args:
            confidence: level of the interval; exact returns do not depend on it.

        Returns:
            (low, high): proved bounds if it is exact, otherwise those of a normal approximation.
        """
        width = self.bound + NormalDist().inv_cdf(0.5 + confidence / 2) * self.error
        return self.value - width, self.value + width

    @property
    def half(self) -> float:
        """Half the width of the 95 % confidence interval, printed after ±."""
        low, high = self.interval()
        return (high - low) / 2

    @classmethod
    def estimated(cls, returns: Sequence[float] | Array) -> Return:
        """Estimate an expected return.

        Args:
            returns: of N episodes, (N,).

        Returns:
            their mean with its standard error, infinite for one episode.
        """
        sample = np.asarray(returns, dtype=np.float64)
        with np.errstate(invalid="ignore", over="ignore"):  # returns, or their squares, may be infinite
            mean = float(sample.mean())
            deviation = math.inf
            if len(sample) > 1:
                deviation = float(sample.std(ddof=1))
        error = deviation / math.sqrt(len(sample))
        return cls(mean, math.inf if math.isnan(error) else error, len(sample))


class Results(InNotebooks):
    """All results about a task's returns, computed when they are read.

    `model` belongs to the task or to its proved abstraction; without one it is None, and `why_not` gives the reason.

    Args:
        episodes, seed: of simulated returns.
        limit: the largest number of states of the model.
        expert: "optimal" or `Soft`, in place of the spec's expert.
    """

    def __init__(
        self, task: TaskLike, episodes: int = EPISODES, seed: int = 0, limit: int | None = None, expert: Given = None
    ) -> None:
        self.given: Given = expert
        self.task: Task = load(task)
        self.episodes: int = episodes
        self.seed: int = seed
        self.limit: int | None = limit
        self.unsettled: str | None = None
        self.searched: dict[tuple[str, bool], Enclosure] = {}
        """Best returns under observations that hide the state, by name and reading."""
        self._enclosures: dict[tuple[str, bool], Enclosure | None] = {}
        self._paid: dict[str, Solvers] = {}
        self._samples: dict[tuple[str, int], Return | None] = {}

    @cached_property
    def abstraction(self) -> Abstraction | None:
        return abstraction(self.task)

    @cached_property
    def abstraction_check(self) -> AbstractionCheck | None:
        """The verification of the abstraction; None without an abstraction."""
        if self.abstraction is None:
            return None
        return verify(self.abstraction)

    @cached_property
    def _extracted(self) -> Model | SpecError:
        task = self.task
        if self.abstraction is not None:
            task = self.abstraction.stand_in
        check = self.abstraction_check
        try:
            if check is not None and check.problem is not None:
                refuse("the abstraction is not faithful")
            if check is not None and check.why_not is not None:
                refuse(f"the abstraction is not proved: {check.why_not}")
            return extract(task, limit=self.limit)
        except SpecError as error:
            return error

    @property
    def model(self) -> Model | None:
        if isinstance(self._extracted, Model):
            return self._extracted
        return None

    @property
    def known_model(self) -> Model:
        """The exact model; raises E712 where there is none, as `TooLarge` where a limit forbids it."""
        if isinstance(self._extracted, SpecError):
            raise self._extracted
        return self._extracted

    @property
    def why_not(self) -> str | None:
        """The reason why there is no exact model, or why some return is unknown; None if there is none."""
        extracted = self._extracted
        reasons = [self.unsettled]
        if isinstance(extracted, SpecError):
            reasons.insert(0, extracted.diagnostics[0].message)
        return " and ".join(filter(None, reasons)) or None

    @property
    def remedy(self) -> str | None:
        """A hint how to get an exact model, where there is none."""
        extracted = self._extracted
        if isinstance(extracted, SpecError):
            return extracted.diagnostics[0].hint
        return None

    @cached_property
    def solvers(self) -> Solvers:
        return Solvers(self.known_model)

    @cached_property
    def remembering(self) -> Results:
        """The results of the task whose state includes the expert's memory; these results for experts without memory."""
        if self.task.annotations.memory is None or self.given is not None:
            return self
        return Results(self.task.remembering(), self.episodes, self.seed, self.limit)

    @cached_property
    def observing(self) -> Results:
        """The results of the task whose state includes random observations; these results where nothing seen is random."""
        if not self.task.observation.is_random:
            return self
        seen = informative(self.task)
        for c, node in zip(seen.components, seen.nodes, strict=True):
            if is_random([node]) and not c.is_finite:
                hint = "a condition, a choice, or an int with bounds can be kept in the state"
                refuse(f"the observation '{c.name}' is random and may have infinitely many values", hint)
        return Results(storing_observations(self.task), self.episodes, self.seed, self.limit)

    @property
    def is_ambiguous(self) -> bool:
        """True where some result depends on how floats are read."""
        others = [self.__dict__.get(name, self) for name in ("remembering", "observing")]
        asked = {id(r): r for r in (self, *others)}.values()
        solvers = [r.solvers for r in asked if r.model is not None]
        for r in asked:
            solvers += r._paid.values()
        return any(each.ambiguous for each in solvers)

    @cached_property
    def expert_rule(self) -> Rule | None:
        if self.model is None:
            return None
        check = self.abstraction_check
        if check is not None and not check.has_expert and self.given is None:
            return None  # the expert of the task looks at more than the abstraction has
        return rule_of(self.model, self.given)

    def measure_under(self, name: str, rule: Rule, as_written: bool = False) -> Enclosure:
        """Return the expected (discounted) sum of a measure under a policy rule of the model.

        Raises:
            SpecError: E712, where the measure has no exact model.
            NoNumber: where it may be infinite.
        """
        assert self.model is not None
        if self.abstraction is not None:
            refuse("the abstraction has no measures")
        if name not in self._paid:
            self._paid[name] = Solvers(with_reward(self.model, self.task.process.measures[name]))
        value = expectation(self.solvers, rule, self._paid[name], as_written)
        if not (math.isfinite(rounded(value.low)) and math.isfinite(rounded(value.high))):
            refuse(why_endless(self._paid[name].in_floats))
        return value

    @cached_property
    def _opposite(self) -> Results:
        """The results of the task with the negative reward, whose best policies are the worst ones here."""
        b = self.task.new_builder()
        return Results(self.task.with_process(reward=b.apply("neg", self.task.process.reward)), limit=self.limit)

    @cached_property
    def measures(self) -> dict[str, dict[str, Return | None]]:
        """The expected sums of each measure, by name, under an optimal, random, worst policy and the expert.

        Of several best or worst actions each is taken as often. None where a policy does not exist, or is not known.
        """
        by_policy: dict[str, dict[str, Return | None]] = {}
        for name in self.task.process.measures:
            by_policy[name] = {which: self._measure(name, which) for which in ("optimal", "random", "worst", "expert")}
        return by_policy

    def _measure(self, name: str, which: str) -> Return | None:
        if which == "expert" and self.remembering is not self:
            return self.remembering._measure(name, which)
        results = self
        rule = {"random": Uniform(), "expert": self.expert_rule, "optimal": Greedy(), "worst": Greedy()}[which]
        if which == "worst" and self.model is not None:
            results = self._opposite
        if rule is not None and results.model is not None:
            try:
                enclosure = results.measure_under(name, rule)
                return Return(enclosure.value, bound=enclosure.error)
            except (SpecError, NoNumber) as error:
                self.unsettled = str(error)
        paid = self.task.with_process(reward=self.task.process.measures[name])
        return Results(paid, self.episodes, self.seed, self.limit, self.given).sample(which)

    @cached_property
    def optimal(self) -> Return | None:
        return self._return("optimal")

    @cached_property
    def worst(self) -> Return | None:
        return self._return("worst")

    @cached_property
    def random(self) -> Return | None:
        """The return of uniformly random actions; None for actions without a finite range."""
        return self._return("random")

    @cached_property
    def expert(self) -> Return | None:
        """The return of the expert; None where there is none, or it is unknown."""
        return self._return("expert")

    def _return(self, which: str) -> Return | None:
        value = self.enclosure(which)
        if value is None:
            return self.sample(which)
        return Return(value.value, bound=value.error)

    def enclosure(self, which: str, as_written: bool = False) -> Enclosure | None:
        """Return bounds of the optimal, worst, random or expert return; None without a model, or if it may be infinite."""
        if which == "expert" and self.remembering is not self:
            value = self.remembering.enclosure(which, as_written)
            self.unsettled = self.remembering.why_not
            return value
        key = (which, as_written)
        if key not in self._enclosures:
            try:
                value = self._enclosed(which, as_written)
            except (SpecError, NoNumber) as error:
                if isinstance(error, SpecError):
                    self.unsettled = error.diagnostics[0].message
                else:
                    self.unsettled = str(error)
                value = None
            self._enclosures[key] = value
        return self._enclosures[key]

    def _enclosed(self, which: str, as_written: bool) -> Enclosure | None:
        if self.model is None:
            return None
        if which == "worst":
            solver = self.solvers.of(None, as_written)
            value = solver.worst()
        else:
            rule = {"random": Uniform(), "expert": self.expert_rule, "optimal": Greedy()}[which]
            if rule is None:
                return None
            solver = self.solvers.of(rule, as_written)
            value = solver.value(rule)
        if not (math.isfinite(rounded(value.low)) and math.isfinite(rounded(value.high))):
            refuse(why_endless(solver))
        return value

    def sample(self, which: str, episodes: int | None = None) -> Return | None:
        """Return the simulated random or expert return; None where episodes do not end, and for other returns."""
        if which == "expert" and self.remembering is not self:
            return self.remembering.sample(which, episodes)
        key = (which, episodes or self.episodes)
        if key not in self._samples:
            choose: Choose | None = None
            if which == "expert" and isinstance(self.task.annotations.expert, tuple) and self.given is None:
                choose = by_expert(self.task)
            elif which == "random" and is_bounded(self.task):
                choose = at_random(self.task)
            if choose is None:
                self._samples[key] = None
            else:
                self._samples[key] = self.estimated(choose, episodes)
        return self._samples[key]

    def interval(self, sample: Return, confidence: float, soundly: bool) -> Enclosure:
        """Return a confidence interval of the expectation; `soundly`: valid for any distribution of the returns."""
        if not soundly:
            low, high = sample.interval(confidence)
            return Enclosure.exactly(low).hull(Enclosure.exactly(high))
        return mean_interval(sample.value, sample.error, sample.episodes, *return_range(self.task), confidence)

    def estimated(self, choose: Choose, episodes: int | None) -> Return | None:
        """Return the simulated return of a policy; None where episodes do not end."""
        try:
            return self.simulated(choose, episodes)
        except SpecError as error:
            self.unsettled = error.diagnostics[0].message
            return None

    @cached_property
    def expert_plan(self) -> Plan | None:
        """The expert as probabilities of actions (A, S) at each time; None without a model, or where they are unknown."""
        try:
            rule = self.expert_rule
            if self.model is None or rule is None:
                return None
            return tables(self.model, rule)
        except SpecError as error:
            self.unsettled = error.diagnostics[0].message
            return None

    def simulated(self, choose: Choose, episodes: int | None = None) -> Return:
        """Return the simulated return of a policy."""
        return Return.estimated(simulate(self.task, choose, episodes or self.episodes, self.seed))


def why_no_expert(task: Task) -> str | None:
    """Return why a task has no expert; None where it has one."""
    if task.annotations.expert is not None:
        return None
    if task.unmodified.annotations.expert is None:
        return "the spec gives no expert"
    return f"the expert of the spec is not for the task with {', '.join(map(str, task.modifiers))}"


def normalised(value: float, random: float, expert: float, floor: float | None = -1.0) -> float:
    """Return a score normalised so that random actions have 0 and the expert has 1.

    Args:
        value, random, expert: returns.
        floor: the smallest score, or None; the seals paper truncates EarlyTermNeg, whose worst policies score below -3, at -1.

    Returns:
        nan where the expert is as good as random actions, and for a value that is nan.
    """
    if expert == random:
        return math.nan
    score = (value - random) / (expert - random)
    if floor is None or math.isnan(score):
        return score
    return max(floor, score)
