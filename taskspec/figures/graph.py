"""A transition graph as a scene: states in columns by their distance from the start, with few crossings of arrows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from taskspec.figures.captions import Captions
from taskspec.figures.layout import DOTS, DX, DY, Arc, Drawing, Vertex, drawings, ordered, whole
from taskspec.figures.machine import Machine, explore
from taskspec.figures.marks import RADIUS, marked, shape
from taskspec.figures.overlays import Overlay
from taskspec.figures.route import ARROW, STATE, Spot, along, at_loop, beside, loops, placed, routed, stubs, ways
from taskspec.figures.scene import Box, Circle, Item, Label, Line, Point, Scene, fitted, text_width
from taskspec.figures.values import reads_of
from taskspec.printers import tree as m
from taskspec.task.task import Task

LOOPS_UP_TO = 6
MOST_ARROWS = 40
MOST_CROSSINGS = 6
"""More arrows or more crossings of them than these are too tangled to draw."""
WIDEST = 20.0
"""Centimetres between vertices that are farthest apart: on a page wider graphs are too small to read."""
STRETCHES = (1.0, 1.4)
RIM = 0.07
DRAWN = {"values": "V", "policy": "thick arrows", "occupancy": "shade, {0}"}
"""How results are drawn."""


def graph(task: Task, overlay: Overlay) -> Scene | None:
    """Draw the graph of a task's transitions; None if it has none that can be drawn and read."""
    machine = explore(task)
    if machine is not None and all(t.source == t.target for t in machine.transitions):
        return None  # nothing leads anywhere
    plan = None if machine is None else plan_of(machine, overlay)
    return None if machine is None or plan is None else _Graph(machine, plan, overlay).scene()


@dataclass(frozen=True)
class Plan:
    """What is drawn and where: vertices, a line for each of `arcs`, and labels."""

    drawing: Drawing
    spots: Mapping[Vertex, Spot]
    arcs: tuple[Arc, ...]
    lines: tuple[Line, ...]  # by arc
    starts: tuple[Line, ...]
    told: tuple[Label | None, ...]  # by arc
    words: Mapping[Vertex, tuple[Label, ...]]
    crossings: int
    faults: int  # what must not be: arrows over vertices or along one another, and labels over anything but lines
    covered: int  # pairs of a label and an arrow, not its own, that it lies over
    shows_loops: bool

    @property
    def cost(self) -> int:
        return self.crossings + self.covered

    @property
    def width(self) -> float:
        """The distance of the first vertex from the last."""
        ends = [spot.at[0] for spot in self.spots.values()]
        return max(ends) - min(ends)


def plan_of(machine: Machine, overlay: Overlay) -> Plan | None:
    """Return the best plan without a fault; None when all have faults, cross too often or are too large."""
    says = Captions(machine)
    best: Plan | None = None
    least: tuple[int, int] | None = None
    for found in drawings(machine, says.kept) if overlay.here is None else whole(machine):
        if len(found.arcs) > (MOST_ARROWS if overlay.here is None else 2 * MOST_ARROWS):
            continue
        vertices = [v for v in found.vertices if isinstance(v, int)]
        request = _Request(
            found,
            machine.ending.intersection(vertices),
            tuple(v for v in machine.start if v in vertices),
            says.good.intersection(vertices),
            not found.elided and len(machine.states) <= LOOPS_UP_TO,
            tuple((v, text_width(says.labels[v], STATE)) for v in vertices),
            tuple(says.arrow(arc) for arc in found.arcs),
            tuple((v, tuple(says.state(v, overlay))) for v in vertices),
        )
        plan = _planned(request)
        if plan is not None and overlay.here is None and plan.width > WIDEST:
            continue
        if plan is not None:
            cost = (len(says.kept.difference(vertices)), plan.cost)
            best, least = (plan, cost) if least is None or cost < least else (best, least)
        if least == (0, 0):
            break
    return best


@dataclass(frozen=True)
class _Request:
    """What decides where things go: a key, so that the frames of an episode are laid out once."""

    drawing: Drawing
    ending: frozenset[Vertex]
    start: tuple[Vertex, ...]
    good: frozenset[int]
    shows_loops: bool
    widths: tuple[tuple[Vertex, float], ...]
    texts: tuple[m.Math | None, ...]
    words: tuple[tuple[Vertex, tuple[m.Math, ...]], ...]


