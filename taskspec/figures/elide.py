"""Which part of a transition graph is drawn: all of a small one, the ends of a long or wide family with dots between."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from dataclasses import dataclass

from taskspec.figures.machine import Machine, Transition

Vertex = Hashable
DOTS = "dots"
LONG, WIDE, MANY = 5, 6, 16
WHOLE, WHOLE_LONG, WHOLE_WIDE = 60, 16, 10
"""As many states, layers, and states of a layer as a frame of an episode has room for, which leaves none out."""
BACK = 3
"""Layers that arrows may lead back among those left out; where they lead further, these are no family that dots stand for."""
FIRSTS = 2
"""So many states of several in which episodes start are tried as the first column."""


@dataclass(frozen=True, slots=True)
class Arc:
    """An arrow of the drawing. `actions` are merged; a chance vertex stands between an action and its outcomes."""

    source: Vertex
    target: Vertex
    actions: tuple[int, ...] = ()
    probability: float | None = None
    reward: float | None = None


@dataclass(frozen=True)
class Drawing:
    """Vertices by layer (distance from the start) and the arrows between them.

    A vertex is the code of a state, `("chance", state, action)`, `("dots", 2)` for layers left out, or
    `("dots", "column", vertex)` for vertices of one layer.
    """

    layers: tuple[tuple[Vertex, ...], ...]
    arcs: tuple[Arc, ...]
    elided: bool = False

    @property
    def vertices(self) -> list[Vertex]:
        return [v for layer in self.layers for v in layer]


def drawings(machine: Machine, marked: Collection[Vertex] = ()) -> Iterator[Drawing]:
    """What may be drawn of a machine, the usual first; nothing when even its outline is too large.

    An outline keeps the states in `marked`; the next one does not, as there may be no room for them.

    The first column holds all states in which episodes start, or one of them from which the others are reached, which
    comes first where several roles start apart.
    """
    arcs = _arcs(machine)
    usual = _layers(machine.start, arcs)
    ones = [_layers([v], arcs) for v in list(machine.start)[:FIRSTS]] if len(machine.start) > 1 else []
    for layers in (*ones, usual) if machine.starters else (usual, *ones):
        if _is_small(layers) and set(machine.start) <= {v for layer in layers for v in layer}:
            yield Drawing(tuple(map(tuple, layers)), tuple(arcs))
    if not _is_small(usual):
        outlines = (_elided(usual, arcs, kept) for kept in dict.fromkeys((frozenset(marked), frozenset[Vertex]())))
        yield from (x for x in outlines if x is not None)


def whole(machine: Machine) -> Iterator[Drawing]:
    """All states, where a frame has room for them."""
    arcs = _arcs(machine)
    layers = _layers(machine.start, arcs)
    if len(machine.states) <= WHOLE and len(layers) <= WHOLE_LONG and max(map(len, layers)) <= WHOLE_WIDE:
        yield Drawing(tuple(map(tuple, layers)), tuple(arcs))


def _is_small(layers: list[list[Vertex]]) -> bool:
    return sum(map(len, layers)) <= MANY and max(map(len, layers)) <= WIDE


def _arcs(machine: Machine) -> list[Arc]:
    """Arrows, those of several actions with one outcome merged."""
    outcomes: dict[tuple[int, int], list[Transition]] = {}
    for t in machine.transitions:
        outcomes.setdefault((t.source, t.action), []).append(t)
    direct: dict[tuple[int, int], list[Transition]] = {}
    arcs: list[Arc] = []
    for (source, action), found in outcomes.items():
        if len(found) == 1:
            direct.setdefault((source, found[0].target), []).append(found[0])
            continue
        chance = ("chance", source, action)
        arcs.append(Arc(source, chance, (action,)))
        arcs += [Arc(chance, t.target, (), t.probability, t.reward) for t in found]
    for (source, target), found in direct.items():
        rewards = {t.reward for t in found}
        arcs.append(
            Arc(source, target, tuple(t.action for t in found), None, rewards.pop() if len(rewards) == 1 else None)
        )
    order = {v: i for i, v in enumerate(machine.states)}
    return sorted(arcs, key=lambda a: (order.get(_state(a.source), 0), a.actions[:1] or (-1,)))


def _state(vertex: Vertex) -> int:
    return vertex if isinstance(vertex, int) else int(vertex[1])  # type: ignore[index]


def _layers(start: Iterable[Vertex], arcs: list[Arc]) -> list[list[Vertex]]:
    """Vertices by their distance from the start, in the order in which they are found."""
    outgoing: dict[Vertex, list[Vertex]] = {}
    for arc in arcs:
        outgoing.setdefault(arc.source, []).append(arc.target)
    layers: list[list[Vertex]] = [list(start)]
    seen: set[Vertex] = set(layers[0])
    while True:
        new = dict.fromkeys(t for v in layers[-1] for t in outgoing.get(v, ()) if t not in seen)
        if not new:
            return layers
        seen |= set(new)
        layers.append(list(new))


def _elided(layers: list[list[Vertex]], arcs: list[Arc], marked: Collection[Vertex]) -> Drawing | None:
    """The first two layers and the last two, each cut to a few, with what is marked, and dots for what is left out."""
    leaves_on = {a.source for a in arcs if a.target != a.source}

    def goes_on(v: Vertex) -> bool:
        return v in leaves_on

    if len(layers) <= LONG:
        kept = [_narrow(layer, goes_on, marked) for layer in layers]
        return _cut(kept, arcs) if sum(map(len, kept)) <= 2 * MANY else None
    depth, dots = len(layers) - 1, (DOTS, 2)
    to_last = {a.source for a in arcs if a.target in layers[depth]}
    before = [v for v in layers[depth - 1] if v in to_last]
    if len(before) > WIDE or not before or len(layers[1]) > 3 * WIDE:
        return None
    inner = [v for layer in layers[2:depth] for v in layer if v in marked and v not in before]
    middle = [v for v in layers[2] if not goes_on(v) and v not in inner]
    through, ends = [v for v in inner if goes_on(v)], [v for v in inner if not goes_on(v)]
    kept = [_narrow(layers[0], goes_on, marked), _narrow(layers[1], goes_on, marked),
            [*_narrow([*middle, dots], lambda v: v == dots), *through],
            _narrow(before, goes_on, marked), [*_narrow(layers[depth], goes_on, marked), *ends]]  # fmt: skip
    shown = {v for layer in (*kept, middle, before) for v in layer}  # or stood for by the dots of a column
    gone = {v: i for i, layer in enumerate(layers[2:depth]) for v in layer if v not in shown}
    if any(a.source in gone and a.target in gone and gone[a.target] < gone[a.source] - BACK for a in arcs):
        return None
    out = (Arc(a.source, dots) for a in arcs if a.source in shown and a.target in gone)
    back = (Arc(dots, a.target) for a in arcs if a.source in gone and a.target in shown)
    return _cut(kept, arcs, list(dict.fromkeys((*out, *back))))


def _narrow(layer: list[Vertex], goes_on: Callable[[Vertex], bool], marked: Collection[Vertex] = ()) -> list[Vertex]:
    """A layer of a few vertices: those that lead on, the first and the last of the others, and what is marked."""
    if len(layer) <= WIDE - 1:
        return layer
    main = [v for v in layer if goes_on(v)][:2]
    others = [v for v in layer if v not in main]
    held = [v for v in others[1:-1] if v in marked]
    if len(others) - len(held) <= 2:
        return layer
    return [others[0], *held, (DOTS, "column", layer[0]), others[-1], *main]


def _cut(kept: list[list[Vertex]], arcs: list[Arc], links: list[Arc] | None = None) -> Drawing | None:
    """The drawing of some vertices; None when one of them would seem to lead nowhere, which it does not."""
    shown = {v for layer in kept for v in layer}
    inside = [a for a in arcs if a.source in shown and a.target in shown and a.source != a.target]
    inside += links or ()
    leading = {a.source for a in arcs if a.source in shown and a.source != a.target}
    if not leading <= {a.source for a in inside}:
        return None
    return Drawing(tuple(map(tuple, kept)), tuple(inside), elided=True)
