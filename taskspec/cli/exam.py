"""`taskspec exam`: what is wrong with a learner."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from taskspec.cli import options
from taskspec.cli.completions import complete_learners
from taskspec.cli.console import misuse, progress, say, say_written, write_json

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
TimeLimit = Annotated[float | None, options.time_limit_option("Time limit for one seed, or block of seeds, on a task.")]


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
    time_limit: TimeLimit = None,
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
    from taskspec.learn.exam.card_text import print_exams
    from taskspec.learn.experiments.exams import examine_all, examine_learners
    from taskspec.learn.experiments.experiment_file import read_if_experiment
    from taskspec.tools.targets import tasks_named

    running = Running(jobs, cluster, time_limit, retry)
    terms: dict[str, Any] = _given({
        "seeds": seeds, "twins": twins, "peeks": peeks, "steps": options.count("--steps", steps),
        "transitions": options.count("--transitions", transitions),
    })  # fmt: skip
    for_learners = _given({
        "--suite": suite, "--tasks": tasks, "--learns-from": learns_from, "--against": against, "--within": within,
        "--until-sure": until_sure or None, "--laws": laws,
    })  # fmt: skip
    experiment = read_if_experiment(learners[0])
    if experiment is not None:
        if len(learners) > 1:
            raise misuse("an experiment names its learners itself", "give one experiment, or several learners")
        if for_learners:
            raise misuse(f"{next(iter(for_learners))} is for learners, not for an experiment")
        with progress(experiment.experiment.name):
            exams = examine_all(experiment, output, running=running, **terms)
    else:
        if tasks is not None:
            terms["tasks"] = tasks_named(options.split_names(tasks))
        if learns_from is not None:
            terms["learns_from"] = options.split_names(learns_from)
        terms["announce"] = lambda words: say(words, err=True)
        terms |= {"suite": suite, "against": against, "within": options.seconds("--within", within)}
        with progress(learners[0]):
            exams = examine_learners(learners, output, running=running, until_sure=until_sure, laws=laws, **terms)
    if json:
        write_json(exams.data)
    else:
        print_exams(exams.exams)
        say_written(exams.write_reports())
    if any(each["flags"] for each in exams.exams.values()):
        raise typer.Exit(1)


def _given(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}
