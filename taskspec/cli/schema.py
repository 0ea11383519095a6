"""`taskspec schema`: the JSON Schema that lets an editor complete and check specs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from taskspec.base.files import write_text
from taskspec.cli.console import say
from taskspec.cli.failures import misuse

Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write to this file.", dir_okay=False, show_default=False),
]


def schema(
    output: Output = None,
    experiment: Annotated[bool, typer.Option("--experiment", help="The schema of experiments.")] = False,
    exam: Annotated[bool, typer.Option("--exam", help="The schema of exams.")] = False,
    findings: Annotated[bool, typer.Option("--findings", help="The schema of findings.")] = False,
) -> None:
    """Print the JSON Schema of specs or related files, for editors.

    With yaml-language-server (VS Code, Neovim, Helix, Emacs), write it next to your specs:

        [cyan]taskspec schema -o taskspec.schema.json[/]

    and start every spec with this line, which gives completion, documentation, and error marks while typing:

        [green]# yaml-language-server: $schema=taskspec.schema.json[/]
    """
    from taskspec.cli.console import to_json
    from taskspec.task.schema.experiments import exam_schema, experiment_schema, findings_schema
    from taskspec.task.schema.export import json_schema

    asked = [
        made
        for given, made in ((experiment, experiment_schema), (exam, exam_schema), (findings, findings_schema))
        if given
    ]
    if len(asked) > 1:
        raise misuse("--experiment, --exam and --findings are three schemas; ask for one")
    text = to_json((asked or [json_schema])[0]())
    if output is None:
        say(text)
        return
    write_text(output, text + "\n")
    say(f"wrote {output}", err=True)
