"""`taskspec sweep`: every instance of an experiment, measured, as tables and a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument

from taskspec.base.files import safe_name
from taskspec.cli import options
from taskspec.cli.completions import complete_experiments
from taskspec.cli.console import progress, say_written, write_json
from taskspec.show.terminal.styled_text import console, line

PICTURES = ("svg", "png", "pdf")
FORMATS = ("json", "csv", "parquet", *PICTURES)
ExperimentName = Annotated[
    str,
    Argument(
        metavar="EXPERIMENT", help="The path of an experiment, or suite/name.", autocompletion=complete_experiments
    ),
]
Format = Annotated[
    list[str] | None,
    options.formats_option(
        FORMATS,
        "What else to write; may be repeated, or given with commas. JSON, CSV and (with matplotlib) SVG by default.",
    ),
]


def sweep(
    experiment: ExperimentName,
    output: Annotated[Path, options.folder_option("Where results are stored and looked up.")] = Path("build/sweeps"),
    parameters: options.Parameters = None,
    format: Format = None,
    jobs: options.Jobs = None,
    cluster: options.Cluster = None,
    time_limit: Annotated[float | None, options.time_limit_option("Time limit for one instance.")] = None,
    retry: options.Retry = False,
    json: options.Json = False,
    limits: options.LimitsGiven = None,
) -> None:
    """Measure every instance of an experiment: sizes, returns, difficulty, roll-outs.

    Results are saved in one file, OUT/NAME.sqlite, as they arrive: a sweep that was stopped resumes where it was, and
    known results are not computed again. An instance that fails, or takes too long, is reported, and the others
    continue. [green]-p[/] gives values to use instead of those in the file.

    Exit status 1 if an instance failed.
    """
    from taskspec import experiments
    from taskspec.learn.experiments import picture
    from taskspec.learn.experiments.sweeping import WRITERS, measured_table
    from taskspec.learn.jobs.running import Running
    from taskspec.show.figures import chart
    from taskspec.tools.targets import settings

    wanted = options.checked_choices("--format", format or chart.possible(["json", "csv", "svg"]), FORMATS)
    written = experiments.read(experiment)
    name = safe_name(written.experiment.name)
    running = Running(jobs, cluster, time_limit, retry)
    with progress(written.experiment.name):
        instances = experiments.expand(written, settings(parameters) if parameters else ())
        swept = experiments.sweep(written, output / f"{name}.sqlite", expanded=instances, running=running)
    files = [output / f"{name}.{kind}" for kind in wanted]
    for kind, path in zip(wanted, files, strict=True):
        if kind in PICTURES:
            chart.save(picture.figure(swept.experiment, swept.rows), path)
        else:
            WRITERS[kind](swept.rows, path)
    if json:
        write_json([row.record() for row in swept.rows])
    else:
        out = console(wide=True)
        out.print(line((swept.experiment.title or swept.experiment.name, "title")))
        out.print(measured_table(swept.rows, swept.experiment.measures))
        for row in swept.failed:
            out.print(line((row.instance.id, "name"), f": {row.error}"), style="bad")
        say_written(files)
    if swept.failed:
        raise typer.Exit(1)
