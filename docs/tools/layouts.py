"""The layout of transition graphs beside Graphviz's, on 40 graphs, measured in the same way, for docs/explain/extending.md.

python -m docs.tools.layouts "dot -Tplain" "neato -Tplain -Goverlap=false -Gsplines=true"
"""

from __future__ import annotations

import random
import shlex
import subprocess
import sys
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, count
from typing import Any

import numpy as np

from taskspec.language import registry
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures.graph import Plan, plan_of
from taskspec.show.figures.machine import explore
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.route import box
from taskspec.show.figures.shapes import Line, bezier

COUNT, INCH, PIECES = 40, 2.54, 12
SUITE = ("Branching", "EarlyTermPos", "EarlyTermPosSeals", "InitShiftExpert", "InitShiftLearnerSeals", "RiskyPath")
Frame = tuple[float, float, float, float]
Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Layout:
    """Vertices and labels as left, top, right, bottom; arrows as points (n, 2) with the indices of their vertices."""

    vertices: Sequence[Frame]
    arrows: Sequence[tuple[int, int, Array]]
    labels: Sequence[tuple[int, Frame]]  # with the index of the arrow

    def measured(self) -> dict[str, float]:
        frames = [frame for _, frame in self.labels]
        corners = np.array([*self.vertices, *frames, *((*p.min(0), *p.max(0)) for *_, p in self.arrows)])
        lengths = [np.hypot(*np.diff(p, axis=0).T).sum() for a, b, p in self.arrows if a != b]
        return {
            "crossings": sum(_crossings(a[2], b[2]) for a, b in combinations(self.arrows, 2)),
            "arrows over vertices": sum(
                _passes(p, v) for a, b, p in self.arrows for i, v in enumerate(self.vertices) if i not in (a, b)
            ),
            "vertices over vertices": sum(_meet(a, b) for a, b in combinations(self.vertices, 2)),
            "labels over labels or vertices": sum(_meet(a, b) for a, b in combinations(frames, 2))
            + sum(_meet(a, v) for a in frames for v in self.vertices),
            "arrows through labels of others": sum(
                _passes(p, frame) for own, frame in self.labels for i, (_, _, p) in enumerate(self.arrows) if i != own
            ),
            "length of an arrow (cm)": float(np.mean(lengths)),
            "area (cm²)": float(np.prod(corners[:, 2:].max(0) - corners[:, :2].min(0))),
        }


def _crossings(a: Array, b: Array) -> int:
    """How often two polylines cross."""
    p, d, q, e = a[:-1, None], np.diff(a, axis=0)[:, None], b[None, :-1], np.diff(b, axis=0)[None]
    turn = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    turn = np.where(np.abs(turn) < 1e-9, np.nan, turn)
    x, y = q[..., 0] - p[..., 0], q[..., 1] - p[..., 1]
    s, t = (x * e[..., 1] - y * e[..., 0]) / turn, (x * d[..., 1] - y * d[..., 0]) / turn
    return int(((s > 0) & (s <= 1) & (t > 0) & (t <= 1)).sum())


def _passes(points: Array, frame: Frame) -> bool:
    parts = np.linspace(0, 1, 8)[:, None, None]
    fine = (points[:-1] * (1 - parts) + points[1:] * parts).reshape(-1, 2)
    return bool(((fine > np.array(frame[:2]) + 0.02) & (fine < np.array(frame[2:]) - 0.02)).all(1).any())


