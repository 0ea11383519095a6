"""A task as a page for the terminal, with its expressions in the notation of specs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group, RenderableType
from rich.markdown import Markdown
from rich.padding import Padding
from rich.table import Table

from taskspec.base.display import lettered, visible
from taskspec.base.files import near
from taskspec.base.numbers import setting
from taskspec.cli.console import VisibleText
from taskspec.lang import syntax as s
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.modifiers import sentences
from taskspec.printers import text as written
from taskspec.task.record import domain_words, space_words
from taskspec.task.schema.models import Erratum, Source
from taskspec.task.task import Component, Followed, Parameter, Soft, Task

if TYPE_CHECKING:
    from rich.console import RenderableType

# Expressions for a terminal: in the notation of specs, coloured, tables and cases set as rows.

_TOKENS = re.compile(
    r"(?P<word>\b(?:and|or|not|in|if|else|for|otherwise)\b)|(?P<call>\b[^\W\d]\w*(?=\())|(?P<number>\b\d[\d_]*(?:\.\d+)?(?:e[+-]?\d+)?\b)"
)
_STYLES = {"word": "bright_blue", "call": "magenta", "number": "green"}


def colored(text: str) -> VisibleText:
    """Return an expression with its words, functions and numbers in colour."""
    line = VisibleText(text)
    for found in _TOKENS.finditer(text):
        assert found.lastgroup is not None
        line.stylize(_STYLES[found.lastgroup], *found.span())
    return line


def body(expr: s.Expr) -> RenderableType:
    """Return the right-hand side of an equation: a line, or rows for what is decided case by case."""
    match expr:
        case s.Piecewise(branches=branches, otherwise=otherwise):
            cases = [(value, f"if {written(condition)}") for condition, value in branches]
            return _rows([[written(value), condition] for value, condition in [*cases, (otherwise, "otherwise")]])
        case s.Table(by=by, rows=rows):
            return _rows([*_table_rows(rows, len(by))], [written(column) for column in by])
        case _:
            return colored(written(expr))


def _table_rows(rows: tuple[s.TableRow, ...], depth: int) -> Iterator[list[str]]:
    """Yield rows of a decision table: the keys, blank where one cell is for all of them, and the cell."""
    for row in rows:
        key = "else" if row.key is None else written(row.key)
        if isinstance(row.body, tuple):
            for i, deeper in enumerate(_table_rows(row.body, depth - 1)):
                yield [key if i == 0 else "", *deeper]
        else:
            yield [key, *([""] * (depth - 1)), written(row.body)]


def _rows(rows: list[list[str]], headers: list[str] | None = None) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=headers is not None, header_style="quiet")
    for header in [*(headers or []), *([""] * (len(rows[0]) - len(headers or [])))]:
        table.add_column(header)
    for row in rows:
        table.add_row(*map(colored, row))
    return table


# A task as a page for the terminal: what it is, what is in it, how it moves, what is claimed of it.

_MATH = re.compile(r"\$([^$\n]+)\$")
_KEYS = ("definitions", "noise", "initial", "dynamics")


def print_page(task: Task, out: Console) -> None:
    """Print everything that the spec says about a task."""
    for part in _page(task, out.width):
        out.print(part)


def _page(task: Task, width: int) -> Iterable[RenderableType]:
    spec = task.spec
    yield _title(task, width)
    if spec.summary:
        yield VisibleText(_words(spec.summary), style="italic")
    if spec.description:
        yield _indented(Markdown(_words(spec.description)), top=1)
    yield from _section("Parameters", _parameters(task.parameters))
    yield from _section("State", _components(task.state))
    yield from _section("Action", _components(task.action), space_words(task.action_layout))
    yield from _section("Observation", _observation(task.unmodified), space_words(task.observation_layout))
    yield from _section("Modifiers", _modifiers(task), "in this order; the equations are those of the task as written")
    yield from _section("Equations", _equations(task.unmodified))
    yield from _section("Symmetries", _symmetries(task.unmodified))
    yield from _section("Claims", _claims(task))
    yield from _section("Examples", _examples(task))
    yield from _section("Corrections to the source", _errata(spec.errata))
    yield from _section("Sources", _sources(spec.sources))
    yield VisibleText()
    yield _foot(task)


# -- parts --------------------------------------------------------------------------------------------------------


def _title(task: Task, width: int) -> RenderableType:
    title = visible(task.title)
    left = VisibleText.assemble((task.id, "bold cyan"), "  ", (title, "bold"))
    right = VisibleText(visible(task.spec.capability or ""), style="quiet")
    line = Table.grid(expand=True, padding=(0, 2, 0, 0))
    line.add_column(ratio=1)
    line.add_column(justify="right")
    line.add_row(left, right if left.cell_len + right.cell_len + 2 <= width else "")
    return line


def _section(title: str, content: RenderableType | None, note: str = "") -> Iterable[RenderableType]:
    if content is None:
        return
    yield VisibleText.assemble("\n", (title, "head"), (f"  {note}" if note else "", "quiet"))
    yield _indented(content)


def _indented(content: RenderableType, top: int = 0) -> Padding:
    return Padding(content, (top, 0, 0, 2))


def _words(text: Any) -> str:
    """Return a spec's prose, with `$mathematics$` as plain characters."""
    return _MATH.sub(lambda m: _plain(m[1]), visible(str(text))).strip()


