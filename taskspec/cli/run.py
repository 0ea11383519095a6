"""`taskspec run`: episodes of a policy, and how it did."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import misuse, progress, say, write_records

if TYPE_CHECKING:
    from taskspec.language.task.parts import RenderMode

EPISODES = 100
MAX_STEPS = 10_000
RENDER_MODES: dict[str, RenderMode] = {"ansi": "ansi", "human": "human", "gif": "rgb_array", "mp4": "rgb_array"}
"""The render mode of environments for each value of `--render`."""
FILMS = ("gif", "mp4")

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
    from taskspec.envs.window import has_display
    from taskspec.show.figures.recording import watching
    from taskspec.show.terminal.rollouts import episodes_of, print_summary, summarize, summary_data
    from taskspec.tools.targets import tasks_of, with_files

    kind = _kind_of(render, output)
    if kind == "human" and not has_display():
        say("no display was found, so no window is shown; --render gif makes a film", err=True)
    if json and kind == "ansi":
        raise misuse("--json and --render ansi cannot be combined")
    tasks = tasks_of(task, variant, parameters or [], modifiers or [])
    count = episodes or (1 if kind else EPISODES)
    records = []
    for each, path in with_files(tasks, output or Path(f"{tasks[0].name}.{kind}")):
        start = time.perf_counter()
        with progress("episodes"), watching(kind, path, count, say) as watch:
            done = episodes_of(each, policy, seed, count, max_steps, RENDER_MODES.get(kind or ""), watch)
        summary = summarize(done, time.perf_counter() - start)
        if json:
            records.append(summary_data(each, policy, seed, summary, done))
        else:
            print_summary(each, policy, seed, summary)
        if kind in FILMS:
            say(f"wrote {path}", err=json)
    if json:
        write_records(records)


def _kind_of(render: str | None, output: Path | None) -> str | None:
    suffix = None
    if output is not None:
        suffix = output.suffix[1:].lower()
    kind = render or suffix
    if kind is not None:
        options.checked_choice("--render", kind, tuple(RENDER_MODES))
    if output is not None and (kind not in FILMS or suffix != kind):
        raise misuse(f"--output is a video: its name ends in .gif or .mp4, as --render says, not '{output.name}'")
    return kind
