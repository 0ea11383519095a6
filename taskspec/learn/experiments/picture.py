"""The picture of a sweep: a panel for each task, with curves over one parameter, or heat maps over two."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from taskspec.base.display import number
from taskspec.language.task.schema.experiments import Experiment
from taskspec.learn.experiments.sweeping import Measured
from taskspec.show.figures import chart, save
from taskspec.show.figures.chart import Axes, LegendEntry, Scale
from taskspec.show.figures.shapes import Box, Dash, Hex, Item, Scene, shifted

FORMATS = ("svg", "png", "pdf")
WIDTH = 6.6
HEIGHT = 4.8
"""Of the axes of a panel, in centimetres."""
APART = 1.0
ACROSS = 3
"""Panels side by side."""
LINES: dict[str, tuple[Hex, Dash, str]] = {
    "optimal": (chart.GREEN, "solid", "optimal"), "expert": (chart.BLUE, "dashed", "expert"),
    "random": (chart.VERMILION, "dashdot", "random actions"), "worst": (Hex("#000000"), "dotted", "worst"),
}  # fmt: skip
"""Colour, dashes and words for returns from theory."""
OTHERS = (chart.PURPLE, chart.ORANGE, chart.SKY, chart.YELLOW)
SHOWN = ("optimal", "expert", "random")
MAPPED = ("optimal", "random")
MOST_NUMBERS = 60
"""Cells of a heat map that have their numbers in them."""
NUMBER = 0.21
"""The size of their letters."""


def draw(experiment: Experiment, rows: Sequence[Measured], path: Path, learners: tuple[str, ...] = ()) -> None:
    """Write an SVG, PNG or PDF file; the same rows give the same bytes.

    Args:
        learners: whose scores are drawn, in place of returns.
    """
    save(figure(experiment, rows, learners), path)


def figure(experiment: Experiment, rows: Sequence[Measured], learners: tuple[str, ...] = ()) -> Scene:
    """Return the picture, without instances that have no results."""
    if learners:
        logs = [name for name in experiment.plot.log if name != "value"]
        plot = experiment.plot.model_copy(update={"show": list(learners), "log": logs})
        experiment = experiment.model_copy(update={"plot": plot})
    panels = _panels(experiment, [row for row in rows if row.error is None], bool(learners))
    drawn = [chart.chart(_panel(panel, experiment), panel.title) for panel in panels]
    items: list[Item] = []
    widths = [max(scene.width for scene in drawn[i::ACROSS]) for i in range(min(ACROSS, len(drawn)))]
    top = 0.9
    for start in range(0, len(drawn), ACROSS):
        line = drawn[start : start + ACROSS]
        for i, scene in enumerate(line):
            left = sum(widths[:i]) + APART * i
            items += [shifted(item, left, top) for item in scene.items]
        top += max(scene.height for scene in line) + APART
    title = experiment.title or experiment.name
    middle = (sum(widths) + APART * (len(widths) - 1)) / 2
    items += chart.words(title, (middle, 0.3), 0.34)
    return chart.chart(items, f"{title}: {', '.join(panel.title for panel in panels)}")


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
    found: list[_Panel] = []
    for _, group in itertools.groupby(rows, key=lambda row: row.instance.entry):
        some = tuple(group)
        free = [n for n in some[0].instance.varied if len({repr(row.instance.varied[n]) for row in some}) > 1]
        plot = experiment.plot
        x = plot.x if plot.x in free else next((n for n in free if n != plot.y), None)
        is_map = plot.y in free or (len(free) == 2 and plot.x is None)
        if is_map:
            y = plot.y if plot.y in free else next(n for n in free if n != x)
        else:
            y = None
        rest = [n for n in free if n not in (x, y)]
        title = some[0].instance.task
        shown = tuple(plot.show)
        for values, part in _parts(some, rest):
            name = ", ".join([title, *(f"{k}={v}" for k, v in values.items()), *_fixed(some[0])])
            if y is None:
                found.append(_Panel(name, part, x, None, shown or SHOWN, scored))
            else:
                differing = [each for each in MAPPED if len({row.values.get(each) for row in part}) > 1]
                mapped = shown or differing or MAPPED[-1:]
                found += [_Panel(f"{name}: {each}", part, x, y, (each,), scored) for each in mapped]
    return found


def _fixed(row: Measured) -> list[str]:
    """Return the modifiers that are the same in a whole panel."""
    return [text for text in row.instance.modifiers if text.partition("=")[0] not in row.instance.varied]


def _parts(rows: Sequence[Measured], names: Sequence[str]) -> list[tuple[dict[str, Any], tuple[Measured, ...]]]:
    """Return rows by the values of parameters that have no axis."""
    found: dict[tuple[str, ...], list[Measured]] = {}
    for row in rows:
        found.setdefault(tuple(repr(row.instance.varied[n]) for n in names), []).append(row)
    return [({n: part[0].instance.varied[n] for n in names}, tuple(part)) for part in found.values()]


def _panel(panel: _Panel, experiment: Experiment) -> Iterator[Item]:
    """Yield the title, the axes and the contents of a panel, from (0, 0)."""
    yield from chart.words(panel.title, (WIDTH / 2, -0.4))
    if panel.y is None:
        yield from _curves(panel, experiment)
    else:
        yield from _map(panel, panel.y)


# -- curves


@dataclass(frozen=True)
class _Curve:
    """Values along the x axis, with the halves of their intervals."""

    entry: LegendEntry
    xs: Sequence[float]
    values: Sequence[float]
    halves: Sequence[float]

    @property
    def lows(self) -> list[float]:
        return [value - half for value, half in zip(self.values, self.halves, strict=True)]

    @property
    def highs(self) -> list[float]:
        return [value + half for value, half in zip(self.values, self.halves, strict=True)]


def _curves(panel: _Panel, experiment: Experiment) -> Iterator[Item]:
    """Yield exact returns as lines, estimates as bands around them, and rollouts as marks with 95 % intervals."""
    rows = panel.rows
    if panel.x is not None:
        x = panel.x
        rows = tuple(sorted(rows, key=lambda row: _key(row.instance.varied[x])))
    xs, labels = _positions(rows, panel.x)
    theory = list(_theory(panel, rows, xs))
    rollouts = list(_rollouts(rows, xs))
    found = [*theory, *rollouts]
    ends = [y for curve in found for y in (*curve.lows, *curve.highs)]
    quantity = "return" if set(panel.show) <= set(LINES) else ""
    if panel.scored:
        quantity = "score: random 0, expert 1"
    y_axis = chart.axis(ends, quantity, log="value" in experiment.plot.log)
    plot = Axes(0.0, 0.0, WIDTH, HEIGHT, _x_axis(panel, experiment, xs, labels), y_axis)
    yield from chart.frame(plot, grid=True)
    for curve in theory:
        yield from _line(plot, curve)
    for curve in rollouts:
        for x_value, y, low, high in zip(curve.xs, curve.values, curve.lows, curve.highs, strict=True):
            yield from chart.error_bar(plot, x_value, low, high, curve.entry.color)
            if curve.entry.shape is not None and plot.has(x_value, y):
                yield chart.mark(plot.at(x_value, y), curve.entry.shape, curve.entry.color)
    top = HEIGHT + chart.below_axis(plot.x) + (0.35 if plot.x.label else 0.1)
    yield from chart.legend([curve.entry for curve in found], -0.6, top, WIDTH + 0.8)


def _theory(panel: _Panel, rows: Sequence[Measured], xs: Sequence[float]) -> Iterator[_Curve]:
    spare = itertools.cycle(OTHERS)
    for name in panel.show:
        if name in LINES:
            color, dash, label = LINES[name]
        else:
            color, dash, label = (next(spare), "solid", name)
        values = [_number(row.values.get(name)) for row in rows]
        halves = [_number(row.values.get(f"{name}_half")) for row in rows]
        if not all(map(math.isnan, values)):
            shape: chart.Shape | None = "circle" if len(xs) < 30 else None
            known = [0.0 if math.isnan(half) else half for half in halves]
            yield _Curve(LegendEntry(label, color, dash, shape, filled=True), xs, values, known)


def _line(plot: Axes, curve: _Curve) -> Iterator[Item]:
    """Yield a line, its marks, and a band, or an error bar if there is one point."""
    color = curve.entry.color
    if any(curve.halves) and len(curve.xs) > 1:
        yield from chart.band(plot, curve.xs, curve.lows, curve.highs, color)
    if any(curve.halves) and len(curve.xs) == 1:
        yield from chart.error_bar(plot, curve.xs[0], curve.lows[0], curve.highs[0], color)
    yield from chart.polyline(plot, curve.xs, curve.values, color, dash=curve.entry.dash or "solid")
    for x, y in zip(curve.xs, curve.values, strict=True):
        if curve.entry.shape is not None and plot.has(x, y):
            yield chart.mark(plot.at(x, y), curve.entry.shape, color, size=0.06, filled=True)


def _rollouts(rows: Sequence[Measured], xs: Sequence[float]) -> Iterator[_Curve]:
    names = dict.fromkeys(name for row in rows for name in row.policies)
    for name, shape in zip(names, itertools.cycle(chart.SHAPES), strict=False):
        found = [(x, row.policies[name]) for x, row in zip(xs, rows, strict=True) if name in row.policies]
        means = [_number(each.get("mean")) for _, each in found]
        halves = [_number(each.get("half")) for _, each in found]
        color = LINES[name][0] if name in LINES else Hex("#444444")
        yield _Curve(LegendEntry(f"{name}, rolled out", color, None, shape), [x for x, _ in found], means, halves)


def _x_axis(panel: _Panel, experiment: Experiment, xs: Sequence[float], labels: Sequence[str] | None) -> Scale:
    """Return the axis of the parameter, with a tick at each of its values if they are few."""
    name = panel.x or ""
    if labels is not None:
        found = chart.axis(xs, name)
        turned = 30.0 if max(map(len, labels), default=0) > 6 else 0.0
        return replace(found, ticks=tuple(dict.fromkeys(zip(xs, labels, strict=True))), angle=turned)
    at_values = tuple((x, number(x)) for x in dict.fromkeys(xs))
    if min(xs) > 0 and (panel.x in experiment.plot.log or _is_geometric(xs)):
        return replace(chart.axis(xs, name, log=True), ticks=at_values)
    found = chart.axis(xs, name)
    if all(float(x).is_integer() for x in xs) and len(xs) <= 12:
        return replace(found, ticks=at_values)
    return found


def _positions(rows: Sequence[Measured], x: str | None) -> tuple[list[float], list[str] | None]:
    """Return where rows stand along the axis; names instead of numbers, where these are none."""
    values: list[Any] = [_label(row) if x is None else row.instance.varied[x] for row in rows]
    if not any(isinstance(v, bool | str) for v in values):
        return [float(v) for v in values], None
    names = list(dict.fromkeys(map(str, values)))
    return [float(names.index(str(v))) for v in values], [str(v) for v in values]


def _label(row: Measured) -> str:
    """Return what an instance is called beside others of its task."""
    return row.instance.id.removeprefix(row.instance.task).lstrip("?+") or row.instance.task


def _is_geometric(xs: Sequence[float]) -> bool:
    """Return whether values are far apart, each about as many times the one before."""
    ratios = [b / a for a, b in itertools.pairwise(xs)]
    return len(ratios) > 1 and min(ratios) >= 2 and max(ratios) <= 2 * min(ratios)


def _key(value: Any) -> tuple[int, Any]:
    if isinstance(value, str):
        return (1, value)
    return (0, value)


def _number(value: Any) -> float:
    if isinstance(value, int | float):
        return float(value)
    return math.nan


# -- heat maps


def _map(panel: _Panel, y_name: str) -> Iterator[Item]:
    """Yield one number over two parameters as colours; it stands in each cell as well, if there is room."""
    assert panel.x is not None
    across = _sorted(panel.rows, panel.x)
    up = _sorted(panel.rows, y_name)
    cells: dict[tuple[str, str], float] = {}
    for row in panel.rows:
        place = (str(row.instance.varied[panel.x]), str(row.instance.varied[y_name]))
        cells[place] = _number(row.values.get(panel.show[0]))
    known = [value for value in cells.values() if not math.isnan(value)] or [0.0]
    is_log = min(known) > 0 and max(known) > 100 * min(known)
    scale = chart.axis(known, log=is_log, margin=0.0)
    width = WIDTH / len(across)
    height = HEIGHT / len(up)
    for i, b in enumerate(up):
        bottom = HEIGHT - i * height
        yield from chart.words(b, (-0.2, bottom - height / 2), chart.SMALL, "end")
        for j, a in enumerate(across):
            value = cells.get((a, b), math.nan)
            if math.isnan(value):
                continue
            color = chart.blend(chart.CIVIDIS, scale.share(value))
            yield Box((j * width, bottom - height), width, height, chart.hexadecimal(color), None)
            if len(across) * len(up) <= MOST_NUMBERS:
                at = (j * width + width / 2, bottom - height / 2)
                yield from chart.words(f"{value:.3g}".replace("-", "−"), at, NUMBER, color=chart.ink(color))
    yield Box((0.0, 0.0), WIDTH, HEIGHT, None, chart.EDGE)
    for j, a in enumerate(across):
        yield from chart.words(a, ((j + 0.5) * width, HEIGHT + 0.3), chart.SMALL)
    yield from chart.words(panel.x, (WIDTH / 2, HEIGHT + 0.7), chart.SMALL)
    widest = max(chart.breadth(b, chart.SMALL) for b in up)
    yield from chart.words(y_name, (-0.45 - widest, HEIGHT / 2), chart.SMALL, angle=90)
    bar = Axes(WIDTH + 0.35, HEIGHT * 0.08, 0.3, HEIGHT * 0.84, Scale(0, 1), scale)
    yield from chart.color_bar(bar, chart.CIVIDIS)


def _sorted(rows: Sequence[Measured], name: str) -> list[str]:
    values: Mapping[str, Any] = {str(row.instance.varied[name]): row.instance.varied[name] for row in rows}
    return sorted(values, key=lambda text: _key(values[text]))
