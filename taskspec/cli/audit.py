"""`taskspec audit`: what is wrong with an environment that is not ours, and what is true of it."""

from __future__ import annotations

import contextlib
import json as json_text
import sys
import warnings
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from taskspec.base.columns import Columns
from taskspec.base.display import decimal, plural
from taskspec.base.terminal import console, line
from taskspec.cli import options
from taskspec.cli.console import misuse, say, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from taskspec.tools.audit.findings import Audit
    from taskspec.tools.audit.subject import Subject


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
    from taskspec.tools.audit.findings import examined
    from taskspec.tools.audit.subject import Subject

    given = _kwargs(kwargs)
    with contextlib.redirect_stdout(sys.stderr), warnings.catch_warnings(action="ignore"), progress("audit"):
        subject = Subject(env, given)
        if replay is None:
            report = examined(subject, seconds)
    if replay is not None:
        _replay(subject, replay)
        return
    if json:
        write_json(report.record())
    else:
        _print(report)
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


def _print(report: Audit) -> None:
    out = console()
    out.print(line((report.name, "name"), (f"  {report.size}", "quiet")))
    table = Columns("", "", styles=("quiet",), fold=(1,))
    for name, words in report.values:
        table.add_row(f"  {name}", words)
    out.print(table)
    for kind, style in (("fault", "bad"), ("fact", "value")):
        for entry in report.of(kind):
            out.print(line((f"{kind} ", style), (f"{entry.check.name}: ", "title"), entry.finding.words))
            if entry.trace:
                say(f"  --replay '{entry.trace}'")
    count = plural(len(report.faults), "fault")
    out.print(line((count if report.faults else "no faults", "bad" if report.faults else "good")))


def _replay(subject: Subject, text: str) -> None:
    """Play a trace twice in new instances, and print what it gives and the code that does the same."""
    from taskspec.tools.audit.subject import first_difference, shown

    trace = subject.read(text)
    with contextlib.redirect_stdout(sys.stderr), warnings.catch_warnings(action="ignore"):
        steps = subject.play(trace)
        again = subject.play(trace, world=1)
    table = Columns("action", "observation", "reward", "end", fold=(1,))
    for step in steps:
        ends = " ".join(name for name in ("terminated", "truncated") if getattr(step, name))
        if step.action is None:
            action = "reset"
        else:
            action = shown(step.action)
        table.add_row(action, step.error or shown(step.observation, 200), decimal(step.paid), ends)
    console().print(table)
    t = first_difference(steps, again)
    say("a second run gives the same" if t is None else f"a second run differs at line {t + 1}: {again[t]}")
    say(f"\n{subject.script(trace)}")
