"""`taskspec bench`: how fast, beside what others offer. Each part is a module of its own, imported when it is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated

import typer

from taskspec.cli.options import Json

PARTS = {
    "seals": ("taskspec.cli.bench_seals", "scalar environments against seals 0.2.1"),
    "exact": ("taskspec.cli.bench_exact", "exact models of large grids, beside Storm and plain loops"),
    "vector": ("taskspec.cli.bench_vector", "vector environments on every backend, beside others"),
}
"""Parts by name: the module, with a function `bench(tasks, rounds, seconds, json)` that gives whether targets are met."""


def complete_parts(incomplete: str) -> list[tuple[str, str]]:
    return [(name, doc) for name, (_, doc) in PARTS.items() if name.startswith(incomplete)]


Part = Annotated[
    str,
    typer.Argument(metavar="|".join(PARTS), help="What to measure.", autocompletion=complete_parts),
]
Only = Annotated[
    list[str] | None, typer.Option("--task", "-t", metavar="NAME", help="Only this task; may be repeated.")
]
Rounds = Annotated[int, typer.Option("--rounds", min=1, help="How often each side is measured, taking turns.")]
Seconds = Annotated[float, typer.Option("--seconds", min=0.001, help="How long a measurement takes, about.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with status 1 when a target is missed.")]


def bench(
    part: Part = "seals",
    only: Only = None,
    rounds: Rounds = 9,
    seconds: Seconds = 0.1,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Measure steps per second, ours beside others'.

    Both sides run in one process and take turns, so that a slow moment of the machine meets both.
    """
    from taskspec.cli.targets import checked_choice

    module, _ = PARTS[checked_choice("what to measure", part, list(PARTS))]
    met = import_module(module).bench(only or [], rounds, seconds, json)
    if strict and not met:
        raise typer.Exit(1)
