"""`taskspec run` and `taskspec play`: episodes of a policy and how it did, and of a person with the keyboard."""

from __future__ import annotations

import dataclasses
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from taskspec.base.columns import Columns
from taskspec.base.display import decimal, estimate
from taskspec.base.limits import tell
from taskspec.base.terminal import VisibleText, console, line
from taskspec.cli import options
from taskspec.cli.console import misuse, say, write_records
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.envs.rollouts import Episode, Summary, Watch
    from taskspec.language.task.parts import RenderMode
    from taskspec.language.task.task import Task

EPISODES = 100
MAX_STEPS = 10_000
RENDER_MODES: dict[str, RenderMode] = {"ansi": "ansi", "human": "human", "gif": "rgb_array", "mp4": "rgb_array"}
"""The render mode of environments for each value of `--render`."""
FILMS = ("gif", "mp4")
GIF_FRAMES = 500  # A GIF is kept in memory until it is whole, with 1.5 MB a frame
FPS = 4  # steps per second while a key is held in `play`

EpisodeCount = Annotated[
    int | None, Option("--episodes", "-n", min=1, help=f"How many; {EPISODES} by default, 1 with --render.")
]
Render = Annotated[
    str | None,
    options.choices_option(
        "--render", allowed=tuple(RENDER_MODES), help="Show every state: as text, in a window, or as a video."
    ),
]
FilmFile = Annotated[
    Path | None, options.file_option("--output", "-o", help="The video, .gif or .mp4; named after the task by default.")
]


def run(
    task: options.TaskArgument,
    policy: options.PolicyName = "random",
    episodes: EpisodeCount = None,
    seed: Annotated[int, options.seed_option("Seed of the episodes.")] = 0,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    render: Render = None,
    output: FilmFile = None,
    max_steps: Annotated[
        int, Option("--max-steps", min=1, help="Stop episodes that do not end by themselves.")
    ] = MAX_STEPS,
    json: options.Json = False,
) -> None:
    """Roll out a policy and print its results.

    Mean return with its 95 % confidence interval, lengths of episodes, and how they ended; [green]--json[/] adds every
    return, which [cyan]taskspec score[/] reads. [green]--render[/] shows the episodes; [green]-o video.gif[/] records them.
    """
    from taskspec.envs.rollouts import summarize
    from taskspec.language.targets import beside, tasks_of

    kind = _kind_of(render, output)
    if json and kind == "ansi":
        raise misuse("--json and --render ansi cannot be combined")
    found = tasks_of(task, variant, parameters or [], modifiers or [])
    count = episodes or (1 if kind else EPISODES)
    records = []
    for each in found:
        path = output or Path(f"{each.name}.{kind}")
        if len(found) > 1:
            path = beside(path, each)
        start = time.perf_counter()
        with _watching(kind, path, count) as watch:
            done = _episodes(each, policy, seed, count, max_steps, kind, watch)
        summary = summarize(done, time.perf_counter() - start)
        if json:
            records.append(_record(each, policy, seed, summary, done))
        else:
            _print(each, policy, seed, summary)
        if kind in FILMS:
            say(f"wrote {path}", err=json)
    if json:
        write_records(records)


def _kind_of(render: str | None, output: Path | None) -> str | None:
    suffix = output.suffix[1:].lower() if output is not None else None
    kind = render or suffix
    if kind is not None:
        options.checked_choice("--render", kind, tuple(RENDER_MODES))
    if output is not None and (kind not in FILMS or suffix != kind):
        raise misuse(f"--output is a video: its name ends in .gif or .mp4, as --render says, not '{output.name}'")
    return kind


def _episodes(
    task: Task, policy: str, seed: int, count: int, max_steps: int, kind: str | None, watch: Watch | None
) -> list[Episode]:
    from taskspec.base.extras import need
    from taskspec.envs import Environment
    from taskspec.envs.rollouts import policy_for, rollouts

    env = Environment(task, render_mode=RENDER_MODES[kind] if kind else None)
    if kind == "human" and need("matplotlib", "figures").get_backend().lower() == "agg":
        say("no display was found, so no window is shown; --render gif makes a film", err=True)
    try:
        running = rollouts(env, policy_for(policy, env, seed), seed, count, max_steps, watch)
        if kind:
            return list(running)
        done = []
        with progress("episodes"):
            for episode in running:
                done.append(episode)
                tell(f"episodes {len(done)}/{count}", len(done) / count)
        return done
    finally:
        env.close()


