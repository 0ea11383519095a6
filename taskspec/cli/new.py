"""`taskspec new`: a spec to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from taskspec.cli.console import say


def new(
    name: Annotated[
        str,
        Argument(metavar="NAME|FILE", help="Name of the task, such as RiskyPath, or a file, such as risky_path.yaml."),
    ],
    output: Annotated[
        Path | None, Option("--output", "-o", metavar="FILE", help="Where to write it; risky_path.yaml by default.")
    ] = None,
) -> None:
    """Write a commented spec to start from.

    It passes [cyan]taskspec check[/] as it is, and shows every section that most tasks need.
    """
    from taskspec.tools.authoring.scaffold import write_scaffold

    path = write_scaffold(name, output)
    say(f"wrote {path}\n")
    for command in (f"check {path}", f"show {path}", f"run {path} --policy expert --render ansi"):
        say(f"  taskspec {command}")
