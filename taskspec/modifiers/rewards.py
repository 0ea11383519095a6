"""Modifiers of rewards: scaled, shifted, noisy, shaped."""

from __future__ import annotations

from dataclasses import replace

from taskspec.lang.ir import Const
from taskspec.lang.types import Kind
from taskspec.modifiers.core import after_step, last, noisy, paying, step_draws
from taskspec.modifiers.entry import STD, Arguments, ModifierArgument, ModifierEntry, always, as_well
from taskspec.modifiers.later import TABLE as LATER
from taskspec.modifiers.potential import potential
from taskspec.task.task import Component, Task


def _changed(task: Task, op: str, given: float) -> Task:
    """An operation on the reward and on what absorbing states pay."""
    b = task.builder
    reward, absorbing = (b.apply(op, b.scalar(float(given)), n) for n in (task.reward, task.absorbing_reward))
    return paying(replace(task, absorbing_reward=absorbing), reward)


def _noise(task: Task, given: Arguments) -> Task:
    with step_draws(task) as with_draws:
        reward = noisy(task.builder, task.reward, given["std"])
    return with_draws(paying(task, reward))


def _shaped(task: Task, given: Arguments) -> Task:
    b, here = task.builder, potential(task, given["of"])
    there = b.apply("where", last(task), b.scalar(0.0), after_step(task, here))
    gained = b.apply("sub", b.apply("mul", b.scalar(float(task.discount)), there), here)
    return paying(task, b.apply("add", task.reward, gained))


def _some_state(task: Task) -> str:
    """A number that depends on the state."""
    c: Component = task.state[0]
    if not c.type.is_scalar:
        return f"sum({c.name})"
    if c.domain is not None:
        return f"{c.name} == {c.domain.labels[-1]}"
    return f"1 if {c.name} else 0" if c.type.kind is Kind.BOOL else c.name


def lasts(task: Task) -> bool:
    """Whether all episodes are equally long."""
    return isinstance(task.terminal, Const) and not task.terminal.value and task.horizon is not None


TABLE = (
    *LATER,
    ModifierEntry(
        "reward_scale", (ModifierArgument("factor", "real", "what rewards are multiplied by", sample=lambda task: 2),),
        "Rewards are multiplied by a number.",
        lambda task, given: _changed(task, "mul", given["factor"]),
        lambda task, given: f"every reward is multiplied by ${given['factor']:g}$",
        keeps="best policies", when=lambda task, given: given["factor"] > 0, condition="the factor is above 0",
        abstraction=as_well,
    ),
    ModifierEntry(
        "reward_shift", (ModifierArgument("by", "real", "what is added", sample=lambda task: -0.5),),
        "A number is added to the reward of every step.",
        lambda task, given: _changed(task, "add", given["by"]),
        lambda task, given: f"${given['by']:g}$ is added to the reward of every step",
        keeps="best policies", when=lambda task, given: lasts(task), condition="all episodes are equally long",
        abstraction=as_well,
    ),
    ModifierEntry(
        "reward_noise", (STD,), "Normal noise is added to every reward.",
        _noise,
        lambda task, given: rf"noise from $\mathcal{{N}}(0, {given['std']:g}^2)$ is added to every reward",
        keeps="every policy's return", observed=always, abstraction=as_well,
    ),
    ModifierEntry(
        "potential", (
            ModifierArgument("of", "expression", "the potential of a state, in the task language", sample=_some_state),
        ),
        "The increase of a potential is added to each reward (Ng, Harada and Russell, 1999); the end has potential 0.",
        _shaped,
        lambda task, given: rf"$\gamma\, \Phi(s') - \Phi(s)$ is added to the reward, where $\Phi$ is `{given['of']}`, and 0 when "
        "the episode has ended",
        time_limit="read", keeps="best policies",
    ),
)  # fmt: skip
