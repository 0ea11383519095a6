"""A task as a page for the terminal, with its expressions in the notation of specs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.markdown import Markdown
from rich.padding import Padding
from rich.table import Table

from taskspec.base.display import lettered, setting, visible
from taskspec.base.files import near
from taskspec.cli.console import VisibleText
from taskspec.cli.tables import Columns
from taskspec.lang import syntax as s
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.modifiers import sentences
from taskspec.printers import plain
from taskspec.printers import text as written
from taskspec.printers.tex import read as read_tex
from taskspec.task.merge import variant_names
from taskspec.task.parts import Component, Example, Soft
from taskspec.task.record import domain_words, space_words
from taskspec.task.task import Task

if TYPE_CHECKING:
    from rich.console import RenderableType

    Line = tuple[str, RenderableType]  # the left and the right side of an equation

_TOKENS = re.compile(
    r"(?P<word>\b(?:and|or|not|in|if|else|for|otherwise)\b)|(?P<call>\b[^\W\d]\w*(?=\())|(?P<number>\b\d[\d_]*(?:\.\d+)?(?:e[+-]?\d+)?\b)"
)
_STYLES = {"word": "bright_blue", "call": "magenta", "number": "green"}
_MATH = re.compile(r"\$([^$\n]+)\$")
_LONGEST = 300
"""Longer constants are cut."""


def print_page(task: Task, out: Console) -> None:
    """Print everything that the spec says about a task: what it is, what is in it, how it moves, what is claimed of it."""
    spec = task.spec
    bare = task.unmodified
    out.print(_title(task, out.width))
    if spec.summary:
        out.print(VisibleText(_words(spec.summary), style="italic"))
    if spec.description:
        out.print(Padding(Markdown(_words(spec.description)), (1, 0, 0, 2)))
    sections: tuple[tuple[str, Sequence[RenderableType], str], ...] = (
        ("Parameters", _parameters(task), ""),
        ("State", _components(task.state), ""),
        ("Action", _components(task.action), space_words(task.action_layout)),
        ("Observation", _observation(bare), space_words(task.observation_layout)),
        ("Modifiers", _modifiers(task), "in this order; the equations are those of the task as written"),
        ("Equations", list(_equations(bare)), ""),
        ("Symmetries", _symmetries(bare), ""),
        ("Claims", [_expression(claim.text, claim.cases) for claim in task.annotations.claims], ""),
        ("Examples", [_expression(_example(each), each.cases) for each in task.annotations.examples], ""),
        ("Corrections to the source", _errata(task), ""),
        ("Sources", [VisibleText.assemble((visible(x.key), "cyan"), f"  {visible(x.where or '')}") for x in spec.sources], ""),
    )  # fmt: skip
    for title, content, note in sections:
        if content:
            out.print(VisibleText.assemble("\n", (title, "head"), (f"  {note}" if note else "", "quiet")))
            out.print(Padding(Group(*content), (0, 0, 0, 2)))
    out.print()
    out.print(f"{near(Path(task.source.document.origin.name))}  {task.content_hash[:12]}", style="quiet")
    others = [name for name in variant_names(task.source.document.data) if name != task.name]
    if others:
        out.print(f"the same spec defines {', '.join(others)}", style="quiet")


# -- expressions --------------------------------------------------------------------------------------------------


def _colored(text: str) -> VisibleText:
    """Return an expression with its words, functions and numbers in colour."""
    line = VisibleText(text)
    for found in _TOKENS.finditer(text):
        assert found.lastgroup is not None
        line.stylize(_STYLES[found.lastgroup], *found.span())
    return line


def _body(expr: s.Expr) -> RenderableType:
    """Return the right-hand side of an equation: a line, or rows for what is decided case by case."""
    match expr:
        case s.Piecewise(branches=branches, otherwise=otherwise):
            cases = [[written(value), f"if {written(condition)}"] for condition, value in branches]
            return _rows([*cases, [written(otherwise), "otherwise"]], ["", ""])
        case s.Table(by=by, rows=rows):
            return _rows([*_table_rows(rows, len(by))], [*map(written, by), ""])
        case _:
            return _colored(written(expr))


def _table_rows(rows: tuple[s.TableRow, ...], depth: int) -> Iterator[list[str]]:
    """Yield rows of a decision table: the keys, blank where one cell is for all of them, and the cell."""
    for row in rows:
        key = "else" if row.key is None else written(row.key)
        if isinstance(row.body, tuple):
            for deeper in _table_rows(row.body, depth - 1):
                yield [key, *deeper]
                key = ""
        else:
            yield [key, *([""] * (depth - 1)), written(row.body)]


def _rows(rows: Sequence[Sequence[str]], headers: Sequence[str]) -> Columns:
    table = Columns(*headers, fold=range(len(headers)))
    for row in rows:
        table.add_row(*map(_colored, row))
    return table


def _lines(lines: Sequence[Line]) -> RenderableType:
    """Return equations under each other, aligned at the equals sign; a value without a name stands alone."""
    if not any(name for name, _ in lines):
        return Group(*(content for _, content in lines))
    table = Columns("", "", "", fold=(1, 2), styles=("cyan",), gap=1)
    for name, content in lines:
        table.add_row(name, "=", content)
    return table


def _named(expressions: Mapping[str, Any]) -> list[Line]:
    return [(name, _body(expr)) for name, expr in expressions.items() if expr is not None]


def _expression(text: str, cases: Iterable[Mapping[str, Any]]) -> VisibleText:
    """Return an expression with the values of parameters that it is for."""
    line = _colored(visible(text))
    listed = []
    for case in cases:
        listed.append(", ".join(f"{name}={setting(value)}" for name, value in case.items()))
    if listed:
        line.append(f"  for {'; '.join(listed)}", "quiet")
    return line


# -- sections -----------------------------------------------------------------------------------------------------


def _title(task: Task, width: int) -> RenderableType:
    left = VisibleText.assemble((task.id, "bold cyan"), "  ", (visible(task.title), "bold"))
    right = VisibleText(task.spec.capability or "", style="quiet")
    line = Table.grid(expand=True, padding=(0, 2, 0, 0))
    line.add_column(ratio=1)
    line.add_column(justify="right")
    line.add_row(left, right if left.cell_len + right.cell_len + 2 <= width else "")
    return line


def _words(text: Any) -> str:
    """Return a spec's prose, with `$mathematics$` as plain characters."""
    return _MATH.sub(lambda found: plain(read_tex(found[1])), visible(str(text))).strip()


