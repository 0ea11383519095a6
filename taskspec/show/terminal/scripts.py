"""Scripts of actions (JSON or CSV), which `taskspec run` plays as a policy."""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.named import all_names
from taskspec.exact.policies.policy import Actions, EpisodeBatch, TaskPolicy
from taskspec.language.expressions.types import Kind
from taskspec.language.task.parts import Component
from taskspec.language.task.task import Task

SCRIPTS = (".json", ".csv")


def is_script(name: str) -> bool:
    """Return whether a policy's name means a script of actions."""
    return Path(name).suffix in SCRIPTS


class ScriptEnd(Exception):
    """A script has no more actions for this episode."""


class ScriptedPolicy(TaskPolicy):
    """The actions of a file in order, for one episode at a time: the same for every episode, or a list for each.

    JSON holds a list of actions, or of such lists; an action is a label, a number, a list, or a mapping by component. CSV
    has one action a line.

    Args:
        path: the file.
        task: the task in which it acts.
        hint: what an action is, for messages.

    Raises:
        SpecError: E706 for an action outside the action space; E710, E711, E713 for a file that is no script.
    """

    def __init__(self, path: Path, task: Task, hint: str) -> None:
        self.name = str(path)
        self.task = task
        self.episodes = []
        for items in _episodes(path, task):
            self.episodes.append([_action(task, item, path, hint) for item in items])
        self.episode = -1

    def choose(self, batch: EpisodeBatch) -> Actions:
        if batch.t == 0:
            self.episode += 1
        actions = self.episodes[self.episode % len(self.episodes)]
        if batch.t >= len(actions):
            raise ScriptEnd
        pairs = zip(self.task.action, actions[batch.t], strict=True)
        return {c.name: np.array(flat).reshape(*c.type.shape, 1) for c, flat in pairs}


def _episodes(path: Path, task: Task) -> list[list[Any]]:
    if not path.exists():
        raise SpecError([Diagnostic("E710", None, f"there is no file '{path}'")])
    text = path.read_text(encoding="utf-8", errors="replace")
    is_list = len(task.action) > 1 or bool(task.action[0].type.shape)  # an action is written as a list
    if path.suffix == ".csv":
        items = _rows(text, is_list)
        names = all_names(task.action)
        if items and items[0] in (names, names[0]):
            items = items[1:]
        return [items]
    try:
        data: Any = json.loads(text)
    except ValueError as error:
        raise SpecError([Diagnostic("E711", None, f"'{path}' is not JSON: {error}")]) from None
    if not isinstance(data, list) or not data:
        hint = 'for example: ["safe", "risky"]'
        raise SpecError([Diagnostic("E713", None, f"'{path}' is not a list of actions", hint)])
    is_nested = all(isinstance(item, list) for item in data)
    if is_nested and is_list:
        is_nested = all(isinstance(part, list | dict) for part in itertools.chain.from_iterable(data))
    if is_nested:
        return data
    return [data]


def _rows(text: str, is_list: bool) -> list[Any]:
    rows: list[Any] = []
    for row in csv.reader(text.splitlines()):
        if any(row):
            cells = list(map(_number, row))
            if is_list or len(cells) > 1:
                rows.append(cells)
            else:
                rows += cells
    return rows


def _number(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell.strip()


def _action(task: Task, item: Any, path: Path, hint: str) -> list[tuple[Any, ...]]:
    try:
        parts: Sequence[Any]
        if isinstance(item, dict):
            parts = [item[c.name] for c in task.action]
        else:
            parts = _parts(task, item)
        return [_flat(c, part) for c, part in zip(task.action, parts, strict=True)]
    except (KeyError, ValueError, TypeError):
        message = f"{path}: {json.dumps(item)} is not an action of {task.id}"
        raise SpecError([Diagnostic("E706", None, message, hint)]) from None


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
    items = np.asarray(part, dtype=object).ravel().tolist()
    if len(items) != c.type.size:
        raise ValueError
    return tuple(map(partial(_element, c), items))


def _element(c: Component, item: Any) -> Any:
    if c.domain is not None and isinstance(item, str):
        return c.domain.labels.index(item)
    if isinstance(item, str):
        raise ValueError
    if c.type.kind is Kind.REAL:
        return float(item)
    return int(item)
