"""`taskspec sweep`: every instance of an experiment, measured, as tables and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.files import safe_name
from taskspec.cli.console import say
from taskspec.cli.failures import misuse
from taskspec.cli.options import Json, LimitsGiven, Parameters, complete_experiments

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.experiments import Swept
    from taskspec.experiments.sweeping import Measured

TABLES = ("json", "csv", "parquet")
PICTURES = ("svg", "png", "pdf")
FORMATS = (*TABLES, *PICTURES)
Experiment = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT", help="The path of an experiment, or suite/name.", autocompletion=complete_experiments,
        show_default=False,
    ),
]  # fmt: skip
Output = Annotated[
    Path,
    typer.Option(
        "--output", "--out", "-o", metavar="FOLDER", help="Where results are stored and looked up.", file_okay=False
    ),
]
Format = Annotated[
    list[str] | None,
    typer.Option(
        "--format", "-f", metavar="|".join(FORMATS), help="What else to write; may be repeated, or given with "
        "commas. JSON, CSV and SVG by default.", autocompletion=lambda: FORMATS, show_default=False,
    ),
]  # fmt: skip
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", min=1, help="Processes; one for each processor by default.", show_default=False),
]
Cluster = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="A Dask scheduler that does the work, such as tcp://10.0.0.1:8786.",
                 show_default=False),
]  # fmt: skip
TimeLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="SECONDS", help="Time limit for one instance.", show_default=False),
]
Retry = Annotated[bool, typer.Option("--retry", help="Retry what failed before.")]


def sweep(
    experiment: Experiment,
    output: Output = Path("build/sweeps"),
    parameters: Parameters = None,
    format: Format = None,
    jobs: Jobs = None,
    cluster: Cluster = None,
    time_limit: TimeLimit = None,
    retry: Retry = False,
    json: Json = False,
    limits: LimitsGiven = None,
) -> None:
    """Measure every instance of an experiment: sizes, returns, difficulty, roll-outs.

    Results are saved in one file, OUT/NAME.sqlite, as they arrive: a sweep that was stopped resumes where it was, and
    known results are not computed again. An instance that fails, or takes too long, is reported, and the others
    continue. [green]-p[/] gives values to use instead of those in the file.

    Exit status 1 if an instance failed.
    """
    from taskspec import experiments
    from taskspec.cli.progress import bar
    from taskspec.experiments import sweep as run
    from taskspec.targets import settings

    wanted = _formats(format)
    written = experiments.read(experiment)
    found = experiments.expand(written, settings(parameters) if parameters else ())
    found.raise_if_wrong()
    with bar(written.experiment.name) as progress:
        swept = run(
            written, output / f"{safe_name(written.experiment.name)}.sqlite", expanded=found, workers=jobs, cluster=cluster,
            seconds=time_limit, retry=retry, progress=progress,
        )  # fmt: skip
    files = _write(swept, output, wanted)
    _print_json(swept) if json else _print(swept, files)
    if swept.failed:
        raise typer.Exit(1)


def _formats(asked: Sequence[str] | None) -> list[str]:
    """Return the formats to write: JSON, CSV and an SVG picture unless others are asked for."""
    if asked is None:
        return ["json", "csv", "svg"]
    wanted = [name.strip() for text in asked for name in text.split(",")]
    for name in wanted:
        if name not in FORMATS:
            raise misuse(f"--format is one of {', '.join(FORMATS)}, not '{name}'")
    return wanted


def _write(swept: Swept, output: Path, wanted: Sequence[str]) -> list[Path]:
    """Return the files in the formats that are wanted."""
    from taskspec.experiments import picture
    from taskspec.experiments.sweeping import WRITERS

    paths = []
    for kind in wanted:
        path = output / f"{safe_name(swept.experiment.name)}.{kind}"
        if kind in PICTURES:
            picture.draw(swept.experiment, swept.rows, path)
        else:
            WRITERS[kind](swept.rows, path)
        paths.append(path)
    return paths


# -- output -------------------------------------------------------------------------------------------------------


def _print_json(swept: Swept) -> None:
    from taskspec.cli.console import write_json

    write_json([row.record() for row in swept.rows])


def _print(swept: Swept, files: Sequence[Path]) -> None:
    from taskspec.base.files import near
    from taskspec.cli.console import console, line

    out = console(wide=True)
    out.print(line((swept.experiment.title or swept.experiment.name, "title")))
    out.print(table_of(swept.rows, swept.experiment.measures))
    for row in swept.failed:
        out.print(line((row.instance.id, "name"), f": {row.error}"), style="bad")
    for path in files:
        say(f"wrote {near(path)}")


MEASURES = ("solution_length", "best_at_random")
"""Measures in the table on the terminal, where the experiment names none; files have all."""


def table_of(rows: Sequence[Measured], measures: Sequence[str] | None = None) -> Table:
    """Return a row for each instance: sizes, returns, measures, roll-outs."""
    from taskspec.cli.console import VisibleText, columns

    chosen = [name for name in (MEASURES if measures is None else measures) if name not in ("states", "actions")]
    extra = [*chosen, *(f"{name}, rolled out" for name in dict.fromkeys(name for row in rows for name in row.policies))]
    table = columns("", "states", "optimal", "expert", "random", *(name.replace("_", " ") for name in extra))
    for row in rows:
        if row.error is not None:
            table.add_row(
                VisibleText(row.instance.id, style="name"), VisibleText(row.status.replace("_", " "), style="bad")
            )
            continue
        shown = [_count(row.values.get("states")), *(_return(row, name) for name in ("optimal", "expert", "random"))]
        table.add_row(VisibleText(row.instance.id, style="name"), *shown, *(_cell(row, name) for name in extra))
    return table


def _cell(row: Measured, name: str) -> str:
    policy = row.policies.get(name.removesuffix(", rolled out"))
    if policy is not None:
        return _with_half(policy.get("mean"), policy.get("half"))
    return _with_half(row.values.get(name), None)


def _return(row: Measured, name: str) -> str:
    return _with_half(row.values.get(name), row.values.get(f"{name}_half"))


def _with_half(value: Any, half: Any) -> str:
    """Return a number, with half of its 95 % confidence interval where it is estimated."""
    from taskspec.base.numbers import decimal, estimate

    if not isinstance(value, int | float):
        return "" if value is None else str(value)
    if not half or half <= 1e-9 * abs(value):
        return decimal(value, 6)
    mean, width = estimate(value, half)
    return f"{mean} ± {width}"


def _count(value: Any) -> str:
    return "" if value is None else f"{value:,}"
