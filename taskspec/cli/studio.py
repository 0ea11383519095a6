"""`taskspec studio`: specs in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from taskspec.base.extras import need
from taskspec.cli.completions import complete_paths
from taskspec.cli.console import say


def studio(
    target: Annotated[
        Path, Argument(metavar="FILE|FOLDER", help="A spec, or a folder of specs.", autocompletion=complete_paths)
    ] = Path(),
    port: Annotated[int, Option("--port", min=0, max=65535, help="The port; 0 takes one that is free.")] = 0,
    browser: Annotated[bool, Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Write specs in the browser: mathematics, figure, exact scores and episodes follow the text.

    It serves a page on this machine alone, until Ctrl-C, and reads and writes no file outside the folder. It needs the extra
    [green]studio[/].
    """
    for package in ("starlette", "uvicorn", "websockets"):
        need(package, "studio", "the studio")
    from taskspec.tools.authoring.scaffold import SCAFFOLD
    from taskspec.tools.studio.server import Studio, run

    def ready(address: str) -> None:
        say(f"{address}\nCtrl-C ends the studio.")
        if browser:
            webbrowser.open(address)

    run(Studio.of(target, port, SCAFFOLD), ready)
