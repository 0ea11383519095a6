"""Policies from files: functions of Python files (`model.py:fn`), scripts of actions (JSON or CSV), and networks of PyTorch.

PyTorch is no dependency: whoever hands over a network has it.
"""

from __future__ import annotations

import csv
import importlib
import importlib.util
import itertools
import json
import sys
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.named import all_names
from taskspec.exact.model.model import misused
from taskspec.exact.policies.policy import Actions, EpisodeBatch, TaskPolicy
from taskspec.language.expressions.types import Kind
from taskspec.language.task.parts import Component
from taskspec.language.task.task import Task


def is_network(given: Any) -> bool:
    """Return whether something is a network of PyTorch, `torch.nn.Module`, that has no `predict` of its own."""
    has_parts = all(callable(getattr(given, name, None)) for name in ("forward", "parameters", "state_dict"))
    return has_parts and not hasattr(given, "predict")


def plain(values: Any) -> Any:
    """Return a tensor of PyTorch, with a gradient or without, as an array; anything else as it is."""
    if hasattr(values, "detach"):
        return values.detach().cpu().numpy()
    return values


def outputs_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of arrays that gives arrays: a network is evaluated without gradients, in its mode for evaluation.

    Args:
        function: a network, or a function that may give tensors.
    """
    if is_network(function):
        return _Evaluated(function)
    return lambda *arguments: plain(function(*arguments))


@contextmanager
def evaluating(network: Any) -> Iterator[Any]:
    """Evaluate a network without gradients, in its mode for evaluation, within a block; PyTorch is what it gives."""
    torch = importlib.import_module("torch")
    was_training = network.training
    network.train(False)
    try:
        with torch.no_grad():
            yield torch
    finally:
        network.train(was_training)


class _Evaluated:
    """A network as a function of arrays (N, *shape): real numbers in its own precision, whole ones as they are."""

    def __init__(self, network: Any) -> None:
        self.network = network

    def __call__(self, *arguments: Any) -> Array:
        first = next(iter(self.network.parameters()), None)
        with evaluating(self.network) as torch:
            tensors = []
            for argument in arguments:
                tensor = torch.as_tensor(np.asarray(argument))
                if first is not None and tensor.is_floating_point():
                    tensor = tensor.to(first.dtype)
                if first is not None:
                    tensor = tensor.to(first.device)
                tensors.append(tensor)
            try:
                output = self.network(*tensors)
            except RuntimeError as error:
                given = ", ".join(f"{np.shape(argument)} {np.asarray(argument).dtype}" for argument in arguments)
                hint = "a function of one observation, or an object with `probabilities(observations)`, can encode them first"
                misused(f"the network refuses observations as the environment gives them, {given}: {error}", hint)
        if not hasattr(output, "detach"):
            hint = "wrap it in a function of one observation that gives the action"
            misused(f"a network that is a policy gives one tensor, not {type(output).__name__}", hint)
        return np.asarray(plain(output))


def is_function(name: str) -> bool:
    return ".py:" in name


def place_of(name: str) -> tuple[Path, str]:
    """Return the file of `model.py:fn` and the name of the function; nothing is run."""
    place, _, attribute = name.rpartition(":")
    if not Path(place).is_file():
        raise SpecError([Diagnostic("E710", None, f"there is no file '{place}'")])
    return Path(place), attribute


def function_of(name: str, form: str = "(observation)") -> Any:
    """Run the file of `model.py:fn`, and return the function, or the object with `predict`.

    Args:
        form: the function's parameters, for a hint.
    """
    path, attribute = place_of(name)
    function = getattr(_module(path), attribute, None)
    if not (callable(function) or hasattr(function, "predict")):
        message = f"'{path}' has no function '{attribute}', nor an object of that name with `predict`"
        raise SpecError([Diagnostic("E713", None, message, f"def {attribute or 'act'}{form}: ...")])
    return function


def _module(path: Path) -> Any:
    """Run a file as a module; as for a script, modules in its folder can be imported."""
    name = f"{path.stem}_{zlib.crc32(str(path.resolve()).encode()):08x}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look for the module of a class
    sys.path.insert(0, str(path.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        message = f"'{path}' cannot be run: {type(error).__name__}: {error}"
        raise SpecError([Diagnostic("E711", None, message)]) from error
    finally:
        sys.path.pop(0)
    return module


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
            cells = [_number(cell.strip()) for cell in row]
            if is_list or len(cells) > 1:
                rows.append(cells)
            else:
                rows += cells
    return rows


def _number(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell


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
    return tuple(_element(c, item) for item in items)


def _element(c: Component, item: Any) -> Any:
    if c.domain is not None and isinstance(item, str):
        return c.domain.labels.index(item)
    if isinstance(item, str):
        raise ValueError
    if c.type.kind is Kind.REAL:
        return float(item)
    return int(item)
