"""`taskspec reference`: the pages of the manual that are generated from the tables of the language."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from taskspec.base.files import write_text
from taskspec.cli.console import say


class ReferencePage(StrEnum):
    """The page to print."""

    language = "language"
    errors = "errors"
    modifiers = "modifiers"


Which = Annotated[ReferencePage, typer.Argument(help="The page to print.", show_default=False)]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write to this file.", dir_okay=False, show_default=False),
]


def reference(page: Which, output: Output = None) -> None:
    """Print the language reference, the guide to all errors, or the table of modifiers, as Markdown."""
    from taskspec.cli import manual

    pages = {"language": manual.language, "errors": manual.errors, "modifiers": manual.modifiers}
    text = pages[page.value]()
    if output is None:
        say(text, nl=False)
        return
    write_text(output, text)
    say(f"wrote {output}", err=True)
