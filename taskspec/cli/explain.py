"""`taskspec explain`: what a code means."""

from __future__ import annotations

from itertools import groupby
from typing import Annotated

from typer import Argument

from taskspec.base.codes import Code, classes, codes
from taskspec.base.diagnostics import spec_error, suggest
from taskspec.base.terminal import Columns, VisibleText, colored, console, line, terminal_width
from taskspec.cli import options
from taskspec.cli.console import say, write_json

CODE_FIELDS = ("code", "slug", "severity", "title", "explanation")
CodeArgument = Annotated[str | None, Argument(metavar="[CODE]", help="A code or its name; lists all if omitted.")]


def explain(code: CodeArgument = None, json: options.Json = False) -> None:
    """Explain an error or a warning, such as E302, with an example."""
    if code is None:
        chosen = list(codes().values())
    else:
        chosen = [_find(code)]
    if json:
        write_json([{name: getattr(each, name) for name in CODE_FIELDS} for each in chosen])
    elif code is None:
        table = Columns("", "", "", fold=(2,), styles=("name", "", "quiet"))
        for prefix, members in groupby(chosen, lambda each: each.code[:2]):
            subject = VisibleText(classes().get(prefix, ""), style="title")
            table.add_row(VisibleText(prefix + "xx", style="bold default"), subject)
            for each in members:
                table.add_row(f"  {each.code}", each.slug, each.title)
        console(wide=True).print(table)
    else:
        _explain(chosen[0])


def _find(text: str) -> Code:
    wanted = text.strip("[]").split(" ")[0].lower()
    for code in codes().values():
        if wanted in (code.code.lower(), code.slug):
            return code
    near = suggest(wanted.upper(), codes()) or suggest(wanted, [c.slug for c in codes().values()])
    raise spec_error("E713", f"there is no code '{text}'", near or "`taskspec explain` lists them all")


def _explain(code: Code) -> None:
    out = console()
    style = "warn"
    if code.severity == "error":
        style = "bad"
    out.print(line((f"{code.severity}[{code.code} {code.slug}]", style), f": {code.title}\n"))
    if colored():
        from rich.markdown import Markdown

        out.print(Markdown(code.explanation, code_theme="ansi_dark"))
    elif terminal_width() is None:
        say(code.explanation)
    else:
        parts = []
        for i, part in enumerate(code.explanation.split("```")):
            if i % 2:
                parts.append(f"```{part}```")
            else:
                parts += [" ".join(paragraph.split()) for paragraph in part.split("\n\n") if paragraph.strip()]
        out.print("\n\n".join(parts))
