"""A transition graph as a scene: states in columns by their distance from the start, laid out by networkx."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskspec.appendix.extras import need
from taskspec.appendix.figures.elide import DOTS, Arc, Drawing, Vertex, drawing
from taskspec.appendix.figures.machine import Machine, explore
from taskspec.appendix.figures.marks import RADIUS, beside_line, chance, decimal, edge, near, number, shape, signed
from taskspec.appendix.figures.overlay import Overlay
from taskspec.appendix.figures.scene import (
    Box,
    Circle,
    Item,
    Label,
    Line,
    Point,
    Role,
    Scene,
    fitted,
    text_width,
)
from taskspec.appendix.figures.values import at_states, compile_value, reads_of
from taskspec.exact.space import Space
from taskspec.lang.ir import Role as Reading
from taskspec.printers import tree as m
from taskspec.printers.names import of_task
from taskspec.printers.notation import Notation
from taskspec.spec.task import Component, Task

DX, DY, SMALL = 1.55, 1.05, 0.28
LOOPS_UP_TO = 6
READABLE = 28
"""More arrows than these make a knot, not a figure."""
_HIGHLIGHT: dict[str, Role] = {"good": "good", "bad": "bad", "end": "end", "first": "accent", "second": "second"}


def graph(task: Task, overlay: Overlay) -> Scene | None:
    """The graph of a task's transitions, or None when it has none that can be drawn."""
    machine = explore(task)
    if machine is not None and all(t.source == t.target for t in machine.transitions):
        return None  # nothing leads anywhere
    found = drawing(machine) if machine is not None else None
    if machine is None or found is None or len(found.arcs) > READABLE:
        return None
    return _Graph(machine, found, overlay).scene()


