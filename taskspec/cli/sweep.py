"""`taskspec sweep`: every instance of an experiment, measured, as tables and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from taskspec.base.columns import Columns
from taskspec.base.display import decimal, estimate
from taskspec.base.files import near, safe_name
from taskspec.base.terminal import VisibleText, console, line
from taskspec.cli import options
from taskspec.cli.console import say, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.experiments import Measured

PICTURES = ("svg", "png", "pdf")
FORMATS = ("json", "csv", "parquet", *PICTURES)
MEASURES = ("solution_length", "best_at_random")
"""Measures in the table on the terminal, where the experiment names none; files have all."""
ExperimentName = Annotated[
    str,
    Argument(
        metavar="EXPERIMENT", help="The path of an experiment, or suite/name.", autocompletion=options.complete_experiments,

    ),
]  # fmt: skip
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
    from taskspec.base.jobs.running import Running
    from taskspec.language.targets import settings
    from taskspec.learn.experiments import picture
    from taskspec.learn.experiments.sweeping import WRITERS
    from taskspec.show.figures import chart

    wanted = options.checked_choices("--format", format or chart.possible(["json", "csv", "svg"]), FORMATS)
    written = experiments.read(experiment)
    found = experiments.expand(written, settings(parameters) if parameters else ())
    found.raise_if_wrong()
    name = safe_name(written.experiment.name)
    running = Running(jobs, cluster, time_limit, retry)
    with progress(written.experiment.name):
        swept = experiments.sweep(written, output / f"{name}.sqlite", expanded=found, running=running)
    files = [output / f"{name}.{kind}" for kind in wanted]
    for kind, path in zip(wanted, files, strict=True):
        if kind in PICTURES:
            picture.draw(swept.experiment, swept.rows, path)
        else:
            WRITERS[kind](swept.rows, path)
    if json:
        write_json([row.record() for row in swept.rows])
    else:
        out = console(wide=True)
        out.print(line((swept.experiment.title or swept.experiment.name, "title")))
        out.print(_table(swept.rows, swept.experiment.measures))
        for row in swept.failed:
            out.print(line((row.instance.id, "name"), f": {row.error}"), style="bad")
        for path in files:
            say(f"wrote {near(path)}")
    if swept.failed:
        raise typer.Exit(1)


def _table(rows: Sequence[Measured], measures: Sequence[str] | None) -> Columns:
    """Return a row for each instance: sizes, returns, measures, roll-outs."""
    if measures is None:
        measures = MEASURES
    chosen = [name for name in measures if name not in ("states", "actions")]
    policies = dict.fromkeys(name for row in rows for name in row.policies)
    headers = [name.replace("_", " ") for name in chosen] + [f"{name}, rolled out" for name in policies]
    numbers = range(1, 5 + len(headers))
    table = Columns("", "states", "optimal", "expert", "random", *headers, styles=("name",), right=numbers, names=0)
    for row in rows:
        if row.error is not None:
            table.add_row(row.instance.id, VisibleText(row.status.replace("_", " "), style="bad"))
            continue
        values = row.values
        cells = [f"{values['states']:,}" if values.get("states") is not None else ""]
        cells += [_number(values.get(name), values.get(f"{name}_half")) for name in ("optimal", "expert", "random")]
        cells += [_number(values.get(name)) for name in chosen]
        for name in policies:
            means = row.policies.get(name, {})
            cells.append(_number(means.get("mean"), means.get("half")))
        table.add_row(row.instance.id, *cells)
    return table


def _number(value: Any, half: Any = None) -> str:
    if not isinstance(value, int | float):
        if value is None:
            return ""
        return str(value)
    if not half or half <= 1e-9 * abs(value):
        return decimal(value, 6)
    mean, width = estimate(value, half)
    return f"{mean} ± {width}"
