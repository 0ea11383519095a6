"""`taskspec play`: a person in the place of a policy, with the keyboard."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.cli.console import say
from taskspec.cli.options import Modifiers, Parameters, TaskArgument, Variant

if TYPE_CHECKING:
    from taskspec.task.task import Task


def play(
    task: TaskArgument,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Seed of the first episode; random if omitted.")] = None,
    fps: Annotated[int, typer.Option("--fps", min=1, help="Steps per second while a key is held.")] = 4,
) -> None:
    """Play a task with the keyboard, in a window; Escape ends it."""
    from taskspec.envs import Environment, window
    from taskspec.envs.options import seed_of
    from taskspec.targets import task_of

    found = task_of(task, variant, parameters or [], modifiers or [])
    env = Environment(found, render_mode="rgb_array")
    _print_keys(found)
    try:
        env.reset(seed=None if seed is None else seed_of(seed))
        window.play(env, _Teller(found), fps)
    finally:
        env.close()


def _print_keys(task: Task) -> None:
    from taskspec.envs import window

    width = max(len(key) for key, _ in window.legend(task))
    say("\n".join([task.id, *(f"  {key:<{width}}  {name}" for key, name in window.legend(task))]))


class _Teller:
    """Says how every episode ended."""

    def __init__(self, task: Task) -> None:
        self.discount = task.discount
        self.factor = 1.0
        self.total = 0.0
        self.steps = 0

    def __call__(self, before: Any, after: Any, action: Any, reward: float, ended: bool, cut: bool, info: Any) -> None:
        self.total += self.factor * float(reward)
        self.factor *= self.discount
        self.steps += 1
        if ended or cut:
            say(f"return {self.total:g} in {self.steps} steps, {'terminated' if ended else 'truncated'}")
            self.total = 0.0
            self.steps = 0
            self.factor = 1.0