def _plain(tex: str) -> str:
    from taskspec.printers import plain
    from taskspec.printers.tex import read as read_tex

    return plain(read_tex(tex))


def _grid(*, last: str = "quiet") -> Table:
    table = Table.grid(padding=(0, 2, 0, 0))
    for style in ("cyan", "default", "default", last):
        table.add_column(style=style, overflow="fold")
    return table


def _parameters(parameters: Sequence[Parameter]) -> RenderableType | None:
    if not parameters:
        return None
    table = _grid()
    for p in parameters:
        value = VisibleText(setting(p.value), style="bold green" if p.value != p.default else "green")
        table.add_row(p.name, value, domain_words(p), "; ".join(_notes(p)))
    return table


def _notes(p: Parameter) -> Iterator[str]:
    if p.doc:
        yield visible(p.doc)
    if p.alias:
        yield f"also called {p.alias}"


def _components(components: Sequence[Component]) -> RenderableType:
    table = Table.grid(padding=(0, 2, 0, 0))
    for style in ("cyan", "default", "quiet"):
        table.add_column(style=style, overflow="fold")
    for c in components:
        table.add_row(c.name, domain_words(c), visible(c.doc or ""))
    return table


def _observation(task: Task) -> RenderableType:
    if task.observation.is_state:
        return VisibleText("the state", style="quiet")
    expressions = task.surface.sections.get("observation", {})
    return _lines(_named(expressions))


def _modifiers(task: Task) -> RenderableType | None:
    if not task.modifiers:
        return None
    table = Table.grid(padding=(0, 2, 0, 0))
    for style in ("cyan", "default"):
        table.add_column(style=style, overflow="fold")
    for each, said in sentences(task):
        table.add_row(visible(str(each)), _words(said).replace("`", ""))
    return table


# -- equations ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Shown:
    """The left and the right side of a line."""

    name: str
    content: RenderableType


def _equations(task: Task) -> RenderableType:
    parts: list[RenderableType] = []
    for title, lines in _blocks(task):
        table = Table.grid(padding=(0, 1, 0, 0))
        table.add_column(min_width=12, style="quiet")
        table.add_column()
        table.add_row(title, _lines(lines))
        parts.append(table)
    return Group(*parts)


def _lines(lines: Sequence[_Shown]) -> RenderableType:
    """Equations under each other, aligned at the equals sign; a value without a name stands alone."""
    if not any(shown.name for shown in lines):
        return Group(*(shown.content for shown in lines))
    table = Table.grid(padding=(0, 1, 0, 0))
    table.add_column(style="cyan", no_wrap=True)
    for shown in lines:
        table.add_row(shown.name, "=", shown.content)
    return table


def _blocks(task: Task) -> Iterable[tuple[str, list[_Shown]]]:
    """Sections in the order of a paper's appendix, with their lines."""
    constants = task.spec.constants
    sections = task.surface.sections
    if constants:
        yield (
            "constants",
            [_Shown(visible(name), _constant(value, _drawn(task, name))) for name, value in constants.items()],
        )
    for key in _KEYS:
        if sections.get(key):
            yield key, _named(sections[key])
    for key in ("reward", "terminal", "absorbing_reward"):
        if sections.get(key) is not None:
            yield key.replace("_", " "), [_Shown("", body(sections[key]))]
    yield "horizon", [_Shown("", _horizon(task))]
    if task.discount != 1:
        yield "discount", [_Shown("", VisibleText(f"{task.discount:g}"))]
    if sections.get("memory"):
        yield "memory", _named(sections["memory"])
    yield "expert", _expert(task)


def _named(expressions: Mapping[str, Any]) -> list[_Shown]:
    return [_Shown(name, body(expr)) for name, expr in expressions.items() if expr is not None]


def _horizon(task: Task) -> VisibleText:
    raw = task.spec.horizon
    steps = "none" if task.horizon is None else f"{task.horizon:,}"
    return colored(steps if isinstance(raw, int) or task.horizon is None else f"{raw} = {steps}")


