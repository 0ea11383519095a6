"""`taskspec exam`: what is wrong with a learner."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from taskspec.base.display import count_of
from taskspec.base.files import safe_name
from taskspec.cli import options
from taskspec.cli.console import misuse, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.exam import Running
    from taskspec.experiments import ExperimentFile
    from taskspec.language.task.task import TaskLike

_TIME = re.compile(r"(\d+(?:\.\d+)?)([smh])")
_SECONDS = {"s": 1, "m": 60, "h": 3600}


LearnerArgument = Annotated[
    list[str],
    Argument(
        metavar="LEARNER...|EXPERIMENT", autocompletion=options.complete_learners,
        help="[cyan]FILE.py:train[/] or [cyan]module:train[/], a function of a case that gives a policy; or one that comes with "
        "the package, by its name ([cyan]bc[/]) or as a YAML file of its settings. Or an experiment, by its path or as "
        "[cyan]suite/name[/]: its learners, on its tasks. Several learners are compared side by side.",
    ),
]  # fmt: skip
Suite = Annotated[
    str | None, Option("--suite", metavar="NAME", help="The suite of tasks; derail and probes unless given.")
]
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
    Option("--steps", metavar="N", help="Environment steps of each training run; 500k unless given, 10k on probes."),
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


def exam(
    learners: LearnerArgument,
    suite: Suite = None,
    tasks: Tasks = None,
    seeds: Seeds = None,
    steps: Steps = None,
    within: Within = None,
    until_sure: UntilSure = False,
    transitions: Transitions = None,
    twins: Twins = None,
    peeks: Peeks = None,
    laws: Laws = None,
    learns_from: LearnsFrom = None,
    against: Against = None,
    output: Output = None,
    jobs: options.Jobs = None,
    cluster: options.Cluster = None,
    time_limit: Annotated[
        float | None, options.time_limit_option("Time limit for one seed, or block of seeds, on a task.")
    ] = None,
    retry: options.Retry = False,
    json: options.Json = False,
    limits: options.LimitsGiven = None,
) -> None:
    """Examine a learner: train it on every task, and on twins of them, and say which capability fails.

    Results are saved in OUT as they arrive: an exam that was stopped resumes where it was. OUT/exam.json has all of them,
    and OUT/report.html shows them. A learner that fails on a task, or takes too long, is reported, and the others continue.

    Several learners are examined one after the other, each in a folder of its own, and compared: interquartile mean,
    probability of improvement, share of runs above a score, steps to 0.9.

    For an experiment, every learner is examined on all instances, each in its own folder; options override the file.

    It flags changes since an earlier exam, twins on which scores differ, learners that use rewards that are
    withheld from them, and failures. Exit status 1 if anything is flagged.
    """
    from taskspec.exam import Running
    from taskspec.learn.experiments.experiment_file import read_if_experiment

    running = Running(jobs, cluster, time_limit, retry)
    counts = {"steps": _count("--steps", steps), "transitions": _count("--transitions", transitions)}
    given = {"seeds": seeds, "twins": twins, "peeks": peeks, **counts}
    terms: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    written = list(map(read_if_experiment, learners))
    if written[0] is not None:
        if len(learners) > 1:
            raise misuse("an experiment names its learners itself", "give one experiment, or several learners")
        single = {
            "--suite": suite, "--tasks": tasks, "--learns-from": learns_from, "--against": against, "--within": within,
            "--until-sure": until_sure or None, "--laws": laws,
        }  # fmt: skip
        for option, value in single.items():
            if value is not None:
                raise misuse(f"{option} is for learners, not for an experiment")
        _examine_all(written[0], output, running, terms, json)
        return
    if tasks is not None:
        terms["tasks"] = _tasks(options.split_names(tasks))
    if learns_from is not None:
        terms["learns_from"] = options.split_names(learns_from)
    terms |= {"suite": suite, "against": against, "within": _seconds(within), "until_sure": until_sure, "laws": laws}
    _examine(learners, output, running, terms, json)


def _examine(learners: Sequence[str], output: Path | None, running: Running, terms: dict[str, Any], json: bool) -> None:
    """Examine one learner, or several, each in a folder of its own."""
    from taskspec.cli.report import show
    from taskspec.exam import examine
    from taskspec.learn.exam.comparison import compare
    from taskspec.learn.exam.report import write, write_several
    from taskspec.learn.exam.results import folder_name
    from taskspec.show.figures import chart

    names = list(map(folder_name, learners))
    if len(set(names)) < len(names):
        raise misuse("two of these learners have the same name", "each needs a name of its own")
    is_one = len(learners) == 1
    folder = output or Path("build/exams")
    exams = {}
    for learner, name in zip(learners, names, strict=True):
        own = output if is_one and output is not None else folder / name
        with progress(learner):
            exams[learner] = examine(learner, **terms, out=own, running=running)
    if json:
        write_json(exams[learner] if is_one else {"exams": exams, "comparison": compare(exams)})
    elif is_one:
        show(exams, [own / "exam.json", *write(exams[learner], own)])
    else:
        show(exams, write_several(exams, folder, chart.possible(["svg"])))
    if any(each["flags"] for each in exams.values()):
        raise typer.Exit(1)


def _examine_all(
    written: ExperimentFile, output: Path | None, running: Running, terms: dict[str, Any], json: bool
) -> None:
    from taskspec.cli.report import print_exams
    from taskspec.experiments import examine_all

    folder = output or Path("build/exams") / safe_name(written.experiment.name)
    with progress(written.experiment.name):
        found = examine_all(written, folder, running=running, **terms)
    if json:
        write_json(found.exams)
    else:
        print_exams(written.experiment, found, folder)
    if any(each["flags"] for each in found.exams.values()):
        raise typer.Exit(1)


def _tasks(names: Sequence[str]) -> list[TaskLike]:
    """Return tasks by name; those of an experiment where one is named."""
    from taskspec.learn.experiments.experiment_file import read_if_experiment
    from taskspec.learn.experiments.instances import expand

    found: list[TaskLike] = []
    for name in names:
        written = read_if_experiment(name)
        found += [name] if written is None else expand(written).tasks()
    return found


def _seconds(text: str | None) -> float | None:
    """Return a time such as 5m, 90s or 1.5h in seconds; None where none is given."""
    if text is None:
        return None
    found = _TIME.fullmatch(text)
    if found is None:
        raise misuse(f"--within is a time such as 5m, 90s or 1.5h, not '{text}'")
    return float(found[1]) * _SECONDS[found[2]]


def _count(option: str, text: str | None) -> int | None:
    """Return a number such as 500k or 1.5M; None where none is given."""
    if text is None:
        return None
    found = count_of(text)
    if found is None:
        raise misuse(f"{option} is a number such as 500k, not '{text}'")
    return found
