"""`taskspec figure`: the figure of a task."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import say

OVERLAYS = ("values", "policy", "expert", "occupancy")
FigureFile = Annotated[
    Path | None,
    Option(
        "--output", "-o", metavar="FILE", dir_okay=False,
        help="Output file, ending in .svg, .tex, .png or .pdf; by default an SVG file with the task's name.",
    ),
]  # fmt: skip
Overlays = Annotated[
    list[str] | None,
    options.choices_option(
        "--overlay", allowed=OVERLAYS, help="Lay exact results over the states; may be repeated, or given with commas."
    ),
]


def figure(
    task: options.TaskArgument,
    output: FigureFile = None,
    overlays: Overlays = None,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
) -> None:
    """Draw the figure of a task, as SVG, TikZ, PNG or PDF.

    The states can be overlaid with their optimal values, the optimal or the expert's actions, and how often they are visited.
    """
    from taskspec.show import pages
    from taskspec.show.pages.page import anchor
    from taskspec.tools.targets import tasks_of, with_files

    tasks = tasks_of(task, variant, parameters or [], modifiers or [])
    if output is None:
        output = Path(f"{anchor(tasks[0].name)}.svg")
    wanted = options.checked_choices("--overlay", overlays, OVERLAYS)
    for each, place in with_files(tasks, output):
        say(f"wrote {pages.figure(each, place, wanted)}")