@lru_cache(maxsize=16)
def _planned(request: _Request) -> Plan | None:
    request = replace(request, drawing=ordered(request.drawing))
    best: Plan | None = None
    for stretch in STRETCHES:
        plan = _Layout(request, stretch).plan()
        if plan.crossings > MOST_CROSSINGS:  # more room changes little here
            break
        if plan.faults == 0 and (best is None or plan.cost < best.cost):
            best = plan
        if best is not None and best.cost == 0:
            break
    return best


@dataclass(frozen=True)
class _Layout:
    request: _Request
    stretch: float

    @property
    def drawing(self) -> Drawing:
        return self.request.drawing

    def plan(self) -> Plan:
        shown = [
            (arc, text) for arc, text in zip(self.drawing.arcs, self.request.texts, strict=True)
            if arc.source != arc.target or self.request.shows_loops
        ]  # fmt: skip
        spots = self.spots
        vertices = list(self.spots)
        rank = {v: i for i, v in enumerate(vertices)}
        pairs = {(arc.source, arc.target) for arc, _ in shown}
        options = []
        for arc, _ in shown:
            a = spots[arc.source]
            b = spots[arc.target]
            others = [spots[v] for v in vertices if v not in (arc.source, arc.target)]
            arrow = not _is_chance(arc.target)
            options.append(
                loops(a) if a is b else ways(a, b, (arc.target, arc.source) in pairs, others, arrow, self.stretch)
            )
        ends = [(rank[arc.source], rank[arc.target]) for arc, _ in shown]
        for v in self.request.start:
            options.append(stubs(spots[v]))
            ends.append((rank[v], rank[v]))
        way = routed(options, ends, list(spots.values()))
        looped = {a.source for a, _ in shown if a.source == a.target}
        labels: list[list[Label]] = []
        own: list[int] = []
        for i, ((arc, text), line) in enumerate(zip(shown, way.lines, strict=False)):
            if text is not None:
                labels.append(at_loop(line, text, spots[arc.source]) if arc.source == arc.target else along(line, text))
                own.append(i)
        of = [(v, row, word) for v, words in self.request.words for row, word in enumerate(words)]
        labels += [beside(spots[v], word, row, v in looped) for v, row, word in of]
        done = placed(labels, own, way.lines, list(spots.values()))
        told = dict(zip(own, done.labels, strict=False))
        words: dict[Vertex, tuple[Label, ...]] = {}
        for (v, _, _), label in zip(of, done.labels[len(own) :], strict=True):
            words[v] = (*words.get(v, ()), label)
        return Plan(
            self.drawing, spots, tuple(arc for arc, _ in shown), way.lines[: len(shown)], way.lines[len(shown) :],
            tuple(told.get(i) for i in range(len(shown))), words,
            way.crossings, way.over + done.overlaps, done.covered, self.request.shows_loops,
        )  # fmt: skip

    @cached_property
    def spots(self) -> Mapping[Vertex, Spot]:
        widths = dict(self.request.widths)
        last = set(self.drawing.layers[-1])
        found = {}
        for v, at in self._straight(self._places(widths)).items():
            half, radius = _size(v, widths)
            found[v] = Spot(at, half, radius, RIM if v in self.request.ending else 0.0, v in last)
        return found

    def _places(self, widths: Mapping[Vertex, float]) -> dict[Vertex, Point]:
        """Return columns far enough apart for the longest label of an arrow and the widest vertices."""
        arcs = zip(self.drawing.arcs, self.request.texts, strict=True)
        text = max((text_width(t, ARROW) for a, t in arcs if a.source != a.target and t), default=0.0)
        step = max(DX, text + 2 * max(_size(v, widths)[0] for v in self.drawing.vertices) + 0.35) * self.stretch
        layers = self.drawing.layers
        return {
            v: (step * i, DY * self.stretch * (k - (len(layer) - 1) / 2))
            for i, layer in enumerate(layers) for k, v in enumerate(layer)
        }  # fmt: skip

    def _straight(self, places: dict[Vertex, Point]) -> dict[Vertex, Point]:
        """Put vertices on one line if one vertex of each column leads on."""
        on = {a.source for a in self.drawing.arcs if a.source != a.target}
        good = self.request.good
        layers = self.drawing.layers
        mains = [[v for v in layer if v in on or (v in good and v == layer[-1])] for layer in layers]
        if any(len(main) > 1 for main in mains):
            return places
        moved: dict[Vertex, Point] = {}
        for layer, main in zip(layers, mains, strict=True):
            shift = -places[main[0]][1] if main else 0.0
            moved |= {v: (places[v][0], places[v][1] + shift) for v in layer}
        return moved


