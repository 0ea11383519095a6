"""The arguments and options of `taskspec exam`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from taskspec.cli import options
from taskspec.cli.completions import complete_learners

LearnerArgument = Annotated[
    list[str],
    Argument(
        metavar="LEARNER...|EXPERIMENT", autocompletion=complete_learners,
        help="[cyan]FILE.py:train[/] or [cyan]module:train[/], a function of a case that gives a policy; or one that comes with "
        "the package, by its name ([cyan]bc[/]) or as a YAML file of its settings. Or an experiment, by its path or as "
        "[cyan]suite/name[/]: its learners, on its tasks. Several learners are compared side by side.",
    ),
]  # fmt: skip
Suite = Annotated[str | None, Option("--suite", metavar="NAME", help="The suite of tasks; probes unless given.")]
Tasks = Annotated[
    list[str] | None,
    Option(
        "--tasks", "-t", metavar="TASK,...",
        help="The tasks to examine, or an experiment for its instances; all of the suite unless given.",
    ),
]  # fmt: skip
Seeds = Annotated[int | None, Option("--seeds", min=1, help="Number of random seeds; 15 unless given.")]
Steps = Annotated[
    str | None,
    Option(
        "--steps",
        metavar="N",
        help="Environment steps of each training run; 500k unless given, 10k on probes.",
    ),
]
Transitions = Annotated[
    str | None, Option("--transitions", metavar="N", help="Transitions of expert demonstrations; 10k unless given.")
]
Within = Annotated[
    str | None,
    Option("--within", metavar="TIME", help="Time for the exam, such as 5m or 90s: seeds and steps are chosen for it."),
]  # fmt: skip
UntilSure = Annotated[
    bool, Option("--until-sure", help="Add seeds, up to 30, until each capability is mastered or failed.")
]
Twins = Annotated[int | None, Option("--twins", min=0, help="Twins of each task that has some; 2 unless given.")]
Peeks = Annotated[
    bool | None,
    Option("--peeks/--no-peeks", help="Whether to test if the learner uses rewards that are withheld; on by default."),
]
Laws = Annotated[
    bool | None,
    Option(
        "--laws/--no-laws",
        help="Whether to try all laws of learning, or none; those that the learner declares by default.",
    ),
]
LearnsFrom = Annotated[
    list[str] | None,
    Option(
        "--learns-from", metavar="reward|demonstrations|preferences",
        help="What the learner is granted; may be repeated, or given with commas.",
    ),
]  # fmt: skip
Against = Annotated[
    Path | None,
    Option(
        "--against", metavar="FOLDER",
        help="An earlier exam, or one that comes with a suite (derail/bc): changes since then are flagged.",
    ),
]  # fmt: skip
Output = Annotated[Path | None, options.folder_option("Where results are stored; build/exams/NAME by default.")]
TimeLimit = Annotated[float | None, options.time_limit_option("Time limit for one seed, or block of seeds, on a task.")]
