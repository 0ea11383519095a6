"""`taskspec check`: proves specs right, or says exactly where they are wrong."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Annotated

import typer
from typer import Option

from taskspec.base.diagnostics import render
from taskspec.base.display import plural
from taskspec.cli import options
from taskspec.cli.console import print_diagnostics, progress, say, write_json
from taskspec.show.terminal.styled_text import console

FORMATS = ("text", "json", "github")
Format = Annotated[str, options.choices_option("--format", allowed=FORMATS, help="Text, JSON, or GitHub annotations.")]
Quick = Annotated[bool, Option("--quick", help="Only soundness for the given parameters; no sanity checks, no claims.")]
AllBackends = Annotated[
    bool, Option("--all-backends", help="Also run what takes seconds to compile: every backend that is installed.")
]
Fix = Annotated[bool, Option("--fix", help="Write what hints say to write into the files, and check them again.")]


def check(
    targets: options.Targets = None,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    format: Format = "text",
    json: options.Json = False,
    strict: Annotated[bool, Option("--strict", help="Count warnings as errors.")] = False,
    quick: Quick = False,
    all_backends: AllBackends = False,
    fix: Fix = False,
    jobs: options.Jobs = None,
    limits: options.LimitsGiven = None,
) -> None:
    """Prove that specs are correct, or say exactly what is wrong and where.

    For every task and variant of the given files and folders, it checks the shape of the spec, the meaning of every
    expression, soundness (with a counterexample where it fails) for the default parameters and at the ends of their
    ranges, sanity checks, and the claims. The scalar and the NumPy program are reset and stepped at each of these settings, and
    compared with the reference interpreter. With [green]-p[/], it checks soundness and sanity for those parameters. For
    experiments, it checks that every instance exists; for exams and findings, that every rule is meaningful.

    Exit status 1 if there is an error.
    """
    from taskspec.cli import check_text
    from taskspec.tools.authoring.checks import check_files, counts, examine, problems_of
    from taskspec.tools.authoring.formatting import fix_files
    from taskspec.tools.targets import files_of, others_of

    start = time.perf_counter()
    options.checked_choice("--format", format, FORMATS)
    files = files_of(targets or [], parameters or [], modifiers or [])
    if variant is not None:
        files = [replace(file, variants=(variant,)) for file in files]
    others = others_of(targets or [])
    prove = partial(examine, sense=not quick, all_backends=all_backends)
    with progress("check"):
        reports = check_files(others, files, prove, jobs)
    if fix:
        number = fix_files(problems_of(reports))
        console(err=True).print(f"{plural(number, 'mistake')} put right")
        if number:
            with progress("check"):
                reports = check_files(others, files, prove, jobs)
    problems = problems_of(reports)
    seconds = time.perf_counter() - start
    if json or format == "json":
        write_json(check_text.record(reports, seconds))
    elif format == "github":
        if problems:
            say(render(problems, "github"))
        check_text.print_verdict(reports, seconds, err=True)
    else:
        print_diagnostics(problems, err=False)
        if problems:
            say("")
        check_text.print_table(reports)
        check_text.print_verdict(reports, seconds)
    errors, warnings = counts(problems)
    if errors or (strict and warnings):
        raise typer.Exit(1)
