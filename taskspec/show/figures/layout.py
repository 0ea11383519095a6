"""The part of a transition graph that is drawn, and the order of vertices in their columns."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, filterfalse

import numpy as np

from taskspec.show.figures.machine import Machine, Transition

Vertex = Hashable
Outcome = tuple[int, float, float | None]  # a next state, its probability, and its own reward
WIDE = 6
MANY = 24
"""The most vertices of a layer, and of a graph."""
WHOLE = 60
WHOLE_LONG = 16
WHOLE_WIDE = 10
"""As many states, layers, and states of a layer as a frame of an episode has room for, which leaves none out."""
FIRSTS = 2  # so many states of several in which episodes start are tried as the first column


@dataclass(frozen=True, slots=True)
class Arc:
    """An arrow of the drawing. A chance vertex stands between actions and their outcomes.

    `actions` are merged; where they do not pay the same, `rewards` has what each of them pays.
    """

    source: Vertex
    target: Vertex
    actions: tuple[int, ...] = ()
    probability: float | None = None
    reward: float | None = None
    rewards: tuple[float, ...] = ()


@dataclass(frozen=True)
class Drawing:
    """Vertices by layer (distance from the start) and the arrows between them.

    A vertex is the code of a state, or `("chance", state, action)`.
    """

    layers: tuple[tuple[Vertex, ...], ...]
    arcs: tuple[Arc, ...]

    @property
    def vertices(self) -> list[Vertex]:
        return list(chain.from_iterable(self.layers))

    @property
    def states(self) -> list[int]:
        return [v for v in self.vertices if isinstance(v, int)]


def drawings(machine: Machine) -> Iterator[Drawing]:
    """Yield what can be drawn of a machine, the usual first; nothing if it is too large.

    The first column holds all states in which episodes start, or one of them from which the others are reached, which
    comes first where several roles start apart.
    """
    arcs = _arcs(machine)
    usual = _layers(machine.start, arcs)
    choices = [usual]
    if len(machine.start) > 1:
        ones = [_layers([v], arcs) for v in list(machine.start)[:FIRSTS]]
        if machine.starters:
            choices = [*ones, usual]
        else:
            choices = [usual, *ones]
    for layers in choices:
        drawing = _drawing(layers, arcs)
        is_small = len(drawing.vertices) <= MANY and max(map(len, layers)) <= WIDE
        if is_small and set(machine.start) <= set(drawing.vertices):
            yield drawing


def whole(machine: Machine) -> Iterator[Drawing]:
    """Yield all states, where a frame has room for them."""
    arcs = _arcs(machine)
    layers = _layers(machine.start, arcs)
    if len(machine.states) <= WHOLE and len(layers) <= WHOLE_LONG and max(map(len, layers)) <= WHOLE_WIDE:
        yield _drawing(layers, arcs)


def _drawing(layers: list[list[Vertex]], arcs: list[Arc]) -> Drawing:
    return Drawing(tuple(map(tuple, layers)), tuple(arcs))


def _arcs(machine: Machine) -> list[Arc]:
    outcomes: dict[tuple[int, int], list[Transition]] = {}
    for t in machine.transitions:
        outcomes.setdefault((t.source, t.action), []).append(t)
    direct: dict[tuple[int, int], list[Transition]] = {}
    alike: dict[tuple[int, tuple[Outcome, ...]], dict[int, float | None]] = {}
    for (source, action), targets in outcomes.items():
        if len(targets) == 1:
            direct.setdefault((source, targets[0].target), []).append(targets[0])
        else:
            drawn: list[Outcome] = [(t.target, t.probability, t.reward) for t in targets]
            paid = None
            if len({t.reward for t in targets}) == 1:  # paid by the action, whatever its outcome is
                paid = targets[0].reward
                drawn = [(target, probability, None) for target, probability, _ in drawn]
            alike.setdefault((source, tuple(drawn)), {})[action] = paid
    by_source: dict[int, list[Arc]] = {v: [] for v in machine.states}
    for (source, outcome), paid_by in alike.items():
        chance = ("chance", source, next(iter(paid_by)))
        by_source[source].append(_merged(source, chance, paid_by))
        for target, probability, reward in outcome:
            by_source[source].append(Arc(chance, target, (), probability, reward))
    for (source, target), targets in direct.items():
        by_source[source].append(_merged(source, target, {t.action: t.reward for t in targets}))
    arcs: list[Arc] = []
    for out in by_source.values():
        arcs += sorted(out, key=lambda arc: arc.actions[:1] or (-1,))
    return arcs


def _merged(source: Vertex, target: Vertex, paid_by: Mapping[int, float | None]) -> Arc:
    rewards = tuple(paid_by.values())
    if len(set(rewards)) == 1:
        return Arc(source, target, tuple(paid_by), None, rewards[0])
    return Arc(source, target, tuple(paid_by), rewards=tuple(r for r in rewards if r is not None))


def _layers(start: Iterable[Vertex], arcs: list[Arc]) -> list[list[Vertex]]:
    outgoing: dict[Vertex, list[Vertex]] = {}
    for arc in arcs:
        outgoing.setdefault(arc.source, []).append(arc.target)
    new = list(start)
    layers: list[list[Vertex]] = []
    seen: set[Vertex] = set()
    while new:
        layers.append(new)
        seen |= set(new)
        reached: dict[Vertex, None] = {}
        for v in new:
            reached |= dict.fromkeys(outgoing.get(v, ()))
        new = list(filterfalse(seen.__contains__, reached))
    return layers


# Exchanges within a column while they help. Arrows count as straight.

DX = 1.55
DY = 1.05
TRIALS = 1500
CLOSE = 0.4  # an arrow nearer to the centre of a vertex than this passes over it
Layers = tuple[tuple[Vertex, ...], ...]


def ordered(drawing: Drawing) -> Drawing:
    """Return the drawing with vertices of its columns exchanged as long as that is better, for a number of trials."""
    cost = _Cost(drawing)
    least = cost(drawing.layers)
    if least < 1.0:
        return drawing
    layers = drawing.layers
    trials = 0
    better = True
    while better:
        better = False
        for i, layer in enumerate(layers):
            for j in range(len(layer)):
                for k in range(j + 1, len(layer)):
                    trials += 1
                    if trials > TRIALS:
                        return replace(drawing, layers=layers)
                    changed = list(layers[i])
                    changed[j], changed[k] = changed[k], changed[j]
                    trial = (*layers[:i], tuple(changed), *layers[i + 1 :])
                    crossings = cost(trial)
                    if crossings < least - 1e-9:
                        layers = trial
                        least = crossings
                        better = True
    return replace(drawing, layers=layers)


class _Cost:
    """Crossings, twice the vertices that arrows pass over, and a little for length."""

    def __init__(self, drawing: Drawing) -> None:
        self.rank = {v: i for i, v in enumerate(drawing.vertices)}
        pairs: set[tuple[int, ...]] = set()
        for arc in drawing.arcs:
            if arc.source != arc.target:
                pairs.add(tuple(sorted((self.rank[arc.source], self.rank[arc.target]))))
        self.ends = np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
        a = self.ends[:, None, :, None]
        b = self.ends[None, :, None, :]
        self.apart = np.triu(~(a == b).any((2, 3)))  # pairs of arrows without a common end
        self.own = (np.arange(len(self.rank))[None, :, None] == self.ends[:, None, :]).any(2)

    def __call__(self, layers: Layers) -> float:
        at = np.empty((len(self.rank), 2))
        for i, layer in enumerate(layers):
            for k, v in enumerate(layer):
                at[self.rank[v]] = DX * i, DY * (k - (len(layer) - 1) / 2)
        a = at[self.ends[:, 0]]
        b = at[self.ends[:, 1]]
        d = b - a

        def side(p: np.ndarray) -> np.ndarray:
            cross = d[:, None, 0] * (p[:, 1] - a[:, None, 1]) - d[:, None, 1] * (p[:, 0] - a[:, None, 0])
            return np.sign(np.round(cross, 9))

        opposite = side(a) * side(b) < 0
        length = np.hypot(d[:, 0], d[:, 1])
        to = at[None] - a[:, None]
        t = np.clip((to * d[:, None]).sum(2) / length[:, None] ** 2, 0, 1)
        off = to - t[..., None] * d[:, None]
        over = (np.hypot(off[..., 0], off[..., 1]) < CLOSE) & ~self.own
        return float((opposite & opposite.T & self.apart).sum() + 2 * over.sum() + length.sum() / 1000)
