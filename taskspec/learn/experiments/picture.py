"""The picture of a sweep: a panel for each task, with curves over one parameter, or heat maps over two."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.display import number
from taskspec.learn.documents.document_models import Experiment, Plot
from taskspec.learn.experiments.sweeping import Measured
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart

WIDTH = 3.2
HEIGHT = 2.6
"""Of a panel, in inches."""
ACROSS = 3
"""Panels side by side."""
LINES: dict[str, tuple[str, str, str]] = {
    "optimal": (chart.GREEN, "-", "optimal"), "expert": (chart.BLUE, "--", "expert"),
    "random": (chart.VERMILION, "-.", "random actions"), "worst": (chart.INK, ":", "worst"),
}  # fmt: skip
"""Colour, dashes and words for returns from theory."""
SHOWN = ("optimal", "expert", "random")
MAPPED = ("optimal", "random")
MOST_NUMBERS = 60
"""Cells of a heat map that have their numbers in them."""
MOST_MARKED = 30
"""Points of a curve that have marks."""
MOST_TICKS = 12
"""Values of a parameter that have ticks."""
MARGIN = 0.6
"""Room for numbers beside a panel, in inches."""


def figure(experiment: Experiment, rows: Sequence[Measured], learners: tuple[str, ...] = ()) -> Chart:
    """Return the picture, without instances that have no results; the same rows give the same bytes.

    Args:
        experiment: the experiment.
        rows: its results.
        learners: whose scores are drawn, in place of returns.

    Raises:
        SpecError: E705 without matplotlib.
    """
    if learners:
        logs = [name for name in experiment.plot.log if name != "value"]
        plot = experiment.plot.model_copy(update={"show": list(learners), "log": logs})
        experiment = experiment.model_copy(update={"plot": plot})
    measured = [row for row in rows if row.error is None]
    panels = _panels(experiment, measured, bool(learners))
    title = experiment.title or experiment.name
    across = max(1, min(ACROSS, len(panels)))
    down = math.ceil(len(panels) / across)
    with chart.style():
        drawn = chart.figure(WIDTH * across, HEIGHT * max(1, down) + 0.4, layout="constrained")
        drawn.suptitle(title)
        for i, panel in enumerate(panels):
            axes = drawn.add_subplot(down, across, i + 1)
            if panel.title != title:
                axes.set_title(panel.title)
            if panel.y is None:
                _curves(axes, panel, experiment)
            else:
                _map(axes, panel, panel.y)
        chart.key_below(drawn, 2 * across)
    return Chart(drawn, f"{title}: {', '.join(panel.title for panel in panels)}")


@dataclass(frozen=True)
class _Panel:
    """Rows of one task, along one parameter or two; for a heat map, `show` is what it maps. `scored`: scores, not returns."""

    title: str
    rows: tuple[Measured, ...]
    x: str | None
    y: str | None = None
    show: tuple[str, ...] = SHOWN
    scored: bool = False


def _panels(experiment: Experiment, rows: Sequence[Measured], scored: bool) -> list[_Panel]:
    panels: list[_Panel] = []
    for _, group in itertools.groupby(rows, key=lambda row: row.instance.entry):
        some = tuple(group)
        x, y, rest = _axes(experiment.plot, some)
        shown = tuple(experiment.plot.show)
        for part in _parts(some, rest):
            title = _title(part[0], rest)
            if y is None:
                panels.append(_Panel(title, part, x, None, shown or SHOWN, scored))
                continue
            differing = [name for name in MAPPED if len({row.values.get(name) for row in part}) > 1]
            for name in shown or differing or MAPPED[-1:]:
                panels.append(_Panel(f"{title}: {name}", part, x, y, (name,), scored))
    return panels


def _axes(plot: Plot, rows: Sequence[Measured]) -> tuple[str | None, str | None, list[str]]:
    """Return the parameters along both axes, where there are some, and the others that vary."""
    rest = []
    for name in rows[0].instance.varied:
        if len({repr(row.instance.varied[name]) for row in rows}) > 1:
            rest.append(name)
    is_map = plot.y in rest or (len(rest) == 2 and plot.x is None)
    y = _taken(plot.y, rest) if plot.y in rest else None
    x = _taken(plot.x, rest)
    if is_map and y is None:
        y = _taken(None, rest)
    return x, y, rest


def _taken(wanted: str | None, names: list[str]) -> str | None:
    """Take a name out of some: the first where the wanted one is not among them."""
    if wanted not in names:
        return names.pop(0) if names else None
    names.remove(wanted)
    return wanted


def _title(row: Measured, names: Sequence[str]) -> str:
    instance = row.instance
    parts = [instance.task]
    parts += [f"{name}={instance.varied[name]}" for name in names]
    for text in instance.modifiers:
        if text.partition("=")[0] not in instance.varied:
            parts.append(text)
    return ", ".join(parts)


def _parts(rows: Sequence[Measured], names: Sequence[str]) -> list[tuple[Measured, ...]]:
    parts: dict[tuple[str, ...], list[Measured]] = {}
    for row in rows:
        values = tuple(repr(row.instance.varied[name]) for name in names)
        parts.setdefault(values, []).append(row)
    return list(map(tuple, parts.values()))


# -- curves


@dataclass(frozen=True)
class _Curve:
    """Values along the x axis, with the halves of their intervals."""

    label: str
    look: Mapping[str, Any]
    xs: np.ndarray
    values: np.ndarray
    halves: np.ndarray


def _curves(axes: Any, panel: _Panel, experiment: Experiment) -> None:
    """Draw exact returns as lines, estimates as bands around them, and rollouts as marks with 95 % intervals."""
    rows = panel.rows
    if panel.x is not None:
        x = panel.x
        rows = tuple(sorted(rows, key=lambda row: _key(row.instance.varied[x])))
    xs, labels = _positions(rows, panel.x)
    is_log = "value" in experiment.plot.log
    if is_log:
        axes.set_yscale("log", nonpositive="clip")
    has_log_x = labels is None and min(xs) > 0 and (panel.x in experiment.plot.log or _is_geometric(xs))
    if has_log_x:
        axes.set_xscale("log")
    for curve in _theory(panel, rows, xs):
        _line(axes, curve, is_log)
    for curve in _rollouts(rows, xs):
        axes.errorbar(curve.xs, curve.values, yerr=curve.halves, label=curve.label, **curve.look)
    axes.grid(True)
    axes.margins(0.05)
    axes.set_xlabel(panel.x or "")
    if panel.scored:
        axes.set_ylabel(chart.SCORE)
    elif set(panel.show) <= set(LINES):
        axes.set_ylabel("return")
    chart.numbers(axes.yaxis, is_log)
    if labels is not None:
        chart.labelled(axes, xs, labels, WIDTH - MARGIN, turns=True)
    elif has_log_x or (np.equal(np.mod(xs, 1), 0).all() and len(xs) <= MOST_TICKS):
        chart.labelled(axes, xs, list(map(number, xs)), WIDTH - MARGIN)
    else:
        chart.numbers(axes.xaxis)


def _theory(panel: _Panel, rows: Sequence[Measured], xs: Sequence[float]) -> Iterator[_Curve]:
    spare = itertools.cycle(chart.SERIES)
    for name in panel.show:
        if name in LINES:
            color, dash, label = LINES[name]
        else:
            color, dash, _ = next(spare)
            label = name
        values = _numbers([row.values.get(name) for row in rows])
        halves = np.nan_to_num(_numbers([row.values.get(f"{name}_half") for row in rows]))
        if not np.isnan(values).all():
            yield _Curve(label, {"color": color, "linestyle": dash}, np.array(xs), values, halves)


def _line(axes: Any, curve: _Curve, is_log: bool) -> None:
    values = curve.values
    if is_log:
        values = np.where(values > 0, values, np.nan)
    marker = "o" if len(values) < MOST_MARKED else ""
    axes.plot(curve.xs, values, marker=marker, label=curve.label, **curve.look)
    if not curve.halves.any():
        return
    if len(values) == 1:
        axes.errorbar(curve.xs, values, yerr=curve.halves, color=curve.look["color"], capsize=2)
        return
    low = values - curve.halves
    high = values + curve.halves
    chart.band(axes, curve.xs, low, high, curve.look["color"], where=~is_log | (low > 0))


def _rollouts(rows: Sequence[Measured], xs: Sequence[float]) -> Iterator[_Curve]:
    names = dict.fromkeys(itertools.chain(*(row.policies for row in rows)))
    for name, (_, _, marker) in zip(names, itertools.cycle(chart.SERIES), strict=False):
        known = [name in row.policies for row in rows]
        returns = [row.policies[name] for row in itertools.compress(rows, known)]
        means = _numbers([each.get("mean") for each in returns])
        halves = np.nan_to_num(_numbers([each.get("half") for each in returns]))
        color = chart.MUTED
        if name in LINES:
            color = LINES[name][0]
        look = {"color": color, "linestyle": "none", "marker": marker, "markerfacecolor": chart.PAPER, "capsize": 2}
        yield _Curve(f"{name}, rolled out", look, np.array(xs)[known], means, halves)


def _positions(rows: Sequence[Measured], x: str | None) -> tuple[list[float], list[str] | None]:
    """Return where rows stand along the axis; names instead of numbers, where these are none."""
    values: list[Any] = list(map(_label, rows))
    if x is not None:
        values = [row.instance.varied[x] for row in rows]
    if not any(isinstance(value, bool | str) for value in values):
        return list(map(float, values)), None
    labels = list(map(str, values))
    names = list(dict.fromkeys(labels))
    return [float(names.index(label)) for label in labels], labels


def _label(row: Measured) -> str:
    return row.instance.id.removeprefix(row.instance.task).lstrip("?+") or row.instance.task


def _is_geometric(xs: Sequence[float]) -> bool:
    ratios = np.divide(xs[1:], xs[:-1])
    return len(ratios) > 1 and bool(ratios.min() >= 2 and ratios.max() <= 2 * ratios.min())


def _key(value: Any) -> tuple[int, Any]:
    if isinstance(value, str):
        return (1, value)
    return (0, value)


def _numbers(values: Sequence[Any]) -> np.ndarray:
    """Return numbers as an array, nan for everything else."""
    array = np.full(len(values), math.nan)
    for i, value in enumerate(values):
        if isinstance(value, int | float):
            array[i] = value
    return array


# -- heat maps


def _map(axes: Any, panel: _Panel, y_name: str) -> None:
    """Draw one number over two parameters as colours; it stands in each cell as well, if there is room."""
    assert panel.x is not None
    across = _sorted(panel.rows, panel.x)
    up = _sorted(panel.rows, y_name)
    cells = np.full((len(up), len(across)), math.nan)
    values = _numbers([row.values.get(panel.show[0]) for row in panel.rows])
    for row, value in zip(panel.rows, values, strict=True):
        i = up.index(str(row.instance.varied[y_name]))
        j = across.index(str(row.instance.varied[panel.x]))
        cells[i, j] = value
    chart.heat_map(axes, cells, has_numbers=cells.size <= MOST_NUMBERS)
    chart.labelled(axes, (np.arange(len(across)) + 0.5).tolist(), across, WIDTH - 1.5 * MARGIN)
    axes.set_yticks((np.arange(len(up)) + 0.5).tolist(), up)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(y_name)


def _sorted(rows: Sequence[Measured], name: str) -> list[str]:
    values: Mapping[str, Any] = {str(row.instance.varied[name]): row.instance.varied[name] for row in rows}
    return sorted(values, key=lambda text: _key(values[text]))