def _expert(task: Task) -> list[_Shown]:
    match task.expert:
        case None:
            return [_Shown("", VisibleText("not given", style="quiet"))]
        case "optimal":
            return [_Shown("", VisibleText("optimal, by planning on the exact model"))]
        case Soft(beta=beta):
            return [_Shown("", VisibleText(f"Boltzmann-rational with β = {beta:g}, by planning on the exact model"))]
    found = task.surface.sections["expert"]
    return _named(found) if isinstance(found, Mapping) else [_Shown(task.action[0].name, body(found))]


def _drawn(task: Task, name: str) -> str:
    """Return what a constant that draws is in this instance, after an equals sign; nothing for any other."""
    written = str(task.spec.constants[name])
    if name not in task.constants or not any(f"{dist}(" in written for dist in (*DISTS, CATEGORICAL.name)):
        return ""
    value = task.constants[name]
    return f" = {value.tolist() if hasattr(value, 'tolist') else value}"


def _constant(value: Any, drawn: str = "") -> RenderableType:
    if isinstance(value, Mapping) and "grid" in value:
        grid = value["grid"]
        rows = grid.splitlines() if isinstance(grid, str) else grid
        meanings = value.get("legend", {}).items()
        legend = "  ".join(f"{lettered(letter)} {visible(str(meaning))}" for letter, meaning in meanings)
        return VisibleText("\n".join([*(visible(str(row)) for row in rows), legend]))
    text = visible(str(value)) + drawn
    return colored(text if len(text) <= 300 else text[:300] + " …")


# -- the rest -----------------------------------------------------------------------------------------------------


def _symmetries(task: Task) -> RenderableType | None:
    """Return a line for each: its name and what it is; and one for each of its maps."""
    lines: list[RenderableType] = []
    for each in task.symmetries:
        lines.append(VisibleText.assemble((visible(each.name), "cyan"), f"  {_words(each.doc or '')}"))
        for key, exprs in task.surface.sections["symmetries"][each.name].items():
            table = Table.grid(padding=(0, 2, 0, 0))
            for name, expr in exprs.items():
                table.add_row(VisibleText(f"  {key}", style="quiet"), colored(f"{name} -> {written(expr)}"))
            lines.append(table)
    return Group(*lines) if lines else None


def _claims(task: Task) -> RenderableType | None:
    if not task.claims:
        return None
    lines = []
    for claim in task.claims:
        cases = "; ".join(", ".join(f"{k}={setting(v)}" for k, v in case.items()) for case in claim.cases)
        lines.append(VisibleText.assemble(colored(visible(claim.text)), (f"  for {cases}" if cases else "", "quiet")))
    return Group(*lines)


def _examples(task: Task) -> RenderableType | None:
    """Return a line for each: what is given, an arrow, what follows."""
    lines = []
    for example in task.examples:
        given = [f"{name} = {written(expr)}" for (_, name), expr in example.given.items()]
        given += [f"t = {example.t}"] if example.t else []
        follows = [_followed(f) for f in example.follows]
        follows += [] if example.probability is None else [f"with probability {written(example.probability)}"]
        cases = "; ".join(", ".join(f"{k}={setting(v)}" for k, v in case.items()) for case in example.cases)
        text = f"{', '.join(given)} → {', '.join(follows)}".removeprefix(" → ")
        lines.append(VisibleText.assemble(colored(visible(text)), (f"  for {cases}" if cases else "", "quiet")))
    return Group(*lines) if lines else None


def _followed(found: Followed) -> str:
    """Return one thing that follows: `s' = goal`, `reward 1`, `observed x = 0`."""
    if found.name is None:
        return f"{found.section} {written(found.expr)}"
    word = {"observation": "observed ", "expert": "expert "}.get(found.section, "")
    return f"{word}{found.name}{chr(39) * (found.section == 'next')} = {written(found.expr)}"


def _errata(errata: Sequence[Erratum]) -> RenderableType | None:
    if not errata:
        return None
    table = Table.grid(padding=(0, 1, 0, 0))
    for style in ("quiet", "default"):
        table.add_column(style=style)
    for i, erratum in enumerate(errata):
        for label in ("source", "here", "because"):
            if words := getattr(erratum, label):
                table.add_row(label, _words(words))
        if i + 1 < len(errata):
            table.add_row()
    return table


def _sources(sources: Sequence[Source]) -> RenderableType | None:
    if not sources:
        return None
    lines = [VisibleText.assemble((visible(x.key), "cyan"), f"  {visible(x.where or '')}") for x in sources]
    return Group(*lines)


def _foot(task: Task) -> VisibleText:
    from taskspec.task.merge import variant_names

    others = [name for name in variant_names(task.document.data) if name != task.name]
    lines = [f"{near(Path(task.document.origin.name))}  {task.content_hash[:12]}"]
    if others:
        lines.append(f"the same spec defines {', '.join(others)}")
    return VisibleText("\n".join(lines), style="quiet")
