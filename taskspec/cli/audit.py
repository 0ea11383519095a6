"""`taskspec audit`: what is wrong with an environment that is not ours, and what is true of it."""

from __future__ import annotations

import contextlib
import json as json_text
import sys
import warnings
from typing import Annotated, Any

import typer
from typer import Argument, Option

from taskspec.cli import options
from taskspec.cli.console import misuse, progress, say, write_json


def audit(
    env: Annotated[
        str,
        Argument(
            metavar="ENV",
            help="An id of Gymnasium, [cyan]module:id[/] to import a module first, or [cyan]FILE.py:FUNCTION[/] that makes it.",
        ),
    ],
    kwargs: Annotated[str, Option("--kwargs", metavar="JSON", help="Keyword arguments, as a JSON object.")] = "{}",
    seconds: Annotated[float, Option("--seconds", min=1, help="Time that the audit may take, roughly.")] = 60.0,
    replay: Annotated[str | None, Option("--replay", metavar="TRACE", help="Play a trace of a report instead.")] = None,
    json: options.Json = False,
) -> None:
    """Look for faults of any Gymnasium environment.

    A small one is tabulated and solved exactly; a large one is sampled. Faults end with exit status 1; facts, such as that
    the state is hidden, do not. Each comes with a trace, a seed and actions, that [green]--replay[/] plays again.
    """
    from taskspec.tools.audit.report import examined, print_audit, print_steps
    from taskspec.tools.audit.subject import Subject

    given = _kwargs(kwargs)
    with contextlib.redirect_stdout(sys.stderr), warnings.catch_warnings(action="ignore"), progress("audit"):
        subject = Subject(env, given)
        if replay is None:
            report = examined(subject, seconds)
        else:
            trace = subject.read(replay)
            steps = subject.play(trace)
            again = subject.play(trace, world=1)
    if replay is not None:
        print_steps(steps, again)
        say(f"\n{subject.script(trace)}")
        return
    if json:
        write_json(report.record())
    else:
        print_audit(report)
    if report.faults:
        raise typer.Exit(1)


def _kwargs(text: str) -> dict[str, Any]:
    try:
        given = json_text.loads(text)
    except ValueError:
        given = None
    if not isinstance(given, dict):
        raise misuse(f"--kwargs is a JSON object, not {text}", "for example --kwargs '{\"size\": 5}'")
    return given
