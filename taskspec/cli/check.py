"""`taskspec check`: proves specs right, or says exactly where they are wrong."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.cli.console import say
from taskspec.cli.options import Json, LimitsGiven, Modifiers, Parameters, Targets, Variant

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

    from taskspec.cli.checking import Checked, FileReport
    from taskspec.cli.targets import File
    from taskspec.source.scan import Kind

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
    from taskspec.cli.checking import counts
    from taskspec.cli.targets import checked_choice, files_of, others_of

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
    from taskspec.cli.checking import Check, check_file, check_other, examine, started
    from taskspec.cli.progress import progress

    checks = [Check(path, partial(check_other, path, kind)) for path, kind in others]
    for file in files:
        prove = partial(examine, sense=sense, defaults=not file.parameters)
        checks.append(Check(file.path, partial(check_file, file, prove)))
    with started(checks, jobs) as reports, progress("check"):
        return reports()


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
    """What was checked, file by file, and how."""
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
    """What was left out, and why, each reason once."""
    skipped = [each.finding.skipped for report in reports for each in report.tasks]
    return list(dict.fromkeys(reason for reason in skipped if reason))


def mark(diagnostics: Sequence[Any]) -> Any:
    """A sign for errors, for warnings, for neither."""
    from taskspec.cli.checking import counts
    from taskspec.cli.console import VisibleText

    errors, warnings = counts(diagnostics)
    if errors:
        return VisibleText("✗", style="bad")
    return VisibleText("!", style="warn") if warnings else VisibleText("✓", style="good")


def verdict(reports: Sequence[FileReport], errors: int, warnings: int, seconds: float) -> Any:
    """The last line: how many tasks, how many problems, how long."""
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


def plural(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


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
    """Diagnostics as data, as `diagnostics.render` writes them."""
    from json import loads

    from taskspec.base.diagnostics import render

    return loads(render(diagnostics, "json"))


def _accepted(reports: Sequence[FileReport]) -> list[dict[str, Any]]:
    found = [a for report in reports for a in report.accepted]
    warnings = records([a.warning for a in found])
    return [warning | {"because": a.because} for warning, a in zip(warnings, found, strict=True)]


def _record(path: str, each: Checked) -> dict[str, Any]:
    from taskspec.cli.checking import counts

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
