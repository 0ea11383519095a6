"""`taskspec run`: rolls out a policy and says how it did."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.cli.console import say
from taskspec.cli.failures import misuse
from taskspec.cli.options import Json, Modifiers, Parameters, PolicyName, TaskArgument, Variant

if TYPE_CHECKING:
    from taskspec.cli.rollouts import Episode, Summary, Watch
    from taskspec.envs import Environment
    from taskspec.envs.window import Film
    from taskspec.task.parameters import RenderMode
    from taskspec.task.task import Task

EPISODES = 100
MAX_STEPS = 10_000
RENDER_MODES: dict[str, RenderMode] = {"ansi": "ansi", "human": "human", "gif": "rgb_array", "mp4": "rgb_array"}
"""The render mode of environments for each value of `--render`."""
FILMS = ("gif", "mp4")
GIF_FRAMES = 500
"""A GIF is kept in memory until it is whole, with 1.5 MB a frame."""
BAR_AFTER = 0.3
"""Seconds; what is done sooner needs no progress bar."""


Episodes = Annotated[
    int | None,
    typer.Option(
        "--episodes", "-n", min=1, help=f"How many; {EPISODES} by default, 1 with --render.", show_default=False
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**64 - 1, metavar="SEED", help="Seed of the episodes.")]
Render = Annotated[
    str | None,
    typer.Option(
        "--render", metavar="ansi|human|gif|mp4", help="Show every state: as text, in a window, or as a video.",
        autocompletion=lambda: ("ansi", "human", "gif", "mp4"), show_default=False,
    ),
]  # fmt: skip
FilmFile = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="FILE", help="The video, .gif or .mp4; named after the task by default.", dir_okay=False,
        show_default=False,
    ),
]  # fmt: skip
MaxSteps = Annotated[int, typer.Option("--max-steps", min=1, help="Stop episodes that do not end by themselves.")]


def run(
    task: TaskArgument,
    policy: PolicyName = "random",
    episodes: Episodes = None,
    seed: Seed = 0,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    render: Render = None,
    output: FilmFile = None,
    max_steps: MaxSteps = MAX_STEPS,
    json: Json = False,
) -> None:
    """Roll out a policy and print its results.

    Mean return with its 95 % confidence interval, lengths of episodes, and how they ended; [green]--json[/] adds every
    return, which [cyan]taskspec score[/] reads. [green]--render[/] shows the episodes; [green]-o video.gif[/] records them.
    """
    from taskspec.cli.console import write_records
    from taskspec.targets import beside, tasks_of

    kind = _kind_of(render, output)
    if json and kind == "ansi":
        raise misuse("--json and --render ansi cannot be combined")
    found = tasks_of(task, variant, parameters or [], modifiers or [])
    count = episodes or (1 if kind else EPISODES)
    records = []
    for each in found:
        path = output or Path(f"{each.name}.{kind}")
        path = path if len(found) == 1 else beside(path, each)
        summary, done = _rolled_out(each, policy, seed, count, max_steps, kind, path, quiet=json)
        if json:
            records.append(_record(each, policy, seed, summary, done))
        else:
            _print(each, policy, seed, summary)
        if kind in FILMS:
            say(f"wrote {path}", err=json)
    if json:
        write_records(records)


def _rolled_out(
    task: Task, policy: str, seed: int, count: int, max_steps: int, kind: str | None, path: Path, quiet: bool
) -> tuple[Summary, list[Episode]]:
    """Return episodes, shown as was asked for, and how they went."""
    from taskspec.cli.rollouts import Stopwatch, summarize

    clock = Stopwatch()
    with _watching(kind, path, count) as watch:
        done = list(_episodes(task, policy, seed, count, max_steps, kind, watch, quiet))
    return summarize(done, clock.seconds), done


def _episodes(
    task: Task, policy: str, seed: int, count: int, max_steps: int, kind: str | None, watch: Watch | None, quiet: bool
) -> Iterator[Episode]:
    """Yield episodes, shown step by step or behind a progress bar."""
    from taskspec.cli.policies import policy_for
    from taskspec.cli.rollouts import rollouts
    from taskspec.envs import Environment

    env = Environment(task, render_mode=None if kind is None else RENDER_MODES[kind])
    if kind == "human":
        _warn_unseen()
    try:
        acts = policy_for(policy, env, seed)
        done = rollouts(env, acts, seed, count, max_steps, watch)
        yield from done if kind is not None or quiet else _with_bar(done, count)
    finally:
        env.close()


def _kind_of(render: str | None, output: Path | None) -> str | None:
    """Return how to show episodes, by `--render` or else by the suffix of the file.

    Raises:
        UsageError: for an unknown kind, or one that does not go with the file.
    """
    suffix = None if output is None else output.suffix[1:].lower()
    kind = render or suffix
    if kind is not None and kind not in RENDER_MODES:
        raise misuse(f"--render is one of {', '.join(RENDER_MODES)}, not '{kind}'")
    if output is not None and (kind not in FILMS or suffix != kind):
        raise misuse(f"--output is a video: its name ends in .gif or .mp4, as --render says, not '{output.name}'")
    return kind


@contextmanager
def _watching(kind: str | None, path: Path, episodes: int) -> Iterator[Watch | None]:
    """Yield the function that shows every state; None where nothing is shown."""
    from taskspec.cli.progress import progress
    from taskspec.envs.window import Film

    match kind:
        case "ansi":
            yield lambda env, note, last: say((f"{env.render()}\n  {note}" if note else str(env.render())) + "\n")
        case "mp4":
            with progress(str(path)), Film(path, kind, episodes) as film:
                yield film
        case "gif":
            with progress(str(path)), Film(path, kind, episodes) as film:
                yield lambda env, note, last: _add(film, env, note, last)
        case _:
            yield None


def _add(gif: Film, env: Environment, note: str, last: bool) -> None:
    gif(env, note, last)
    if gif.frames > GIF_FRAMES:
        raise misuse(f"a GIF holds {GIF_FRAMES} steps at most", "make an MP4, or cut the episode with --max-steps")


def _warn_unseen() -> None:
    """Print a note where there is no display, so that no window is shown."""
    from taskspec.base.extras import need

    if need("matplotlib", "figures").get_backend().lower() == "agg":
        say("no display was found, so no window is shown; --render gif makes a film", err=True)


def _with_bar(done: Iterator[Episode], count: int) -> Iterator[Episode]:
    """Yield the same episodes, with a progress bar when they take long."""
    from taskspec.cli.progress import counter

    with counter("episodes", count, BAR_AFTER) as advance:
        for episode in done:
            advance()
            yield episode


# -- output -------------------------------------------------------------------------------------------------------


def _record(task: Task, policy: str, seed: int, summary: Summary, done: list[Episode]) -> dict[str, Any]:
    given = [str(m) for m in task.modifiers]
    about: dict[str, Any] = {
        "id": task.id,
        "parameters": task.values,
        "modifiers": given,
        "policy": policy,
        "seed": seed,
    }
    found = dataclasses.asdict(summary)
    half = found.pop("half")
    interval = None if half is None else [summary.mean - half, summary.mean + half]
    returns = [episode.total for episode in done]
    return {**about, "content_hash": task.content_hash, **found, "confidence_95": interval, "returns": returns}


def _print(task: Task, policy: str, seed: int, summary: Summary) -> None:
    from rich.table import Table

    from taskspec.base.numbers import decimal
    from taskspec.cli.console import VisibleText, console, line
    from taskspec.task.record import settings

    out = console()
    given = f" {settings(task)}".rstrip()
    who = policy if "." in policy else f"{policy} policy"
    out.print(line((task.id, "name"), (given, "value"), (f"  {who}, seed {seed}", "quiet")))
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="quiet")
    table.add_row("  return", _mean(summary))
    if summary.deviation > 0:
        spread = f"{decimal(summary.lowest)} to {decimal(summary.highest)}, standard deviation {summary.deviation:.3g}"
        table.add_row("", VisibleText(spread, style="quiet"))
    if task.discount != 1:
        plain = f"discounted by {task.discount:g} a step; {decimal(summary.undiscounted)} without"
        table.add_row("", VisibleText(plain, style="quiet"))
    table.add_row("  length", f"{decimal(summary.length, 2)} steps")
    table.add_row("  episodes", _endings(summary))
    out.print(table)


def _mean(summary: Summary) -> Any:
    from taskspec.base.numbers import decimal, estimate
    from taskspec.cli.console import line

    if summary.half is None or summary.deviation == 0:
        every = "  in every episode" if summary.episodes > 1 else ""
        return line((decimal(summary.mean), "title"), (every, "quiet"))
    mean, half = estimate(summary.mean, summary.half)
    low, high = (estimate(summary.mean + side * summary.half, summary.half)[0] for side in (-1, 1))
    return line((mean, "title"), f" ± {half}", (f"   95 % CI: {low} to {high}", "quiet"))


def _endings(summary: Summary) -> str:
    from taskspec.cli.rollouts import ENDINGS

    parts = [f"{n:,} {ENDINGS[key]}" for key, n in sorted(summary.endings.items(), key=lambda item: -item[1])]
    return ", ".join(parts)
