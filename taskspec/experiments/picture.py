"""The picture of a sweep: a panel for each task, with curves over one parameter, or heat maps over two."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from taskspec.base.display import visible
from taskspec.base.extras import need
from taskspec.base.files import write_bytes
from taskspec.experiments.results import Measured
from taskspec.task.schema.experiments import Experiment

FORMATS = ("svg", "png", "pdf")
WIDTH, HEIGHT, TITLE = 3.6, 2.7, 0.3
"""Inches: of a panel, and of what stands above all."""
ACROSS = 3
"""Panels side by side."""
LINES = {
    "optimal": ("#009E73", "-", "optimal"), "expert": ("#0072B2", "--", "expert"), "random": ("#D55E00", "-.", "random actions"),
    "worst": ("#000000", ":", "worst"),
}  # fmt: skip
"""Colour (of Okabe and Ito, which all eyes tell apart), dashes, and words for returns from theory."""
OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
MARKERS = "osD^vP"
SHOWN = ("optimal", "expert", "random")
MAPPED = ("optimal", "random")


def draw(experiment: Experiment, rows: Sequence[Measured], path: Path, learners: tuple[str, ...] = ()) -> None:
    """Write an SVG, PNG or PDF file; the same rows give the same bytes.

    Args:
        learners: whose scores are drawn, in place of returns.

    Raises:
        SpecError: E705 without matplotlib.
    """
    matplotlib = need("matplotlib", "figures")
    kind = path.suffix[1:].lower()
    settings = {
        "svg.hashsalt": "taskspec", "svg.fonttype": "path", "font.size": 8, "font.family": "DejaVu Sans",
        "text.parse_math": False,
    }  # fmt: skip
    with matplotlib.rc_context(settings):
        drawn = figure(experiment, rows, learners)
        metadata: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}[
            kind
        ]
        picture = BytesIO()
        drawn.savefig(picture, format=kind, dpi=160, metadata=metadata)
    write_bytes(path, picture.getvalue())


def figure(experiment: Experiment, rows: Sequence[Measured], learners: tuple[str, ...] = ()) -> Any:
    """The picture as matplotlib's `Figure`; instances without results are left out."""
    if learners:
        plot = experiment.plot.model_copy(
            update={"show": list(learners), "log": [n for n in experiment.plot.log if n != "value"]}
        )
        experiment = experiment.model_copy(update={"plot": plot})
    figures = need("matplotlib.figure", "figures")
    panels = _panels(experiment, [row for row in rows if row.error is None], bool(learners))
    across = max(1, min(ACROSS, len(panels)))
    down = max(1, math.ceil(len(panels) / across))
    drawn = figures.Figure(figsize=(WIDTH * across, HEIGHT * down + TITLE), layout="constrained")
    drawn.suptitle(visible(experiment.title or experiment.name), fontsize=9)
    axes = [drawn.add_subplot(down, across, i + 1) for i in range(len(panels))]
    for panel, each in zip(panels, axes, strict=True):
        (_map if panel.y else _curves)(panel, each, experiment)
        each.set_title(panel.title, fontsize=8)
    return drawn


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
        y = (plot.y if plot.y in free else next(n for n in free if n != x)) if is_map else None
        rest = [n for n in free if n not in (x, y)]
        title = some[0].instance.task
        shown = tuple(plot.show)
        for values, part in _parts(some, rest):
            name = ", ".join([title, *(f"{k}={v}" for k, v in values.items()), *_fixed(some[0])])
            if y is None:
                found.append(_Panel(name, part, x, None, shown or SHOWN, scored))
            else:
                mapped = shown or [each for each in MAPPED if _differs(part, each)] or MAPPED[-1:]
                found += [_Panel(f"{name}: {each}", part, x, y, (each,), scored) for each in mapped]
    return found


def _differs(rows: Sequence[Measured], name: str) -> bool:
    return len({row.values.get(name) for row in rows}) > 1


def _fixed(row: Measured) -> list[str]:
    """The modifiers that are the same in a whole panel."""
    return [text for text in row.instance.modifiers if text.partition("=")[0] not in row.instance.varied]


def _parts(rows: Sequence[Measured], names: Sequence[str]) -> list[tuple[dict[str, Any], tuple[Measured, ...]]]:
    """Rows by the values of parameters that have no axis."""
    found: dict[tuple[str, ...], list[Measured]] = {}
    for row in rows:
        found.setdefault(tuple(repr(row.instance.varied[n]) for n in names), []).append(row)
    return [({n: part[0].instance.varied[n] for n in names}, tuple(part)) for part in found.values()]


# -- curves -------------------------------------------------------------------------------------------------------------


def _curves(panel: _Panel, axes: Any, experiment: Experiment) -> None:
    """What theory says as lines, with what is estimated as bands; roll-outs as marks with 95 % intervals."""
    rows = (
        panel.rows if panel.x is None else sorted(panel.rows, key=lambda row: _key(row.instance.varied[panel.x or ""]))
    )
    xs, labels = _positions(rows, panel.x)
    spare = iter(OTHERS * 9)
    for name in panel.show:
        color, dashes, label = LINES.get(name) or (next(spare), "-", name)
        values, halves = ([_number(row.values.get(key)) for row in rows] for key in (name, f"{name}_half"))
        if all(map(math.isnan, values)):
            continue
        axes.plot(xs, values, dashes, color=color, label=label, marker="." if len(xs) < 30 else None)
        if len(xs) == 1 and halves[0] > 0:
            axes.errorbar(xs, values, halves, color=color, capsize=3)
        elif any(half > 0 for half in halves):
            low, high = zip(*((v - h, v + h) for v, h in zip(values, halves, strict=True)), strict=True)
            axes.fill_between(xs, low, high, color=color, alpha=0.2, linewidth=0)
    _rolled_out(rows, xs, axes)
    _frame(axes, panel, experiment, xs, labels)


