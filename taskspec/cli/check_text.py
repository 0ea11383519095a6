"""Checks of files, as text on the terminal and as JSON data."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from taskspec.base.diagnostics import Diagnostic, records
from taskspec.base.display import listed, plural
from taskspec.language.source import Kind
from taskspec.programs.agreement import EVERY
from taskspec.show.terminal.styled_text import Columns, VisibleText, console, line
from taskspec.tools.authoring.checks import Checked, FileReport, counts, problems_of

ENTRIES: dict[Kind, str] = {"experiment": "instance", "exam": "rule", "findings": "finding"}
"""The entries of files that are no specs."""
NOUNS: dict[Kind, str] = {"experiment": "experiment", "exam": "exam", "findings": "findings file"}


def print_table(reports: Sequence[FileReport]) -> None:
    """Print a row for each task with the methods of its checks, and the programs that were compared."""
    out = console(wide=True)
    out.print(_table(reports))
    out.print()
    for text in _programs(tasks_of(reports)):
        out.print(text, style="quiet")


def tasks_of(reports: Sequence[FileReport]) -> list[Checked]:
    tasks: list[Checked] = []
    for report in reports:
        tasks += report.tasks
    return tasks


def _table(reports: Sequence[FileReport]) -> Columns:
    headers = _headers(tasks_of(reports))
    table = Columns("", "", *headers, names=1, spare=range(len(headers) + 1, 2, -1))
    for report in reports:
        table.add_row(_mark(report.diagnostics), VisibleText(report.path, style="title"))
        if report.kind != "taskspec":
            table.add_row("", VisibleText(f"  {plural(report.entries, ENTRIES[report.kind])}", style="quiet"))
        for task in report.tasks:
            cells = _cells(task)
            name = VisibleText(f"  {task.id or task.name}", style="name")
            table.add_row(_mark(task.diagnostics), name, *(cells[header] for header in headers))
    return table


def _headers(tasks: Sequence[Checked]) -> list[str]:
    if all(task.id is None for task in tasks):
        return [""]
    headers = ["validated by", "settings", "claims"]
    if any(task.coverage.examples for task in tasks):
        headers.append("examples")
    if any(task.symmetries for task in tasks):
        headers.append("symmetries")
    if any(task.coverage.untried for task in tasks):
        headers.append("sanity")
    return headers


def _cells(task: Checked) -> dict[str, str]:
    coverage = task.coverage
    settings = {"tried": len(coverage.cases), "not checked": coverage.untried_cases}
    examples = {"wrong": len(coverage.wrong_examples)}
    return {
        "": task.how,
        "validated by": task.how,
        "settings": _counted(settings),
        "claims": _decided(task.claims, coverage.untried_claims),
        "examples": _counted(examples) or str(coverage.examples or ""),
        "symmetries": _decided(task.symmetries),
        "sanity": _counted({"not checked": len(coverage.untried)}),
    }


def _counted(numbers: Mapping[str, int]) -> str:
    return ", ".join(f"{number} {word}" for word, number in numbers.items() if number)


def _decided(records: Sequence[dict[str, Any]], untried: int = 0) -> str:
    """Count claims or symmetries by status: `8 proved`; `3 (2 tested)` for one that is proved and two that are tested."""
    statuses = Counter(record["status"] for record in records)
    proved = statuses["proved"]
    tested = statuses["tested"]
    undecided = statuses["undecided"]
    failed = len(records) - proved - tested - undecided
    if failed or undecided or untried:
        return _counted({"failed": failed, "not decided": undecided, "not checked": untried})
    if proved and tested:
        return f"{len(records)} ({tested} tested)"
    return _counted({"proved": proved, "tested": tested})


def _mark(diagnostics: Sequence[Diagnostic]) -> VisibleText:
    errors, warnings = counts(diagnostics)
    if errors:
        return VisibleText("✗", style="bad")
    if warnings:
        return VisibleText("!", style="warn")
    return VisibleText("✓", style="good")


def _programs(tasks: Sequence[Checked]) -> Iterator[str]:
    run = Counter[str]()
    left_out: dict[str, Counter[str]] = {}
    for task in tasks:
        run.update(task.coverage.programs)
        for (name, reason), number in task.coverage.left_out.items():
            left_out.setdefault(reason, Counter())[name] += number
    for number, names in _by_number(run).items():
        if number:
            yield f"programs: {', '.join(names)} ran at {plural(number, 'setting')} as the interpreter"
    for reason, numbers in left_out.items():
        for number, names in _by_number(numbers).items():
            yield f"not run at {plural(number, 'setting')}: {', '.join(names)} ({reason})"
    tried = set(run).union(*left_out.values())
    others = [name for name in EVERY if name not in tried]
    if tried and others:
        yield f"not run: {', '.join(others)} (--all-backends)"


def _by_number(counts: Mapping[str, int]) -> dict[int, list[str]]:
    names: dict[int, list[str]] = {}
    for name, number in counts.items():
        names.setdefault(number, []).append(name)
    return names


def print_verdict(reports: Sequence[FileReport], seconds: float, err: bool = False) -> None:
    """Print the last line: how many tasks, how many problems, how long."""
    errors, warnings = counts(problems_of(reports))
    accepted = sum(len(report.accepted) for report in reports)
    text = line(_subjects(reports), ": ")
    if errors:
        text.append(plural(errors, "error"), "bad")
    if errors and warnings:
        text.append(", ")
    if warnings:
        text.append(plural(warnings, "warning"), "warn")
    if not errors and not warnings:
        text.append("no errors, no warnings", "good")
    if accepted:
        text.append(", ").append(f"{plural(accepted, 'warning')} accepted", "quiet")
    for noun, number in _untried(tasks_of(reports)).items():
        if number:
            text.append(", ").append(f"{plural(number, noun)} not checked", "warn")
    text.append(f"  ({seconds:.2f} s)", "quiet")
    console(err=err, wide=not err).print(text)


def _subjects(reports: Sequence[FileReport]) -> str:
    kinds = Counter(report.kind for report in reports)
    subjects = []
    if kinds["taskspec"] or not kinds:
        subjects.append(f"{plural(len(tasks_of(reports)), 'task')} in {plural(kinds['taskspec'], 'spec')}")
    for kind, noun in NOUNS.items():
        if kinds[kind]:
            subjects.append(plural(kinds[kind], noun))
    return listed(subjects)


def _untried(tasks: Sequence[Checked]) -> dict[str, int]:
    return {
        "claim": sum(task.coverage.untried_claims for task in tasks),
        "setting": sum(task.coverage.untried_cases for task in tasks),
        "sanity check": sum(len(task.coverage.untried) for task in tasks),
    }


def record(reports: Sequence[FileReport], seconds: float) -> dict[str, Any]:
    """Summarise checks as JSON data.

    Args:
        reports: one for each file.
        seconds: time that all of them took.

    Returns:
        numbers of errors and warnings, all diagnostics, and a record of each task, experiment, exam and findings file.
    """
    problems = problems_of(reports)
    errors, warnings = counts(problems)
    data: dict[str, Any] = {
        "errors": errors,
        "warnings": warnings,
        "seconds": round(seconds, 4),
        "diagnostics": records(problems),
        "tasks": [],
        "accepted": [],
        "experiments": [],
        "exams": [],
        "findings": [],
    }
    for report in reports:
        data["tasks"] += [_task_record(report.path, task) for task in report.tasks]
        accepted = records([each.warning for each in report.accepted])
        for each, warning in zip(report.accepted, accepted, strict=True):
            data["accepted"].append({**warning, "because": each.because})
        if report.kind != "taskspec":
            kind = report.kind.removesuffix("s") + "s"
            data[kind].append({"path": report.path, ENTRIES[report.kind] + "s": report.entries})
    return data


def _task_record(path: str, task: Checked) -> dict[str, Any]:
    coverage = task.coverage
    errors, warnings = counts(task.diagnostics)
    statuses = [claim["status"] for claim in task.claims]
    left_out = []
    for (program, reason), number in coverage.left_out.items():
        left_out.append({"program": program, "reason": reason, "settings": number})
    return {
        "id": task.id, "name": task.name, "path": path, "variant": task.variant, "errors": errors, "warnings": warnings,
        "method": task.method, "other_parameter_values": len(coverage.cases), "claims_proved": statuses.count("proved"),
        "claims_tested": statuses.count("tested"), "claims": task.claims, "examples": coverage.examples,
        "examples_wrong": len(coverage.wrong_examples), "claims_not_checked": coverage.untried_claims,
        "other_parameter_values_not_checked": coverage.untried_cases, "warnings_not_looked_for": coverage.untried,
        "symmetries": task.symmetries, "programs": coverage.programs, "programs_not_run": left_out,
        "seconds": round(task.seconds, 6),
    }  # fmt: skip
