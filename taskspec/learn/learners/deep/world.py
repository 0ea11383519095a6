"""A task as learners with nets act in it, and the training of all seeds of a block at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.base.arrays import AnyArray
from taskspec.base.limits import tell
from taskspec.language.modifiers import modify
from taskspec.language.task.task import Task
from taskspec.learn.learners.deep.nets import ActionHead
from taskspec.learn.learners.interface import CannotLearn, LearnerCase, Vectors
from taskspec.learn.learners.paper_settings import Experience
from taskspec.programs.jax import State, compile_jax
from taskspec.programs.jax.program import acted, observed


class RolloutState(NamedTuple):
    """The lanes of a learner: the program's state, observations (E, D), and 1.0 in absorbing states (E,)."""

    state: State
    seen: AnyArray
    gone: AnyArray


class StepBatch(NamedTuple):
    """Steps, (T, E, ...) in order; `next_seen` is the observation after the step, before a reset.

    `gone` is 1.0 for steps taken in an absorbing state, and `next_gone` for those that led to one; `seen` and `taken`
    (actions as vectors) are 0 there. `time` counts the earlier steps of the episode. `ended` is 1.0 for the last step of an
    episode. `weight` is 0.0 for steps that do not count.
    """

    seen: AnyArray
    gone: AnyArray
    time: AnyArray
    action: AnyArray
    taken: AnyArray
    next_seen: AnyArray
    next_gone: AnyArray
    reward: AnyArray
    ended: AnyArray
    weight: AnyArray

    def flat(self) -> StepBatch:
        """Return the steps with the first two axes joined."""
        return StepBatch(*(x.reshape(-1, *x.shape[2:]) for x in self))


FORBIDDEN = 1e9
"""What the noise of an illegal action is lowered by."""
Act = Callable[[AnyArray, AnyArray], AnyArray]
"""From observations (E, D) and noise (E, size) to actions (E, K)."""


def declares_bounds(task: Task) -> bool:
    """Return whether the spec gives bounds to every component of the observation; others are derived, and may be far too wide."""
    data = task.source.merged.data
    state = data.get("state") or {}
    observed = data.get("observation") or {}
    for component in task.observation.components:
        entry = observed.get(component.name, component.name)
        if isinstance(entry, str):
            entry = state.get(entry)
        if not isinstance(entry, Mapping) or entry.get("low") is None or entry.get("high") is None:
            return False
    return True


@dataclass(frozen=True, eq=False)
class World:
    """A task with its observations as vectors and its actions as distributions."""

    task: Task
    horizon: int | None
    absorbs: bool
    seen: Vectors
    head: ActionHead

    @classmethod
    def of(cls, task: Task, absorb: bool) -> World:
        """Return the world of a task; `absorb` as in `Experience`."""
        absorbs = absorb and not task.process.never_ends and task.horizon is not None and task.ending == "terminate"
        program = compile_jax(modify(task, "absorbing") if absorbs else task)
        head = ActionHead(Vectors.of(program.action))
        seen = Vectors.of(program.observation)
        if not declares_bounds(program.task):
            seen = seen.unbounded()
        return cls(program.task, task.horizon, absorbs, seen, head)

    @property
    def may_end(self) -> bool:
        """True where there are terminal states."""
        return not self.task.process.never_ends

    @property
    def length(self) -> int:
        """The largest number of steps of an episode."""
        if self.horizon is not None:
            return self.horizon
        if self.task.process.always_ends:
            return 1
        raise CannotLearn(f"episodes of {self.task.id} have no horizon", "give the task one")

    def begin(self, key: AnyArray, lanes: int) -> RolloutState:
        """Begin an episode in every lane."""
        words = jax.random.bits(key, (2, lanes), jnp.uint32)
        program = compile_jax(self.task)
        state, seen = program.reset(words)
        return RolloutState(state, self._vectors(seen), jnp.zeros(lanes))

    def step(self, walk: RolloutState, action: AnyArray) -> tuple[RolloutState, StepBatch]:
        """Take a step in every lane; lanes whose episodes end are reset."""
        program = compile_jax(self.task)
        after, result = program.step(walk.state, acted(program.action, self.head.program_action(action)))
        gone = jnp.zeros_like(walk.gone)
        if self.absorbs:
            gone = after.values[-1].astype(jnp.float32)
        next_seen = self._vectors(result.observation) * (1 - gone)[:, None]
        ended = result.terminated | result.truncated
        state, first_seen = program.again(after, result)
        following = RolloutState(
            state, jnp.where(ended[:, None], self._vectors(first_seen), next_seen), jnp.where(ended, 0.0, gone)
        )
        taken = self.head.vectors.one_hot(action) * (1 - walk.gone)[:, None]
        step = StepBatch(
            walk.seen, walk.gone, walk.state.time, action, taken, next_seen, gone,
            result.reward, ended.astype(jnp.float32), 1 - walk.gone,
        )  # fmt: skip
        return following, step

    def rollout(self, walk: RolloutState, act: Act, key: AnyArray, steps: int) -> tuple[RolloutState, StepBatch]:
        """Take steps in every lane: (T, E, ...)."""
        noise = self.head.noise(key, (steps, len(walk.seen)))
        return jax.lax.scan(lambda w, n: self.step(w, act(w.seen, self.allowed(w, n))), walk, noise)

    def allowed(self, walk: RolloutState, noise: AnyArray) -> AnyArray:
        """Return the noise of actions (E, size), such that no illegal one is sampled."""
        if not self.task.mask:
            return noise
        return jnp.where(compile_jax(self.task).mask(walk.state).T, noise, noise - FORBIDDEN)

    def _vectors(self, seen: Any) -> AnyArray:
        shown = observed(compile_jax(self.task).observation, seen)
        return self.seen(jnp.moveaxis(shown, -1, 0))


