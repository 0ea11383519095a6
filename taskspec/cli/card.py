"""`taskspec card`: the card of a task."""

from __future__ import annotations

from typing import Annotated

from typer import Option

from taskspec.cli import options
from taskspec.cli.console import progress, say, write_json


def card(
    task: options.TaskArgument,
    format: Annotated[str, Option("--format", "-f", metavar="md|json", help="Markdown, or JSON-LD.")] = "md",
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    limits: options.LimitsGiven = None,
) -> None:
    """Print the card of a task, for papers, data sets and hubs.

    Name, version, capability, sources, parameters, spaces, horizon, returns, claims and licence: as Markdown with front
    matter, or as JSON-LD in the terms of schema.org.
    """
    from taskspec.show.pages import card as cards
    from taskspec.show.pages.facts import gather
    from taskspec.tools.targets import task_of

    options.checked_choice("--format", format, ("md", "json"))
    built = task_of(task, variant, parameters or [], modifiers or [])
    with progress("scores"):
        facts = gather(built)
    content = cards.linked_data(built, facts)
    if format == "json":
        write_json(content)
    else:
        say(cards.markdown(content), nl=False)