def _is_chance(v: Vertex) -> bool:
    return isinstance(v, tuple) and v[0] == "chance"


def _size(v: Vertex, widths: Mapping[Vertex, float]) -> tuple[float, float]:
    """Return half the width and half the height of a vertex."""
    if isinstance(v, int):
        return max(RADIUS, widths[v] / 2 + 0.1), RADIUS
    return (0.12, 0.12) if _is_chance(v) else (0.26, 0.26)


@dataclass(frozen=True)
class _Graph:
    machine: Machine
    plan: Plan
    overlay: Overlay

    @property
    def task(self) -> Task:
        return self.machine.task

    @cached_property
    def says(self) -> Captions:
        return Captions(self.machine)

    def scene(self) -> Scene:
        nodes = [x for v in self.plan.spots for x in self.vertex(v)]
        shown = [v for v in self.plan.spots if isinstance(v, int)]
        notes = (*self.says.notes(self.plan.shows_loops, shown), *self.says.unmarked(shown))
        laid = self.overlay.values or self.overlay.policy or self.overlay.occupancy
        if laid and self.plan.drawing.elided:
            notes += ("Results of the states left out are not shown.",)
        focus = None if self.present is None else self.plan.spots[self.present].at
        return fitted([*self.arrows(), *self.plan.starts, *nodes], self.alt, notes, focus=focus, drawn=DRAWN)

    @property
    def alt(self) -> str:
        count = len(self.machine.states)
        some = ", elided" if self.plan.drawing.elided else ""
        return f"Transition graph of {self.task.name}: {count} states{some}, {self.machine.n_actions} actions"

    def arrows(self) -> Iterator[Item]:
        for arc, line, label in zip(self.plan.arcs, self.plan.lines, self.plan.told, strict=True):
            yield replace(line, width=0.065) if self._chosen(arc) else line
            if label is not None:
                yield label

    def _chosen(self, arc: Arc) -> bool:
        return isinstance(arc.source, int) and any(self.overlay.chosen(arc.source, a) for a in arc.actions)

    @cached_property
    def present(self) -> Vertex | None:
        """The vertex of the present state of a frame."""
        if self.overlay.here is None:
            return None
        space = self.says.space
        arrays = [reads_of(self.task, self.overlay.here)[c.read] for c in self.task.state]
        return int(space.encode(arrays, 1)[0][0])

    def vertex(self, v: Vertex) -> Iterator[Item]:
        spot = self.plan.spots[v]
        x, y = spot.at
        if self.overlay.here is not None:  # room for it around each of them, so that all frames have one size
            yield Circle((x, y), spot.half + 0.16, "accent" if v == self.present else None, None)
        if isinstance(v, int):
            yield from self._body(v, spot)
            yield Label((x, y), self.says.labels[v], STATE)
            yield from self.plan.words.get(v, ())
        elif isinstance(v, tuple) and v[0] == DOTS:
            yield Label((x, y), m.Words("⋮") if v[1] != 2 else m.Sym("…"), 0.42)
        else:
            yield Box((x - 0.1, y - 0.1), 0.2, 0.2, "paper")

    def _body(self, v: int, spot: Spot) -> Iterator[Item]:
        (x, y), fill = spot.at, self.says.fills.get(v, "paper")
        if spot.rim:
            yield shape(x, y, spot.half + RIM, RADIUS + RIM, "paper", 1.0)
        body = shape(x, y, spot.half, RADIUS, fill, 1.0)
        yield body
        if v in self.overlay.occupancy:
            yield shape(x, y, spot.half, RADIUS, "accent", min(1.0, self.overlay.occupancy[v]))
        yield from marked(body, min(RADIUS / 2, text_width(self.says.labels[v], STATE) / 2))
