"""`taskspec exam`: what is wrong with a learner."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskspec.cli.console import say, write_json
from taskspec.cli.failures import misuse
from taskspec.cli.options import Json, LimitsGiven
from taskspec.cli.sweep import Cluster, Jobs, Retry

if TYPE_CHECKING:
    from taskspec.exam import Exam

_COUNT = re.compile(r"(\d+(?:\.\d+)?)([kM]?)")
LearnerArgument = Annotated[
    str,
    typer.Argument(
        metavar="LEARNER", show_default=False,
        help="[cyan]FILE.py:train[/] or [cyan]module:train[/], a function of a case that gives a policy; or one that comes with "
        "the package, by its name ([cyan]bc[/]) or as a YAML file of its settings.",
    ),
]  # fmt: skip
Suite = Annotated[str, typer.Option("--suite", metavar="NAME", help="The suite of tasks.")]
Tasks = Annotated[
    list[str] | None,
    typer.Option("--tasks", "-t", metavar="TASK,...", help="The tasks to examine; all of the suite unless given.",
                 show_default=False),
]  # fmt: skip
Seeds = Annotated[int, typer.Option("--seeds", min=1, help="Number of random seeds.")]
Steps = Annotated[
    str, typer.Option("--steps", metavar="N", help="Environment steps of each training run, such as 500k.")
]
Shown = Annotated[str, typer.Option("--transitions", metavar="N", help="Transitions of expert demonstrations.")]
Twins = Annotated[int, typer.Option("--twins", min=0, help="Twins of each task that has some.")]
LearnsFrom = Annotated[
    list[str] | None,
    typer.Option(
        "--learns-from", metavar="reward|demonstrations|preferences",
        help="What the learner is granted; may be repeated, or given with commas.", show_default=False,
    ),
]  # fmt: skip
Output = Annotated[
    Path | None,
    typer.Option("--output", "--out", "-o", metavar="FOLDER", help="Where results are kept; build/exams/LEARNER unless given.",
                 file_okay=False, show_default=False),
]  # fmt: skip
Against = Annotated[
    Path | None,
    typer.Option("--against", metavar="FOLDER", help="An earlier exam: what has become worse since is flagged.",
                 show_default=False),
]  # fmt: skip
TimeLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="SECONDS", help="The longest that one seed, or block of seeds, may take on a task.",
                 show_default=False),
]  # fmt: skip


def exam(
    learner: LearnerArgument,
    suite: Suite = "derail",
    tasks: Tasks = None,
    seeds: Seeds = 15,
    steps: Steps = "500k",
    transitions: Shown = "10k",
    twins: Twins = 2,
    learns_from: LearnsFrom = None,
    against: Against = None,
    output: Output = None,
    jobs: Jobs = None,
    cluster: Cluster = None,
    time_limit: TimeLimit = None,
    retry: Retry = False,
    json: Json = False,
    limits: LimitsGiven = None,
) -> None:
    """Examine a learner: train it on every task, and on twins of them, and say which capability fails.

    Results are kept in OUT as they come: an exam that was stopped goes on where it was. OUT/exam.json has all of them, and
    OUT/report.html shows them. A learner that fails on a task, or takes too long, is reported, and the others go on.

    Flagged are regressions against an earlier exam, twins on which scores differ, learners that look at rewards that
    are withheld from them, and failures. Exit status 1 if something is.
    """
    from taskspec.cli.progress import bar
    from taskspec.exam import Running, examine

    folder = output or Path("build/exams") / _named(learner)
    with bar(learner) as progress:
        found = examine(
            learner, suite=suite, tasks=_split(tasks), seeds=seeds, steps=_count("--steps", steps),
            transitions=_count("--transitions", transitions), twins=twins, learns_from=_split(learns_from), against=against,
            out=folder, running=Running(jobs, cluster, time_limit, retry, progress),
        )  # fmt: skip
    write_json(found) if json else _print(found, folder)
    if found["flags"]:
        raise typer.Exit(1)


def _split(given: Sequence[str] | None) -> list[str] | None:
    return None if given is None else [name.strip() for text in given for name in text.split(",")]


def _count(option: str, text: str) -> int:
    """A number such as 500k or 1.5M."""
    found = _COUNT.fullmatch(text.replace("_", "").replace(",", ""))
    if found is None:
        raise misuse(f"{option} is a number such as 500k, not '{text}'")
    return round(float(found[1]) * {"": 1, "k": 1_000, "M": 1_000_000}[found[2]])


def _named(learner: str) -> str:
    """The name of a folder for what a learner earns."""
    return re.sub(r"\W+", "-", learner.rpartition("/")[2].replace(".py", "")).strip("-")


# -- output -------------------------------------------------------------------------------------------------------


def _print(found: Exam, folder: Path) -> None:
    from taskspec.cli.examined import show
    from taskspec.cli.targets import near
    from taskspec.exam.report import write

    show(found)
    for path in (folder / "exam.json", *write(found, folder)):
        say(f"wrote {near(path)}")
