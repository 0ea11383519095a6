"""`taskspec solve` and `taskspec score`: what returns are possible, and where given ones stand between them."""

from __future__ import annotations

import csv
import json as json_
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskspec.base.diagnostics import spec_error
from taskspec.base.numbers import decimal, estimate, number
from taskspec.cli.options import Json, LimitsGiven, Modifiers, Parameters, TaskArgument, Variant

if TYPE_CHECKING:
    from rich.table import Table

    from taskspec.exact import Difficulty, PomdpBounds, Return, Score, Scores
    from taskspec.task.task import Task

Episodes = Annotated[int, typer.Option("--episodes", "-n", min=2, help="Used where simulation is needed.")]
Seed = Annotated[
    int, typer.Option("--seed", min=0, max=2**64 - 1, metavar="SEED", help="Used where simulation is needed.")
]
Output = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="FILE", help="Save the scores to this file.", dir_okay=False, show_default=False
    ),
]
Known = Annotated[
    Path | None,
    typer.Option("--scores", metavar="FILE", help="Scores saved by `solve -o`.", dir_okay=False, show_default=False),
]
Returns = Annotated[
    Path,
    typer.Argument(
        metavar="RETURNS", help="Returns of episodes: JSON (as `run --json` writes), or CSV (a monitor file, or a column).",
        show_default=False,
    ),
]  # fmt: skip

Hardness = Annotated[
    bool,
    typer.Option("--difficulty", help="Measures of difficulty from theory besides: `docs/difficulty.md` lists them."),
]


def solve(
    task: TaskArgument,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    episodes: Episodes = 1000,
    seed: Seed = 0,
    difficulty: Hardness = False,
    output: Output = None,
    json: Json = False,
    limits: LimitsGiven = None,
) -> None:
    """Compute optimal, expert, random and worst return.

    Exactly where the task has an exact model, else from episodes, with a confidence interval. Where observations hide
    the state, also the best returns given observations alone: with memory, and without.
    """
    from taskspec import exact
    from taskspec.cli.console import write_records
    from taskspec.cli.progress import progress
    from taskspec.targets import beside, tasks_of

    records = []
    found = tasks_of(task, variant, parameters or [], modifiers or [])
    for each in found:
        with progress(each.instance_id):
            measured = exact.scores(each, episodes, seed)
            results = exact.Results(each)
            seen = exact.pomdp_bounds(results)
            hard = exact.difficulty(results) if difficulty else None
        if output is not None:
            measured.save(output if len(found) == 1 else beside(output, each))
        if json:
            record = measured.record() | {"yardsticks": None if seen is None else _seen_record(seen)}
            records.append(record if hard is None else record | {"difficulty": hard.record()})
        else:
            _print_scores(each, measured, seen)
            if hard is not None:
                _print_difficulty(hard, measured.why_not_exact)
    if json:
        write_records(records)


def score(
    task: TaskArgument,
    returns: Returns,
    variant: Variant = None,
    parameters: Parameters = None,
    modifiers: Modifiers = None,
    scores: Known = None,
    json: Json = False,
) -> None:
    """Score returns: 0 is random actions, 1 is the expert.

    A score below -1 counts as -1, as in the paper that the derail suite comes from.
    """
    from taskspec import exact
    from taskspec.cli.console import write_json
    from taskspec.targets import task_of

    found = task_of(task, variant, parameters or [], modifiers or [])
    known = None if scores is None else _known(scores, found)
    result = exact.score(found, returns=read_returns(returns), known=known)
    if json:
        low, high = result.interval()
        record = result.scores.record()
        write_json({"score": result.normalised, "confidence_95": [low, high], "episodes": result.value.episodes,
                    "mean_return": result.value.value, "scores": record})  # fmt: skip
    else:
        _print_score(found, result)


def _known(path: Path, task: Task) -> Scores:
    """Return scores from a file; refused when they are those of another version of the task."""
    from taskspec.exact import Scores

    try:
        return Scores.load(path, task)
    except (KeyError, TypeError, json_.JSONDecodeError):
        raise spec_error("E711", f"'{path}' contains no scores", "`taskspec solve TASK -o FILE` writes some") from None


# -- returns ------------------------------------------------------------------------------------------------------


def read_returns(path: Path) -> list[float]:
    """Return returns of episodes from a file: a JSON list, or `returns` of a JSON object; or CSV, in the first column or
    in `r`.

    Raises:
        SpecError: E710, E711 when there is no such file, or no numbers in it.
    """
    if not path.exists():
        raise spec_error("E710", f"there is no file '{path}'")
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        found = _from_json(text) if path.suffix == ".json" else _from_csv(text)
        values = [float(value) for value in found]
    except (ValueError, TypeError, KeyError, IndexError):
        values = []
    if not values:
        raise spec_error("E711", f"'{path}' contains no returns", "a JSON list of numbers, or one number per line")
    if any(map(math.isnan, values)):
        raise spec_error("E711", f"return number {[*map(math.isnan, values)].index(True) + 1} of '{path}' is nan")
    return values


def _from_json(text: str) -> list[Any]:
    data = json_.loads(text)
    return list(data["returns"] if isinstance(data, dict) else data)


