"""The section `figure`: what its kind needs, and its expressions, are checked here; `appendix.figures` draws it."""

from __future__ import annotations

from taskspec.diagnostics import suggest
from taskspec.lang.scope import Scope
from taskspec.lang.types import Shape
from taskspec.source import Path
from taskspec.spec.context import Context

_NEEDED: dict[str, tuple[str, ...]] = {"grid": ("at",), "curve": ("at", "curve")}


def check_figure(context: Context, scope: Scope) -> None:
    """Report keys that the kind of figure lacks (E203), and expressions that mean nothing or have the wrong shape."""
    figure = context.data.get("figure")
    if not figure:
        return
    for key in _NEEDED.get(figure["kind"], ()):
        if figure.get(key) is None:
            span = context.merged.key_span(("figure",))
            context.collector.add("E203", span, f"a figure of kind `{figure['kind']}` needs `{key}`")
    if isinstance(figure.get("at"), list):
        found = [_shape(context, ("figure", "at", i), scope) for i in range(len(figure["at"]))]
        whole = None if None in found else (len(found), *(found[0] or ()))
    else:
        whole = _shape(context, ("figure", "at"), scope) if figure.get("at") is not None else None
    if whole not in (None, (2,)):
        span = context.merged.span(("figure", "at"))
        context.collector.add("E307", span, f"a place is two numbers, but this has shape {list(whole or ())}")
    for path in [
        ("figure", "curve"),
        ("figure", "values"),
        *(("figure", "highlight", k) for k in figure.get("highlight") or {}),
    ]:
        if path[-1] in figure or len(path) > 2:
            _shape(context, path, scope)
    _check_map(context, figure.get("map"))


def _shape(context: Context, path: Path, scope: Scope) -> Shape | None:
    """The shape of an expression, or None where it is broken (and reported)."""
    expr = context.forms.expr(path)
    value = None if expr is None else context.checker.check(expr, scope)
    return None if value is None else value.node.type.shape


def _check_map(context: Context, name: str | None) -> None:
    constants = context.data.get("constants") or {}
    if name is not None and name not in constants:
        span = context.merged.span(("figure", "map"))
        context.collector.add("E302", span, f"there is no constant '{name}'", suggest(name, constants))
    elif name is not None and not (isinstance(constants[name], dict) and "grid" in constants[name]):
        message, hint = f"the constant '{name}' is no grid of letters", f"{name}: {{grid: [...], legend: {{...}}}}"
        context.collector.add("E204", context.merged.span(("figure", "map")), message, hint)