@contextmanager
def _watching(kind: str | None, path: Path, episodes: int) -> Iterator[Watch | None]:
    """Yield the function that shows every state; None where nothing is shown."""
    from taskspec.envs.recording import Film

    def show(env: Any, note: str, last: bool) -> None:
        remark = f"\n  {note}" if note else ""
        say(f"{env.render()}{remark}\n")

    def film_of_limited_length(env: Any, note: str, last: bool) -> None:
        film(env, note, last)
        if kind == "gif" and film.frames > GIF_FRAMES:
            raise misuse(f"a GIF holds {GIF_FRAMES} steps at most", "make an MP4, or cut the episode with --max-steps")

    match kind:
        case "ansi":
            yield show
        case "gif" | "mp4":
            with progress(str(path)), Film(path, kind, episodes) as film:
                yield film_of_limited_length
        case _:
            yield None


def _record(task: Task, policy: str, seed: int, summary: Summary, done: list[Episode]) -> dict[str, Any]:
    found = dataclasses.asdict(summary)
    half = found.pop("half")
    interval = None
    if half is not None:
        interval = [summary.mean - half, summary.mean + half]
    return {
        "id": task.id, "parameters": task.values, "modifiers": list(map(str, task.modifiers)), "policy": policy, "seed": seed,
        "content_hash": task.content_hash, **found, "confidence_95": interval, "returns": [each.total for each in done],
    }  # fmt: skip


def _print(task: Task, policy: str, seed: int, summary: Summary) -> None:
    from taskspec.envs.rollouts import ENDINGS
    from taskspec.language.task.record import settings

    out = console()
    given = f" {settings(task)}".rstrip()
    who = policy if "." in policy else f"{policy} policy"
    out.print(line((task.id, "name"), (given, "value"), (f"  {who}, seed {seed}", "quiet")))
    table = Columns("", "", styles=("quiet",), fold=(1,))
    table.add_row("  return", _mean(summary))
    if summary.deviation > 0:
        spread = f"{decimal(summary.lowest)} to {decimal(summary.highest)}, standard deviation {summary.deviation:.3g}"
        table.add_row("", VisibleText(spread, style="quiet"))
    if task.discount != 1:
        plain = f"discounted by {task.discount:g} a step; {decimal(summary.undiscounted)} without"
        table.add_row("", VisibleText(plain, style="quiet"))
    table.add_row("  length", f"{decimal(summary.length, 2)} steps")
    endings = Counter(summary.endings).most_common()
    table.add_row("  episodes", ", ".join(f"{n:,} {ENDINGS[key]}" for key, n in endings))
    out.print(table)


def _mean(summary: Summary) -> Any:
    if summary.half is None or summary.deviation == 0:
        every = "  in every episode" * (summary.episodes > 1)
        return line((decimal(summary.mean), "title"), (every, "quiet"))
    mean, half = estimate(summary.mean, summary.half)
    low = estimate(summary.mean - summary.half, summary.half)[0]
    high = estimate(summary.mean + summary.half, summary.half)[0]
    return line((mean, "title"), f" ± {half}", (f"   95 % CI: {low} to {high}", "quiet"))


def play(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    seed: Annotated[int | None, Option("--seed", help="Seed of the first episode; random if omitted.")] = None,
) -> None:
    """Play a task with the keyboard, in a window; Escape ends it."""
    from taskspec.envs import Environment, window
    from taskspec.envs.options import seed_of
    from taskspec.language.targets import task_of

    found = task_of(task, variant, parameters or [], modifiers or [])
    env = Environment(found, render_mode="rgb_array")
    keys = window.legend(found)
    width = max(len(key) for key, _ in keys)
    say("\n".join([found.id, *(f"  {key:<{width}}  {name}" for key, name in keys)]))
    rewards: list[float] = []

    def report(before: Any, after: Any, action: Any, reward: float, ended: bool, cut: bool, info: Any) -> None:
        rewards.append(float(reward) * found.discount ** len(rewards))
        if ended or cut:
            how = "terminated" if ended else "truncated"
            say(f"return {sum(rewards):g} in {len(rewards)} steps, {how}")
            rewards.clear()

    try:
        env.reset(seed=seed_of(seed) if seed is not None else None)
        window.play(window.Warned(env, say) if found.mask else env, report, FPS)
    finally:
        env.close()
