"""States of an environment for people: read and set by name, shown as text, reported in infos; and the view of one lane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

import gymnasium
import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import spec_error, suggest
from taskspec.base.named import all_names
from taskspec.envs import window
from taskspec.envs.options import LaneError, NotRunningError, StateError, one_of
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.types import Domain, Kind
from taskspec.language.task.legal import action_mask
from taskspec.language.task.parts import Component, RenderMode, are_finite
from taskspec.language.task.spaces import single, space
from taskspec.language.task.task import Task

# -- reading and setting the state --------------------------------------------------------------------------------


def plain_state(task: Task, values: tuple[Any, ...]) -> dict[str, Any]:
    """Return values by component name: labels for choices, Python numbers, arrays for vectors."""
    return {c.name: _plain(c, value) for c, value in zip(task.state, values, strict=True)}


def _plain(c: Component, value: Any) -> Any:
    if c.type.shape:
        return np.array(value, DTYPES[c.type.kind]).reshape(c.type.shape)
    if c.domain is not None:
        return c.domain.labels[value]
    return {Kind.BOOL: bool, Kind.INT: int, Kind.REAL: float}[c.type.kind](value)


def flat_state(task: Task, override: Mapping[str, Any], values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the flat state with some components replaced.

    Raises:
        StateError: for a component that does not exist or a value outside its domain.
    """
    names = all_names(task.state)
    if not isinstance(override, Mapping):
        raise StateError(f"E709: a state gives values by component, as in {{{names[0]!r}: ...}}, not {override!r}")
    for name in override:
        if name not in names:
            hint = suggest(str(name), names) or f"its components are {', '.join(names)}"
            raise StateError(f"E709: {task.id} has no state component {name!r}; {hint}")
    flat = []
    for c, value in zip(task.state, values, strict=True):
        if c.name in override:
            value = _flat(c, override[c.name])
        flat.append(value)
    return tuple(flat)


def _flat(c: Component, value: Any) -> Any:
    if isinstance(value, str):
        return _label(c, c.domain, value)
    array = np.asarray(value)
    fits = array.shape == c.type.shape or array.size == c.type.size == 0
    if not fits or array.dtype.kind not in "biuf":
        raise StateError(f"E709: {c.name} needs {_needs(c)}, not {value!r}")
    flat = array.ravel().tolist()
    items: list[Any] = []
    for item, low, high in zip(flat, c.low, c.high, strict=True):
        if c.type.kind is Kind.REAL:  # bounds hold to float32, as spaces have them
            inside = single(low) <= single(item) <= single(high)
            items.append(min(max(float(item), low), high))
        else:
            inside = float(item).is_integer() and low <= item <= high
            items.append(item)
        if not inside:
            raise StateError(f"E709: {c.name} needs {_needs(c)}, not {value!r}")
    if c.type.kind is not Kind.REAL:
        items = list(map(bool if c.type.kind is Kind.BOOL else int, items))
    if c.type.shape:
        return tuple(items)
    return items[0]


def _label(c: Component, domain: Domain | None, value: str) -> int:
    if domain is None:
        raise StateError(f"E709: {c.name} needs {_needs(c)}, not {value!r}")
    index = domain.index(value)
    if index is None:
        near = suggest(value, domain.labels)
        hint = f" ({near})" if near else ""
        raise StateError(f"E709: {c.name} needs {_needs(c)}, not {value!r}{hint}")
    return index


def _needs(c: Component) -> str:
    if c.domain is not None:
        return f"one of {', '.join(c.domain.labels)}"
    shape = ""
    if c.type.shape:
        shape = f" of shape {list(c.type.shape)}"
    kind = {Kind.BOOL: "true or false", Kind.INT: "an int", Kind.REAL: "a real number"}[c.type.kind]
    if c.type.kind is Kind.BOOL or not c.type.size:
        return f"{kind}{shape}"
    return f"{kind}{shape} between {c.least:g} and {c.most:g}"


# -- the state in infos of many environments ----------------------------------------------------------------------


def state_rows(task: Task, state: Sequence[Array]) -> Array:
    """Return states of all lanes as one array with the lanes first: (N, *shape) where the state is one component, else (N,
    elements).

    Elements are int64 where all components are finite, and float32 elsewhere.

    Args:
        state: an array (*shape, N) for every component.
    """
    (first, *others), lanes = task.state, state[0].shape[-1]
    finite = are_finite(task.state)
    rows = np.concatenate([np.asarray(part).reshape(-1, lanes) for part in state])
    shape = (len(rows),) if others else first.type.shape
    with np.errstate(over="ignore"):  # numbers beyond float32 are infinite, as in observations
        return rows.T.astype(np.int64 if finite else np.float32).reshape(lanes, *shape)


