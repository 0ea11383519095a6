"""A task as learners with nets act in it: vectors in place of observations, and rounds of a fixed number of steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from taskspec.backends.jax import State, compile_jax
from taskspec.backends.jax.pack import acted, observed
from taskspec.lang.ir import Const
from taskspec.learners.configurations import Experience
from taskspec.learners.deep.spaces import ActionHead
from taskspec.learners.refusals import cannot_learn
from taskspec.learners.vectors import Vectors
from taskspec.modifiers import modify
from taskspec.task.task import Task

Array = Any


class Walk(NamedTuple):
    """Where the lanes of a learner are: the program's state, what is seen of it (E, D), and whether all is over (E,)."""

    state: State
    seen: Array
    gone: Array


class Played(NamedTuple):
    """Steps, (T, E, ...) where they are in order; `next_seen` is what the step itself led to, whatever begins anew.

    `gone` is 1.0 where the step was taken in a state that absorbs, and `next_gone` where it led to one; `seen` and `taken`
    (actions as vectors) are 0 there. `time` counts the steps before it in its episode. `ended` is 1.0 for the last step of one.
    `weight` is 0.0 for steps that do not count.
    """

    seen: Array
    gone: Array
    time: Array
    action: Array
    taken: Array
    next_seen: Array
    next_gone: Array
    reward: Array
    ended: Array
    weight: Array

    def flat(self) -> Played:
        """One axis in the place of the first two."""
        return Played(*(x.reshape(-1, *x.shape[2:]) for x in self))


Act = Callable[[Array, Array], Array]
"""Actions (E, K) of what is seen (E, D) and of noise (E, size)."""


@dataclass(frozen=True, eq=False)
class World:
    """A task, how it is seen, and how one acts in it."""

    task: Task
    horizon: int | None
    absorbs: bool
    seen: Vectors
    head: ActionHead

    @classmethod
    def of(cls, task: Task, absorb: bool) -> World:
        """`absorb`: as in `Experience`."""
        ends = not (isinstance(task.terminal, Const) and not task.terminal.value)
        absorbs = absorb and ends and task.horizon is not None and task.ending == "terminate"
        program = compile_jax(modify(task, "absorbing") if absorbs else task)
        head = ActionHead(Vectors.of(program.action))
        return cls(program.task, task.horizon, absorbs, Vectors.of(program.observation), head)

    @property
    def may_end(self) -> bool:
        """Whether there are terminal states."""
        return not (isinstance(self.task.terminal, Const) and not self.task.terminal.value)

    @property
    def length(self) -> int:
        """The most steps that an episode may take.

        Raises:
            CannotLearn: where there is no telling.
        """
        if self.horizon is not None:
            return self.horizon
        if isinstance(self.task.terminal, Const) and self.task.terminal.value:
            return 1
        return cannot_learn(f"episodes of {self.task.id} have no horizon", "give the task one")

    def begin(self, key: Array, lanes: int) -> Walk:
        """New episodes."""
        words = jax.random.bits(key, (2, lanes), jnp.uint32)
        program = compile_jax(self.task)
        state, seen = program.reset(words)
        return Walk(state, self._vectors(seen), jnp.zeros(lanes))

    def step(self, walk: Walk, action: Array) -> tuple[Walk, Played]:
        """A step of every lane; an episode that ends begins anew."""
        program = compile_jax(self.task)
        after, result = program.step(walk.state, acted(program.action, self.head.played(action)))
        gone = after.values[-1].astype(jnp.float32) if self.absorbs else jnp.zeros_like(walk.gone)
        next_seen = self._vectors(result.observation) * (1 - gone)[:, None]
        ended = result.terminated | result.truncated
        state, begun = program.again(after, result)
        following = Walk(
            state,
            jnp.where(ended[:, None], self._vectors(begun), next_seen),
            jnp.where(ended, 0.0, gone),
        )
        taken = self.head.vectors.one_hot(action) * (1 - walk.gone)[:, None]
        told = Played(
            walk.seen, walk.gone, walk.state.time, action, taken, next_seen, gone,
            result.reward, ended.astype(jnp.float32), 1 - walk.gone,
        )  # fmt: skip
        return following, told

    def walk(self, walk: Walk, act: Act, key: Array, steps: int) -> tuple[Walk, Played]:
        """So many steps of every lane: (T, E, ...)."""
        noise = self.head.noise(key, (steps, len(walk.seen)))
        return jax.lax.scan(lambda w, n: self.step(w, act(w.seen, n)), walk, noise)

    def _vectors(self, seen: Any) -> Array:
        shown = observed(compile_jax(self.task).observation, seen)
        return self.seen(jnp.moveaxis(shown, -1, 0))


def round_length(world: World, experience: Experience) -> int:
    """The steps of a lane in a round: rounds of whole episodes have room for enough of the longest."""
    if not experience.whole:
        return experience.steps
    return -(-experience.steps // world.length) * world.length


def complete(steps: Played) -> Array:
    """1.0 for steps (T, E) of episodes whose ends are among them; 0.0 for those of the last one where it was cut."""
    return jnp.flip(jax.lax.cummax(jnp.flip(steps.ended, 0), axis=0), 0)
