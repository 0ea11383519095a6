"""A transition graph as a scene: states in columns by their distance from the start, with few crossings of arrows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from taskspec.base.display import plural
from taskspec.language.task.task import Task
from taskspec.show.figures import shapes as sc
from taskspec.show.figures.layout import DX, DY, Arc, Drawing, Vertex, drawings, ordered, whole
from taskspec.show.figures.machine import Machine, explore
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.route import ARROW, STATE, Spot, along, at_loop, beside, loops, placed, routed, stubs, ways
from taskspec.show.printers import tree as m

LOOPS_UP_TO = 6
NAMED = 5  # as many actions on one arrow are all named
MOST_ARROWS = 40
MOST_CROSSINGS = 6  # more arrows or more crossings of them than these are too tangled to draw
WIDEST = 20.0  # centimetres between vertices that are farthest apart: on a page wider graphs are too small to read
STRETCH = 1.4  # of distances, where there is no room for labels at the usual ones
RIM = 0.07
CHANCE = (0.12, 0.12)  # half the sides of a chance vertex
BELOW_SIGN = 0.06  # how far the name of a state is moved down for the sign above it
DRAWN = {"values": "V", "policy": "thick arrows", "occupancy": "shade, {0}"}  # how results are drawn


def graph(task: Task, overlay: Overlay) -> sc.Scene | None:
    """Draw the graph of a task's transitions; None if it has none that can be drawn and read."""
    machine = explore(task)
    if machine is None:
        return None
    if len(machine.states) > LOOPS_UP_TO and all(t.source == t.target for t in machine.transitions):
        return None
    plan = plan_of(machine, overlay)
    if plan is None:
        return None
    return _scene(machine, plan, overlay)


@dataclass(frozen=True)
class Plan:
    """The drawn items and their places: vertices, a line for each of `arcs`, and labels."""

    drawing: Drawing
    spots: Mapping[Vertex, Spot]
    arcs: Sequence[Arc]
    lines: Sequence[sc.Line]  # by arc
    starts: Sequence[sc.Line]
    told: Sequence[sc.Label | None]  # by arc
    words: Mapping[Vertex, tuple[sc.Label, ...]]
    cost: int  # how often arrows cross, and labels lie over arrows that are not their own
    shows_loops: bool

    @property
    def width(self) -> float:
        ends = [spot.at[0] for spot in self.spots.values()]
        return max(ends) - min(ends)


def plan_of(machine: Machine, overlay: Overlay) -> Plan | None:
    """Return the best plan without a fault; None when all have faults, cross too often or are too large."""
    choices = drawings(machine)
    most_arrows = MOST_ARROWS
    widest = WIDEST
    if overlay.here is not None:  # a frame has room for all
        choices = whole(machine)
        most_arrows = 2 * MOST_ARROWS
        widest = math.inf
    best: Plan | None = None
    for drawing in choices:
        if len(drawing.arcs) > most_arrows:
            continue
        request = _request(machine, drawing, overlay)
        for stretch in (1.0, STRETCH):
            plan = _planned(replace(request, stretch=stretch))
            if plan is None or plan.width > widest:
                continue
            if best is None or plan.cost < best.cost:
                best = plan
            if plan.cost == 0:
                return best
    return best


def _request(machine: Machine, drawing: Drawing, overlay: Overlay) -> _Request:
    widths: list[tuple[Vertex, float]] = []
    words: list[tuple[Vertex, m.Math]] = []
    good: set[int] = set()
    for v in drawing.states:
        widths.append((v, sc.text_width(machine.labels[v], STATE)))
        for word in _at_state(machine, v, overlay):
            words.append((v, word))
        if machine.fills.get(v) == "good":
            good.add(v)
    return _Request(
        drawing=drawing,
        ending=machine.ending.intersection(drawing.states),
        start=tuple(filter(drawing.states.__contains__, machine.start)),
        good=frozenset(good),
        shows_loops=len(machine.states) <= LOOPS_UP_TO,
        widths=tuple(widths),
        texts=tuple(_on_arrow(machine, arc) for arc in drawing.arcs),
        words=tuple(words),
    )