def _from_csv(text: str) -> list[str]:
    """Return the column `r` or `return`, else the first one; comments start with `#`."""
    rows = list(csv.reader(line for line in text.splitlines() if line.strip() and not line.startswith("#")))
    header = [cell.strip().lower() for cell in rows[0]]
    column = next((header.index(name) for name in ("r", "return", "returns", "score") if name in header), 0)
    return [row[column] for row in (rows if _is_number(rows[0][column]) else rows[1:])]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# -- output -------------------------------------------------------------------------------------------------------


def _seen_record(seen: PomdpBounds) -> dict[str, Any]:
    """Return the best returns of those who see observations only, as the bounds that are proved."""
    values = {"remembering": seen.remembering, "memoryless": seen.memoryless}
    told = {k: None if v is None else list(v.ends) for k, v in values.items()}
    return told | {"why_not": seen.why_not}


def _print_scores(task: Task, found: Scores, seen: PomdpBounds | None) -> None:
    from taskspec.cli.console import console, line
    from taskspec.task.record import settings

    out = console()
    out.print(line((task.id, "name"), (f"  {settings(task)}", "value")))
    out.print(_score_table(found, seen))
    out.print(_ground(found), style="quiet")
    _print_discount(task)


def _score_table(found: Scores, seen: PomdpBounds | None) -> Table:
    from rich.table import Table

    from taskspec.cli.console import VisibleText

    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="quiet")
    table.add_column(justify="right", style="title")
    for name in ("optimal", "expert", "random", "worst"):
        value: Return | None = getattr(found, name)
        remark = "knowing the state, which observations hide" if name == "optimal" and seen else _remark(found, name)
        table.add_row(f"  {name}", *_return(value), VisibleText(remark, style="quiet"))
        for row in _seen_rows(seen) if name == "optimal" and seen else ():
            table.add_row(*row[:3], VisibleText(row[3], style="quiet"))
    return table


def _seen_rows(seen: PomdpBounds) -> Iterator[tuple[str, str, str, str]]:
    """Yield rows for the best of those who see observations only: name, return, how sure it is, a remark."""
    from taskspec.exact import Return

    told = (
        ("remembering", seen.remembering, "given all observations and actions so far"),
        ("memoryless", seen.memoryless, ""),
    )
    for name, value, remark in told:
        if value is None:
            yield f"  {name}", "unknown", "", seen.why_not or ""
        elif value.error <= 1e-9 * abs(value.value):
            yield f"  {name}", *_return(Return(value.value, bound=value.error)), remark
        else:
            low, high = (number(end) for end in value.ends)
            yield f"  {name}", f"{low} to {high}", "proved bounds", remark


def _return(value: Return | None) -> tuple[str, str]:
    """Return a return, and how sure it is."""
    from taskspec.scores.saved import NUMBERS

    if value is None:
        return "unknown", ""
    if not value.episodes:
        sure = NUMBERS[value.status].shown.format(episodes=f"{value.tested:,}") or value.status
        off = f"± {value.bound:.2g}, " if value.bound > 1e-10 * abs(value.value) else ""
        return number(value.value, 10), off + sure
    mean, half = estimate(value.value, value.half)
    if not math.isfinite(value.value):
        return mean, f"({value.episodes:,} episodes)"
    return mean, f"± {half} (95 % CI, {value.episodes:,} episodes)"


def _remark(found: Scores, name: str) -> str:
    if name != "expert":
        is_unsettled = getattr(found, name) is None and found.states is not None  # otherwise the last line says why
        return (found.why_not_exact or "") if is_unsettled else ""
    if found.gap is None:
        return ""
    return "optimal" if abs(found.gap) < 1e-9 else f"{decimal(found.gap, 6)} below the optimum"


def _ground(found: Scores) -> str:
    """Return what the numbers rest on."""
    if found.states is not None:
        return f"  from an exact model of {found.states:,} states and {found.actions:,} actions"
    return f"  no exact model: {found.why_not_exact}"


def _print_discount(task: Task) -> None:
    """That returns are those of discounted rewards, where they are."""
    from taskspec.cli.console import console

    if task.discount != 1:
        console().print(f"  discounted by {task.discount:g} a step", style="quiet")


def _print_difficulty(found: Difficulty, known: str | None) -> None:
    """The measures; the reason that has been given for having no model is not given again."""
    from taskspec.cli.console import VisibleText, columns, console

    table = columns("  difficulty", "", "", right=(1,), fold=(2,))
    for name, value, unit, _ in found.rows():
        shown = "unknown" if value is None else number(value)
        reason = found.why_not.get(name, unit)
        table.add_row(f"  {name}", shown, VisibleText("" if reason == known else reason, style="quiet"))
    console().print(table)


def _print_score(task: Task, result: Score) -> None:
    from taskspec.cli.console import console, line

    out = console()
    low, high = result.interval()
    value = result.value
    out.print(line((task.id, "name"), "  score ", (decimal(result.normalised), "title"),
                   (f"   95 % confidence: {decimal(low)} to {decimal(high)}", "quiet")))  # fmt: skip
    ends = ((name, getattr(result.scores, name)) for name in ("random", "expert", "optimal"))
    known = ", ".join(f"{name} {decimal(end.value)}" for name, end in ends if end is not None)
    out.print(f"  mean return {decimal(value.value)} over {value.episodes:,} episodes; {known}", style="quiet")
    _print_discount(task)
