"""`taskspec demos` and `taskspec preferences`: data for learners, in files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from taskspec.cli.console import misuse, progress, say, write_records
from taskspec.cli.options import Json, Modifiers, Parameters, PolicyName, TaskArgument, Variant, seed_option
from taskspec.show.terminal.styled_text import console, line

if TYPE_CHECKING:
    from taskspec.data import Demonstrations, Preferences
    from taskspec.language.task.task import Task

FORMATS = ("npz", "parquet", "imitation", "minari")
Seed = Annotated[int, seed_option("Episode i begins with [green]reset(seed=SEED+i)[/].")]
DataJobs = Annotated[int, Option("--jobs", "-j", min=1, help="Processes; the data is the same for any number.")]
Output = Annotated[Path, Option("--output", "-o", metavar="OUT", help="The file, or the folder.")]
Format = Annotated[
    str | None,
    Option(
        "--format", metavar="|".join(FORMATS), help="File format; by default from the suffix.",
        autocompletion=lambda: FORMATS,
    ),
]  # fmt: skip
Transitions = Annotated[
    int | None,
    Option("--transitions", min=1, help="Generate whole episodes, until there are at least this many steps."),
]
TeacherName = Annotated[
    str,
    Option(
        "--teacher", metavar="NAME", help="noiseless, boltzmann(0.1), myopic(0.9), mistaken(0.1), skipping(0.2), equal(0.1), "
        "with any numbers; [green]+[/] combines several.",
    ),
]  # fmt: skip


def demos(
    task: TaskArgument,
    output: Output,
    policy: PolicyName = "expert",
    episodes: Annotated[int | None, Option("--episodes", "-n", min=1, help="How many; 100 by default.")] = None,
    transitions: Transitions = None,
    seed: Seed = 0,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    jobs: DataJobs = 1,
    format: Format = None,
    json: Json = False,
) -> None:
    """Write demonstrations: episodes of a policy, for imitation and offline learning.

    As NumPy arrays ([green].npz[/]), as a table ([green].parquet[/]), or as a folder that imitation or Minari loads. Where the
    spec gives roles, they come from the variant in which the expert acts.
    """
    from taskspec.data import demonstrations
    from taskspec.tools.targets import tasks_of

    if episodes is not None and transitions is not None:
        raise misuse("--episodes and --transitions cannot be combined")
    make = partial(demonstrations, policy=policy, episodes=episodes, transitions=transitions, seed=seed, jobs=jobs)
    _write(tasks_of(task, variant, parameters or [], modifiers or []), make, output, format, json)


def preferences(
    task: TaskArgument,
    output: Output,
    pairs: Annotated[int, Option("--pairs", "-n", min=1, help="How many pairs the teacher is shown.")] = 100,
    policy: PolicyName = "random",
    length: Annotated[
        int | None, Option("--length", min=1, metavar="K", help="Steps of a segment; whole episodes by default.")
    ] = None,
    teacher: TeacherName = "noiseless",
    seed: Seed = 0,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    jobs: DataJobs = 1,
    format: Format = None,
    json: Json = False,
) -> None:
    """Write preferences: pairs of trajectories or segments, labelled by their true returns.

    The teacher is noiseless, or makes errors as in B-Pref. Temperature and thresholds are in units of the exact range of
    returns. Where the spec gives roles, trajectories come from the variant in which the learner acts.
    """
    from taskspec.data import preferences as compared
    from taskspec.tools.targets import tasks_of

    make = partial(compared, pairs=pairs, policy=policy, length=length, teacher=teacher, seed=seed, jobs=jobs)
    _write(tasks_of(task, variant, parameters or [], modifiers or []), make, output, format, json)


def _write(
    tasks: Sequence[Task],
    make: Callable[..., Demonstrations | Preferences],
    output: Path,
    format: str | None,
    as_json: bool,
) -> None:
    from taskspec.data import write
    from taskspec.learn.data.datasets import format_of, summary
    from taskspec.tools.targets import with_files

    format_of(output, format)  # a mistake is reported before the work
    records = []
    for task, place in with_files(tasks, output):
        with progress(task.instance_id):
            data = make(task)
        write(data, place, format)
        about = data.metadata
        records.append({**about, "file": str(place)})
        if not as_json:
            out = console()
            out.print(line((about["instance"], "name"), (f"  {about['policy']}, seed {about['seed']}", "quiet")))
            out.print(f"  {summary(about)}")
            say(f"wrote {place}")
    if as_json:
        write_records(records)
