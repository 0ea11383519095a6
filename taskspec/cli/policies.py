"""Policies that `taskspec run` can roll out: random, the spec's expert, a script of actions."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taskspec.cli.failures import refuse
from taskspec.diagnostics import suggest
from taskspec.lang.evaluate import evaluate
from taskspec.lang.ir import Node, Role
from taskspec.lang.types import Kind
from taskspec.lang.variates.layout import WordLayout
from taskspec.lang.variates.sample import sampler
from taskspec.task.memory import recall
from taskspec.task.spaces import SpaceLayout, action_layout, observation_layout, pack, unpack
from taskspec.task.task import Component, Task

if TYPE_CHECKING:
    from taskspec.envs import Environment

Policy = Callable[[Any], Any]
"""The action for the observation just made; raises ScriptEnd where it has none."""
NAMES = ("random", "expert")
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
    if name == "expert":
        expert = expert_policy(env, seed)
        return lambda episode: expert
    if Path(name).suffix in SCRIPTS:
        return scripted(Path(name), env.task)
    hint = suggest(name, NAMES) or "random, expert, or a .json or .csv file of actions"
    raise refuse("E713", f"there is no policy '{name}'", hint)


# -- the expert ---------------------------------------------------------------------------------------------------


def expert_policy(env: Environment, seed: int) -> Policy:
    """The expert that the spec gives."""
    match env.task.expert:
        case None:
            raise refuse("E713", f"{env.task.id} gives no expert", "an `expert:` section says how it acts")
        case tuple() as nodes:
            return _expression_expert(env, nodes, seed)
        case _:
            return _planned_expert(env, seed)


def _expression_expert(env: Environment, nodes: tuple[Node, ...], seed: int) -> Policy:
    """Expressions over the state, the time and the expert's memory, by the reference interpreter."""
    task, layout, memory = env.task, action_layout(env.task), env.task.memory
    words, rng = WordLayout.of(nodes), np.random.default_rng(seed)
    kept: list[tuple[Any, ...]] = []
    done: list[tuple[Any, ...]] = []

    def act(observation: Any) -> Any:
        state = env.state
        reads = {c.read: _state_flat(c, state[c.name]) for c in task.state} | {(Role.TIME, "t"): (env.time,)}
        if memory is not None:
            kept[:] = recall(task, memory, unpack(observation_layout(task), observation), kept, done, env.time)
            reads |= {c.read: flat for c, flat in zip(memory.components, kept, strict=True)}
        drawn = [int(w) for w in rng.integers(0, 2**32, words.count)]
        done[:] = evaluate(nodes, reads, sampler(words, drawn))
        return pack(layout, done)

    return act


def _state_flat(c: Component, value: Any) -> tuple[Any, ...]:
    """A state component as environments show it, as a flat value."""
    if c.domain is not None and not c.type.shape:
        return (c.domain.index(value),)
    return tuple(np.asarray(value).ravel().tolist())


def _planned_expert(env: Environment, seed: int) -> Policy:
    """The optimal or soft-optimal expert: a plan on the exact model, which knows the state whatever is observed."""
    from taskspec.exact import Results

    task, layout, results = env.task, action_layout(env.task), Results(env.task)
    model, plan, rng = results.model, results.expert_plan, np.random.default_rng(seed)
    if model is None or plan is None:
        raise refuse(
            "E712", f"the expert of {task.id} is planned on an exact model, and it has none: {results.why_not}"
        )
    stand_in = results.abstraction

    def act(observation: Any) -> Any:
        state = {c.name: _state_array(c, env.state[c.name]) for c in task.state}
        known = state if stand_in is None else stand_in.map(state)
        code, _ = model.states.encode([known[c.name] for c in model.states.components], 1)
        chances = plan(env.time)[:, int(np.searchsorted(model.codes, code[0]))]
        chosen = model.actions.decode(np.array([rng.choice(len(chances), p=chances / chances.sum())]))
        return pack(layout, [tuple(chosen[Role.ACTION, c.name].reshape(-1).tolist()) for c in task.action])

    return act


def _state_array(c: Component, value: Any) -> np.ndarray[Any, Any]:
    """A state component as a batch of one: shape (*shape, 1)."""
    return np.array(_state_flat(c, value)).reshape(*c.type.shape, 1)


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
        raise refuse("E711", f"'{path}' is no JSON: {error}") from None
    if not isinstance(items, list) or not items:
        raise refuse("E713", f"'{path}' is no list of actions", 'for example: ["safe", "risky"]')
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
    layout = action_layout(task)
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
