"""`taskspec explain`: what a code means, and a mistake in a learner."""

from __future__ import annotations

from dataclasses import asdict
from itertools import groupby
from typing import Annotated

from typer import Argument

from taskspec.base.codes import Code, classes, codes
from taskspec.base.diagnostics import spec_error, suggest
from taskspec.cli import options
from taskspec.cli.console import say, write_json
from taskspec.learn.exam.mistakes import MISTAKES, KnownMistake, anchor
from taskspec.show.terminal.styled_text import Columns, VisibleText, colored, console, line, terminal_width

CODE_FIELDS = ("code", "slug", "severity", "title", "explanation")
CodeArgument = Annotated[
    str | None, Argument(metavar="[CODE]", help="A code, its name, or the name of a mistake; lists all if omitted.")
]
BY_ANCHOR = {anchor(name): name for name, mistake in MISTAKES.items() if mistake.explanation}


def explain(code: CodeArgument = None, json: options.Json = False) -> None:
    """Explain an error or a warning, such as E302, or a mistake in a learner, such as limit_is_an_end, with an example."""
    mistake = BY_ANCHOR.get(anchor(code or ""))
    if mistake is not None:
        _explain_mistake(mistake, MISTAKES[mistake], json)
        return
    if code is None:
        chosen = list(codes().values())
    else:
        chosen = [_find(code)]
    if json:
        write_json([{name: getattr(each, name) for name in CODE_FIELDS} for each in chosen])
    elif code is None:
        console(wide=True).print(_listed(chosen))
    else:
        _explain_code(chosen[0])


def _listed(listed: list[Code]) -> Columns:
    table = Columns("", "", "", fold=(2,), styles=("name", "", "quiet"))
    for prefix, members in groupby(listed, lambda each: each.code[:2]):
        subject = VisibleText(classes().get(prefix, ""), style="title")
        table.add_row(VisibleText(prefix + "xx", style="bold default"), subject)
        for each in members:
            table.add_row(f"  {each.code}", each.slug, each.title)
    table.add_row("", VisibleText("Mistakes in learners", style="title"))
    for slug, name in BY_ANCHOR.items():
        table.add_row("", slug, f"a learner {MISTAKES[name].what}")
    return table


def _find(text: str) -> Code:
    wanted = text.strip("[]").split(" ")[0].lower()
    for code in codes().values():
        if wanted in (code.code.lower(), code.slug):
            return code
    slugs = [code.slug for code in codes().values()]
    near = suggest(wanted.upper(), codes()) or suggest(wanted, [*slugs, *BY_ANCHOR])
    raise spec_error("E713", f"there is no code '{text}'", near or "`taskspec explain` lists them all")


def _explain_code(code: Code) -> None:
    style = "bad" if code.severity == "error" else "warn"
    _print((f"{code.severity}[{code.code} {code.slug}]", style), f": {code.title}", code.explanation)


def _explain_mistake(name: str, mistake: KnownMistake, json: bool) -> None:
    if json:
        write_json([{"mistake": name, **asdict(mistake)}])
        return
    parts = [mistake.explanation, mistake.fix]
    if mistake.oracle:
        parts.append(f"It fails against {mistake.calls}.")
    if mistake.reported:
        parts.append(f"Public threads about it: {', '.join(mistake.reported)}.")
    _print((name, "warn"), f": a learner {mistake.what}", "\n\n".join(parts))


def _print(name: tuple[str, str], title: str, explanation: str) -> None:
    """Print a heading, and an explanation in Markdown."""
    out = console()
    out.print(line(name, f"{title}\n"))
    if colored():
        from rich.markdown import Markdown

        out.print(Markdown(explanation, code_theme="ansi_dark"))
    elif terminal_width() is None:
        say(explanation)
    else:
        paragraphs = []
        for i, part in enumerate(explanation.split("```")):
            if i % 2:
                paragraphs.append(f"```{part}```")
                continue
            for paragraph in part.split("\n\n"):
                paragraphs.append(" ".join(paragraph.split()))
        out.print("\n\n".join(filter(None, paragraphs)))
