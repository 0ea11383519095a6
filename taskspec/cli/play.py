"""`taskspec play`: a person with the keyboard."""

from __future__ import annotations

from typing import Annotated, Any

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import say

FPS = 4  # steps per second while a key is held


def play(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    seed: Annotated[int | None, Option("--seed", help="Seed of the first episode; random if omitted.")] = None,
) -> None:
    """Play a task with the keyboard, in a window; Escape ends it."""
    from taskspec.envs import Environment
    from taskspec.envs.options import seed_of
    from taskspec.tools.play import Warned, legend
    from taskspec.tools.play import play as open_window
    from taskspec.tools.targets import task_of

    built = task_of(task, variant, parameters or [], modifiers or [])
    env = Environment(built, render_mode="rgb_array")
    keys = legend(built)
    width = max(len(key) for key, _ in keys)
    say("\n".join([built.id, *(f"  {key:<{width}}  {name}" for key, name in keys)]))
    rewards: list[float] = []

    def report(before: Any, after: Any, action: Any, reward: float, ended: bool, cut: bool, info: Any) -> None:
        rewards.append(float(reward) * built.discount ** len(rewards))
        if ended or cut:
            how = "terminated" if ended else "truncated"
            say(f"return {sum(rewards):g} in {len(rewards)} steps, {how}")
            rewards.clear()

    try:
        env.reset(seed=seed_of(seed) if seed is not None else None)
        open_window(Warned(env, say) if built.mask else env, report, FPS)
    finally:
        env.close()
