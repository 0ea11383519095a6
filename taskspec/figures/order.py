"""The order of vertices within the columns of a graph, so that few arrows cross.

Barycentre sweeps (Sugiyama, Tagawa, Toda 1981), then exchanges within a column while they help. Arrows count as straight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from taskspec.figures.elide import DOTS, Drawing, Vertex

DX, DY = 1.55, 1.05
SWEEPS, TRIALS = 4, 1500
CLOSE = 0.4
"""An arrow nearer to the centre of a vertex than this passes over it."""
Layers = tuple[tuple[Vertex, ...], ...]


def ordered(drawing: Drawing) -> Drawing:
    """The drawing with the vertices of its columns in a better order; as it is where no arrows cross."""
    cost = _Cost(drawing)
    best, least = drawing.layers, cost(drawing.layers)
    if least < 1.0:
        return drawing
    for layers in _sweeps(drawing):
        found = cost(layers)
        if found < least:
            best, least = layers, found
    return replace(drawing, layers=_exchanged(best, least, cost))


class _Cost:
    """Crossings, twice the vertices that arrows pass over, and a little for length."""

    def __init__(self, drawing: Drawing) -> None:
        self.rank = {v: i for i, v in enumerate(drawing.vertices)}
        pairs = {tuple(sorted((self.rank[a.source], self.rank[a.target]))) for a in drawing.arcs}
        self.ends = np.array(sorted(p for p in pairs if p[0] != p[1]), dtype=np.int64).reshape(-1, 2)
        a, b = self.ends[:, None, :, None], self.ends[None, :, None, :]
        self.apart = np.triu(~(a == b).any((2, 3)))  # pairs of arrows without a common end
        self.own = (np.arange(len(self.rank))[None, :, None] == self.ends[:, None, :]).any(2)

    def __call__(self, layers: Layers) -> float:
        at = np.empty((len(self.rank), 2))
        for i, layer in enumerate(layers):
            for k, v in enumerate(layer):
                at[self.rank[v]] = DX * i, DY * (k - (len(layer) - 1) / 2)
        a, b = at[self.ends[:, 0]], at[self.ends[:, 1]]
        d = b - a

        def side(p: np.ndarray) -> np.ndarray:
            """On which side of each arrow (rows) points (columns) lie."""
            return np.sign(
                np.round(d[:, None, 0] * (p[:, 1] - a[:, None, 1]) - d[:, None, 1] * (p[:, 0] - a[:, None, 0]), 9)
            )

        opposite = side(a) * side(b) < 0
        length = np.hypot(d[:, 0], d[:, 1])
        to = at[None] - a[:, None]
        t = np.clip((to * d[:, None]).sum(2) / length[:, None] ** 2, 0, 1)
        off = to - t[..., None] * d[:, None]
        over = (np.hypot(off[..., 0], off[..., 1]) < CLOSE) & ~self.own
        return float((opposite & opposite.T & self.apart).sum() + 2 * over.sum() + length.sum() / 1000)


def _free(layer: tuple[Vertex, ...]) -> bool:
    """Whether the order of a column means nothing: dots stand for the vertices between their neighbours."""
    return not any(isinstance(v, tuple) and v[0] == DOTS for v in layer)


def _sweeps(drawing: Drawing) -> Iterator[Layers]:
    """Columns ordered by the mean height of their neighbours, there and back."""
    around: dict[Vertex, list[Vertex]] = {}
    for arc in drawing.arcs:
        around.setdefault(arc.source, []).append(arc.target)
        around.setdefault(arc.target, []).append(arc.source)
    layers = list(drawing.layers)
    for sweep in range(SWEEPS):
        for i in range(len(layers)) if sweep % 2 == 0 else reversed(range(len(layers))):
            height = {v: k - (len(layer) - 1) / 2 for layer in layers for k, v in enumerate(layer)}
            if _free(layers[i]):
                mean = {
                    v: sum(height[w] for w in (v, *around.get(v, ()))) / (1 + len(around.get(v, ()))) for v in layers[i]
                }
                layers[i] = tuple(sorted(layers[i], key=lambda v, mean=mean: mean[v]))  # type: ignore[misc]
        yield tuple(layers)


def _exchanged(layers: Layers, least: float, cost: _Cost) -> Layers:
    """Two vertices of a column exchanged, as long as that is better, for so many trials."""
    trials, better = 0, True
    while better:
        better = False
        for i, layer in enumerate(layers):
            for j in range(len(layer) if _free(layer) else 0):
                for k in range(j + 1, len(layer)):
                    trials += 1
                    if trials > TRIALS:
                        return layers
                    changed = list(layers[i])
                    changed[j], changed[k] = changed[k], changed[j]
                    trial = (*layers[:i], tuple(changed), *layers[i + 1 :])
                    found = cost(trial)
                    if found < least - 1e-9:
                        layers, least, better = trial, found, True
    return layers