def round_length(world: World, experience: Experience) -> int:
    """Return the steps of a lane in a round; rounds of whole episodes are long enough for the longest."""
    if not experience.whole:
        return experience.steps
    return -(-experience.steps // world.length) * world.length


def in_complete_episode(steps: StepBatch) -> AnyArray:
    """Return 1.0 for steps (T, E) of episodes that end within them, 0.0 for those of a last one that is cut off."""
    return jnp.flip(jax.lax.cummax(jnp.flip(steps.ended, 0), axis=0), 0)


def in_first_episode(steps: StepBatch) -> AnyArray:
    """Return 1.0 for steps (T, E) of the first episode of a lane, 0.0 for those after its end."""
    ongoing = jnp.concatenate([jnp.ones_like(steps.ended[:1]), 1 - steps.ended[:-1]])
    return jnp.cumprod(ongoing, axis=0)


def discounted_rewards(task: Task, steps: StepBatch, live: AnyArray) -> AnyArray:
    """Return the rewards (T, E) of live steps, discounted from the start of their episodes."""
    return steps.reward * live * jnp.float32(task.discount) ** steps.time


# -- training -----------------------------------------------------------------------------------------------------

CHUNKS = 10
"""Chunks of rounds; progress and a point of the learning curve are reported after each."""


@dataclass(frozen=True)
class Schedule:
    """The length of a training.

    Attributes:
        steps, comparisons: counted for a round.
        shown: from the state of all seeds to a policy for each: a point of the learning curve.
    """

    rounds: int
    steps: int
    comparisons: int = 0
    shown: Callable[[Any], list[Any]] | None = None


def train_seeds(
    case: LearnerCase, init: Callable[[AnyArray], Any], advance: Callable[[Any, AnyArray, Any], Any], plan: Schedule,
    shared: Any = (),
) -> Any:  # fmt: skip
    """Train all seeds and return their last states, seeds first.

    Args:
        init: from a seed's key to its first state.
        advance: from a state, the round's key and `shared` to the state after the round.
        shared: arrays that all seeds read.
    """

    def chunk(state: Any, keys: AnyArray, first: AnyArray, end: AnyArray, shared: Any) -> Any:
        def one(state: Any, key: AnyArray) -> Any:
            body = lambda n, s: advance(s, jax.random.fold_in(key, n), shared)  # noqa: E731
            return jax.lax.fori_loop(first, end, body, state)

        return jax.vmap(one)(state, keys)

    keys = jax.vmap(jax.random.key)(jnp.array(np.array(case.seeds, np.uint64).astype(np.uint32)))
    halves = jax.vmap(jax.random.split)(keys)
    state = jax.jit(jax.vmap(init))(halves[:, 0])
    run = jax.jit(chunk, donate_argnums=0)
    size = max(1, plan.rounds // CHUNKS)
    for first in range(0, plan.rounds, size):
        tell(f"{case.task.name}: round {first:,} of {plan.rounds:,}, {len(case.seeds)} seeds")
        end = min(first + size, plan.rounds)
        state = run(state, halves[:, 1], first, end, shared)
        case.count(plan.steps * (end - first), plan.comparisons * (end - first))
        if plan.shown is not None and end < plan.rounds:
            case.show(*plan.shown(state))
    return state


def seed_slice(state: Any, i: int) -> Any:
    """Return one seed's part of a state, as NumPy arrays."""
    return jax.tree.map(lambda x: np.asarray(x[i]), state)