def _at_state(machine: Machine, v: int, overlay: Overlay) -> Iterator[m.Math]:
    if v in machine.starters:
        yield m.Words(machine.starters[v])
    reward = machine.rewards[1].get(v)
    if reward:
        yield sc.equal("r", reward)
    if v in overlay.values:
        yield sc.equal("V", overlay.values[v])


def _on_arrow(machine: Machine, arc: Arc) -> m.Math | None:
    parts: list[m.Math] = []
    if arc.rewards and machine.rewards[0] == "arrow" and len(arc.actions) <= NAMED:
        for a, reward in zip(arc.actions, arc.rewards, strict=True):
            parts.append(m.joined((machine.actions[a], sc.equal("r", reward))))
        return m.joined(parts, ";")
    if arc.probability is not None:
        parts.append(sc.chance(arc.probability))
    elif len(arc.actions) < machine.n_actions:
        names = [machine.actions[a] for a in arc.actions]
        if len(names) > NAMED:
            names[1:-1] = [m.Sym("…")]
        parts += names
    if machine.rewards[0] == "arrow" and arc.reward:
        parts.append(sc.equal("r", arc.reward))
    if parts:
        return m.joined(parts)
    return None


@dataclass(frozen=True)
class _Request:
    """The input of a layout: a key, so that the frames of an episode are laid out once."""

    drawing: Drawing
    ending: frozenset[Vertex]
    start: tuple[Vertex, ...]
    good: frozenset[int]
    shows_loops: bool
    widths: tuple[tuple[Vertex, float], ...]
    texts: tuple[m.Math | None, ...]  # by arc
    words: tuple[tuple[Vertex, m.Math], ...]
    stretch: float = 1.0


@lru_cache(maxsize=16)
def _planned(request: _Request) -> Plan | None:
    request = replace(request, drawing=ordered(request.drawing))
    spots = _spots(request)
    rank = {v: i for i, v in enumerate(spots)}
    arcs: list[Arc] = []
    texts: list[m.Math | None] = []
    for arc, text in zip(request.drawing.arcs, request.texts, strict=True):
        if arc.source != arc.target or request.shows_loops:
            arcs.append(arc)
            texts.append(text)
    options = _options(arcs, spots)
    ends = [(rank[arc.source], rank[arc.target]) for arc in arcs]
    for v in request.start:
        options.append(stubs(spots[v]))
        ends.append((rank[v], rank[v]))
    lines, crossings, faults = routed(options, ends, list(spots.values()))
    if crossings > MOST_CROSSINGS or faults:
        return None
    labels = []
    own = []
    for i, text in enumerate(texts):
        if text is not None:
            own.append(i)
            labels.append(_beside_arrow(arcs[i], lines[i], text, spots))
    looped = {arc.source for arc in arcs if arc.source == arc.target}
    rows: dict[Vertex, int] = {}
    for v, word in request.words:
        rows[v] = rows.get(v, -1) + 1
        labels.append(beside(spots[v], word, rows[v], v in looped))
    chosen, overlaps, covered = placed(labels, own, lines, list(spots.values()))
    if overlaps:
        return None
    told = dict(zip(own, chosen, strict=False))
    words: dict[Vertex, tuple[sc.Label, ...]] = {}
    for (v, _), label in zip(request.words, chosen[len(own) :], strict=True):
        words[v] = (*words.get(v, ()), label)
    count = len(arcs)
    return Plan(
        request.drawing, spots, arcs, lines[:count], lines[count:], list(map(told.get, range(count))), words,
        crossings + covered, request.shows_loops,
    )  # fmt: skip


def _beside_arrow(arc: Arc, line: sc.Line, text: m.Math, spots: Mapping[Vertex, Spot]) -> list[sc.Label]:
    if arc.source == arc.target:
        return at_loop(line, text, spots[arc.source])
    return along(line, text)


def _options(arcs: Sequence[Arc], spots: Mapping[Vertex, Spot]) -> list[list[sc.Line]]:
    """Return the lines among which the one of each arc is chosen."""
    pairs = {(arc.source, arc.target) for arc in arcs}
    options = []
    for arc in arcs:
        a = spots[arc.source]
        b = spots[arc.target]
        if arc.source == arc.target:
            options.append(loops(a))
        else:
            both = (arc.target, arc.source) in pairs
            options.append(ways(a, b, both, isinstance(arc.target, int)))
    return options