def _rolled_out(rows: Sequence[Measured], xs: Sequence[float], axes: Any) -> None:
    names = list(dict.fromkeys(name for row in rows for name in row.policies))
    for i, name in enumerate(names):
        found = [(x, row.policies[name]) for x, row in zip(xs, rows, strict=True) if name in row.policies]
        means, halves = ([_number(each.get(key)) for _, each in found] for key in ("mean", "half"))
        color = LINES.get(name, ("#444444",))[0]
        at = [x for x, _ in found]
        axes.errorbar(at, means, halves, fmt=MARKERS[i % len(MARKERS)], color=color, mfc="white", ms=4, capsize=2,
                      label=f"{name}, rolled out")  # fmt: skip


def _frame(axes: Any, panel: _Panel, experiment: Experiment, xs: Sequence[float], labels: Sequence[str] | None) -> None:
    if labels is not None:
        axes.set_xticks(xs, labels, rotation=30 if max(map(len, labels), default=0) > 6 else 0, ha="right")
    elif min(xs) > 0 and (panel.x in experiment.plot.log or _is_geometric(xs)):
        axes.set_xscale("log")
        axes.set_xticks(xs, [f"{x:g}" for x in xs], minor=False)
        axes.minorticks_off()
    elif all(float(x).is_integer() for x in xs) and len(xs) <= 12:
        axes.set_xticks(xs, [f"{x:g}" for x in xs])
    if "value" in experiment.plot.log:
        axes.set_yscale("log")
    axes.set_xlabel(panel.x or "")
    axes.set_ylabel(_quantity(panel))
    axes.grid(True, alpha=0.25, linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=6.5, frameon=False)


def _quantity(panel: _Panel) -> str:
    if panel.scored:
        return "score: random 0, expert 1"
    return "return" if set(panel.show) <= set(LINES) else ""


def _positions(rows: Sequence[Measured], x: str | None) -> tuple[list[float], list[str] | None]:
    """Where rows stand along the axis; names instead of numbers, where these are none."""
    values: list[Any] = [_label(row) if x is None else row.instance.varied[x] for row in rows]
    if not any(isinstance(v, bool | str) for v in values):
        return [float(v) for v in values], None
    names = list(dict.fromkeys(map(str, values)))
    return [float(names.index(str(v))) for v in values], [str(v) for v in values]


def _label(row: Measured) -> str:
    """What an instance is called beside others of its task."""
    return row.instance.id.removeprefix(row.instance.task).lstrip("?+") or row.instance.task


def _is_geometric(xs: Sequence[float]) -> bool:
    """Whether values are far apart, each about as many times the one before."""
    ratios = [b / a for a, b in itertools.pairwise(xs)]
    return len(ratios) > 1 and min(ratios) >= 2 and max(ratios) <= 2 * min(ratios)


def _key(value: Any) -> tuple[int, Any]:
    return (1, value) if isinstance(value, str) else (0, value)


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


# -- heat maps ----------------------------------------------------------------------------------------------------------


def _map(panel: _Panel, axes: Any, experiment: Experiment) -> None:
    """One number over two parameters; it stands in each cell as well, as far as there is room."""
    assert panel.x is not None and panel.y is not None
    across, up = (_sorted(panel.rows, name) for name in (panel.x, panel.y))
    cells = {
        (str(row.instance.varied[panel.x]), str(row.instance.varied[panel.y])): _number(row.values.get(panel.show[0]))
        for row in panel.rows
    }
    grid = [[cells.get((a, b), math.nan) for a in across] for b in up]
    image = axes.imshow(grid, origin="lower", aspect="auto", cmap="cividis", norm=_norm(list(cells.values())))
    axes.figure.colorbar(image, ax=axes, shrink=0.85)
    axes.set_xticks(range(len(across)), across)
    axes.set_yticks(range(len(up)), up)
    axes.set_xlabel(panel.x)
    axes.set_ylabel(panel.y)
    if len(across) * len(up) <= 60:
        _write_numbers(axes, image, grid)


def _norm(values: Sequence[float]) -> str:
    """The scale of the colours: logarithmic for positive numbers that go over more than two orders of magnitude."""
    known = [v for v in values if not math.isnan(v)]
    return "log" if known and min(known) > 0 and max(known) > 100 * min(known) else "linear"


def _sorted(rows: Sequence[Measured], name: str) -> list[str]:
    values: Mapping[str, Any] = {str(row.instance.varied[name]): row.instance.varied[name] for row in rows}
    return sorted(values, key=lambda text: _key(values[text]))


def _write_numbers(axes: Any, image: Any, grid: Sequence[Sequence[float]]) -> None:
    for row, line in enumerate(grid):
        for column, value in enumerate(line):
            if not math.isnan(value):
                color = "black" if image.norm(value) > 0.5 else "white"
                axes.text(column, row, f"{value:.3g}", ha="center", va="center", fontsize=6, color=color)