def _grid(rows: Iterable[Sequence[RenderableType]], *styles: str, gap: int = 2) -> list[RenderableType]:
    """Return rows as a table; nothing where there are none."""
    table = Columns(*([""] * len(styles)), fold=range(len(styles)), styles=styles, gap=gap)
    for row in rows:
        table.add_row(*row)
    if table.rows:
        return [table]
    return []


def _parameters(task: Task) -> list[RenderableType]:
    rows = []
    for p in task.parameters:
        value = VisibleText(setting(p.value), style="green" if p.value == p.default else "bold green")
        alias = f"also called {p.alias}" if p.alias else ""
        rows.append((p.name, value, domain_words(p), "; ".join(filter(None, (visible(p.doc or ""), alias)))))
    return _grid(rows, "cyan", "", "", "quiet")


def _components(components: Sequence[Component]) -> list[RenderableType]:
    return _grid([(c.name, domain_words(c), visible(c.doc or "")) for c in components], "cyan", "", "quiet")


def _observation(task: Task) -> list[RenderableType]:
    if task.observation.is_state:
        return [VisibleText("the state", style="quiet")]
    return [_lines(_named(task.source.surface.sections.get("observation", {})))]


def _modifiers(task: Task) -> list[RenderableType]:
    if not task.modifiers:
        return []
    return _grid([(visible(str(each)), _words(text).replace("`", "")) for each, text in sentences(task)], "cyan", "")


