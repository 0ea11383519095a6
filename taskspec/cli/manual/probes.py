"""What the language does, found out by trying it: values of expressions, names in sections, spaces of declarations."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from taskspec.base.diagnostics import Collector, Origin, Span, SpecError
from taskspec.lang.builder import Builder
from taskspec.lang.check import Checker
from taskspec.lang.ir import Const
from taskspec.lang.parse import parse
from taskspec.lang.scope import Scope
from taskspec.lang.syntax import SourceText
from taskspec.source import read_text
from taskspec.task.build import build
from taskspec.task.task import Task

# -- values -------------------------------------------------------------------------------------------------------


def value(expression: str) -> str:
    """The value of a constant expression, written as the language writes values."""
    origin = Origin("<manual>", expression)
    text = SourceText(expression, lambda start, end: Span(origin, 1, start + 1, 1, end + 1))
    collector = Collector()
    found = Checker(Builder(), collector).check(parse(text), Scope({}))
    collector.raise_if_errors()
    assert found is not None and isinstance(found.node, Const)
    return _written(found.node.flat, found.node.type.shape)


def _written(flat: tuple[Any, ...], shape: tuple[int, ...]) -> str:
    if not shape:
        return _number(flat[0])
    step = len(flat) // shape[0]
    rows = (flat[i * step : (i + 1) * step] for i in range(shape[0]))
    return f"({', '.join(_written(row, shape[1:]) for row in rows)})"


def _number(item: Any) -> str:
    if isinstance(item, Fraction):
        return str(item) if item.denominator <= 100 else f"{float(item):.6g}"
    return f"{item:.6g}" if isinstance(item, float) else str(item)


# -- specs --------------------------------------------------------------------------------------------------------

PROBE: dict[str, Any] = {
    "taskspec": 1,
    "name": "Probe",
    "parameters": {"L": {"type": "int", "default": 3}},
    "constants": {"k": 2},
    "noise": {"n": "UniformInt(0, 1)"},
    "state": {"x": {"type": "int"}, "y": {"type": "real"}},
    "action": {"a": {"type": "int", "low": 0, "high": 9}},
    "horizon": 5,
    "initial": {"x": 0, "y": 0},
    "dynamics": {"x'": "x + a"},
    "reward": 0,
}


def task(changes: dict[str, Any]) -> Task:
    """The probe with some sections replaced."""
    import json

    return build(read_text(json.dumps(PROBE | changes), "<manual>"))


def fits(section: str, template: str, expression: str) -> bool:
    """Whether an expression may stand in a place of the probe: `template` is the section with `@` for the expression."""
    import json

    try:
        task({section: json.loads(template.replace("@", expression))})
    except SpecError:
        return False
    return True


def spaces(changes: dict[str, Any]) -> tuple[str, str]:
    """The observation space and the action space of the probe with some sections replaced."""
    from taskspec.task.spaces import space

    found = task(changes)
    return str(space(found.observation_layout)), str(space(found.action_layout))
