"""`taskspec fmt`: the usual layout of specs."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Annotated

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.display import plural
from taskspec.base.files import write_text
from taskspec.cli.completions import complete_paths
from taskspec.cli.console import print_diagnostics, say
from taskspec.show.terminal.styled_text import console


def fmt(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE|FOLDER...",
            show_default=False,
            autocompletion=complete_paths,
            help="Specs, and folders of specs.",
        ),
    ],
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; exit status 1 if a file would change.")
    ] = False,
    diff: Annotated[bool, typer.Option("--diff", help="Change nothing; show what would change.")] = False,
) -> None:
    """Write specs in their usual layout.

    Expressions get the spaces of their printed form, and rows of tables and of lists of lists stand under each other.
    Comments, quotes, line breaks and the order of everything stay, and so does what the specs mean. A file that cannot be read
    stays as it is; the others are written all the same.
    """  # fmt: skip
    from taskspec.language.source import read_file
    from taskspec.tools.authoring.formatting import formatted
    from taskspec.tools.targets import files_of

    problems: list[Diagnostic] = []
    changed = 0
    paths = dict.fromkeys(file.path for file in files_of(targets))
    for path in paths:
        try:
            text = read_file(path).origin.text
            new = formatted(text, str(path))
        except SpecError as error:
            problems += error.diagnostics
            continue
        if new == text:
            continue
        changed += 1
        if diff:
            _show(path, text, new)
        elif check:
            say(str(path))
        else:
            write_text(path, new)
    print_diagnostics(problems)
    done = "would change" if check or diff else "changed"
    console(err=True).print(f"{plural(changed, 'file')} {done}, {len(paths) - changed} left as they are")
    if problems or (check and changed):
        raise typer.Exit(1)


def _show(path: Path, old: str, new: str) -> None:
    for line in difflib.unified_diff(old.splitlines(), new.splitlines(), str(path), str(path), lineterm=""):
        say(line)
