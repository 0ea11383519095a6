"""The arguments and options that several commands share, with their help."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from typer import Argument, Option

from taskspec.base.diagnostics import suggest
from taskspec.base.display import count_of
from taskspec.cli.completions import complete_modifiers, complete_policies, complete_targets
from taskspec.cli.console import misuse


def flowed(doc: str) -> str:
    """Join the lines of each paragraph of a docstring, to be wrapped at the reader's width; indented lines stay."""
    paragraphs = inspect.cleandoc(doc).split("\n\n")
    for i, paragraph in enumerate(paragraphs):
        if not paragraph.startswith(" "):
            paragraphs[i] = paragraph.replace("\n", " ")
    return "\n\n".join(paragraphs)


def checked_choice(name: str, value: str, allowed: Sequence[str]) -> str:
    if value not in allowed:
        code = "E726" if name == "--format" else "E713"
        raise misuse(f"{name} is one of {', '.join(allowed)}, not '{value}'", suggest(value, allowed), code)
    return value


def split_names(texts: Sequence[str] | None) -> list[str]:
    """Split an option that may be repeated, or given with commas, into names."""
    names: list[str] = []
    for text in texts or ():
        names += map(str.strip, text.split(","))
    return names


def checked_choices(option: str, texts: Sequence[str] | None, allowed: Sequence[str]) -> list[str]:
    """Split and check an option that may be repeated, or given with commas."""
    return [checked_choice(option, name, allowed) for name in split_names(texts)]


def count(option: str, text: str | None) -> int | None:
    """Read a number such as 500k or 1.5M."""
    if text is None:
        return None
    number = count_of(text)
    if number is None:
        raise misuse(f"{option} is a number such as 500k, not '{text}'")
    return number


_TIME = re.compile(r"(\d+(?:\.\d+)?)([smh])")
_SECONDS = {"s": 1, "m": 60, "h": 3600}


def seconds(option: str, text: str | None) -> float | None:
    """Read a time such as 5m, 90s or 1.5h, in seconds."""
    if text is None:
        return None
    match = _TIME.fullmatch(text)
    if match is None:
        raise misuse(f"{option} is a time such as 5m, 90s or 1.5h, not '{text}'")
    return float(match[1]) * _SECONDS[match[2]]


def _set_limits(ctx: typer.Context, given: list[str] | None) -> list[str] | None:
    """Set the limits while the command runs."""
    if given:
        from taskspec.base.limits import also

        ctx.with_resource(also(",".join(given), "--limit"))
    return given


def choices_option(*names: str, allowed: Sequence[str], help: str) -> Any:
    """Make an option with some of the values allowed; see `checked_choices`."""
    return Option(*names, metavar="|".join(allowed), help=help, autocompletion=lambda: allowed)


def formats_option(allowed: Sequence[str], help: str) -> Any:
    return choices_option("--format", "-f", allowed=allowed, help=help)


def folder_option(help: str) -> Any:
    """Make the option for the folder that a command writes to."""
    return Option("--output", "--out", "-o", metavar="FOLDER", help=help, file_okay=False)


def file_option(*names: str, help: str) -> Any:
    return Option(*names, metavar="FILE", help=help, dir_okay=False)


def seed_option(help: str) -> Any:
    return Option("--seed", min=0, max=2**64 - 1, metavar="SEED", help=help)


def time_limit_option(help: str) -> Any:
    return Option("--time-limit", metavar="SECONDS", help=help)


TaskArgument = Annotated[
    str, Argument(metavar="TASK", help="An id, or the path of a spec.", autocompletion=complete_targets)
]
Targets = Annotated[
    list[str] | None,
    Argument(
        metavar="[TASK|FOLDER]...", help="Ids, specs, suites or folders of specs; all known tasks if omitted.",
        autocompletion=complete_targets,
    ),
]  # fmt: skip
Variant = Annotated[str | None, Option("--variant", "-v", metavar="NAME", help="A variant of the spec.")]
Parameters = Annotated[
    list[str] | None,
    Option(
        "-p", "--param", metavar="NAME=VALUE,...",
        help="A parameter, such as [green]-p L=20[/], or several values, [green]-p L=5,10,20[/]; may be repeated.",
    ),
]  # fmt: skip
Modifiers = Annotated[
    list[str] | None,
    Option(
        "-m", "--modifier", metavar="NAME=VALUE", autocompletion=complete_modifiers,
        help="A modifier of the task, such as [green]-m sticky=0.25[/]; may be repeated; the order matters.",
    ),
]  # fmt: skip
LimitsGiven = Annotated[
    list[str] | None,
    Option(
        "--limit", metavar="NAME=VALUE", callback=_set_limits,
        help="Limit the cost of an analysis: [green]--limit seconds=60[/], or [green]seconds=0[/] to skip it; may be repeated.",
    ),
]  # fmt: skip
PolicyName = Annotated[
    str,
    Option(
        "--policy", metavar="NAME|FILE", autocompletion=complete_policies,
        help="random, expert, optimal, soft(1), epsilon(0.1) with any numbers; FILE.py:FUNCTION, from the observation to the "
        "action; [green]run[/] also takes a .json or .csv file of actions.",
    ),
]  # fmt: skip
Json = Annotated[bool, Option("--json", help="Print JSON, for programs.")]
Jobs = Annotated[int | None, Option("--jobs", "-j", min=1, help="Processes; one for each processor by default.")]
Cluster = Annotated[
    str | None,
    Option("--cluster", metavar="ADDRESS", help="A Dask scheduler that does the work, such as tcp://10.0.0.1:8786."),
]
Retry = Annotated[bool, Option("--retry", help="Retry what failed before.")]
