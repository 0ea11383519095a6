"""Benchmarks, in a checkout: `python -m tests.benchmarks [seals|vector|accelerator|learners|exact|jobs|first|studio|compare]`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from taskspec.base.limits import Limits
from taskspec.cli.app import Commands
from taskspec.cli.completions import complete_targets
from taskspec.cli.console import misuse
from taskspec.cli.options import Json, Parameters, checked_choice, flowed
from taskspec.programs.backend_table import BACKENDS, PROGRAMS

VECTOR = ("auto", *BACKENDS)

Tasks = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[TASK|FOLDER]...",
        help="Ids, specs, suites or folders of specs; the project's own benchmarks if omitted.",
        autocompletion=complete_targets,
        show_default=False,
    ),
]
Only = Annotated[
    list[str] | None, typer.Option("--task", "-t", metavar="NAME", help="Only this task; may be repeated.")
]
Programs = Annotated[
    list[str] | None,
    typer.Option(
        "--backend", "-b", metavar="NAME", help=f"The programs to measure a TASK with: {', '.join(PROGRAMS)}; may be repeated.",
        autocompletion=lambda: PROGRAMS, show_default=False,
    ),
]  # fmt: skip
Lanes = Annotated[
    list[int] | None,
    typer.Option(
        "--lanes", "-l", metavar="N", min=1, max=Limits.lanes, show_default=False,
        help="Number of environments of a TASK that are stepped together; 1, 64, 1024 and 4096 by default.",
    ),
]  # fmt: skip
Threads = Annotated[int, typer.Option("--num-threads", metavar="N", min=1, max=1024, help="Threads of Numba.")]
Rounds = Annotated[int, typer.Option("--rounds", min=1, help="How often each side is measured, alternately.")]
Seconds = Annotated[float, typer.Option("--seconds", min=0.001, help="Approximate duration of a measurement.")]
Starts = Annotated[bool, typer.Option("--start/--no-start", help="Also measure start-up time and memory.")]
Chart = Annotated[
    Path | None,
    typer.Option("--chart", metavar="FILE", help="Draw a chart: .svg, .png or .pdf.", dir_okay=False, show_default=False),
]  # fmt: skip
Strict = Annotated[bool, typer.Option("--strict", help="Exit with status 1 when a target is missed.")]
HELP = """Measure steps per second, ours beside others'.

What is compared runs in one process and takes turns, so that a slow moment of the machine meets all of it."""


def seals(
    only: Only = None,
    lanes: Annotated[
        int | None,
        typer.Option(
            "--lanes", "-l", metavar="N", min=1, max=Limits.lanes, show_default=False,
            help="Vector environments instead: ours compared with SyncVectorEnv.",
        ),
    ] = None,
    backend: Annotated[
        str, typer.Option("--backend", "-b", metavar="NAME", help=f"Ours, with --lanes: {', '.join(VECTOR)}.")
    ] = "auto",
    rounds: Rounds = 9,
    seconds: Seconds = 0.1,
    strict: Strict = False,
    json: Json = False,
) -> None:  # fmt: skip
    """Environments of gym.make, compared with the same tasks of seals 0.2.1."""
    from tests.benchmarks import seals as benchmark

    if checked_choice("--backend", backend, VECTOR) != "auto" and lanes is None:
        raise misuse("--backend goes with --lanes: a single environment has none")
    _end(benchmark.bench(only or [], lanes, backend, rounds, seconds, json), strict)


def vector(
    tasks: Tasks = None,
    parameters: Parameters = None,
    backend: Programs = None,
    lanes: Lanes = None,
    num_threads: Threads = 1,
    rounds: Rounds = 7,
    seconds: Seconds = 0.05,
    start: Starts = True,
    chart: Chart = None,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Vector environments of any task on every backend; start-up time; memory.

    Without a TASK: the suite on all installed backends, with targets and compared with seals, and games compared with
    Gymnasium, gymnax and EnvPool where these are installed. Takes about three minutes.
    """
    from tests.benchmarks.vector import Wanted, bench

    wanted = Wanted(
        tuple(tasks or ()), tuple(parameters or ()), tuple(backend or ()), tuple(lanes or ()), num_threads, rounds,
        seconds, start, chart, json,
    )  # fmt: skip
    _end(bench(wanted), strict)


def accelerator(
    lanes: Annotated[
        list[int] | None,
        typer.Option("--lanes", "-l", metavar="N", min=1, max=Limits.lanes, help="2^14 and 2^20 by default.", show_default=False),
    ] = None,
    rounds: Rounds = 5,
    seconds: Seconds = 0.2,
    json: Json = False,
) -> None:  # fmt: skip
    """Many lanes inside scan, on the device that JAX finds: DERAIL, and games compared with gymnax."""
    from tests.benchmarks import accelerator as benchmark

    benchmark.bench(lanes or benchmark.LANES, rounds, seconds, json)


def learners(
    names: Annotated[list[str] | None, typer.Argument(metavar="[LEARNER]...", show_default=False)] = None,
    task: Annotated[str, typer.Option("--task", "-t", metavar="ID", help="What they learn.")] = "derail/RiskyPath-v0",
    seeds: Annotated[
        list[int] | None, typer.Option("--seeds", metavar="N", min=1, help="Trained together; 15 by default.", show_default=False)
    ] = None,
    json: Json = False,
) -> None:  # fmt: skip
    """Training steps per second of learners with nets, on the device that JAX finds."""
    from tests.benchmarks import learners as benchmark

    benchmark.bench(names or benchmark.LEARNERS, task, seeds or (15,), json)


def exact(
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Number of runs; the best one counts.")] = 3,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Exact models of large grids, compared with Storm if it is installed, and with plain loops."""
    from tests.benchmarks import exact as benchmark

    _end(benchmark.bench(rounds, json), strict)


def jobs(strict: Strict = False) -> None:
    """What a job of a sweep costs beside its work, and how long and how much memory it takes to plan many."""
    from tests.benchmarks import jobs as benchmark

    _end(benchmark.bench(), strict)


def first(
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Number of processes of each program.")] = 40,
    strict: Strict = False,
) -> None:
    """How long `import taskspec` and the first gym.make of a process take."""
    from tests.benchmarks import first as benchmark

    _end(benchmark.bench(rounds), strict)


def studio(
    edits: Annotated[int, typer.Option("--edits", min=1, help="Number of edits of each task.")] = 40,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """How soon the page of the studio follows an edit, in Chromium."""
    from tests.benchmarks import studio as benchmark

    _end(benchmark.bench(edits, json), strict)


def _end(met: bool, strict: bool) -> None:
    if strict and not met:
        raise typer.Exit(1)


def compare(context: typer.Context) -> None:
    """Speed compared with an earlier commit; see `compare --help`."""
    from tests.benchmarks.compare import main

    main(context.args)


app = typer.Typer(
    no_args_is_help=True, help=flowed(HELP), cls=Commands, pretty_exceptions_enable=False, add_completion=False
)
for _function in (seals, vector, accelerator, learners, exact, jobs, first, studio):
    app.command(help=flowed(_function.__doc__ or ""))(_function)
_FORWARDED = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}
app.command(help=compare.__doc__, context_settings=_FORWARDED)(compare)

if __name__ == "__main__":
    app(prog_name="python -m tests.benchmarks")
