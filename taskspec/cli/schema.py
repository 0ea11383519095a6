"""`taskspec schema`: the JSON Schema of specs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from taskspec.base.display import visible_json
from taskspec.cli.console import misuse, write_output
from taskspec.cli.options import file_option


def schema(
    output: Annotated[Path | None, file_option("--output", "-o", help="Write to this file.")] = None,
    experiment: Annotated[bool, Option("--experiment", help="The schema of experiments.")] = False,
    exam: Annotated[bool, Option("--exam", help="The schema of exams.")] = False,
    findings: Annotated[bool, Option("--findings", help="The schema of findings.")] = False,
) -> None:
    """Print the JSON Schema of specs or related files, for editors.

    With yaml-language-server (VS Code, Neovim, Helix, Emacs), write it next to your specs:

        [cyan]taskspec schema -o taskspec.schema.json[/]

    and start every spec with this line, which gives completion, documentation, and error marks while typing:

        [green]# yaml-language-server: $schema=taskspec.schema.json[/]
    """
    from taskspec.language.task.schema.export import json_schema
    from taskspec.learn.documents.document_models import ExamDocument, Experiment, FindingsDocument, document_schema

    if experiment + exam + findings > 1:
        raise misuse("--experiment, --exam and --findings are three schemas; ask for one")
    schema = json_schema()
    for model, wanted in ((Experiment, experiment), (ExamDocument, exam), (FindingsDocument, findings)):
        if wanted:
            schema = document_schema(model)
    write_output(visible_json(schema) + "\n", output)
