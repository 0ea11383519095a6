"""Environments with one planted fault or fact each, and the right versions of them: a grid and a cart on a track."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete

MOVES = ((1, 0), (0, 1), (-1, 0), (0, -1))


class Grid(gymnasium.Env):
    """A grid of 4 x 4 cells; the goal in the opposite corner pays 1, and each step costs 0.01."""

    size = 4
    goal: ClassVar[tuple[int, int]] = (3, 3)
    n_actions = 4

    def __init__(self) -> None:
        self.observation_space = Box(0, self.size - 1, (2,), np.float32)
        self.action_space = Discrete(self.n_actions)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.x = self.y = 0
        self.begin()
        return self.observe(), {}

    def begin(self) -> None:
        """Set what a fault adds to the state."""

    def step(self, action: int) -> Any:
        dx, dy = self.move(int(action))
        self.x = min(max(self.x + dx, 0), self.size - 1)
        self.y = min(max(self.y + dy, 0), self.size - 1)
        terminated = (self.x, self.y) == self.goal
        return self.observe(), self.pay(terminated), terminated, False, {}

    def move(self, action: int) -> tuple[int, int]:
        return MOVES[action]

    def pay(self, terminated: bool) -> float:
        return float(terminated) - 0.01

    def observe(self) -> Any:
        return np.array([self.x, self.y], np.float32)


class Slippery(Grid):
    """Right: a move goes sideways with probability 1/4, by the generator of the environment."""

    def move(self, action: int) -> tuple[int, int]:
        return MOVES[(action + int(self.np_random.random() < 0.25)) % 4]


class Nondeterministic(Grid):
    """The slip is drawn from a global generator."""

    def move(self, action: int) -> tuple[int, int]:
        return MOVES[(action + int(np.random.random() < 0.25)) % 4]  # noqa: NPY002


class LeakingReward(Grid):
    """The number of goals reached since the instance was made is added to the reward."""

    wins = 0

    def pay(self, terminated: bool) -> float:
        self.wins += terminated
        return super().pay(terminated) + self.wins


class UnreachableGoal(Grid):
    """The goal is outside."""

    goal: ClassVar[tuple[int, int]] = (4, 4)

    def __init__(self) -> None:
        super().__init__()
        self.steps = 0

    def begin(self) -> None:
        self.steps = 0

    def step(self, action: int) -> Any:
        self.steps += 1
        observation, reward, terminated, _, info = super().step(action)
        return observation, reward, terminated, self.steps >= 30, info


class HiddenState(Grid):
    """A key in a corner opens the goal, and is not observed."""

    def begin(self) -> None:
        self.has_key = False

    def step(self, action: int) -> Any:
        observation, _, terminated, truncated, info = super().step(action)
        self.has_key = self.has_key or (self.x, self.y) == (3, 0)
        terminated = terminated and self.has_key
        return observation, self.pay(terminated), terminated, truncated, info


class HiddenReward(Grid):
    """The goal pays for a visit to a corner before, which is not observed."""

    def begin(self) -> None:
        self.was_there = False

    def pay(self, terminated: bool) -> float:
        self.was_there = self.was_there or (self.x, self.y) == (0, 3)
        return super().pay(terminated) + (terminated and self.was_there)


class RewardByTime(Grid):
    """The goal pays less the later it is reached, and the time is not observed."""

    n_actions = 2

    def begin(self) -> None:
        self.steps = 0

    def pay(self, terminated: bool) -> float:
        self.steps += 1
        return terminated / self.steps


class UselessAction(Grid):
    """The fifth action does the same as the first."""

    n_actions = 5

    def move(self, action: int) -> tuple[int, int]:
        return MOVES[action % 4]


class OneAction(Grid):
    """The goal is at the end of the first row."""

    goal: ClassVar[tuple[int, int]] = (3, 0)


class SharedState(Grid):
    """All instances have the same walker."""

    walker: ClassVar[list[int]] = [0, 0]

    def begin(self) -> None:
        self.walker[:] = 0, 0

    def step(self, action: int) -> Any:
        self.x, self.y = self.walker
        found = super().step(action)
        self.walker[:] = self.x, self.y
        return found


class ResetKeeps(Grid):
    """A reset leaves the row as it was."""

    y = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        gymnasium.Env.reset(self, seed=seed)
        self.x = 0
        self.y = 0 if self.y == 3 and self.x == 3 else self.y
        return self.observe(), {}


class Mutated(Grid):
    """One array is returned by every step."""

    def begin(self) -> None:
        self.array = np.zeros(2, np.float32)

    def observe(self) -> Any:
        self.array[:] = self.x, self.y
        return self.array


class MutatedInfo(Grid):
    """One `info` is returned by every step."""

    def begin(self) -> None:
        self.info: dict[str, int] = {}

    def step(self, action: int) -> Any:
        *found, _ = super().step(action)
        self.info["x"] = self.x
        return *found, self.info


class Raises(Grid):
    """A step into the last column raises an exception."""

    def pay(self, terminated: bool) -> float:
        return [0.0, 0.0, 0.0][self.x]


class WrongTable(gymnasium.Env):
    """`P` says that the action moves on; the step stays."""

    observation_space = Discrete(2)
    action_space = Discrete(2)
    initial_state_distrib = np.array([1.0, 0.0])
    stays = True

    def __init__(self) -> None:
        self.P = {s: {a: [(1.0, a, float(a), a == 1)] for a in range(2)} for s in range(2)}

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return 0, {}

    def step(self, action: int) -> Any:
        to = 0 if self.stays else int(action)
        return to, float(action), action == 1, False, {}


class RightTable(WrongTable):
    """Right: `P` and the step agree."""

    stays = False


class Cart(gymnasium.Env):
    """A cart on a track that is pushed left or right, and falls off at 2.4; each step pays 1, for 100 steps."""

    def __init__(self) -> None:
        self.observation_space = Box(np.array([-5, -10], np.float32), np.array([5, 10], np.float32))
        self.action_space = Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.x, self.speed = self.np_random.uniform(-0.05, 0.05, 2)
        self.steps = 0
        return self.observe(), {}

    def step(self, action: int) -> Any:
        self.speed += 0.1 * (2 * int(action) - 1)
        self.x += 0.1 * self.speed
        self.steps += 1
        is_off = bool(abs(self.x) > 2.4)
        return self.observe(), 1.0, *self.ends(is_off), {}

    def ends(self, is_off: bool) -> tuple[bool, bool]:
        return is_off, self.steps >= 100

    def observe(self) -> Any:
        return np.array([self.x, self.speed], np.float32)


class TimeTerminates(Cart):
    """The time limit is reported as a termination."""

    def ends(self, is_off: bool) -> tuple[bool, bool]:
        return is_off or self.steps >= 20, False


class StateTruncates(Cart):
    """Falling off is reported as a truncation."""

    def ends(self, is_off: bool) -> tuple[bool, bool]:
        return False, is_off or self.steps >= 100


class OutOfSpace(Cart):
    """Positions are observed in another unit, far outside the bounds."""

    def observe(self) -> Any:
        return np.array([100 * self.x, self.speed], np.float32)


class WrongType(Cart):
    """Observations are doubles, and their space holds floats."""

    def observe(self) -> Any:
        return np.array([self.x, self.speed])


class WrongShape(Cart):
    """Observations are matrices of one row."""

    def observe(self) -> Any:
        return super().observe()[None]


class NoNumber(Cart):
    """The reward is nan once the cart is fast."""

    def step(self, action: int) -> Any:
        observation, _, *rest = super().step(action)
        return observation, float("nan") if abs(self.speed) > 0.3 else 1.0, *rest


class Hangs(Grid):
    """The first step does not return."""

    def pay(self, terminated: bool) -> float:
        while True:
            pass


def lake_without_table() -> gymnasium.Env:
    """Make a frozen lake that does not slip, whose table is not to be seen."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    TABLE.update(env.unwrapped.P)
    env.unwrapped.P = _Elsewhere()
    return env


TABLE: dict[int, Any] = {}


class _Elsewhere:
    """A table that is no dictionary."""

    def __getitem__(self, state: int) -> Any:
        return TABLE[state]


PLANTED = {
    Nondeterministic: "same seed",
    LeakingReward: "reset",
    UnreachableGoal: "unsolvable",
    HiddenState: "hidden state",
    HiddenReward: "hidden reward",
    RewardByTime: "time",
    UselessAction: "same actions",
    OneAction: "one action",
    SharedState: "instances",
    ResetKeeps: "reset",
    Mutated: "changed later",
    MutatedInfo: "changed later",
    Raises: "exception",
    WrongTable: "P",
    TimeTerminates: "time limit",
    StateTruncates: "truncation",
    OutOfSpace: "observation",
    WrongType: "observation",
    WrongShape: "observation",
    NoNumber: "reward",
}
RIGHT = (Grid, Slippery, RightTable, Cart)
