"""The arguments and options that several commands share, with their help and their shell completion."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from taskspec.base.diagnostics import suggest
from taskspec.cli.failures import misuse

CHARTS = (".svg", ".png", ".pdf")
MAX_OFFERED = 100


def flowed(doc: str) -> str:
    """Return a docstring with its paragraphs on one line each, for the width of whoever reads it; indented lines stay."""
    paragraphs = inspect.cleandoc(doc).split("\n\n")
    return "\n\n".join(p if p.startswith(" ") else " ".join(p.split("\n")) for p in paragraphs)


def checked_choice(name: str, value: str, allowed: Sequence[str]) -> str:
    """Return the value of an option.

    Raises:
        UsageError: when it is not one of those allowed.
    """
    if value not in allowed:
        listed = ", ".join(allowed)
        raise misuse(f"{name} is one of {listed}, not '{value}'", suggest(value, allowed))
    return value


def complete_targets(incomplete: str) -> list[tuple[str, str]]:
    """Ids of known tasks, and specs and folders on disk, that start like this."""
    from taskspec import registry

    known = registry.known().values()
    ids = [(e.id, e.path.name) for e in known if e.id.startswith(incomplete)]
    names = [(e.name, e.id) for e in known if incomplete and e.name.startswith(incomplete)]
    return (ids + names + complete_paths(incomplete))[:MAX_OFFERED]


def complete_paths(incomplete: str) -> list[tuple[str, str]]:
    """Specs, and folders, that a path may go on to."""
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(head + slash or ".")
    if not folder.is_dir():
        return []
    found = [p for p in sorted(folder.iterdir()) if p.name.startswith(tail) and (tail or not p.name.startswith("."))]
    folders = [(f"{head}{slash}{p.name}/", "folder") for p in found if p.is_dir()]
    return [(f"{head}{slash}{p.name}", "spec") for p in found if p.suffix in (".yaml", ".yml")] + folders


def complete_experiments(incomplete: str) -> list[tuple[str, str]]:
    """Return the experiments that come with the suites, and files on disk."""
    from taskspec.experiments.reading import shipped

    return [(name, path.name) for name, path in shipped().items() if name.startswith(incomplete)] + complete_paths(
        incomplete
    )


def complete_learners(incomplete: str) -> list[tuple[str, str]]:
    """Return the learners that come with the package, experiments, and files on disk."""
    from taskspec.learners import BUILT_IN

    own = [(entry.name, entry.summary) for entry in BUILT_IN.values() if entry.name.startswith(incomplete)]
    return own + complete_experiments(incomplete)


def complete_parameters(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """`L=10` for the parameters of the task on the command line: with their defaults, and what they mean."""
    task = _task_in(ctx)
    if task is None:
        return []
    from taskspec.base.numbers import setting

    name, sign, _ = incomplete.partition("=")
    if sign:
        values = next((p.values or () for p in task.parameters if p.name == name), ())
        return [(f"{name}={v}", "") for v in values if f"{name}={v}".startswith(incomplete)]
    return [
        (f"{p.name}={setting(p.default)}", p.doc or p.kind) for p in task.parameters if p.name.startswith(incomplete)
    ]


def complete_variants(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Variants of the spec on the command line."""
    from taskspec import registry
    from taskspec.source.scan import scan

    target = _target_in(ctx)
    try:
        name = registry.instance(target or "").name
        path = Path(name) if registry.is_path(name) else registry.find(name).path
        found = scan(path.read_text(encoding="utf-8")).tasks
    except (ValueError, OSError):
        return []
    return [(variant, name) for name, variant in found if variant is not None and variant.startswith(incomplete)]


def _target_in(ctx: typer.Context) -> str | None:
    """Return the task that the words before the cursor name. An option still without its value leaves them all in `args`."""
    found = ctx.params.get("task") or ctx.params.get("targets") or ctx.args
    words = [found] if isinstance(found, str) else found
    return next((word for word in words if not word.startswith("-")), None)


def _task_in(ctx: typer.Context) -> Any:
    from taskspec import registry

    target = _target_in(ctx)
    try:
        return None if target is None else registry.load(target, ctx.params.get("variant"))
    except (ValueError, OSError):
        return None


def complete_modifiers(incomplete: str) -> list[tuple[str, str]]:
    """`sticky=` and the others: with what they do."""
    from taskspec.modifiers import MODIFIERS

    return [(n + "=" * bool(e.arguments), e.doc) for n, e in MODIFIERS.items() if n.startswith(incomplete)]


def complete_limits(incomplete: str) -> list[tuple[str, str]]:
    """`seconds=10` for the limits that can be changed: with their defaults, and what they are about."""
    from taskspec.base.limits import table

    return [
        (f"{row.name}={row.value}", row.what) for row in table() if not row.fixed and row.name.startswith(incomplete)
    ]


def _set_limits(ctx: typer.Context, given: list[str] | None) -> list[str] | None:
    """Set the limits while the command runs."""
    if given:
        from taskspec.base.limits import also

        ctx.with_resource(also(",".join(given)))
    return given


def complete_policies(incomplete: str) -> list[tuple[str, str]]:
    """Return names of policies, and files."""
    from taskspec.policies.named import NAMES

    return [p for p in NAMES.items() if p[0].startswith(incomplete)] + complete_paths(incomplete)


TaskArgument = Annotated[
    str,
    typer.Argument(
        metavar="TASK", help="An id, or the path of a spec.", autocompletion=complete_targets, show_default=False
    ),
]
Targets = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[TASK|FOLDER]...",
        help="Ids, specs, suites or folders of specs; all known tasks if omitted.",
        autocompletion=complete_targets,
        show_default=False,
    ),
]
Variant = Annotated[
    str | None,
    typer.Option("--variant", "-v", metavar="NAME", help="A variant of the spec.", autocompletion=complete_variants),
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        "-p", "--param", metavar="NAME=VALUE,...",
        help="A parameter, such as [green]-p L=20[/], or several values, [green]-p L=5,10,20[/]; may be repeated.",
        autocompletion=complete_parameters,
    ),
]  # fmt: skip
Modifiers = Annotated[
    list[str] | None,
    typer.Option(
        "-m", "--modifier", metavar="NAME=VALUE", autocompletion=complete_modifiers,
        help="A modifier of the task, such as [green]-m sticky=0.25[/]; may be repeated; the order matters.",
    ),
]  # fmt: skip
LimitsGiven = Annotated[
    list[str] | None,
    typer.Option(
        "--limit", metavar="NAME=VALUE", callback=_set_limits, autocompletion=complete_limits, show_default=False,
        help="Limit the cost of an analysis: [green]--limit seconds=60[/], or [green]seconds=0[/] to skip it; may be repeated.",
    ),
]  # fmt: skip
Json = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
PolicyName = Annotated[
    str,
    typer.Option(
        "--policy", metavar="NAME|FILE", autocompletion=complete_policies,
        help="random, expert, optimal, soft(1), epsilon(0.1) with any numbers; FILE.py:FUNCTION, from the observation to the "
        "action; [green]run[/] also takes a .json or .csv file of actions.",
    ),
]  # fmt: skip
