"""The section `figure`: what its kind needs is checked, and its expressions become nodes; `appendix.figures` draws them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taskspec.diagnostics import suggest
from taskspec.lang import syntax as s
from taskspec.lang.ir import Const, Node
from taskspec.lang.scope import Scope, Value
from taskspec.lang.types import Kind
from taskspec.source import Path
from taskspec.task.context import Context
from taskspec.task.task import Figure

_NEEDED: dict[str, tuple[str, ...]] = {
    "grid": ("at",),
    "curve": ("at", "curve"),
    "portrait": ("at",),
    "arm": ("values",),
}


def figure(context: Context, scope: Scope) -> Figure | None:
    """What the section says; None without one.

    Reported are keys that the kind of figure lacks (E203), and expressions that mean nothing or have the wrong shape.
    """
    written: dict[str, Any] | None = context.data.get("figure")
    if not written:
        return None
    for key in _NEEDED.get(written["kind"], ()):
        if written.get(key) is None:
            span = context.merged.key_span(("figure",))
            context.collector.add("E203", span, f"a figure of kind `{written['kind']}` needs `{key}`")
    parts = {key: _node(context, ("figure", key), scope) for key in ("curve", "values") if written.get(key) is not None}
    marks = {name: _node(context, ("figure", "highlight", name), scope) for name in written.get("highlight") or {}}
    sizes = (2, 4) if written["kind"] == "grid" else (2,)
    objects = {
        name: _place(context, ("figure", "objects", name), at, scope, (2, 4))
        for name, at in (written.get("objects") or {}).items()
    }
    return Figure(
        kind=written["kind"], at=_place(context, ("figure", "at"), written.get("at"), scope, sizes), curve=parts.get("curve"),
        values=parts.get("values"), highlight={name: node for name, node in marks.items() if node is not None},
        map=_map(context, written.get("map")), objects={name: at for name, at in objects.items() if at},
    )  # fmt: skip


def _place(context: Context, path: Path, at: Any, scope: Scope, sizes: tuple[int, ...]) -> tuple[Node, ...]:
    """A column and a row, and maybe a way, or one vector of all; nothing where there is none, or it is broken."""
    if at is None:
        return ()
    whole = None if isinstance(at, list) else context.forms.expr(path)
    parts: Sequence[s.Expr | None] = [whole]
    if isinstance(at, list):
        parts = [context.forms.expr((*path, i)) for i in range(len(at))]
    elif isinstance(whole, s.Vector):
        parts = whole.items  # `at: "[x, y]"` is the same as `at: [x, y]`
    nodes = [_number_of(context, expr, scope) for expr in parts]
    found = tuple(node for node in nodes if node is not None)
    if len(found) < len(nodes):
        return ()
    inner = next((node.type.shape for node in found if node.type.shape), ())
    shape = inner if parts == [whole] else (len(found), *inner)
    if shape not in [(n,) for n in sizes]:
        more = ", or four with the way that it faces" if 4 in sizes else ""
        message = f"a place is two numbers{more}, but this has shape {list(shape)}"
        context.collector.add("E307", context.merged.span(path), message)
    return found


def _node(context: Context, path: Path, scope: Scope) -> Node | None:
    """An expression as a node, a choice as the number that it stands for; None where it is broken (and reported)."""
    return _number_of(context, context.forms.expr(path), scope)


def _number_of(context: Context, expr: s.Expr | None, scope: Scope) -> Node | None:
    value = None if expr is None else context.checker.check(expr, scope)
    if expr is None or value is None:
        return None
    return context.checker.number_of(value)


def _map(context: Context, name: str | None) -> tuple[str, ...]:
    """The rows of the grid of letters that the figure names; none where it names none."""
    constants = context.data.get("constants") or {}
    if name is None:
        return ()
    grid = constants[name].get("grid") if isinstance(constants.get(name), dict) else None
    if name not in constants:
        span = context.merged.span(("figure", "map"))
        context.collector.add("E302", span, f"there is no constant '{name}'", suggest(name, constants))
    elif grid is None:
        value = context.constant(name)
        rows = _digits(value)
        if rows is None and value is not None:
            message = f"the constant '{name}' is neither a grid of letters nor a matrix of conditions or digits"
            hint = f"{name}: {{grid: [...], legend: {{...}}}}"
            context.collector.add("E204", context.merged.span(("figure", "map")), message, hint)
        return rows or ()
    return tuple(grid.splitlines() if isinstance(grid, str) else grid or ())


def _digits(value: Value | None) -> tuple[str, ...] | None:
    """A matrix as rows of characters, `#` for a condition that holds; None where it has other numbers, or is no matrix."""
    node = None if value is None else value.node
    if not isinstance(node, Const) or len(node.type.shape) != 2 or not node.type.size:
        return None
    if node.type.kind is Kind.BOOL:
        letters = ["#" if v else " " for v in node.flat]
    elif node.type.kind is Kind.INT and all(0 <= v <= 9 for v in node.flat):
        letters = [str(v) for v in node.flat]
    else:
        return None
    width = node.type.shape[1]
    return tuple("".join(letters[i : i + width]) for i in range(0, len(letters), width))
