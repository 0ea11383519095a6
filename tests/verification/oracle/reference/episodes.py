"""Episodes from seeds: the environment that the documentation describes, one step at a time."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.verification.oracle.reference.moment import Moment
from tests.verification.oracle.reference.task import State, Task
from tests.verification.oracle.reference.values import Value, number, scalar

Seen = list[tuple[str, Value]]


@dataclass(frozen=True)
class Result:
    """What a reset or a step gives."""

    state: State
    seen: Seen
    reward: Value
    terminated: bool
    truncated: bool
    time: int
    measures: dict[str, Value] = field(default_factory=dict)
    mask: list[bool] | None = None
    """Which actions are legal in the state; None where the spec does not say."""


@dataclass
class Episodes:
    """All episodes that follow from one seed."""

    task: Task
    absorb: bool = False
    seed: int = 0
    steps: int = 0
    """Steps since the seed was set."""
    begun: int = 0
    """Episodes since the seed was set."""
    time: int = 0
    over: bool = True
    absorbed: bool = False
    state: State = field(default_factory=dict)

    def reset(self, seed: int | None = None, given: State | None = None) -> Result:
        if seed is not None:
            self.seed = seed
            self.steps = 0
            self.begun = 0
        moment = Moment.begin(self.task, self.task.words("reset", self.seed, self.begun), given)
        self.begun += 1
        self.time = 0
        self.over = False
        self.absorbed = False
        self.state = moment.state
        return Result(self.state, moment.observation(), scalar(0.0), False, False, 0, mask=self.mask())

    def step(self, action: State) -> Result:
        """One step; all its draws are made whether or not the state is absorbed."""
        assert not self.over
        chance = self.task.words("step", self.seed, self.steps)
        moment = Moment(self.task, self.state, action, self.time, chance)
        self.steps += 1
        if self.absorbed:
            reward, terminated = self._absorbed(moment)
            measures = {name: scalar(0.0) for name in self.task.sections.get("measures") or {}}
        else:
            reward, terminated = self._moved(moment)
            measures = moment.measures()
        self.time += 1
        truncated = self.task.horizon is not None and self.time >= self.task.horizon
        self.state = moment.following
        self.over = truncated or (terminated and not self.absorb)
        ends = (terminated and not self.absorb, truncated)
        seen = moment.observation()
        self.absorbed = self.absorbed or terminated
        return Result(self.state, seen, reward, *ends, self.time, measures, self.mask())

    def mask(self) -> list[bool] | None:
        """The legal actions of the present state; all, where it absorbs."""
        if "legal" not in self.task.sections:
            return None
        (c,) = self.task.action
        absorbs = self.absorb and self.absorbed
        return [absorbs or Moment(self.task, self.state, {c.name: v}, 0, None).legal() for v in c.everything()]

    def _moved(self, moment: Moment) -> tuple[Value, bool]:
        moment.following = moment.next_state()
        return moment.reward(), moment.terminal()

    def _absorbed(self, moment: Moment) -> tuple[Value, bool]:
        """A step after the end, where terminal states absorb: the state stays."""
        reward = moment.absorbing_reward()
        moment.following = dict(self.state)
        return number(reward), False
