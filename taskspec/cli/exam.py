"""`taskspec exam`: what is wrong with a learner."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.files import safe_name
from taskspec.cli.console import say, write_json
from taskspec.cli.failures import misuse
from taskspec.cli.options import Json, LimitsGiven, complete_learners
from taskspec.cli.sweep import Cluster, Jobs, Retry

if TYPE_CHECKING:
    from taskspec.exam import Exam, Running
    from taskspec.experiments import ExperimentFile
    from taskspec.task.task import TaskLike

_COUNT = re.compile(r"(\d+(?:\.\d+)?)([kM]?)")
LearnerArgument = Annotated[
    str,
    typer.Argument(
        metavar="LEARNER|EXPERIMENT", show_default=False, autocompletion=complete_learners,
        help="[cyan]FILE.py:train[/] or [cyan]module:train[/], a function of a case that gives a policy; or one that comes with "
        "the package, by its name ([cyan]bc[/]) or as a YAML file of its settings. Or an experiment, by its path or as "
        "[cyan]suite/name[/]: its learners, on its tasks.",
    ),
]  # fmt: skip
Suite = Annotated[
    str | None,
    typer.Option("--suite", metavar="NAME", help="The suite of tasks; derail unless given.", show_default=False),
]
Tasks = Annotated[
    list[str] | None,
    typer.Option("--tasks", "-t", metavar="TASK,...", show_default=False,
                 help="The tasks to examine, or an experiment for its instances; all of the suite unless given."),
]  # fmt: skip
Seeds = Annotated[
    int | None, typer.Option("--seeds", min=1, help="Number of random seeds; 15 unless given.", show_default=False)
]
Steps = Annotated[
    str | None,
    typer.Option("--steps", metavar="N", help="Environment steps of each training run; 500k unless given.",
                 show_default=False),
]  # fmt: skip
Shown = Annotated[
    str | None,
    typer.Option("--transitions", metavar="N", help="Transitions of expert demonstrations; 10k unless given.",
                 show_default=False),
]  # fmt: skip
Twins = Annotated[
    int | None,
    typer.Option("--twins", min=0, help="Twins of each task that has some; 2 unless given.", show_default=False),
]
Probes = Annotated[
    bool | None,
    typer.Option("--probes/--no-probes", show_default=False,
                 help="Whether to test if the learner uses rewards that are withheld; on by default."),
]  # fmt: skip
LearnsFrom = Annotated[
    list[str] | None,
    typer.Option(
        "--learns-from", metavar="reward|demonstrations|preferences",
        help="What the learner is granted; may be repeated, or given with commas.", show_default=False,
    ),
]  # fmt: skip
Output = Annotated[
    Path | None,
    typer.Option("--output", "--out", "-o", metavar="FOLDER", help="Where results are stored; build/exams/NAME by default.",
                 file_okay=False, show_default=False),
]  # fmt: skip
Against = Annotated[
    Path | None,
    typer.Option("--against", metavar="FOLDER", show_default=False,
                 help="An earlier exam, or one that comes with a suite (derail/bc): regressions since then are flagged."),
]  # fmt: skip
TimeLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="SECONDS", help="Time limit for one seed, or block of seeds, on a task.",
                 show_default=False),
]  # fmt: skip


def exam(
    learner: LearnerArgument,
    suite: Suite = None,
    tasks: Tasks = None,
    seeds: Seeds = None,
    steps: Steps = None,
    transitions: Shown = None,
    twins: Twins = None,
    probes: Probes = None,
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

    Results are saved in OUT as they arrive: an exam that was stopped resumes where it was. OUT/exam.json has all of them,
    and OUT/report.html shows them. A learner that fails on a task, or takes too long, is reported, and the others continue.

    For an experiment, every learner is examined on all instances, each in its own folder; options override the file.

    It flags regressions against an earlier exam, twins on which scores differ, learners that use rewards that are
    withheld from them, and failures. Exit status 1 if anything is flagged.
    """
    from taskspec.exam import Running
    from taskspec.experiments.reading import read_if_experiment

    running = Running(jobs, cluster, time_limit, retry)
    terms = _terms(seeds, steps, transitions, twins, probes)
    written = read_if_experiment(learner)
    if written is None:
        about = {"suite": suite or "derail", "tasks": _tasks(_split(tasks)), "learns_from": _split(learns_from)}
        _examine_one(learner, output, running, about | terms, against, json)
    else:
        _refuse({"--suite": suite, "--tasks": tasks, "--learns-from": learns_from, "--against": against})
        _examine_all(written, output, running, terms, json)


def _examine_one(
    learner: str, output: Path | None, running: Running, terms: dict[str, Any], against: Path | None, json: bool
) -> None:
    from taskspec.cli.progress import bar
    from taskspec.exam import examine
    from taskspec.exam.results import folder_name

    folder = output or Path("build/exams") / folder_name(learner)
    with bar(learner) as progress:
        found = examine(learner, **terms, against=against, out=folder, running=replace(running, progress=progress))
    write_json(found) if json else _print(found, folder)
    if found["flags"]:
        raise typer.Exit(1)


def _examine_all(
    written: ExperimentFile, output: Path | None, running: Running, terms: dict[str, Any], json: bool
) -> None:
    from taskspec.cli.exam_tables import print_exams
    from taskspec.cli.progress import bar
    from taskspec.experiments import examine_all

    folder = output or Path("build/exams") / safe_name(written.experiment.name)
    found = examine_all(written, folder, running=running, bar=bar, **terms)
    write_json(found.exams) if json else print_exams(written.experiment, found, folder)
    if any(each["flags"] for each in found.exams.values()):
        raise typer.Exit(1)


def _terms(
    seeds: int | None, steps: str | None, transitions: str | None, twins: int | None, probes: bool | None
) -> dict[str, Any]:
    """Return what is given of an exam's terms."""
    counts = {"steps": _count("--steps", steps), "transitions": _count("--transitions", transitions)}
    given = {"seeds": seeds, "twins": twins, "probes": probes, **counts}
    return {name: value for name, value in given.items() if value is not None}


def _refuse(given: dict[str, Any]) -> None:
    """Options that an experiment says itself, or that are about one learner."""
    for option, value in given.items():
        if value is not None:
            raise misuse(f"{option} is for a single learner, not for an experiment")


def _tasks(names: Sequence[str] | None) -> list[TaskLike] | None:
    """Return tasks by name; those of an experiment where one is named."""
    from taskspec.experiments.instances import expand
    from taskspec.experiments.reading import read_if_experiment

    if names is None:
        return None
    found: list[TaskLike] = []
    for name in names:
        written = read_if_experiment(name)
        if written is None:
            found.append(name)
        else:
            found += expand(written).tasks()
    return found


def _split(given: Sequence[str] | None) -> list[str] | None:
    return None if given is None else [name.strip() for text in given for name in text.split(",")]


def _count(option: str, text: str | None) -> int | None:
    """Return a number such as 500k or 1.5M; None where none is given."""
    if text is None:
        return None
    found = _COUNT.fullmatch(text.replace("_", "").replace(",", ""))
    if found is None:
        raise misuse(f"{option} is a number such as 500k, not '{text}'")
    return round(float(found[1]) * {"": 1, "k": 1_000, "M": 1_000_000}[found[2]])


# -- output -------------------------------------------------------------------------------------------------------


def _print(found: Exam, folder: Path) -> None:
    from taskspec.base.files import near
    from taskspec.cli.exam_tables import show
    from taskspec.exam.report import write

    show(found)
    for path in (folder / "exam.json", *write(found, folder)):
        say(f"wrote {near(path)}")
