"""`taskspec check`: proves specs right, or says exactly where they are wrong."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from taskspec.base.columns import Columns
from taskspec.base.diagnostics import Diagnostic, SpecError, in_order, records, render
from taskspec.base.display import plural
from taskspec.base.terminal import VisibleText, console, line
from taskspec.cli import options
from taskspec.cli.console import print_diagnostics, say, write_json
from taskspec.cli.progress import progress

if TYPE_CHECKING:
    from pathlib import Path

    from taskspec.exact.check.file_checks import Checked, FileCheck, FileReport
    from taskspec.exact.check.report import Report
    from taskspec.language.source import Kind
    from taskspec.language.targets import File
    from taskspec.language.task.task import Task

FORMATS = ("text", "json", "github")
ENTRIES: dict[Kind, str] = {"experiment": "instance", "exam": "rule", "findings": "finding"}
"""The entries of files that are no specs."""
NOUNS: dict[Kind, str] = {"findings": "findings file"}


def check(
    targets: options.Targets = None,
    variant: options.Variant = None,
    parameters: options.Parameters = None,
    modifiers: options.Modifiers = None,
    format: Annotated[
        str, options.choices_option("--format", allowed=FORMATS, help="Text, JSON, or GitHub annotations.")
    ] = "text",
    json: options.Json = False,
    strict: Annotated[bool, Option("--strict", help="Count warnings as errors.")] = False,
    quick: Annotated[
        bool, Option("--quick", help="Only soundness for the given parameters; no sanity checks, no claims.")
    ] = False,
    all_backends: Annotated[
        bool,
        Option("--all-backends", help="Also run what takes seconds to compile: every backend that is installed."),
    ] = False,
    fix: Annotated[
        bool, Option("--fix", help="Write what hints say to write into the files, and check them again.")
    ] = False,
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
    from taskspec.exact.check.file_checks import counts
    from taskspec.language.targets import files_of, others_of

    start = time.perf_counter()
    options.checked_choice("--format", format, FORMATS)
    files = files_of(targets or [], parameters or [], modifiers or [])
    if variant is not None:
        files = [replace(file, variants=(variant,)) for file in files]
    others = others_of(targets or [])
    prove = partial(examine, sense=not quick, all_backends=all_backends)
    reports = _checked(others, files, prove, jobs)
    if fix:
        from taskspec.tools.authoring.formatting import fix_files

        number = fix_files(d for report in reports for d in report.diagnostics)
        console(err=True).print(f"{plural(number, 'mistake')} put right")
        if number:
            reports = _checked(others, files, prove, jobs)
    problems = [d for report in reports for d in report.diagnostics]
    seconds = time.perf_counter() - start
    if json or format == "json":
        _print_json(reports, problems, seconds)
    elif format == "github":
        if problems:
            say(render(problems, "github"))
        console(err=True).print(verdict(reports, problems, seconds))
    else:
        print_reports(reports, problems)
        console(wide=True).print(verdict(reports, problems, seconds))
    errors, warnings = counts(problems)
    if errors or (strict and warnings):
        raise typer.Exit(1)


def _checked(
    others: Iterable[tuple[Path, Kind]], files: Iterable[File], prove: Callable[..., Report], jobs: int | None
) -> list[FileReport]:
    from taskspec import exact  # noqa: F401  # before processes are forked, which then need not import them again
    from taskspec.exact.check.file_checks import check_file, run_checks
    from taskspec.show import figures  # noqa: F401  # before processes are forked, which then need not import them again

    checks: list[FileCheck] = [(path, partial(check_other, path, kind)) for path, kind in others]
    for file in files:
        checks.append((file.path, partial(check_file, file, partial(prove, defaults=not file.parameters))))
    with progress("check"):
        return run_checks(checks, jobs)


def examine(task: Task, sense: bool = True, defaults: bool = True, all_backends: bool = False) -> Report:
    """Check a task.

    Args:
        task: a task without mistakes of form.
        sense: also check sanity, claims and programs, beyond soundness.
        defaults: whether its parameters have their defaults: claims speak of these, and ranges are checked from there.
        all_backends: whether every backend that is installed is run, not only what is generated in milliseconds.
    """
    from taskspec import exact
    from taskspec.programs.agreement import EVERY, QUICK

    if not sense:
        return exact.check(task, ranges=False, with_warnings=False, claims=False, programs=())
    programs = EVERY if all_backends else QUICK
    return exact.check(task, ranges=defaults, claims=defaults, programs=programs, beside=_looks)


def _looks(task: Task) -> list[Diagnostic]:
    from taskspec.exact.check.spec_warnings import look_alikes
    from taskspec.show.figures import undrawn

    return [*undrawn(task), *look_alikes(task)]


def check_other(path: Path, kind: Kind) -> FileReport:
    """Check a file that is not a spec: its shape, and that all its instances, rules or findings mean something."""
    from taskspec.exact.check.file_checks import FileReport
    from taskspec.exact.rules.rule_books import read_exam, read_findings
    from taskspec.learn.experiments.experiment_file import read
    from taskspec.learn.experiments.instances import expand

    try:
        if kind == "experiment":
            expanded = expand(read(path))
            diagnostics: Sequence[Diagnostic] = [*expanded.diagnostics, *expanded.refused]
            entries = len(expanded.instances)
        else:
            if kind == "exam":
                found = read_exam(path)
            else:
                found = read_findings(path)
            diagnostics = found.diagnostics
            entries = len(found.rules)
    except SpecError as error:
        return FileReport(str(path), (), error.diagnostics, kind=kind)
    return FileReport(str(path), (), in_order(diagnostics), kind=kind, entries=entries)


def print_reports(reports: Sequence[FileReport], problems: Sequence[Diagnostic]) -> None:
    """Print problems, what was checked and how, and what was left out and why, each reason once."""
    print_diagnostics(problems, err=False)
    out = console(wide=True)
    if problems:
        out.print()
    out.print(_table(reports))
    out.print()
    tasks = [each for report in reports for each in report.tasks]
    for text in _programs(tasks):
        out.print(text, style="quiet")


def _programs(tasks: Sequence[Checked]) -> Iterator[str]:
    from taskspec.programs.agreement import EVERY

    run = Counter[str]()
    left_out = Counter[tuple[str, str]]()
    for each in tasks:
        run.update(each.programs)
        left_out.update(each.left_out)
    for number, names in _grouped(run).items():
        if number:
            yield f"programs: {', '.join(names)} ran at {plural(number, 'setting')} as the interpreter"
    for reason in dict.fromkeys(reason for _, reason in left_out):
        without = {name: number for (name, why), number in left_out.items() if why == reason}
        for number, names in _grouped(without).items():
            yield f"not run at {plural(number, 'setting')}: {', '.join(names)} ({reason})"
    tried = {*run, *(name for name, _ in left_out)}
    others = [name for name in EVERY if name not in tried]
    if tried and others:
        yield f"not run: {', '.join(others)} (--all-backends)"


def _grouped(counts: Mapping[str, int]) -> dict[int, list[str]]:
    names: dict[int, list[str]] = {}
    for name, number in counts.items():
        names.setdefault(number, []).append(name)
    return names


def _table(reports: Sequence[FileReport]) -> Columns:
    tasks = [each for report in reports for each in report.tasks]
    if any(each.id is not None for each in tasks):
        headers = ["validated by", "settings", "claims"]
        headers += [name for name in ("examples", "symmetries") if any(getattr(each, name) for each in tasks)]
        headers += ["sanity"] * any(each.untried for each in tasks)
    else:
        headers = [""]
    table = Columns("", "", *headers, names=1, spare=range(len(headers) + 1, 2, -1))
    for report in reports:
        table.add_row(_mark(report.diagnostics), VisibleText(report.path, style="title"))
        if report.kind != "taskspec":
            table.add_row("", VisibleText(f"  {plural(report.entries, ENTRIES[report.kind])}", style="quiet"))
        for each in report.tasks:
            cells = {
                "settings": _settings(each),
                "claims": _decided(each.claims, each.untried_claims),
                "examples": f"{each.wrong_examples} wrong" * bool(each.wrong_examples) or str(each.examples or ""),
                "symmetries": _decided(each.symmetries),
                "sanity": f"{len(each.untried)} not checked" * bool(each.untried),
            }
            name = VisibleText(f"  {each.id or each.name}", style="name")
            table.add_row(_mark(each.diagnostics), name, each.how, *(cells[header] for header in headers[1:]))
    return table


def _settings(each: Checked) -> str:
    tried = f"{each.cases} tried" * bool(each.cases)
    untried = f"{each.untried_cases} not checked" * bool(each.untried_cases)
    return ", ".join(filter(None, (tried, untried)))


def _decided(records: Sequence[dict[str, Any]], untried: int = 0) -> str:
    """Return how many claims or symmetries are proved, as `8 proved`; `3 (2 tested)` are three with one that is proved.

    Args:
        untried: how many were not evaluated, beside the records.
    """
    statuses = Counter(record["status"] for record in records)
    proved = statuses["proved"]
    tested = statuses["tested"]
    undecided = statuses["undecided"]
    failed = len(records) - proved - tested - undecided
    if failed or undecided or untried:
        counts = {"failed": failed, "not decided": undecided, "not checked": untried}
        return ", ".join(f"{number} {word}" for word, number in counts.items() if number)
    if proved and tested:
        return f"{len(records)} ({tested} tested)"
    if proved:
        return f"{proved} proved"
    return f"{tested} tested" * bool(tested)


def _mark(diagnostics: Sequence[Diagnostic]) -> VisibleText:
    severities = {each.severity for each in diagnostics}
    if "error" in severities:
        return VisibleText("✗", style="bad")
    if "warning" in severities:
        return VisibleText("!", style="warn")
    return VisibleText("✓", style="good")


def verdict(reports: Sequence[FileReport], problems: Sequence[Diagnostic], seconds: float) -> VisibleText:
    """Return the last line: how many tasks, how many problems, how long."""
    from taskspec.exact.check.file_checks import counts

    errors, warnings = counts(problems)
    tasks = sum(len(report.tasks) for report in reports)
    accepted = sum(len(report.accepted) for report in reports)
    kinds = Counter(report.kind for report in reports)
    what = []
    if kinds["taskspec"] or not kinds:
        what.append(f"{plural(tasks, 'task')} in {plural(kinds['taskspec'], 'spec')}")
    for kind in ENTRIES:
        if kinds[kind]:
            what.append(plural(kinds[kind], NOUNS.get(kind, kind)))
    found = line(" and ".join(filter(None, (", ".join(what[:-1]), what[-1]))), ": ")
    if errors:
        found.append(plural(errors, "error"), "bad")
    if warnings:
        found.append(", " * bool(errors)).append(plural(warnings, "warning"), "warn")
    if not errors and not warnings:
        found.append("no errors, no warnings", "good")
    if accepted:
        found.append(", ").append(f"{plural(accepted, 'warning')} accepted", "quiet")
    for noun, number in _untried(reports).items():
        if number:
            found.append(", ").append(f"{plural(number, noun)} not checked", "warn")
    return found.append(f"  ({seconds:.2f} s)", "quiet")


def _untried(reports: Sequence[FileReport]) -> dict[str, int]:
    tasks = [each for report in reports for each in report.tasks]
    return {
        "claim": sum(each.untried_claims for each in tasks),
        "setting": sum(each.untried_cases for each in tasks),
        "sanity check": sum(len(each.untried) for each in tasks),
    }


def _print_json(reports: Sequence[FileReport], problems: Sequence[Diagnostic], seconds: float) -> None:
    from taskspec.exact.check.file_checks import counts

    errors, warnings = counts(problems)
    data: dict[str, Any] = {
        "errors": errors,
        "warnings": warnings,
        "seconds": round(seconds, 4),
        "diagnostics": records(problems),
        "tasks": [_record(report.path, each) for report in reports for each in report.tasks],
        "accepted": [],
        "experiments": [],
        "exams": [],
        "findings": [],
    }
    for report in reports:
        for accepted, record in zip(report.accepted, records([a.warning for a in report.accepted]), strict=True):
            data["accepted"].append({**record, "because": accepted.because})
        if report.kind != "taskspec":
            kind = report.kind.removesuffix("s") + "s"
            data[kind].append({"path": report.path, ENTRIES[report.kind] + "s": report.entries})
    write_json(data)


def _record(path: str, each: Checked) -> dict[str, Any]:
    from taskspec.exact.check.file_checks import counts

    errors, warnings = counts(each.diagnostics)
    statuses = [claim["status"] for claim in each.claims]
    left_out = [{"program": p, "reason": reason, "settings": n} for (p, reason), n in each.left_out.items()]
    return {
        "id": each.id, "name": each.name, "path": path, "variant": each.variant, "errors": errors, "warnings": warnings,
        "method": each.method, "other_parameter_values": each.cases, "claims_proved": statuses.count("proved"),
        "claims_tested": statuses.count("tested"), "claims": each.claims, "examples": each.examples,
        "examples_wrong": each.wrong_examples, "claims_not_checked": each.untried_claims,
        "other_parameter_values_not_checked": each.untried_cases, "warnings_not_looked_for": each.untried,
        "symmetries": each.symmetries, "programs": each.programs, "programs_not_run": left_out,
        "seconds": round(each.seconds, 6),
    }  # fmt: skip
