"""What a transition graph says in words and colours: names of states and actions, chances, rewards and notes."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from taskspec.figures.layout import Arc
from taskspec.figures.machine import Machine
from taskspec.figures.marks import chance, decimal, number, signed
from taskspec.figures.overlays import Overlay
from taskspec.figures.scene import Color
from taskspec.figures.values import at_states
from taskspec.lang.ir import Role as Reading
from taskspec.model.space import Space
from taskspec.printers import tree as m
from taskspec.printers.names import Notation, of_task
from taskspec.printers.text import plain
from taskspec.task.task import Component

_HIGHLIGHT: dict[str, Color] = {"good": "good", "bad": "bad", "end": "end", "first": "accent", "second": "second"}
FEW = 3
"""As many states of one colour are always shown, and named where they are not, if there is room."""


@dataclass(frozen=True)
class Captions:
    machine: Machine

    @cached_property
    def space(self) -> Space:
        return Space(self.machine.task.state, Reading.STATE)

    @cached_property
    def labels(self) -> Mapping[int, m.Math]:
        """States as mathematics, by code."""
        return {code: self._combination(self.space, self.machine.task.state, code) for code in self.machine.states}

    @cached_property
    def actions(self) -> tuple[m.Math, ...]:
        space = Space(self.machine.task.action, Reading.ACTION)
        return tuple(self._combination(space, self.machine.task.action, code) for code in range(space.size))

    @cached_property
    def notation(self) -> Notation:
        return of_task(self.machine.task)

    def _combination(self, space: Space, components: tuple[Component, ...], code: int) -> m.Math:
        """Return the values of some components: labels by their symbols, numbers as digits."""
        values = space.values_of(code)
        parts = []
        for c in components:
            is_label = c.domain is not None and not c.type.shape
            parts.append(self.notation.labels[c.name][str(values[c.name])] if is_label else number(values[c.name]))
        return parts[0] if len(parts) == 1 else m.joined(parts)

    @cached_property
    def marks(self) -> Mapping[str, tuple[int, ...]]:
        """States in which the conditions under `figure: highlight:` hold, by colour."""
        figure = self.machine.task.figure
        found = {}
        codes = np.array(self.machine.states)
        for name, node in ({} if figure is None else figure.highlight).items():
            if node.type.shape or name not in _HIGHLIGHT:
                continue
            holds = at_states(self.machine.task, node, dict(self.space.decode(codes)), len(codes))
            found[name] = tuple(codes[holds.astype(bool)].tolist())
        return found

    @cached_property
    def fills(self) -> Mapping[int, Color]:
        """Colours of states; the last of several."""
        return {code: _HIGHLIGHT[name] for name, codes in self.marks.items() for code in codes}

    @property
    def kept(self) -> frozenset[int]:
        """Coloured states that a graph must show: those of rare colours."""
        return frozenset(c for codes in self.marks.values() if len(codes) <= FEW for c in codes)

    def unmarked(self, shown: Collection[int]) -> Iterator[str]:
        """Yield notes on what a figure of some states does not show of `figure: highlight:`."""
        for name, codes in self.marks.items():
            left = [c for c in codes if c not in shown]
            if not codes:
                yield f"Not shown: {name}, which holds in no state that episodes reach."
            elif left:
                yield f"Not shown: {name} ({self.named(left)})."
        for (one, codes), (other, others) in combinations(self.marks.items(), 2):
            if both := [c for c in codes if c in others and c in shown]:
                yield f"Marked {other}, but {one} as well: {self.named(both)}."

    def named(self, codes: Sequence[int]) -> str:
        """Return a few states by name, or how many there are."""
        names = [plain(self.labels[c]) for c in codes]
        if len(self.machine.task.state) == 1:
            (c,) = self.machine.task.state
            names = names if c.domain else [f"{plain(self.notation.symbol(c.name))} = {x}" for x in names]
        else:
            names = [f"({x})" for x in names]
        return ", ".join(names) if len(names) <= FEW else f"{len(names):,} states"

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

    def notes(self, shows_loops: bool, shown: Collection[int]) -> Iterator[str]:
        how, _, same = self.rewards
        if how == "all" and same is not None:
            yield f"Every step pays {decimal(same)}."
        if how == "left":
            yield "Rewards are paid for the state left."
        hidden = any(t.source == t.target and not t.ends for t in self.machine.transitions)
        if hidden and not shows_loops:
            yield "Where no arrow leads on, the state stays."
        if self.machine.timed:
            yield "The time ends episodes, too."
        if last := [v for v in shown if v in self.machine.cut]:
            yield f"No arrow leads on from {self.named(last)}, as the time is up there."

    def state(self, v: int, overlay: Overlay) -> list[m.Math]:
        """Return the reward and the value written beside a state."""
        how, by, _ = self.rewards
        words: list[m.Math] = [m.Words(self.machine.starters[v])] if v in self.machine.starters else []
        if how in ("reached", "left") and by.get(v):
            words.append(m.Row((m.Ident("r"), m.Sym("="), signed(by[v]))))
        if v in overlay.values:
            words.append(m.Row((m.Ident("V"), m.Sym("="), signed(overlay.values[v]))))
        return words

    def arrow(self, arc: Arc) -> m.Math | None:
        """Return action and probability of an arrow, and its reward where no state tells it."""
        parts: list[m.Math] = []
        if arc.probability is not None:
            parts.append(chance(arc.probability))
        elif arc.actions and len(arc.actions) < self.machine.n_actions:
            parts += [self.actions[a] for a in arc.actions]
        if self.rewards[0] == "arrow" and arc.reward:
            parts.append(m.Row((m.Ident("r"), m.Sym("="), signed(arc.reward))))
        return m.joined(parts) if parts else None