def _meet(a: Frame, b: Frame) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def tasks() -> Iterator[Task]:
    """Graphs of the suite, and random decision processes of growing size; the same ones every time."""
    yield from (registry.load(f"derail/{name}-v0") for name in SUITE)
    for seed in count():
        yield _random(3 + seed % 6, 1 + seed // 6 % 2, random.Random(seed))


def _random(states: int, actions: int, rng: random.Random) -> Task:
    """Each action leads somewhere, one in three of them to either of two states."""
    rows = {
        f"q{s}": {
            f"a{a}": ": 1/4, ".join(f"q{x}" for x in rng.sample(range(states), 1 if rng.random() < 2 / 3 else 2))
            for a in range(actions)
        }
        for s in range(states)
    }
    cells = {
        s: ", ".join(f"{a}: {'{' + x + ': 3/4}' if ':' in x else x}" for a, x in row.items()) for s, row in rows.items()
    }
    written = "\n".join(f"      {s}: {{{row}}}" for s, row in cells.items())
    goal = f'reward: {{by: "s\'", rows: {{q{states - 1}: 1, else: 0}}}}'
    return build(
        read_text(
            f"taskspec: 1\nname: R\nstate: {{s: {{type: choice, values: [{', '.join(rows)}]}}}}\n"
            f"action: {{a: {{type: choice, values: [{', '.join(f'a{a}' for a in range(actions))}]}}}}\n"
            f"horizon: 20\ninitial: {{s: q0}}\ndynamics:\n  s':\n    by: [s, a]\n    rows:\n{written}\n{goal}\n"
        )
    )


def points(line: Line) -> Array:
    """Points along an arrow."""
    return np.array([bezier(line.points, i / PIECES) for i in range(PIECES + 1)] if line.curved else line.points)


def ours(plan: Plan) -> Layout:
    rank = {v: i for i, v in enumerate(plan.spots)}
    frames = [(s.at[0] - s.half, s.at[1] - s.radius, s.at[0] + s.half, s.at[1] + s.radius) for s in plan.spots.values()]
    arrows = [(rank[a.source], rank[a.target], points(line)) for a, line in zip(plan.arcs, plan.lines, strict=True)]
    return Layout(frames, arrows, [(i, box(label)) for i, label in enumerate(plan.told) if label is not None])


def graphviz(plan: Plan, command: str) -> Layout:
    """The same vertices, arrows and labels, each as large, where a command that reads DOT and writes `plain` puts them."""
    rank: dict[Hashable, int] = {v: i for i, v in enumerate(plan.spots)}
    lines = ["digraph {", 'rankdir=LR; node [shape=box fixedsize=true label=""];']
    lines += [
        f"{i} [width={2 * s.half / INCH} height={2 * s.radius / INCH}];" for i, s in enumerate(plan.spots.values())
    ]
    sizes = []
    for arc, label in zip(plan.arcs, plan.told, strict=True):
        left, top, right, bottom = (0.0, 0.0, 0.0, 0.0) if label is None else box(label)
        sizes.append((right - left, bottom - top))
        w, h = (round(x / INCH * 72) for x in sizes[-1])
        table = f'<TABLE BORDER="0" FIXEDSIZE="TRUE" WIDTH="{w}" HEIGHT="{h}"><TR><TD></TD></TR></TABLE>'
        told = "" if label is None else f" [label=<{table}>]"
        lines.append(f"{rank[arc.source]} -> {rank[arc.target]}{told};")
    done = subprocess.run(
        shlex.split(command), input="\n".join([*lines, "}"]), stdout=subprocess.PIPE, encoding="utf-8", check=True
    )
    return _read(done.stdout, sizes, [(rank[a.source], rank[a.target]) for a in plan.arcs])


def _read(plain: str, sizes: Sequence[tuple[float, float]], ends: Sequence[tuple[int, int]]) -> Layout:
    rows = [line.split() for line in plain.splitlines()]
    frames: dict[int, Frame] = {}
    for _, name, *numbers in (row for row in rows if row[0] == "node"):
        x, y, w, h = (float(v) * INCH for v in numbers[:4])
        frames[int(name)] = (x - w / 2, y - h / 2, x + w / 2, y + h / 2)
    open_arrows = list(range(len(ends)))
    arrows: dict[int, tuple[int, int, Array]] = {}
    labels = []
    for _, a, b, total, *rest in (row for row in rows if row[0] == "edge"):
        i = next(i for i in open_arrows if ends[i] == (int(a), int(b)))
        open_arrows.remove(i)
        n = 2 * int(total)
        knots = np.array(rest[:n], dtype=float).reshape(-1, 2) * INCH
        pieces = [tuple(map(tuple, knots[k : k + 4])) for k in range(0, len(knots) - 1, 3)]
        arrows[i] = (int(a), int(b), np.array([bezier(p, t / PIECES) for p in pieces for t in range(PIECES + 1)]))
        if sizes[i][0]:
            x, y = (float(v) * INCH for v in rest[-4:-2])
            labels.append((i, (x - sizes[i][0] / 2, y - sizes[i][1] / 2, x + sizes[i][0] / 2, y + sizes[i][1] / 2)))
    return Layout([frames[i] for i in sorted(frames)], [arrows[i] for i in sorted(arrows)], labels)


def plans() -> Iterator[Plan | None]:
    """How each graph is laid out; None for those that are drawn as tables."""
    for task in tasks():
        machine = explore(task)
        if machine is not None and any(t.source != t.target for t in machine.transitions):
            yield plan_of(machine, Overlay())


def main(commands: Sequence[str]) -> None:
    found: dict[str, list[dict[str, float]]] = {
        name.split()[0].rpartition("/")[2]: [] for name in ("taskspec", *commands)
    }
    tables = 0
    for plan in plans():
        tables += plan is None
        if plan is not None:
            layouts = (ours(plan), *(graphviz(plan, command) for command in commands))
            for rows, layout in zip(found.values(), layouts, strict=True):
                rows.append(layout.measured())
        if len(found["taskspec"]) == COUNT:
            break
    sys.stdout.write(f"{COUNT} graphs; {tables} more are drawn as tables\n\n")
    sys.stdout.write(f"| in all graphs | {' | '.join(found)} |\n|---|{'---|' * len(found)}\n")
    for what in found["taskspec"][0]:
        is_mean = what.endswith(")")
        values = [sum(row[what] for row in rows) / (COUNT if is_mean else 1) for rows in found.values()]
        told = [f"{value:.1f}" if is_mean else f"{value:.0f}" for value in values]
        sys.stdout.write(f"| {what}{', mean' if is_mean else ''} | {' | '.join(told)} |\n")


if __name__ == "__main__":
    main(sys.argv[1:])
