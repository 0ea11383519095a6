"""Programs that step many environments: their memory, how actions are read, which are legal, and when episodes begin.

Arrays have their features first and the lanes last: each feature of all lanes is together, which is what array code and
vector units want. Results have the lanes first, as Gymnasium expects, without a copy: a view of the same memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from taskspec.base.arrays import Array
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.types import Kind
from taskspec.language.task.legal import action_mask
from taskspec.language.task.parts import are_finite, counts_of
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task


@dataclass(frozen=True)
class Values:
    """Gymnasium values of all lanes: an array (*shape, lanes) for every part of the layout."""

    layout: SpaceLayout
    parts: tuple[Array, ...]

    @classmethod
    def empty(cls, layout: SpaceLayout, lanes: int) -> Values:
        """Zeros of a layout."""
        parts = []
        for part in layout.parts:
            dtype = np.int64 if part.is_whole else np.float32
            parts.append(np.zeros((*part.shape, lanes), dtype))
        return cls(layout, tuple(parts))

    def view(self, copy: bool = False) -> Any:
        """View the values with the lanes first, as Gymnasium's batched space has them: in this memory, or copied."""
        shown = []
        for part in self.parts:
            array = part.copy() if copy else part
            # `moveaxis` would take longer than the rest of a step of few lanes.
            shown.append(array.T if array.ndim <= 2 else array.transpose(-1, *range(array.ndim - 1)))
        if not self.layout.is_dict:
            return shown[0]
        return {part.name: array for part, array in zip(self.layout.parts, shown, strict=True)}

    def segments(self) -> list[Array]:
        """Arrays of the layout's segments, in this memory: (*shape, lanes) of the component, or a row a value."""
        arrays = []
        for segment in self.layout.segments:
            raw = self.parts[segment.part]
            lanes = raw.shape[-1]
            rows = raw.reshape(-1, lanes)[segment.first : segment.first + segment.size]
            if segment.values is None:
                rows = rows.reshape(*self.layout.components[segment.component].type.shape, lanes)
            arrays.append(rows)
        return arrays


@dataclass
class Buffers:
    """Everything that a vector environment keeps, for lanes 0 to N - 1.

    Attributes:
        seeds: uint64 (N,), the seed of each lane.
        steps: uint32 (N,), steps taken since the lane was seeded, modulo 2**32: counts the draws of steps.
        episodes: uint32 (N,), episodes begun since then: counts the draws of resets.
        time: int64 (N,), steps taken in the present episode.
        running: bool (N,), whether an episode is under way.
        state: one array (*shape, N) for every state component: bool, int64 or float64.
        seen, final: observations now, and those with which episodes ended in this step.
        reward: float64 (N,). terminated, truncated, ended: bool (N,).
        measures: float64 (N,) each, of the last step; of lanes that have taken none, any number.
    """

    seeds: Array
    steps: Array
    episodes: Array
    time: Array
    running: Array
    state: tuple[Array, ...]
    seen: Values
    final: Values
    reward: Array
    terminated: Array
    truncated: Array
    ended: Array
    measures: tuple[Array, ...]

    @classmethod
    def of(cls, task: Task, layout: SpaceLayout, lanes: int) -> Buffers:
        """Zeros, for a task whose observations have the given layout."""
        return cls(
            seeds=np.zeros(lanes, np.uint64), steps=np.zeros(lanes, np.uint32), episodes=np.zeros(lanes, np.uint32),
            time=np.zeros(lanes, np.int64), running=np.zeros(lanes, np.bool_),
            state=tuple(np.zeros((*c.type.shape, lanes), DTYPES[c.type.kind]) for c in task.state),
            seen=Values.empty(layout, lanes), final=Values.empty(layout, lanes),
            reward=np.zeros(lanes, np.float64), terminated=np.zeros(lanes, np.bool_),
            truncated=np.zeros(lanes, np.bool_), ended=np.zeros(lanes, np.bool_),
            measures=tuple(np.zeros(lanes) for _ in task.process.measures),
        )  # fmt: skip

    @property
    def lanes(self) -> int:
        return len(self.seeds)

    def arrays(self) -> list[Array]:
        """List all arrays, in a fixed order."""
        listed: list[Array] = []
        self._mapped(listed.append)
        return listed

    def part(self, lanes: slice) -> Buffers:
        """Slice a range of the lanes, sharing memory."""
        return Buffers(**self._mapped(lambda array: array[..., lanes]))

    def _mapped(self, function: Callable[[Array], Any]) -> dict[str, Any]:
        mapped: dict[str, Any] = {}
        for name, held in vars(self).items():
            if isinstance(held, Values):
                mapped[name] = Values(held.layout, tuple(map(function, held.parts)))
            elif isinstance(held, tuple):
                mapped[name] = tuple(map(function, held))
            else:
                mapped[name] = function(held)
        return mapped