def states(task: Task, before: Array, stepped: Array, after: Array) -> dict[str, Array]:
    """Return what the spec's `info` asks for of a step, each with a mask, bool (N,): the lanes in which one was taken,
    others are 0.
    """
    if not stepped.any():
        return {}
    before[~stepped] = after[~stepped] = 0
    told = {"old_state": before, "new_state": after}
    infos = {}
    for name in task.info:
        infos[name] = told[name]
        infos[f"_{name}"] = stepped
    return infos


def masked(measures: Mapping[str, Array], lanes: Array) -> dict[str, Any]:
    """Return measures (N,) by name as Gymnasium's vector environments have them: with masks, bool (N,), and 0 in other lanes."""
    if not lanes.any():
        return {}
    infos: dict[str, Any] = {}
    for name, values in measures.items():
        infos[name] = np.where(lanes, values, 0.0)
        infos[f"_{name}"] = lanes.copy()
    return {"measures": infos, "_measures": lanes.copy()}


if TYPE_CHECKING:
    from taskspec.programs.vector_program import Engine

RENDER_MODES: tuple[RenderMode, ...] = ("ansi", "rgb_array")
"""Render modes of lanes: windows are left out, which would be one for each."""


@dataclass(frozen=True)
class LaneView:
    """A lane: what it is, and how it stands. It is read only; lanes are arrays, and are stepped together."""

    task: Task
    engine: Engine
    number: int
    render_mode: str | None
    started: bool
    drawing: window.Frames

    @property
    def state(self) -> dict[str, Any]:
        """The present state by component: labels for choices, numbers, arrays for vectors."""
        if not self.started:
            raise NotRunningError("E707: there is no state before the first reset()")
        values = []
        for of_lanes in self.engine.buffers.state:
            value = of_lanes[..., self.number]
            values.append(value.ravel().tolist() if value.ndim else value.item())
        return plain_state(self.task, tuple(values))

    @property
    def time(self) -> int:
        """Steps taken in the present episode."""
        return int(self.engine.buffers.time[self.number])

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        return space(self.engine.observation)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        return space(self.engine.action)

    def render(self) -> Any:
        """Return the present state as text or as pixels, as the render mode says; None without one."""
        match self.render_mode:
            case "ansi":
                return window.text(self.task, self.state, self.time)
            case "rgb_array":
                episode = int(self.engine.buffers.episodes[self.number])
                return self.drawing.draw(self.task, self.state, self.time, episode=episode)
        return None

    def action_masks(self) -> Array:
        """Return the legal actions of the present state, bool (n,)."""
        if not self.task.mask:
            return all_legal(self.task)
        states = {}
        for c, values in zip(self.task.state, self.engine.buffers.state, strict=True):
            states[c.name] = values[..., self.number, None]
        return action_mask(self.task, states)[:, 0]

    def get_keys_to_action(self) -> dict[tuple[int, ...], Any]:
        return window.keys_to_action(self.task)

    def ask(self, name: str, *args: Any, **options: Any) -> Any:
        """Return an attribute of the lane, or what a method of it gives.

        Raises:
            LaneError: lanes have nothing of that name.
        """
        if name not in KNOWN:
            raise LaneError(f"E713: a lane has no {name!r}; it has {', '.join(KNOWN)}")
        value = getattr(self, name)
        if callable(value):
            return value(*args, **options)
        return value


KNOWN = (
    "task", "state", "time", "observation_space", "action_space", "render_mode", "render", "action_masks", "get_keys_to_action",
)  # fmt: skip


def all_legal(task: Task) -> Array:
    """Return the mask of a task without `legal`: True for every value of every component of an action.

    Returns:
        bool (n,); for several components one after the other, as MaskablePPO wants it.

    Raises:
        SpecError: E713, where the actions are infinite.
    """
    layout = task.action_layout
    if layout.form not in ("discrete", "multi_discrete"):
        raise spec_error("E713", f"the actions of {task.id} are infinite, and have no mask")
    return np.ones(sum(layout.counts), np.bool_)


def refuse_to_set(name: str) -> NoReturn:
    """Refuse to set an attribute: lanes share one task, and have none of their own.

    Raises:
        LaneError: always.
    """
    raise LaneError(
        f"E713: {name!r} cannot be set: all lanes are one task; make another environment with other options"
    )


def lane_render_mode(mode: RenderMode | None) -> RenderMode | None:
    """Return a render mode of lanes.

    Raises:
        SpecError: E713 for another one; E705 without the packages that pixels need.
    """
    if mode is not None:
        one_of("render_mode", mode, RENDER_MODES)
    if mode == "rgb_array":
        window.require()
    return mode
