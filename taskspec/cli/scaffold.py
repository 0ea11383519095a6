"""`taskspec new`, `schema`, `lsp` and `studio`: a spec to start from, and help for editors."""

from __future__ import annotations

import re
import webbrowser
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from taskspec.base.diagnostics import spec_error
from taskspec.base.display import visible_json
from taskspec.base.extras import need
from taskspec.base.files import write_text
from taskspec.cli import options
from taskspec.cli.console import misuse, say, write_output
from taskspec.cli.options import file_option

SCAFFOLD = """\
# Completion and marks in an editor: run `taskspec schema -o taskspec.schema.json`, then make the next line
# the first one:     # yaml-language-server: $schema=taskspec.schema.json
taskspec: 1
name: {name}
title: {title}
summary: Walk along a corridor to the goal at its end.        # one sentence
description: |                                                # Markdown, with $math$
  The agent starts at the left end of a corridor of $L$ steps and is paid once it stands at the right end.
  What a learner must get right to do well here, and what cannot matter, belongs in this paragraph.
capability: exploration              # the one thing this task isolates
# sources:                           # where the task comes from
#   - {{key: author2020title, where: section 3}}

parameters:                          # parameters: `taskspec run FILE -p L=8`, and gym.make(..., L=8)
  L: {{type: int, default: 5, low: 1, high: 100, doc: length of the corridor}}

state:                               # types: int, real, bool, choice; bounds are inclusive
  s: {{type: int, low: 0, high: L, doc: position}}
action:
  a: {{type: choice, values: {{left: -1, right: 1}}, doc: direction of the step}}
# observation:                       # what the agent sees; the state itself unless given
#   position: s / L

horizon: 2 * L                       # the episode is cut off after so many steps; `none` for never
initial:                             # distributions are drawn where they stand: `s: UniformInt(0, L)`
  s: 0
dynamics:                            # a prime marks the next value; what is not named stays as it is
  s': clip(s + a, 0, L)
reward: s' == L                      # a condition counts as 0 or 1
terminal: s' == L                    # ends the episode

expert:                              # or `optimal`, or `soft(1)`
  a: right
claims:                              # statements that `taskspec check` holds you to
  - optimal_return == 1
  - expert_return == optimal_return
"""


def new(
    name: Annotated[
        str,
        Argument(metavar="NAME|FILE", help="Name of the task, such as RiskyPath, or a file, such as risky_path.yaml."),
    ],
    output: Annotated[
        Path | None, Option("--output", "-o", metavar="FILE", help="Where to write it; risky_path.yaml by default.")
    ] = None,
) -> None:
    """Write a commented spec to start from.

    It passes [cyan]taskspec check[/] as it is, and shows every section that most tasks need.
    """
    path = Path(name)
    is_file = path.suffix in (".yaml", ".yml")
    if is_file:
        name = "".join(word[:1].upper() + word[1:] for word in re.split(r"[_\W]+", path.stem))
    if not re.fullmatch("[A-Za-z][A-Za-z0-9]*", name):
        raise spec_error("E205", f"'{name}' cannot name a task: letters and digits only, a letter first")
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name).lower()
    if not is_file:
        path = Path(f"{words.replace(' ', '_')}.yaml")
    if output is not None:
        if output.is_dir():
            path = output / path
        else:
            path = output
    write_text(path, SCAFFOLD.format(name=name, title=words.capitalize()), new=True)
    say(
        f"wrote {path}\n\n  taskspec check {path}\n  taskspec show {path}\n  taskspec run {path} --policy expert --render ansi"
    )


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
    from taskspec.language.task.schema.experiments import ExamDocument, Experiment, FindingsDocument, document_schema
    from taskspec.language.task.schema.export import json_schema

    if experiment + exam + findings > 1:
        raise misuse("--experiment, --exam and --findings are three schemas; ask for one")
    schema = json_schema()
    for model, wanted in ((Experiment, experiment), (ExamDocument, exam), (FindingsDocument, findings)):
        if wanted:
            schema = document_schema(model)
    write_output(visible_json(schema) + "\n", output)


def lsp() -> None:
    """Serve an editor: mistakes while typing, completion, meanings, fixes and exact scores.

    It speaks the Language Server Protocol over standard input and output; an editor starts it. It needs the extra
    [green]editor[/].
    """
    from taskspec.tools.editor import serve

    serve()


def studio(
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FILE|FOLDER", help="A spec, or a folder of specs.", autocompletion=options.complete_paths
        ),
    ] = Path(),
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="The port; 0 takes one that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Write specs in the browser: mathematics, figure, exact scores and episodes follow the text.

    It serves a page on this machine alone, until Ctrl-C, and reads and writes no file outside the folder. It needs the extra
    [green]studio[/].
    """
    for package in ("starlette", "uvicorn", "websockets"):
        need(package, "studio", "the studio")
    from taskspec.tools.studio.server import Studio, run

    def ready(address: str) -> None:
        say(f"{address}\nCtrl-C ends the studio.")
        if browser:
            webbrowser.open(address)

    run(Studio.of(target, port, SCAFFOLD), ready)
