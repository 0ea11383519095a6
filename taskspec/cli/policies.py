"""Policies that `taskspec run` can roll out: those with a name, a script of actions, a function of a file."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.cli.failures import refuse
from taskspec.data.actors import function_of, is_function
from taskspec.lang.batch import DTYPES
from taskspec.lang.types import Kind
from taskspec.task.observe import recall
from taskspec.task.spaces import SpaceLayout, pack, unpack
from taskspec.task.task import Component, Task

if TYPE_CHECKING:
    from taskspec.envs import Environment

Policy = Callable[[Any], Any]
"""The action for the observation just made; raises ScriptEnd where it has none."""
Flat = tuple[Any, ...]
SCRIPTS = (".json", ".csv")


class ScriptEnd(Exception):
    """A script that has no more actions for this episode."""


def policy_for(name: str, env: Environment, seed: int) -> Callable[[int], Policy]:
    """A function from the number of an episode to the policy that acts in it.

    Raises:
        SpecError: for a policy that does not exist, or that this task does not have.
    """
    if name == "random":
        env.action_space.seed(seed % 2**32)
        return lambda episode: lambda observation: env.action_space.sample()
    if Path(name).suffix in SCRIPTS:
        return scripted(Path(name), env.task)
    if is_function(name):
        function = function_of(name)
        return lambda episode: function
    known = _knowing(env, seed, name)
    return lambda episode: known


def _knowing(env: Environment, seed: int, name: str) -> Policy:
    """A named policy, which is told the state whatever is observed, and keeps what it remembers."""
    from taskspec.policies.named import NAMES, named, unknown

    if name.partition("(")[0] not in {known.partition("(")[0] for known in NAMES}:
        unknown(name, ("a .json or .csv file of actions", "FILE.py:FUNCTION"))
    task, layout, policy = env.task, env.task.action_layout, named(env.task, name)
    memory = task.memory if policy.task.remembers else None
    rng, kept, done = np.random.default_rng(seed), list[Flat](), list[Flat]()

    def act(observation: Any) -> Any:
        state = {c.name: _state_array(c, env.state[c.name]) for c in task.state}
        if memory is not None:
            kept[:] = recall(task, memory, unpack(task.observation_layout, observation), kept, done, env.time)
            state |= {c.name: _array(c, flat) for c, flat in zip(memory.components, kept, strict=True)}
        words = rng.integers(0, 2**32, (policy.words, 1)).astype(np.uint32)
        chosen = policy.act(state, env.time, words)
        done[:] = [tuple(np.asarray(chosen[c.name]).reshape(-1).tolist()) for c in task.action]
        return pack(layout, done)

    return act


def _state_array(c: Component, value: Any) -> np.ndarray[Any, Any]:
    """A state component as environments show it, as a batch of one: shape (*shape, 1)."""
    if c.domain is not None and not c.type.shape:
        return _array(c, (c.domain.index(value),))
    return _array(c, tuple(np.asarray(value).ravel().tolist()))


def _array(c: Component, flat: Flat) -> np.ndarray[Any, Any]:
    """A flat value of a component as a batch of one."""
    return np.array(flat, DTYPES[c.type.kind]).reshape(*c.type.shape, 1)


# -- scripts ------------------------------------------------------------------------------------------------------


def scripted(path: Path, task: Task) -> Callable[[int], Policy]:
    """The actions of a file, in order: the same for every episode, or a list for each.

    JSON holds a list of actions, or of such lists; an action is a label, a number, a list, or a mapping by component. CSV
    has one action a line.
    """
    episodes = _episodes(path, task)
    actions = [[_action(task, item, path) for item in items] for items in episodes]

    def policy(episode: int) -> Policy:
        left: Iterator[Any] = iter(actions[episode % len(actions)])

        def act(observation: Any) -> Any:
            try:
                return next(left)
            except StopIteration:
                raise ScriptEnd from None

        return act

    return policy


def _episodes(path: Path, task: Task) -> list[list[Any]]:
    """The items of a script, an inner list for each episode."""
    if not path.exists():
        raise refuse("E710", f"there is no file '{path}'")
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix == ".csv":
        rows = [[_number(cell.strip()) for cell in row] for row in csv.reader(text.splitlines()) if any(row)]
        items: Any = [row[0] if len(row) == 1 and not _vector_action(task) else row for row in rows]
        return [items[1:] if items and _is_header(items[0], task) else items]
    try:
        items = json.loads(text)
    except ValueError as error:
        raise refuse("E711", f"'{path}' is not JSON: {error}") from None
    if not isinstance(items, list) or not items:
        raise refuse("E713", f"'{path}' is not a list of actions", 'for example: ["safe", "risky"]')
    return items if _is_nested(items, task) else [items]


def _is_nested(items: list[Any], task: Task) -> bool:
    """Whether a script holds a list of actions for each episode."""
    if not all(isinstance(item, list) for item in items):
        return False
    return not _vector_action(task) or all(isinstance(part, list | dict) for item in items for part in item)


def _vector_action(task: Task) -> bool:
    """Whether an action is written as a list."""
    return len(task.action) > 1 or bool(task.action[0].type.shape)


def _is_header(item: Any, task: Task) -> bool:
    """Whether the first line of a CSV names the components."""
    return (item if isinstance(item, list) else [item]) == [c.name for c in task.action]


def _number(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell


def _action(task: Task, item: Any, path: Path) -> Any:
    """An item of a script as an action of the environment."""
    layout = task.action_layout
    try:
        parts = [item[c.name] for c in task.action] if isinstance(item, dict) else _parts(task, item)
        flats = [_flat(c, part) for c, part in zip(task.action, parts, strict=True)]
    except (KeyError, ValueError, TypeError):
        raise refuse(
            "E706", f"{path}: {json.dumps(item)} is not an action of {task.id}", _needs(task, layout)
        ) from None
    return pack(layout, flats)


def _parts(task: Task, item: Any) -> Sequence[Any]:
    if len(task.action) == 1:
        return [item]
    sizes = [c.type.size for c in task.action]
    flat = list(item)
    if len(flat) == len(sizes):
        return flat
    ends = np.cumsum(sizes)
    return [flat[end - size : end] for end, size in zip(ends, sizes, strict=True)]


def _flat(c: Component, part: Any) -> tuple[Any, ...]:
    """A component's value, flat: labels as their index."""
    items = np.asarray(part, dtype=object).ravel().tolist()
    if len(items) != c.type.size:
        raise ValueError
    return tuple(_element(c, item) for item in items)


def _element(c: Component, item: Any) -> Any:
    if c.domain is not None and isinstance(item, str):
        return c.domain.labels.index(item)
    if isinstance(item, str):
        raise ValueError
    return float(item) if c.type.kind is Kind.REAL else int(item)


def _needs(task: Task, layout: SpaceLayout) -> str:
    from taskspec.cli.records import domain_words, space_words

    listed = ", ".join(f"{c.name}: {domain_words(c)}" for c in task.action)
    return f"{listed} ({space_words(layout)})"
