"""Where learners come from: functions of files and of modules, and those that come with the package."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn

from taskspec.data.functions import function_of, is_function
from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exam.case import SOURCES, Source
from taskspec.learners import learner

DEFAULT: tuple[Source, ...] = ("demonstrations", "preferences")
"""What a learner that does not say is granted: everything but the reward."""


@dataclass(frozen=True)
class Examinee:
    """A learner, and what it says of itself.

    Attributes:
        name: what it is called.
        place: where another process finds it; None for a function that was handed over.
        train: `train(case)` gives a policy; where it learns `together`, a list of them, one for each seed of the block.
        learns_from: what it is entitled to.
        content: a hash of what it does, as far as its own file tells.
    """

    name: str
    place: str | None
    train: Callable[[Any], Any]
    learns_from: tuple[Source, ...]
    together: bool
    content: str


def learner_of(given: str | Callable[[Any], Any], learns_from: Sequence[str] | None = None) -> Examinee:
    """The learner of `file.py:train`, of `module:train`, of a name or a file that `taskspec.learners` knows, or of a function.

    Args:
        learns_from: what it is granted, in place of what it says itself.

    Raises:
        SpecError: E710, E711 for a file that is not there, or fails; E713 for what is no learner.
    """
    place = _absolute(given) if isinstance(given, str) else None
    train = given if place is None or not isinstance(given, str) else _train(place)
    if isinstance(train, str) or not callable(train):
        _none(str(given))
    wanted = tuple(learns_from) if learns_from is not None else getattr(train, "learns_from", DEFAULT)
    name = str(given) if isinstance(given, str) else getattr(given, "__name__", type(given).__name__)
    return Examinee(
        name, place, train, _sources(wanted), bool(getattr(train, "together", False)), _content(train, name)
    )


def _sources(wanted: Any) -> tuple[Source, ...]:
    names = (wanted,) if isinstance(wanted, str) else tuple(wanted)
    for name in names:
        if name not in SOURCES:
            hint = f"some of {', '.join(SOURCES)}"
            raise SpecError([Diagnostic("E713", None, f"a learner cannot learn from '{name}'", hint)])
    return tuple(source for source in SOURCES if source in names)


def _absolute(place: str) -> str:
    """A place that means the same in every folder."""
    if place.endswith((".yaml", ".yml")):
        return str(Path(place).resolve())
    if not is_function(place):
        return place
    path, _, name = place.rpartition(":")
    return f"{Path(path).resolve()}:{name}"


@lru_cache(maxsize=8)
def _train(place: str) -> Any:
    """The function at a place; a file is run once in a process."""
    if is_function(place):
        return function_of(place, "(case)")
    module, colon, name = place.partition(":")
    if not colon or place.endswith((".yaml", ".yml")):
        return learner(place)
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        return getattr(importlib.import_module(module), name, None)
    except ImportError as error:
        raise SpecError([Diagnostic("E711", None, f"'{module}' cannot be imported: {error}")]) from error


def train_at(place: str, content: str) -> Callable[[Any], Any]:
    """The function at a place, in another process; `content` is what it was when the exam began.

    Raises:
        SpecError: E711 when it has changed since.
    """
    found = learner_of(place)
    if found.content != content:
        raise SpecError([Diagnostic("E711", None, f"{place} has changed since the exam began", "run it again")])
    return found.train


def _content(train: Any, name: str) -> str:
    """A hash of the file that a learner is in; of one of ours, of its settings."""
    try:
        source = Path(inspect.getsourcefile(inspect.unwrap(train)) or "").read_bytes()
    except (OSError, TypeError):
        source = repr(train).encode()
    return hashlib.sha256(source + name.rpartition(":")[2].encode()).hexdigest()


def _none(name: str) -> NoReturn:
    hint = "file.py:train, or module:train, where `def train(case)` gives a policy"
    raise SpecError([Diagnostic("E713", None, f"there is no learner '{name}'", hint)])