def _equations(task: Task) -> Iterator[RenderableType]:
    """Yield sections in the order of a paper's appendix, with their lines."""
    sections = task.source.surface.sections
    blocks: dict[str, list[Line]] = {"constants": _constants(task)}
    blocks["legal"] = _named({"": sections.get("legal")})
    for key in ("definitions", "noise", "initial", "dynamics"):
        blocks[key] = _named(sections.get(key) or {})
    for key in ("reward", "terminal", "absorbing_reward"):
        blocks[key.replace("_", " ")] = _named({"": sections.get(key)})
    blocks["measures"] = _named(sections.get("measures") or {})
    blocks["horizon"] = [("", _horizon(task))]
    if task.discount != 1:
        blocks["discount"] = [("", f"{task.discount:g}")]
    blocks["memory"] = _named(sections.get("memory") or {})
    blocks["expert"] = _expert(task)
    for title, lines in blocks.items():
        if lines:
            table = Columns("", "", fold=(0, 1), styles=("quiet",), gap=1, widths={0: 12})
            table.add_row(title, _lines(lines))
            yield table


def _constants(task: Task) -> list[Line]:
    """Return the constants, with the value in this instance where it is drawn."""
    found: list[Line] = []
    for name, value in task.spec.constants.items():
        if isinstance(value, Mapping) and "grid" in value:
            found.append((visible(name), _map(value)))
            continue
        text = visible(str(value))
        is_drawn = any(f"{dist}(" in text for dist in (*DISTS, CATEGORICAL.name))
        if name in task.constants and is_drawn:
            drawn = task.constants[name]
            text += f" = {drawn.tolist() if hasattr(drawn, 'tolist') else drawn}"
        if len(text) > _LONGEST:
            text = text[:_LONGEST] + " …"
        found.append((visible(name), _colored(text)))
    return found


def _map(value: Mapping[str, Any]) -> VisibleText:
    grid = value["grid"]
    rows = grid.splitlines() if isinstance(grid, str) else grid
    meanings = value.get("legend", {}).items()
    legend = "  ".join(f"{lettered(letter)} {meaning}" for letter, meaning in meanings)
    return VisibleText("\n".join(visible(str(row), keep="") for row in [*rows, legend]))


def _horizon(task: Task) -> VisibleText:
    raw = task.spec.horizon
    if task.horizon is None:
        return _colored("none")
    return _colored(f"{task.horizon:,}" if isinstance(raw, int) else f"{raw} = {task.horizon:,}")


def _expert(task: Task) -> list[Line]:
    match task.annotations.expert:
        case None:
            return [("", VisibleText("not given", style="quiet"))]
        case "optimal":
            return [("", "optimal, by planning on the exact model")]
        case Soft(beta=beta):
            return [("", f"Boltzmann-rational with β = {beta:g}, by planning on the exact model")]
    found = task.source.surface.sections["expert"]
    return _named(found if isinstance(found, Mapping) else {task.action[0].name: found})


def _symmetries(task: Task) -> list[RenderableType]:
    """Return a line for each: its name and what it is; and one for each of its maps."""
    lines: list[RenderableType] = []
    for each in task.annotations.symmetries:
        lines.append(VisibleText.assemble((visible(each.name), "cyan"), f"  {_words(each.doc or '')}"))
        for key, exprs in task.source.surface.sections["symmetries"][each.name].items():
            lines += _grid(
                [(f"  {key}", _colored(f"{name} -> {written(e)}")) for name, e in exprs.items()], "quiet", ""
            )
    return lines


def _example(example: Example) -> str:
    """Return what is given, an arrow, what follows."""
    given = [f"{name} = {written(expr)}" for (_, name), expr in example.given.items()]
    if example.t:
        given.append(f"t = {example.t}")
    follows = []
    for each in example.follows:
        value = written(each.expr)
        match each.section:
            case "next":
                follows.append(f"{each.name}' = {value}")
            case "observation":
                follows.append(f"observed {each.name} = {value}")
            case "expert":
                follows.append(f"expert {each.name} = {value}")
            case section:
                follows.append(f"{section} {value}" if each.name is None else f"{each.name} = {value}")
    if example.probability is not None:
        follows.append(f"with probability {written(example.probability)}")
    return f"{', '.join(given)} → {', '.join(follows)}".removeprefix(" → ")


def _errata(task: Task) -> list[RenderableType]:
    rows: list[tuple[str, str]] = []
    for erratum in task.spec.errata:
        if rows:
            rows.append(("", ""))
        for label in ("source", "here", "because"):
            words = getattr(erratum, label)
            if words:
                rows.append((label, _words(words)))
    return _grid(rows, "quiet", "", gap=1)
