"""`taskspec import`: specs of what other tools have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from taskspec.cli import options
from taskspec.cli.console import say, write_output
from taskspec.cli.export import FORMATS

Format = Annotated[str | None, options.formats_option(FORMATS, "Format of the file; by default from its suffix.")]


def import_(
    source: Annotated[str, Argument(metavar="FILE|ENV", help="A file, or the id of an environment with a table P.")],
    format: Format = None,
    output: Annotated[
        Path | None, options.file_option("--output", "-o", help="The spec; standard output by default.")
    ] = None,
    name: Annotated[str | None, Option("--name", help="Name of the task.")] = None,
    horizon: Annotated[
        int | None, Option("--horizon", min=1, help="Steps of an episode, where the source has none.")
    ] = None,
) -> None:
    """Write a spec of a finite task that another tool has: UMB, arrays, or Gymnasium's table P.

    The returns of the source become claims, which [green]taskspec check[/] proves of the spec. Nothing in a file is executed;
    an environment is made by [green]gymnasium.make[/].
    """
    from taskspec.tools.exchange.formats import imported
    from taskspec.tools.exchange.spec_text import spec_text

    task = imported(source, format, name, horizon)
    write_output(spec_text(task), output)
    for remark in task.remarks:
        say(f"  {remark}", err=True)
