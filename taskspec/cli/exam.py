"""`taskspec exam`: what is wrong with a learner."""

from __future__ import annotations

from typing import Any

import typer

from taskspec.cli import exam_options as given
from taskspec.cli import options
from taskspec.cli.console import misuse, say, say_written, write_json
from taskspec.cli.progress import progress


def exam(
    learners: given.LearnerArgument,
    suite: given.Suite = None,
    tasks: given.Tasks = None,
    seeds: given.Seeds = None,
    steps: given.Steps = None,
    within: given.Within = None,
    until_sure: given.UntilSure = False,
    transitions: given.Transitions = None,
    twins: given.Twins = None,
    peeks: given.Peeks = None,
    laws: given.Laws = None,
    learns_from: given.LearnsFrom = None,
    against: given.Against = None,
    output: given.Output = None,
    jobs: options.Jobs = None,
    cluster: options.Cluster = None,
    time_limit: given.TimeLimit = None,
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
    from taskspec.learn.experiments.named_tasks import tasks_named

    running = Running(jobs, cluster, time_limit, retry)
    numbers = {
        "seeds": seeds, "twins": twins, "peeks": peeks, "steps": options.count("--steps", steps),
        "transitions": options.count("--transitions", transitions),
    }  # fmt: skip
    terms: dict[str, Any] = {name: value for name, value in numbers.items() if value is not None}
    for_learners = {
        "--suite": suite, "--tasks": tasks, "--learns-from": learns_from, "--against": against, "--within": within,
        "--until-sure": until_sure or None, "--laws": laws,
    }  # fmt: skip
    experiment = read_if_experiment(learners[0])
    if experiment is not None:
        refused = [option for option, value in for_learners.items() if value is not None]
        if len(learners) > 1:
            raise misuse("an experiment names its learners itself", "give one experiment, or several learners")
        if refused:
            raise misuse(f"{refused[0]} is for learners, not for an experiment")
        with progress(experiment.experiment.name):
            found = examine_all(experiment, output, running=running, **terms)
    else:
        if tasks is not None:
            terms["tasks"] = tasks_named(options.split_names(tasks))
        if learns_from is not None:
            terms["learns_from"] = options.split_names(learns_from)
        terms["announce"] = lambda words: say(words, err=True)
        terms |= {"suite": suite, "against": against, "within": options.seconds("--within", within)}
        with progress(learners[0]):
            found = examine_learners(learners, output, running=running, until_sure=until_sure, laws=laws, **terms)
    if json:
        write_json(found.data)
    else:
        print_exams(found.exams)
        say_written(found.write_reports())
    if any(each["flags"] for each in found.exams.values()):
        raise typer.Exit(1)
