"""`taskspec demos` and `taskspec preferences`: data for learners, in files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.cli.failures import misuse
from taskspec.cli.options import Json, Modifiers, Parameters, PolicyName, TaskArgument, Variant

if TYPE_CHECKING:
    from taskspec.data import Demonstrations, Preferences
    from taskspec.task.task import Task

    Make = Callable[..., Demonstrations | Preferences]

Episodes = Annotated[
    int | None, typer.Option("--episodes", "-n", min=1, help="How many; 100 by default.", show_default=False)
]
Steps = Annotated[
    int | None,
    typer.Option(
        "--transitions",
        min=1,
        help="Generate whole episodes, until there are at least this many steps.",
        show_default=False,
    ),
]
Seed = Annotated[
    int,
    typer.Option(
        "--seed", min=0, max=2**64 - 1, metavar="SEED", help="Episode i is that of [green]reset(seed=SEED+i)[/]."
    ),
]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Processes; the data is the same for any number.")]
Output = Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="The file, or the folder.")]
Format = Annotated[
    str | None,
    typer.Option(
        "--format", metavar="npz|parquet|imitation|minari", help="File format; by default from the suffix.", show_default=False,
        autocompletion=lambda: ("npz", "parquet", "imitation", "minari"),
    ),
]  # fmt: skip
Pairs = Annotated[int, typer.Option("--pairs", "-n", min=1, help="How many pairs the teacher is shown.")]
Length = Annotated[
    int | None,
    typer.Option(
        "--length", min=1, metavar="K", help="Steps of a segment; whole episodes by default.", show_default=False
    ),
]
TeacherName = Annotated[
    str,
    typer.Option(
        "--teacher", metavar="NAME", help="noiseless, boltzmann(0.1), myopic(0.9), mistaken(0.1), skipping(0.2), equal(0.1), "
        "with any numbers; [green]+[/] combines several.",
    ),
]  # fmt: skip


def demos(
    task: TaskArgument,
    output: Output,
    policy: PolicyName = "expert",
    episodes: Episodes = None,
    transitions: Steps = None,
    seed: Seed = 0,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    jobs: Jobs = 1,
    format: Format = None,
    json: Json = False,
) -> None:
    """Write demonstrations: episodes of a policy, for imitation and offline learning.

    As NumPy arrays ([green].npz[/]), as a table ([green].parquet[/]), or as a folder that imitation or Minari loads. Where the
    spec gives roles, they come from the variant in which the expert acts.
    """
    from taskspec.data import demonstrations
    from taskspec.targets import tasks_of

    if episodes is not None and transitions is not None:
        raise misuse("--episodes and --transitions cannot be combined")
    make = partial(demonstrations, policy=policy, episodes=episodes, transitions=transitions, seed=seed, jobs=jobs)
    _write(tasks_of(task, variant, parameters or [], modifiers or []), make, output, format, json)


def preferences(
    task: TaskArgument,
    output: Output,
    pairs: Pairs = 100,
    policy: PolicyName = "random",
    length: Length = None,
    teacher: TeacherName = "noiseless",
    seed: Seed = 0,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    jobs: Jobs = 1,
    format: Format = None,
    json: Json = False,
) -> None:
    """Write preferences: pairs of trajectories or segments, labelled by their true returns.

    The teacher is noiseless, or makes errors as in B-Pref. Temperature and thresholds are in units of the exact range of
    returns. Where the spec gives roles, trajectories come from the variant in which the learner acts.
    """
    from taskspec.data import preferences as compared
    from taskspec.targets import tasks_of

    make = partial(compared, pairs=pairs, policy=policy, length=length, teacher=teacher, seed=seed, jobs=jobs)
    _write(tasks_of(task, variant, parameters or [], modifiers or []), make, output, format, json)


def _write(found: list[Task], make: Make, output: Path, format: str | None, as_json: bool) -> None:
    """Make data of tasks and write it, in a file each."""
    from taskspec.cli.console import write_records
    from taskspec.cli.progress import progress
    from taskspec.data import write
    from taskspec.data.files import format_of
    from taskspec.targets import beside

    format_of(output, format)
    records = []
    for task in found:
        place = output if len(found) == 1 else beside(output, task)
        with progress(task.instance_id):
            data = make(task)
        write(data, place, format)
        if as_json:
            records.append({**data.metadata, "file": str(place)})
        else:
            _print(data, place)
    if as_json:
        write_records(records)


def _print(data: Demonstrations | Preferences, output: Path) -> None:
    from taskspec.cli.console import console, line, say

    told = data.metadata
    console().print(line((told["instance"], "name"), (f"  {told['policy']}, seed {told['seed']}", "quiet")))
    for row in _rows(told):
        console().print(f"  {row}")
    say(f"wrote {output}")


def _rows(told: Any) -> list[str]:
    """Return what the data amounts to, line by line."""
    if told["kind"] == "demonstrations":
        value = told["return"]
        exact = "" if value is None else f"; the policy earns {value['value']:.6g} ({value['status']})"
        return [f"{told['transitions']:,} transitions of {told['episodes']:,} episodes{exact}"]
    skipped = f", {told['skipped']:,} skipped" if told["skipped"] else ""
    of = "whole episodes" if told["length"] is None else f"segments of {told['length']} steps"
    return [f"{told['shown'] - told['skipped']:,} pairs of {of}{skipped}; teacher: {told['teacher']}"]