def _spots(request: _Request) -> dict[Vertex, Spot]:
    """Return vertices in columns far enough apart for the longest label of an arrow and the widest vertices.

    They are on one line if one vertex of each column leads on.
    """
    drawing = request.drawing
    widths = dict(request.widths)
    sizes = {}
    for v in drawing.vertices:
        sizes[v] = CHANCE
        if isinstance(v, int):
            sizes[v] = (max(sc.RADIUS, widths[v] / 2 + 0.1), sc.RADIUS)
    widest, _ = max(sizes.values())
    longest = 0.0  # text on an arrow between two vertices
    for arc, text in zip(drawing.arcs, request.texts, strict=True):
        if arc.source != arc.target and text:
            longest = max(longest, sc.text_width(text, ARROW))
    step = max(DX, longest + 2 * widest + 0.35) * request.stretch
    mains = _leading_on(request)
    straight = all(len(main) <= 1 for main in mains)
    spots = {}
    for i, layer in enumerate(drawing.layers):
        middle = (len(layer) - 1) / 2
        if straight and mains[i]:
            middle = mains[i][0]
        for k, v in enumerate(layer):
            half, radius = sizes[v]
            rim = RIM * (v in request.ending)
            at: sc.Point = (step * i, request.stretch * DY * (k - middle))
            spots[v] = Spot(at, half, radius, rim, i == len(drawing.layers) - 1)
    return spots


def _leading_on(request: _Request) -> list[list[int]]:
    """Return for each column the places of its vertices that lead to others, and of a good one at its end."""
    leading = {arc.source for arc in request.drawing.arcs if arc.source != arc.target}
    places = []
    for layer in request.drawing.layers:
        main = []
        for k, v in enumerate(layer):
            if v in leading or (v in request.good and v == layer[-1]):
                main.append(k)
        places.append(main)
    return places


def _scene(machine: Machine, plan: Plan, overlay: Overlay) -> sc.Scene:
    items: list[sc.Item] = []
    for arc, line, label in zip(plan.arcs, plan.lines, plan.told, strict=True):
        if isinstance(arc.source, int) and any(overlay.chosen(arc.source, a) for a in arc.actions):
            line = replace(line, width=0.065)
        items.append(line)
        if label is not None:
            items.append(label)
    items += plan.starts
    present = machine.code_of(overlay)
    for v, spot in plan.spots.items():
        ring = sc.Circle(spot.at, spot.half + 0.16, None, None)
        if v == present:
            ring = replace(ring, fill="accent")
        if present is not None:  # room for it around each of them, so that all frames have one size
            items.append(ring)
        items += _vertex(v, spot, plan, machine, overlay)
    notes = (*machine.notes(plan.shows_loops), *machine.unmarked(plan.drawing.states))
    size = f"{plural(len(machine.states), 'state')}, {plural(machine.n_actions, 'action')}"
    focus = plan.spots[present].at if present is not None else None
    return sc.fitted(items, f"Transition graph of {machine.task.name}: {size}", notes, focus=focus, drawn=DRAWN)


def _vertex(v: Vertex, spot: Spot, plan: Plan, machine: Machine, overlay: Overlay) -> Iterator[sc.Item]:
    x, y = spot.at
    if isinstance(v, int):
        if spot.rim:
            yield sc.shape(x, y, spot.half + RIM, sc.RADIUS + RIM, "paper")
        body = replace(sc.shape(x, y, spot.half, sc.RADIUS, machine.fills.get(v, "paper")), state=v)
        yield body
        if v in overlay.occupancy:
            yield sc.shape(x, y, spot.half, sc.RADIUS, "accent", min(1.0, overlay.occupancy[v]))
        signs = [*sc.marked(body)]
        yield from signs
        yield sc.Label((x, y + BELOW_SIGN * bool(signs)), machine.labels[v], STATE)
        yield from plan.words.get(v, ())
    else:
        yield sc.Box((x - 0.1, y - 0.1), 0.2, 0.2, "paper")
