"""A task's page on the terminal: the sections of `taskspec docs`, with mathematics as a line of Unicode."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, assert_never

from rich.console import Console, Group
from rich.padding import Padding
from rich.table import Table

from taskspec.base.display import visible
from taskspec.base.files import near
from taskspec.language.task.merge import variant_names
from taskspec.language.task.task import Task
from taskspec.show.pages import prose as p
from taskspec.show.pages.page import Page, page
from taskspec.show.pages.sections import Section, SectionLine
from taskspec.show.printers import plain
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import expression
from taskspec.show.printers.rewrites import draws
from taskspec.show.record import constants, space_words
from taskspec.show.terminal.styled_text import Columns, VisibleText

if TYPE_CHECKING:
    from rich.console import RenderableType

LONGEST = 300  # longer constants are cut
LABELS = 13  # the width of the column of titles


def print_page(task: Task, out: Console) -> None:
    """Print everything that the spec says about a task: what it is, what is in it, how it moves, what is claimed of it."""
    shown = page(task)
    out.print(_title(shown, out.width))
    if shown.summary:
        out.print(VisibleText(str(_words(shown.summary)), style="italic"))
    for block in shown.description:
        out.print(Padding(_block(block), (1, 0, 0, 2)))
    table = Columns("", "", fold=(1,), styles=("head",), widths={0: LABELS})
    for section in shown.sections:
        table.add_row("")
        table.add_row(section.label, Group(_section(section), *_of_instance(task, section.key)))
    out.print(table)
    out.print()
    out.print(f"{near(Path(task.source.document.origin.name))}  {task.content_hash[:12]}", style="quiet")
    others = list(filter(task.name.__ne__, variant_names(task.source.document.data)))
    if others:
        out.print(f"the same spec defines {', '.join(others)}", style="quiet")


def _title(shown: Page, width: int) -> RenderableType:
    left = VisibleText.assemble((shown.id, "bold cyan"), "  ", (visible(shown.title), "bold"))
    right = VisibleText(shown.capability, style="quiet")
    line = Table.grid(expand=True, padding=(0, 2, 0, 0))
    line.add_column(ratio=1)
    line.add_column(justify="right")
    if left.cell_len + right.cell_len + 2 > width:
        right = VisibleText()
    line.add_row(left, right)
    return line


def _section(section: Section) -> RenderableType:
    parts: list[RenderableType] = []
    for line in section.lines:
        parts += _line(line)
    if section.table is not None:
        table = Columns(*section.table.header, fold=range(len(section.table.header)))
        for row in section.table.rows:
            table.add_row(*map(_words, row))
        parts.append(table)
    return Group(*parts)


def _of_instance(task: Task, key: str) -> Iterator[VisibleText]:
    """Yield what is true of this instance alone: its spaces in Gymnasium, and the values of constants that are drawn."""
    match key:
        case "actions":
            yield VisibleText(space_words(task.action_layout), style="quiet")
        case "observations":
            yield VisibleText(space_words(task.observation_layout), style="quiet")
        case "definitions":
            for name, value in task.spec.constants.items():
                if name in task.constants and not isinstance(value, Mapping) and draws(expression(value)):
                    shown = visible(f"{name} = {constants(task)[name]}")
                    yield VisibleText(f"here {shown[:LONGEST]}{' …' * (len(shown) > LONGEST)}", style="quiet")
        case "horizon" if isinstance(task.spec.horizon, str) and task.horizon is not None:
            yield VisibleText(f"here {task.horizon:,}", style="quiet")


def _line(line: SectionLine) -> Iterator[RenderableType]:
    match line.content:
        case (p.Formula(math=m.Row(items=(*left, m.Cases(rows=rows)))), *rest):
            cases = Columns("", "", fold=(0, 1))
            for value, condition in rows:
                cases.add_row(_formula(value), _formula(condition))
            table = Columns("", "", fold=(1,), gap=1)
            after = [_words(rest)] * bool(rest)
            table.add_row(_formula(m.Row(tuple(left))), Group(cases, *after))
            yield table
        case content:
            yield _words(content)
    if line.verbatim is not None:
        drawn = [visible(row, keep="") for row in line.verbatim.splitlines()]
        yield Padding(VisibleText("\n".join(drawn)), (0, 0, 0, 2))


def _words(content: Iterable[p.Inline]) -> VisibleText:
    text = VisibleText()
    for piece in content:
        match piece:
            case p.Text(text=words):
                text.append(visible(words))
            case p.Formula(math=math):
                text.append_text(_formula(math))
            case p.CodeSpan(text=words):
                text.append(visible(words), "bold")
            case p.Emph(inner=inner) | p.Link(inner=inner):
                text.append_text(_words(inner))
            case p.Cite(key=key, where=where):
                text.append(visible(", ".join(filter(None, (key, where)))))
            case p.Mark(text=words):
                text.append(f"({words})", "quiet")
            case _:
                assert_never(piece)
    return text


def _formula(math: m.Math) -> VisibleText:
    return VisibleText(visible(plain(math)), style="cyan")


def _block(block: p.Block) -> RenderableType:
    match block:
        case p.Paragraph(content=content):
            return _words(content)
        case p.Bullets(items=items):
            table = Columns("", "", fold=(1,), gap=1)
            for item in items:
                table.add_row("-", Group(*map(_block, item)))
            return table
        case _:
            return VisibleText(visible(block.text))
