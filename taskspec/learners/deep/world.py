"""A task as learners with nets act in it, and training of all seeds of a block at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.backends.jax import State, compile_jax
from taskspec.backends.jax.program import acted, observed
from taskspec.base.arrays import AnyArray
from taskspec.base.progress import tell
from taskspec.lang.ir import Const
from taskspec.learners.case import LearnerCase, Vectors, cannot_learn
from taskspec.learners.deep.nets import ActionHead
from taskspec.learners.settings import Experience
from taskspec.modifiers import modify
from taskspec.task.task import Task

# ---------- world
# A task as learners with nets act in it: vectors in place of observations, and rounds of a fixed number of steps.


class Walk(NamedTuple):
    """Where the lanes of a learner are: the program's state, what is seen of it (E, D), and whether all is over (E,)."""

    state: State
    seen: AnyArray
    gone: AnyArray


class Played(NamedTuple):
    """Steps, (T, E, ...) where they are in order; `next_seen` is what the step itself led to, whatever begins anew.

    `gone` is 1.0 where the step was taken in a state that absorbs, and `next_gone` where it led to one; `seen` and `taken`
    (actions as vectors) are 0 there. `time` counts the steps before it in its episode. `ended` is 1.0 for the last step of one.
    `weight` is 0.0 for steps that do not count.
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

    def flat(self) -> Played:
        """One axis in the place of the first two."""
        return Played(*(x.reshape(-1, *x.shape[2:]) for x in self))


Act = Callable[[AnyArray, AnyArray], AnyArray]
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

    def begin(self, key: AnyArray, lanes: int) -> Walk:
        """New episodes."""
        words = jax.random.bits(key, (2, lanes), jnp.uint32)
        program = compile_jax(self.task)
        state, seen = program.reset(words)
        return Walk(state, self._vectors(seen), jnp.zeros(lanes))

    def step(self, walk: Walk, action: AnyArray) -> tuple[Walk, Played]:
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

    def walk(self, walk: Walk, act: Act, key: AnyArray, steps: int) -> tuple[Walk, Played]:
        """So many steps of every lane: (T, E, ...)."""
        noise = self.head.noise(key, (steps, len(walk.seen)))
        return jax.lax.scan(lambda w, n: self.step(w, act(w.seen, n)), walk, noise)

    def _vectors(self, seen: Any) -> AnyArray:
        shown = observed(compile_jax(self.task).observation, seen)
        return self.seen(jnp.moveaxis(shown, -1, 0))


def round_length(world: World, experience: Experience) -> int:
    """The steps of a lane in a round: rounds of whole episodes have room for enough of the longest."""
    if not experience.whole:
        return experience.steps
    return -(-experience.steps // world.length) * world.length


def complete(steps: Played) -> AnyArray:
    """1.0 for steps (T, E) of episodes whose ends are among them; 0.0 for those of the last one where it was cut."""
    return jnp.flip(jax.lax.cummax(jnp.flip(steps.ended, 0), axis=0), 0)


# ---------- engine
# Training: all seeds of a block at once, in chunks of rounds.

CHUNKS = 10
"""How often it is told how far training is, and a point of the learning curve is shown; the last, shorter one is one more."""


@dataclass(frozen=True)
class Schedule:
    """How long it is trained.

    Attributes:
        rounds: of training.
        steps: of the environment that a round is counted as.
        comparisons: that are made in a round.
        shown: the policies, one for each seed, of the state of all seeds: a point of the learning curve.
    """

    rounds: int
    steps: int
    comparisons: int = 0
    shown: Callable[[Any], list[Any]] | None = None


def trained(
    case: LearnerCase,
    init: Callable[[AnyArray], Any],
    advance: Callable[[Any, AnyArray, Any], Any],
    plan: Schedule,
    shared: Any = (),
) -> Any:
    """The state of every seed in the end, seeds first.

    Args:
        init: the first state of a seed, of its key.
        advance: the state after a round, of the state, the round's key, and what is `shared`.
        shared: arrays that all seeds read.
    """

    def chunk(state: Any, keys: AnyArray, numbers: AnyArray, shared: Any) -> Any:
        def one(state: Any, key: AnyArray) -> Any:
            body = lambda s, n: (advance(s, jax.random.fold_in(key, n), shared), None)  # noqa: E731
            return jax.lax.scan(body, state, numbers)[0]

        return jax.vmap(one)(state, keys)

    keys = jax.vmap(jax.random.key)(jnp.array(np.array(case.seeds, np.uint64).astype(np.uint32)))
    halves = jax.vmap(jax.random.split)(keys)
    state = jax.jit(jax.vmap(init))(halves[:, 0])
    run, size = jax.jit(chunk, donate_argnums=0), max(1, plan.rounds // CHUNKS)
    for first in range(0, plan.rounds, size):
        tell(f"{case.task.name}: round {first:,} of {plan.rounds:,}, {len(case.seeds)} seeds")
        numbers = np.arange(first, min(first + size, plan.rounds))
        state = run(state, halves[:, 1], numbers, shared)
        case.count(plan.steps * len(numbers), plan.comparisons * len(numbers))
        if plan.shown is not None and numbers[-1] + 1 < plan.rounds:
            case.show(*plan.shown(state))
    return state


def of_seed(state: Any, i: int) -> Any:
    """The part of a state that belongs to one seed, as NumPy arrays."""
    return jax.tree.map(lambda x: np.asarray(x[i]), state)
