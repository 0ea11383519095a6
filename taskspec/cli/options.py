"""The arguments and options that several commands share, with their help and their shell completion."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from taskspec.base.diagnostics import suggest
from taskspec.base.display import count_of, seconds_of
from taskspec.cli.console import misuse

MAX_OFFERED = 100

Completions = list[tuple[str, str]]  # what a word may go on to, each with a remark


def flowed(doc: str) -> str:
    """Return a docstring with its paragraphs on one line each, for the width of whoever reads it; indented lines stay."""
    paragraphs = inspect.cleandoc(doc).split("\n\n")
    return "\n\n".join(p if p.startswith(" ") else " ".join(p.split("\n")) for p in paragraphs)


def checked_choice(name: str, value: str, allowed: Sequence[str]) -> str:
    """Return the value of an option."""
    if value not in allowed:
        listed = ", ".join(allowed)
        if name == "--format":
            code = "E726"
        else:
            code = "E713"
        raise misuse(f"{name} is one of {listed}, not '{value}'", suggest(value, allowed), code)
    return value


def split_names(texts: Sequence[str] | None) -> list[str]:
    """Return the names in an option that may be repeated, or given with commas."""
    return [name.strip() for text in texts or () for name in text.split(",")]


def checked_choices(option: str, texts: Sequence[str] | None, allowed: Sequence[str]) -> list[str]:
    """Return the names in an option that may be repeated, or given with commas."""
    return [checked_choice(option, name, allowed) for name in split_names(texts)]


def count(option: str, text: str | None) -> int | None:
    """Return a number such as 500k or 1.5M; None where none is given."""
    if text is None:
        found = None
    else:
        found = count_of(text)
    if text is not None and found is None:
        raise misuse(f"{option} is a number such as 500k, not '{text}'")
    return found


def seconds(option: str, text: str | None) -> float | None:
    """Return a time such as 5m, 90s or 1.5h in seconds; None where none is given."""
    if text is None:
        found = None
    else:
        found = seconds_of(text)
    if text is not None and found is None:
        raise misuse(f"{option} is a time such as 5m, 90s or 1.5h, not '{text}'")
    return found


def starting(incomplete: str, found: Completions) -> Completions:
    """Return the completions that begin with what is written so far."""
    return [each for each in found if each[0].startswith(incomplete)]


def complete_targets(incomplete: str) -> Completions:
    """Return ids of known tasks, and specs and folders on disk."""
    from taskspec.language import registry

    known = list(registry.known().values())
    found = starting(incomplete, [(e.id, e.path.name) for e in known])
    if incomplete:
        found += starting(incomplete, [(e.name, e.id) for e in known])
    return (found + complete_paths(incomplete))[:MAX_OFFERED]


def complete_paths(incomplete: str) -> Completions:
    """Return specs, and folders, that a path may go on to."""
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(head + slash or ".")
    if not folder.is_dir():
        return []
    specs: Completions = []
    folders: Completions = []
    for path in sorted(folder.iterdir()):
        if not path.name.startswith(tail) or (not tail and path.name.startswith(".")):
            continue
        if path.is_dir():
            folders.append((f"{head}{slash}{path.name}/", "folder"))
        elif path.suffix in (".yaml", ".yml"):
            specs.append((f"{head}{slash}{path.name}", "spec"))
    return specs + folders


def complete_experiments(incomplete: str) -> Completions:
    """Return the experiments that come with the suites, and files on disk."""
    from taskspec.learn.experiments.experiment_file import shipped

    known = [(name, path.name) for name, path in shipped().items()]
    return starting(incomplete, known) + complete_paths(incomplete)


def complete_learners(incomplete: str) -> Completions:
    """Return the learners that come with the package, experiments, and files on disk."""
    from taskspec.learn.learners import BUILT_IN

    known = [(entry.name, entry.summary) for entry in BUILT_IN.values()]
    return starting(incomplete, known) + complete_experiments(incomplete)


def complete_modifiers(incomplete: str) -> Completions:
    """Return `sticky=` and the others: with what they do."""
    from taskspec.language.modifiers import MODIFIERS

    return starting(incomplete, [(name + "=" * bool(e.arguments), e.doc) for name, e in MODIFIERS.items()])


def complete_policies(incomplete: str) -> Completions:
    """Return names of policies, and files."""
    from taskspec.exact.policies.policy import NAMES

    return starting(incomplete, list(NAMES.items())) + complete_paths(incomplete)


def _set_limits(ctx: typer.Context, given: list[str] | None) -> list[str] | None:
    """Set the limits while the command runs."""
    if given:
        from taskspec.base.limits import also

        ctx.with_resource(also(",".join(given)))
    return given


def choices_option(*names: str, allowed: Sequence[str], help: str) -> Any:
    """Return an option with some of the values allowed; see `checked_choices`."""
    return Option(*names, metavar="|".join(allowed), help=help, autocompletion=lambda: allowed)


def formats_option(allowed: Sequence[str], help: str) -> Any:
    return choices_option("--format", "-f", allowed=allowed, help=help)


def folder_option(help: str) -> Any:
    """Return the option for the folder that a command writes to."""
    return Option("--output", "--out", "-o", metavar="FOLDER", help=help, file_okay=False)


def file_option(*names: str, help: str) -> Any:
    """Return an option that names a file."""
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
