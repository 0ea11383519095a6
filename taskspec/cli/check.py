"""`taskspec check`: proves specs right, or says exactly where they are wrong."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.diagnostics import Diagnostic, SpecError, in_order
from taskspec.base.numbers import plural
from taskspec.cli.console import say
from taskspec.cli.options import Json, LimitsGiven, Modifiers, Parameters, Targets, Variant

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

    from taskspec.check.file_checks import Checked, FileReport, Finding
    from taskspec.check.report import Report
    from taskspec.source.scan import Kind
    from taskspec.targets import File
    from taskspec.task.task import Task

FORMATS = ("text", "json", "github")
OTHER_NOUNS: dict[Kind, str] = {"experiment": "experiment", "exam": "exam", "findings": "findings file"}
ENTRIES: dict[Kind, str] = {"experiment": "instance", "exam": "rule", "findings": "finding"}
"""What files that are no specs are called, and their entries."""
Format = Annotated[
    str,
    typer.Option(
        "--format", metavar="|".join(FORMATS), help="Text, JSON, or GitHub annotations.", autocompletion=lambda: FORMATS
    ),
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", "-j", min=1, help="Processes; one for each processor by default.", show_default=False),
]
Strict = Annotated[bool, typer.Option("--strict", help="Count warnings as errors.")]
Quick = Annotated[
    bool, typer.Option("--quick", help="Only soundness for the given parameters; no sanity checks, no claims.")
]


def check(
    targets: Targets = None,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    format: Format = "text",
    json: Json = False,
    strict: Strict = False,
    quick: Quick = False,
    jobs: Jobs = None,
    limits: LimitsGiven = None,
) -> None:
    """Prove that specs are correct, or say exactly what is wrong and where.

    For every task and variant of the given files and folders, it checks the shape of the spec, the meaning of every
    expression, soundness (with a counterexample where it fails) for the default parameters and at the ends of their
    ranges, sanity checks, and the claims. With [green]-p[/], it checks soundness and sanity for those parameters. For
    experiments, it checks that every instance exists; for exams and findings, that every rule is meaningful.

    Exit status 1 if there is an error.
    """
    from taskspec.check.file_checks import counts
    from taskspec.cli.options import checked_choice
    from taskspec.targets import files_of, others_of

    start = time.perf_counter()
    format = "json" if json else checked_choice("--format", format, FORMATS)  # noqa: A001
    files = files_of(targets or [], parameters or [], modifiers or [])
    if variant is not None:
        files = [replace(file, variants=(variant,)) for file in files]
    reports = _checked(others_of(targets or []), files, not quick, jobs)
    errors, warnings = counts(d for report in reports for d in report.diagnostics)
    _PRINTERS[format](reports, errors, warnings, time.perf_counter() - start)
    if errors or (strict and warnings):
        raise typer.Exit(1)


def _checked(
    others: Iterable[tuple[Path, Kind]], files: Iterable[File], sense: bool, jobs: int | None
) -> list[FileReport]:
    from taskspec import exact, figures  # noqa: F401  # before processes are forked, which then need not import them again
    from taskspec.check.file_checks import FileCheck, check_file, started
    from taskspec.cli.progress import progress

    checks = [FileCheck(path, partial(check_other, path, kind)) for path, kind in others]
    for file in files:
        prove = partial(examine, sense=sense, defaults=not file.parameters)
        checks.append(FileCheck(file.path, partial(check_file, file, prove)))
    with started(checks, jobs) as reports, progress("check"):
        return reports()


def examine(task: Task, sense: bool = True, defaults: bool = True) -> Finding:
    """Check a task.

    Args:
        task: a task without mistakes of form.
        sense: also check sanity and claims, beyond soundness.
        defaults: whether its parameters have their defaults: claims speak of these, and ranges are checked from there.
    """
    from taskspec.check.file_checks import finding

    return finding(reported(task, sense, defaults), len(task.examples) if sense and defaults else 0)


def reported(task: Task, sense: bool = True, defaults: bool = True) -> Report:
    """Return the report of `examine` with the results that it rests on, which may be large."""
    from taskspec import exact
    from taskspec.figures import undrawn

    wanted = sense and defaults
    return exact.check(task, ranges=wanted, with_warnings=sense, claims=wanted, beside=undrawn if sense else None)


def check_other(path: Path, kind: Kind) -> FileReport:
    """Check a file that is not a spec: its shape, and that all its entries mean something."""
    from taskspec.check.file_checks import FileReport

    try:
        diagnostics, entries = _entries(path, kind)
    except SpecError as error:
        return FileReport(str(path), (), error.diagnostics, kind=kind)
    return FileReport(str(path), (), in_order(diagnostics), kind=kind, entries=entries)


def _entries(path: Path, kind: Kind) -> tuple[Sequence[Diagnostic], int]:
    """Return the problems of an experiment, an exam or a findings file, and the number of its instances or rules."""
    if kind == "experiment":
        from taskspec.experiments import expand, read

        expanded = expand(read(path))
        return [*expanded.diagnostics, *expanded.refused], len(expanded.instances)
    from taskspec.rules.rule_books import read_exam, read_findings

    found = read_exam(path) if kind == "exam" else read_findings(path)
    return found.diagnostics, len(found.rules)


# -- text ---------------------------------------------------------------------------------------------------------


def _print_text(reports: Sequence[FileReport], errors: int, warnings: int, seconds: float) -> None:
    from taskspec.cli import failures
    from taskspec.cli.console import console

    problems = [d for report in reports for d in report.diagnostics]
    failures.show(problems, err=False)
    out = console(wide=True)
    if problems:
        out.print()
    out.print(table_of(reports))
    out.print()
    for remark in remarks(reports):
        out.print(remark, style="warn")
    out.print(verdict(reports, errors, warnings, seconds))


def table_of(reports: Sequence[FileReport]) -> Table:
    """Return what was checked, file by file, and how."""
    from taskspec.cli.console import VisibleText, columns

    built = any(each.id is not None for report in reports for each in report.tasks)
    shown = any(each.finding.examples for report in reports for each in report.tasks)
    mirrored = any(each.finding.symmetries for report in reports for each in report.tasks)
    headers = [
        "validated by",
        "settings",
        "claims",
        *(["examples"] if shown else []),
        *(["symmetries"] if mirrored else []),
    ]
    table = columns("", "", *(headers if built else ("", "", "")), fold=(1,))
    for report in reports:
        table.add_row(mark(report.diagnostics), VisibleText(report.path, style="title"))
        if report.kind != "taskspec":
            table.add_row("", VisibleText(f"  {plural(report.entries, ENTRIES[report.kind])}", style="quiet"))
        for each in report.tasks:
            found = each.finding
            ranges = f"{found.cases} tried" if found.cases else ""
            name = VisibleText(f"  {each.title}", style="name")
            row = [found.how, ranges, found.claims_words, *([found.examples_words] if shown else [])]
            row += [found.symmetries_words] if mirrored else []
            table.add_row(mark(each.diagnostics), name, *row)
    return table


def remarks(reports: Sequence[FileReport]) -> list[str]:
    """Return what was left out, and why, each reason once."""
    skipped = [each.finding.skipped for report in reports for each in report.tasks]
    return list(dict.fromkeys(reason for reason in skipped if reason))


def mark(diagnostics: Sequence[Any]) -> Any:
    """Return a sign for errors, for warnings, for neither."""
    from taskspec.check.file_checks import counts
    from taskspec.cli.console import VisibleText

    errors, warnings = counts(diagnostics)
    if errors:
        return VisibleText("✗", style="bad")
    return VisibleText("!", style="warn") if warnings else VisibleText("✓", style="good")


def verdict(reports: Sequence[FileReport], errors: int, warnings: int, seconds: float) -> Any:
    """Return the last line: how many tasks, how many problems, how long."""
    from taskspec.cli.console import line

    tasks = sum(len(report.tasks) for report in reports)
    kinds = Counter(report.kind for report in reports)
    others = [plural(kinds[kind], noun) for kind, noun in OTHER_NOUNS.items() if kinds[kind]]
    specs = (
        [f"{plural(tasks, 'task')} in {plural(kinds['taskspec'], 'spec')}"] if kinds["taskspec"] or not others else []
    )
    *most, last = [*specs, *others]
    what = f"{', '.join(most)} and {last}: " if most else f"{last}: "
    found = [(plural(errors, "error"), "bad")] if errors else []
    found += [(plural(warnings, "warning"), "warn")] if warnings else []
    found = found or [("no errors, no warnings", "good")]
    accepted = sum(len(report.accepted) for report in reports)
    found += [(f"{plural(accepted, 'warning')} accepted", "quiet")] if accepted else []
    parts: list[tuple[str, str] | str] = [what]
    for i, part in enumerate(found):
        parts += [", ", part] if i else [part]
    return line(*parts, (f"  ({seconds:.2f} s)", "quiet"))


# -- for programs -------------------------------------------------------------------------------------------------


def _print_json(reports: Sequence[FileReport], errors: int, warnings: int, seconds: float) -> None:
    from taskspec.cli.console import write_json

    found = [d for report in reports for d in report.diagnostics]
    tasks = [_record(report.path, each) for report in reports for each in report.tasks]
    write_json({
        "errors": errors, "warnings": warnings, "seconds": round(seconds, 4), "diagnostics": records(found), "tasks": tasks,
        "accepted": _accepted(reports),
        **{
            key: [{"path": r.path, ENTRIES[kind] + "s": r.entries} for r in reports if r.kind == kind]
            for key, kind in (("experiments", "experiment"), ("exams", "exam"), ("findings", "findings"))
        },
    })  # fmt: skip


def records(diagnostics: Sequence[Any]) -> Any:
    """Return diagnostics as data, as `diagnostics.render` writes them."""
    from json import loads

    from taskspec.base.diagnostics import render

    return loads(render(diagnostics, "json"))


def _accepted(reports: Sequence[FileReport]) -> list[dict[str, Any]]:
    found = [a for report in reports for a in report.accepted]
    warnings = records([a.warning for a in found])
    return [warning | {"because": a.because} for warning, a in zip(warnings, found, strict=True)]


def _record(path: str, each: Checked) -> dict[str, Any]:
    from taskspec.check.file_checks import counts

    errors, warnings = counts(each.diagnostics)
    return {
        "id": each.id, "name": each.name, "path": path, "variant": each.variant, "errors": errors, "warnings": warnings,
        "method": each.finding.method, "other_parameter_values": each.finding.cases,
        "claims_proved": each.finding.proved, "claims_tested": each.finding.tested,
        "claims": each.finding.verdicts,
        "examples": each.finding.examples, "examples_wrong": each.finding.wrong_examples, "skipped": each.finding.skipped,
        "symmetries": each.finding.symmetries, "seconds": round(each.seconds, 6),
    }  # fmt: skip


def _print_github(reports: Sequence[FileReport], errors: int, warnings: int, seconds: float) -> None:
    from taskspec.base.diagnostics import render
    from taskspec.cli.console import console

    text = render([d for report in reports for d in report.diagnostics], "github")
    if text:
        say(text)
    console(err=True).print(verdict(reports, errors, warnings, seconds))


_PRINTERS = {"text": _print_text, "json": _print_json, "github": _print_github}