class BadActionError(Exception):
    """Actions that are not in the batched action space; the environment layer raises Gymnasium's error."""


Reader = Callable[[Any], tuple[Array, ...]]
"""From a batch of actions to an array (*shape, lanes) for every action component: bool, int64 or float64."""


def action_array(actions: Any, layout: SpaceLayout, lanes: int) -> Array:
    """Convert actions to an array (lanes, *shape); reals are refused for whole numbers, as `MultiDiscrete.contains` does.

    Raises:
        BadActionError: wrong shape or kind of numbers.
    """
    (part,) = layout.parts
    array = np.asarray(actions)
    if array.shape != (lanes, *part.shape) or array.dtype.kind not in ("iub" if part.is_whole else "iubf"):
        raise BadActionError
    return array


def action_reader(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    """Make the reader of a task's actions for a number of lanes; it raises `BadActionError`."""
    (part,) = layout.parts
    if part.shape or not part.is_whole:
        return _array_reader(task, layout, lanes)
    ((low, high),) = layout.ends
    is_bool = task.action[0].type.kind is Kind.BOOL
    smallest = np.minimum.reduce
    largest = np.maximum.reduce

    def read(actions: Any) -> tuple[Array, ...]:
        """Read one whole number for each lane, with as few calls of NumPy as possible."""
        array = action_array(actions, layout, lanes).astype(np.int64, copy=False)
        if low == 0 and largest(array.view(np.uint64)) > high:  # unsigned, negative numbers are huge
            raise BadActionError
        if low != 0 and (smallest(array) < low or largest(array) > high):
            raise BadActionError
        if is_bool:
            return (array != 0,)
        return (array,)

    return read


def _array_reader(task: Task, layout: SpaceLayout, lanes: int) -> Reader:
    low, high = np.array(layout.ends).T[..., None]
    dtype = np.int64 if layout.parts[0].is_whole else np.float64
    segments = list(zip(task.action, layout.segments, strict=True))
    unsigned = dtype is np.int64 and not low.any()  # as such, negative numbers are huge: one comparison is enough
    largest = high
    if unsigned:
        largest = high.astype(np.uint64)

    def read(actions: Any) -> tuple[Array, ...]:
        rows = action_array(actions, layout, lanes).reshape(lanes, -1).T.astype(dtype, order="C")
        if unsigned:
            inside = not np.greater(rows.view(np.uint64), largest).any()
        else:
            inside = np.greater_equal(rows, low).all() and np.less_equal(rows, high).all()
        if not inside:
            raise BadActionError
        components = []
        for c, segment in segments:
            values = rows[segment.first : segment.first + segment.size]
            if segment.starts:
                values = values + np.array(segment.starts)[:, None]
            if values.dtype.kind == "f" and c.type.kind is not Kind.REAL:  # every point of a box is an action
                values = np.rint(values)
            if c.type.kind is Kind.BOOL:
                values = values != 0
            components.append(values.astype(DTYPES[c.type.kind], copy=False).reshape(*c.type.shape, lanes))
        return tuple(components)

    return read


# -- legal actions --------------------------------------------------------------------------------------------------

LOOKED_UP = 500_000
"""Elements of a table of the masks of all states, at most."""


class Masks:
    """The legal actions of all lanes: looked up where there are few states, which takes a tenth of the time, else worked out.

    Args:
        task: a task with `legal`.
        state: the arrays (*shape, N) of the components, which hold the present state.
    """

    def __init__(self, task: Task, state: Sequence[Array]) -> None:
        self._task = task
        self._state = {c.name: part for c, part in zip(task.state, state, strict=True)}
        self._table: Array | None = None
        if not are_finite(task.state):
            return
        counts = counts_of(task.state)
        number = math.prod(counts)
        if number * task.action_layout.counts[0] > LOOKED_UP:
            return
        rows = np.indices(counts).reshape(len(counts), number)  # of all states, the last element fastest
        strides = np.array([math.prod(counts[k + 1 :]) for k in range(len(counts))], np.int64)
        self._strides = []
        self._lowest = 0  # what the lowest state would be numbered without its lows
        every = {}
        first = 0
        for c in task.state:
            mine = slice(first, first + c.type.size)
            low = np.array(c.low, np.int64)
            values = rows[mine] + low[:, None]
            every[c.name] = values.astype(DTYPES[c.type.kind]).reshape(*c.type.shape, number)
            self._strides.append(strides[mine])
            self._lowest += int(low @ strides[mine])
            first += c.type.size
        self._table = np.ascontiguousarray(action_mask(task, every).T, np.int8)

    def __call__(self) -> Array:
        if self._table is None:
            return action_mask(self._task, self._state).T.astype(np.int8)
        numbers: Array = np.array(-self._lowest)
        for strides, part in zip(self._strides, self._state.values(), strict=True):
            elements = part.reshape(len(strides), part.shape[-1]).astype(np.int64, copy=False)
            numbers = numbers + strides @ elements
        return self._table.take(numbers, axis=0)


# -- the interface --------------------------------------------------------------------------------------------------

Mode = Literal["next_step", "same_step", "disabled"]
"""When an environment whose episode has ended is reset: by the next step, by the same step, by the caller only."""


class LanesNotRunningError(Exception):
    """A step before the first reset, or (mode "disabled") of lanes whose episodes have ended."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a vector program; `num_threads` matters to Numba only."""

    mode: Mode = "next_step"
    num_threads: int = 1


class Engine(Protocol):
    """The environments of one task on one backend, made of a task, a number of lanes, and `Options`.

    Lane i draws from the stream of `buffers.seeds[i]`: it has the episodes and steps of a scalar environment with
    that seed, number for number.
    """

    buffers: Buffers
    observation: SpaceLayout
    action: SpaceLayout
    source: str

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        """Restart the streams of some lanes (indices; None: all) with seeds, uint64, one for each."""

    def reset(self, lanes: Array | None = None) -> None:
        """Begin an episode in some lanes (indices; None: all)."""

    def step(self, actions: Any) -> int:
        """Take a step in every lane; return the number of lanes whose episodes ended in it.

        Raises:
            BadActionError: an action is not in the action space; nothing has changed.
            LanesNotRunningError: an episode is over, or none has begun; nothing has changed.
        """

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        """Put lanes into given states, (*shape, k) for each component; what is observed stays as it was."""


# -- when lanes may step and when they are reset ------------------------------------------------------------------
#
# - `same_step`: a lane whose episode ends is reset in the same step. The last observation is in `Buffers.final`, the first one
#   of the next episode in `Buffers.seen`, and the flags say that an episode ended.
# - `next_step`: it is reset by the next step, which ignores the action, is not counted, has reward 0 and sets no flag.
# - `disabled`: it is reset by the caller; until then no lane may step.
#
# A reset takes the words of the lane's next episode, and a step the words of its next step (`Buffers.episodes`, `Buffers.steps`).


@dataclass
class Episodes:
    """The progress of episodes in some buffers.

    `ready` says whether a step may be taken, and `over` how many episodes have ended without a reset.
    """

    buffers: Buffers
    mode: Mode
    begun: bool = False
    ready: bool = False  # an attribute, since a step of few lanes takes a microsecond
    over: int = 0

    def seed(self, seeds: Array, lanes: Array | None) -> None:
        """Restart the streams of some lanes (indices; None: all)."""
        b = self.buffers
        chosen = slice(None) if lanes is None else lanes
        b.seeds[chosen] = seeds
        b.steps[chosen] = 0
        b.episodes[chosen] = 0

    def reset(self, lanes: Array) -> None:
        """Record that some lanes (indices, or a flag for each) have begun an episode."""
        b = self.buffers
        b.running[lanes] = True
        b.terminated[lanes] = b.truncated[lanes] = b.ended[lanes] = False
        self.begun = self.begun or bool(b.running.all())
        self.step(int(np.count_nonzero(b.ended)))

    def step(self, ended: int) -> int:
        """Record a step in which `ended` episodes ended; return their number."""
        if self.mode == "same_step":
            self.over = 0
        else:
            self.over = ended
        self.ready = self.begun and (self.mode != "disabled" or not self.over)
        return ended

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        """Set the states of lanes (indices), (*shape, k) for each component."""
        for held, new in zip(self.buffers.state, values, strict=True):
            held[..., lanes] = new
