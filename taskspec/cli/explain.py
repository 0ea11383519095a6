"""`taskspec explain E302`: what a code means and how to put it right."""

from __future__ import annotations

from itertools import groupby
from typing import Annotated

import typer

from taskspec.base.codes import CLASSES, CODES, Code
from taskspec.base.diagnostics import spec_error, suggest
from taskspec.cli.console import say
from taskspec.cli.options import Json


def complete_codes(incomplete: str) -> list[tuple[str, str]]:
    wanted = incomplete.lower()
    return [(c.code, c.title) for c in CODES.values() if c.code.lower().startswith(wanted)]


def explain(
    code: Annotated[
        str | None,
        typer.Argument(
            metavar="[CODE]",
            help="A code or its name; lists all if omitted.",
            autocompletion=complete_codes,
            show_default=False,
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Explain an error or a warning, such as E302, with an example."""  # fmt: skip
    found = list(CODES.values()) if code is None else [_find(code)]
    if json:
        from taskspec.cli.console import write_json

        write_json([_record(c) for c in found])
    elif code is None:
        _print_all(found)
    else:
        _print_one(found[0])


def _find(text: str) -> Code:
    """Return the code with this number or name, however it is spelt."""
    wanted = text.strip("[]").split(" ")[0].lower()
    for code in CODES.values():
        if wanted in (code.code.lower(), code.slug):
            return code
    near = suggest(wanted.upper(), CODES) or suggest(wanted, [c.slug for c in CODES.values()])
    raise spec_error("E713", f"there is no code '{text}'", near or "`taskspec explain` lists them all")


def _record(code: Code) -> dict[str, str]:
    return {
        "code": code.code, "slug": code.slug, "severity": code.severity, "title": code.title,
        "explanation": code.explanation.strip(),
    }  # fmt: skip


def _print_one(code: Code) -> None:
    from rich.markdown import Markdown

    from taskspec.cli.console import colored, console, line

    out = console()
    style = "bad" if code.severity == "error" else "warn"
    out.print(line((f"{code.severity}[{code.code} {code.slug}]", style), f": {code.title}\n"))
    if colored():
        out.print(Markdown(code.explanation.strip(), code_theme="ansi_dark"))
    else:
        say(code.explanation.strip())


def _print_all(codes: list[Code]) -> None:
    from taskspec.cli.console import VisibleText, columns, console

    table = columns("", "", "", fold=(2,))
    for prefix, members in groupby(codes, lambda c: c.code[:2]):
        table.add_row(VisibleText(prefix + "xx", style="title"), VisibleText(CLASSES.get(prefix, ""), style="title"))
        for code in members:
            table.add_row(
                VisibleText(f"  {code.code}", style="name"), code.slug, VisibleText(code.title, style="quiet")
            )
    console(wide=True).print(table)