@dataclass(frozen=True)
class _Graph:
    machine: Machine
    drawing: Drawing
    overlay: Overlay

    @property
    def task(self) -> Task:
        return self.machine.task

    def scene(self) -> Scene:
        arcs = [x for arc in self.drawing.arcs for x in self.arc(arc)]
        nodes = [x for v in self.drawing.vertices for x in self.vertex(v)]
        return fitted([*arcs, *self.starts(), *nodes], self.alt, tuple(self.notes()))

    # -- where ----------------------------------------------------------------------------------------------------

    @cached_property
    def places(self) -> Mapping[Vertex, Point]:
        """Centres of the vertices: columns from the layout, straightened along a path."""
        nx = need("networkx", "figures")
        g = nx.DiGraph()
        for i, layer in enumerate(self.drawing.layers):
            g.add_nodes_from(layer, layer=i)
        raw = nx.multipartite_layout(g, subset_key="layer", align="vertical")
        order = {v: i for layer in self.drawing.layers for i, v in enumerate(layer)}
        sizes = {v: len(layer) for layer in self.drawing.layers for v in layer}
        columns = sorted({round(float(p[0]), 9) for p in raw.values()})
        wide = {v: columns.index(round(float(raw[v][0]), 9)) for v in raw}
        found = {v: (self.step * wide[v], DY * (order[v] - (sizes[v] - 1) / 2)) for v in raw}
        return self._straight(found)

    @property
    def step(self) -> float:
        """The distance of columns: enough for the longest label of an arrow and the widest vertices."""
        texts = [
            text_width(t, 0.25) for arc in self.drawing.arcs if arc.source != arc.target and (t := self._text(arc))
        ]
        return max(DX, max(texts, default=0.0) + 2 * max(map(self.size, self.drawing.vertices)) + 0.35)

    def _straight(self, places: dict[Vertex, Point]) -> dict[Vertex, Point]:
        """Where one vertex of each column leads on, those lie on a line."""
        on = {a.source for a in self.drawing.arcs if a.source != a.target}
        mains = [[v for v in layer if v in on or (v in self.good and v == layer[-1])] for layer in self.drawing.layers]
        if any(len(main) > 1 for main in mains):
            return places
        moved: dict[Vertex, Point] = {}
        for layer, main in zip(self.drawing.layers, mains, strict=True):
            shift = -places[main[0]][1] if main else 0.0
            moved |= {v: (places[v][0], places[v][1] + shift) for v in layer}
        return moved

    # -- what -----------------------------------------------------------------------------------------------------

    @cached_property
    def space(self) -> Space:
        return Space(self.task.state, Reading.STATE)

    @cached_property
    def labels(self) -> Mapping[int, m.Math]:
        """States as mathematics, by code."""
        return {code: self._combination(self.space, self.task.state, code) for code in self.machine.states}

    @cached_property
    def actions(self) -> tuple[m.Math, ...]:
        space = Space(self.task.action, Reading.ACTION)
        return tuple(self._combination(space, self.task.action, code) for code in range(space.size))

    @cached_property
    def notation(self) -> Notation:
        return of_task(self.task)

    def _combination(self, space: Space, components: tuple[Component, ...], code: int) -> m.Math:
        """The values of some components: labels by their symbols, numbers as digits."""
        values = space.values_of(code)
        parts = []
        for c in components:
            is_label = c.domain is not None and not c.type.shape
            parts.append(self.notation.labels[c.name][str(values[c.name])] if is_label else number(values[c.name]))
        return parts[0] if len(parts) == 1 else m.joined(parts)

    @cached_property
    def fills(self) -> Mapping[int, Role]:
        """Colours of states by the conditions under `figure: highlight:`."""
        figure = self.task.surface.data.get("figure") or {}
        found: dict[int, Role] = {}
        codes = np.array(self.machine.states)
        for name, written in (figure.get("highlight") or {}).items():
            node = compile_value(self.task, written)
            if node is None or node.type.shape or name not in _HIGHLIGHT:
                continue
            holds = at_states(self.task, node, dict(self.space.decode(codes)), len(codes))
            found |= {int(c): _HIGHLIGHT[name] for c in codes[holds.astype(bool)]}
        return found

    @property
    def good(self) -> frozenset[int]:
        return frozenset(c for c, role in self.fills.items() if role == "good")

    @cached_property
    def rewards(self) -> tuple[str, Mapping[int, float], float | None]:
        """How rewards are told: "all" alike, by state "reached" or "left", else by "arrow"."""
        ts = self.machine.transitions
        if len({t.reward for t in ts}) == 1:
            return "all", {}, ts[0].reward
        for how in ("reached", "left"):
            by: dict[int, set[float]] = {}
            for t in ts:
                by.setdefault(t.target if how == "reached" else t.source, set()).add(t.reward)
            if all(len(x) == 1 for x in by.values()):
                return how, {k: x.pop() for k, x in by.items()}, None
        return "arrow", {}, None

    def notes(self) -> Iterator[str]:
        how, _, same = self.rewards
        if how == "all" and same is not None:
            yield f"Every step pays {decimal(same)}."
        if how == "left":
            yield "Rewards are paid for the state left."
        hidden = any(t.source == t.target and not t.ends for t in self.machine.transitions)
        if hidden and not self.shows_loops:
            yield "Where no arrow leads on, the state stays."

    @property
    def shows_loops(self) -> bool:
        return not self.drawing.elided and len(self.machine.states) <= LOOPS_UP_TO

    @property
    def alt(self) -> str:
        count = len(self.machine.states)
        some = ", elided" if self.drawing.elided else ""
        return f"Transition graph of {self.task.name}: {count} states{some}, {self.machine.n_actions} actions"

    # -- drawing --------------------------------------------------------------------------------------------------

    def size(self, v: Vertex) -> float:
        """Half the width of a vertex."""
        if isinstance(v, int):
            return max(RADIUS, text_width(self.labels[v], SMALL) / 2 + 0.1)
        return 0.12 if isinstance(v, tuple) and v[0] == "chance" else 0.26

    @cached_property
    def present(self) -> Vertex | None:
        """Where the present state of a frame is shown: at its vertex, or at the dots that stand for it."""
        if self.overlay.here is None:
            return None
        arrays = [reads_of(self.task, self.overlay.here)[c.read] for c in self.task.state]
        code = int(self.space.encode(arrays, 1)[0][0])
        dots = [v for v in self.drawing.vertices if isinstance(v, tuple) and v[0] == DOTS]
        return code if code in self.places else next(reversed(dots), None)

    def vertex(self, v: Vertex) -> Iterator[Item]:
        x, y = self.places[v]
        if v == self.present:
            yield Circle((x, y), self.size(v) + 0.16, "accent", None)
        if not isinstance(v, int):
            if isinstance(v, tuple) and v[0] == DOTS:
                upright = v[1] != 2
                yield Label((x, y), m.Words("⋮") if upright else m.Sym("…"), 0.42)
            else:
                yield Box((x - 0.1, y - 0.1), 0.2, 0.2, "paper")
            return
        yield from self._body(v, x, y)
        yield Label((x, y), self.labels[v], SMALL)
        yield from self._beside(v, x, y)

    def _body(self, v: int, x: float, y: float) -> Iterator[Item]:
        fill = self.fills.get(v, "paper")
        shade = 1.0
        if v in self.overlay.occupancy:
            fill, shade = "accent", min(1.0, self.overlay.occupancy[v])
        half = self.size(v)
        if v in self.machine.ending:
            yield shape(x, y, half + 0.07, RADIUS + 0.07, "paper", 1.0)
        yield shape(x, y, half, RADIUS, fill, shade)

    def _beside(self, v: int, x: float, y: float) -> Iterator[Item]:
        """Rewards and values next to a state."""
        how, by, _ = self.rewards
        words: list[m.Math] = []
        if how in ("reached", "left") and by.get(v):
            words.append(m.Row((m.Ident("r"), m.Sym("="), signed(by[v]))))
        if v in self.overlay.values:
            words.append(m.Row((m.Ident("V"), m.Sym("="), signed(self.overlay.values[v]))))
        last = v in self.drawing.layers[-1]
        for i, text in enumerate(words):
            loop = 0.42 if self.shows_loops and last and self._loops(v) else 0.0
            if last:
                yield Label((x + self.size(v) + 0.16 + loop, y + 0.4 * i), text, SMALL, "start")
            else:
                yield Label((x, y + RADIUS + 0.26 + 0.4 * i), text, SMALL)

    def _loops(self, v: int) -> bool:
        return any(a.source == a.target == v for a in self.drawing.arcs)

    def starts(self) -> Iterator[Item]:
        for v in self.machine.start:
            if v in self.places:
                x, y = self.places[v]
                yield Line(((x - self.size(v) - 0.55, y), (x - self.size(v), y)), arrow=True, color="muted")

    def arc(self, arc: Arc) -> Iterator[Item]:
        if arc.source == arc.target:
            if self.shows_loops:
                yield from self._loop(arc)
            return
        line = self._curve(arc)
        yield line
        text = self._text(arc)
        if text is not None:
            yield Label(beside_line(line), text, 0.25, color="muted", halo=True)

    def _curve(self, arc: Arc) -> Line:
        a, b = self.places[arc.source], self.places[arc.target]
        both = any(x.source == arc.target and x.target == arc.source for x in self.drawing.arcs)
        blocked = any(near(a, b, self.places[v]) for v in self.drawing.vertices if v not in (arc.source, arc.target))
        bend = 0.32 if both else 0.75 if blocked else 0.0
        dx, dy = b[0] - a[0], b[1] - a[1]
        length = math.hypot(dx, dy) or 1.0
        nx, ny = dy / length * bend, -dx / length * bend
        c1, c2 = (a[0] + dx * 0.3 + nx, a[1] + dy * 0.3 + ny), (a[0] + dx * 0.7 + nx, a[1] + dy * 0.7 + ny)
        start, end = (
            edge(a, c1, self.size(arc.source)),
            edge(b, c2, self.size(arc.target) + 0.02 + self._rim(arc.target)),
        )
        arrow = not (isinstance(arc.target, tuple) and arc.target[0] == "chance")
        width = 0.065 if self._chosen(arc) else 0.03
        if bend:
            return Line((start, c1, c2, end), arrow=arrow, curved=True, width=width)
        return Line((start, end), arrow=arrow, width=width)

    def _rim(self, v: Vertex) -> float:
        return 0.07 if isinstance(v, int) and v in self.machine.ending else 0.0

    def _chosen(self, arc: Arc) -> bool:
        return isinstance(arc.source, int) and any(self.overlay.chosen(arc.source, a) for a in arc.actions)

    def _loop(self, arc: Arc) -> Iterator[Item]:
        """A loop above a state, or beside one in the last column."""
        x, y = self.places[arc.source]
        r, side = self.size(arc.source), arc.source in self.drawing.layers[-1]
        d, out = 0.2, 0.62
        if side:
            points = ((x + r * 0.85, y - d), (x + r + out, y - 0.42), (x + r + out, y + 0.42), (x + r * 0.85, y + d))
        else:
            points = ((x - d, y - RADIUS * 0.85), (x - 0.42, y - RADIUS - out), (x + 0.42, y - RADIUS - out),
                      (x + d, y - RADIUS * 0.85))  # fmt: skip
        line = Line(points, arrow=True, curved=True, width=0.065 if self._chosen(arc) else 0.03)
        yield line
        text = self._text(arc)
        if text is not None and not side:
            yield Label((x, y - RADIUS - out - 0.02), text, 0.25, color="muted", halo=True)

    def _text(self, arc: Arc) -> m.Math | None:
        """Action and probability of an arrow, and its reward where no state tells it."""
        parts: list[m.Math] = []
        if arc.probability is not None:
            parts.append(chance(arc.probability))
        elif arc.actions and len(arc.actions) < self.machine.n_actions:
            parts += [self.actions[a] for a in arc.actions]
        if self.rewards[0] == "arrow" and arc.reward:
            parts.append(m.Row((m.Ident("r"), m.Sym("="), signed(arc.reward))))
        return m.joined(parts) if parts else None
