"""`taskspec freeze`: an instance as a spec of tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import say, write_output


def freeze(
    task: options.TaskArgument,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    seed: Annotated[int | None, Option("--seed", min=0, metavar="SEED", help="Seed of the instance.")] = None,
    output: Annotated[
        Path | None, options.file_option("--output", "-o", help="The spec; standard output by default.")
    ] = None,
) -> None:
    """Write a finite task as a spec of tables, without draws of constants.

    States that no episode visits are left out; exact returns become claims.
    """
    from taskspec.tools.exchange.freezing import freeze as frozen
    from taskspec.tools.exchange.spec_text import spec_text
    from taskspec.tools.targets import task_of

    given = list(parameters or [])
    if seed is not None:
        given.append(f"instance_seed={seed}")
    tables = frozen(task_of(task, variant, given, modifiers or []))
    write_output(spec_text(tables), output)
    for remark in tables.remarks:
        say(f"  {remark}", err=True)
