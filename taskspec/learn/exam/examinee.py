"""Finding learners: functions of files and of modules, and those that come with the package."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact.policies.python_files import function_of, is_function, place_of
from taskspec.learn.exam.case import SOURCES, Source
from taskspec.learn.jobs.code_hash import code_files, code_hash
from taskspec.learn.learners import learner

_OURS = Path(__file__).resolve().parents[2]
DEFAULT: tuple[Source, ...] = ("demonstrations", "preferences")
"""The grants of a learner that does not say: everything but the reward."""


@dataclass(frozen=True)
class Examinee:
    """A learner, and what it says of itself.

    Attributes:
        name: as it was named.
        learns_from: what it is entitled to.
        train: `train(case)` gives a policy; where it learns `together`, a list of them, one for each seed of the block. None in
            another process, which finds it by its place.
        place: where another process finds it; None for a function that was handed over.
        together: whether it learns all seeds of a block at once.
        content: a hash of its file and of what that imports from its folder, or of its settings; empty for a function that was
            handed over.
    """

    name: str
    learns_from: tuple[Source, ...]
    train: Callable[[Any], Any] | None
    place: str | None = None
    together: bool = False
    content: str = ""

    def elsewhere(self) -> Examinee:
        """Return the learner as another process gets it."""
        if self.place is None:
            return self
        return replace(self, train=None)

    def trainer(self) -> Callable[[Any], Any]:
        """Return the function that trains; in another process, from its place, as `train_at`."""
        if self.train is not None:
            return self.train
        assert self.place is not None
        return train_at(self.place, self.content)


def learner_of(given: str | Callable[[Any], Any], learns_from: Sequence[str] | None = None) -> Examinee:
    """Return the learner of `file.py:train`, of `module:train`, of a name or a file that `taskspec.learn.learners` knows, or of
    a function.

    Args:
        learns_from: what it is granted, in place of what it says itself.

    Raises:
        SpecError: E705 where packages of a learner are missing; E710, E711 for a file that is not there, or fails; E725 for what
            is no learner.
    """
    if isinstance(given, str):
        name = given
        place = _absolute(given)
        train, content = _imported(place)
    else:
        name = getattr(given, "__name__", type(given).__name__)
        place = None
        train = given
        content = ""
    if not callable(train):
        hint = "file.py:train, or module:train, where `def train(case)` gives a policy"
        raise SpecError([Diagnostic("E725", None, f"there is no learner '{name}'", hint)])
    if learns_from is None:
        learns_from = getattr(train, "learns_from", DEFAULT)
    if isinstance(learns_from, str):
        granted = (learns_from,)
    else:
        granted = tuple(learns_from)
    for source in granted:
        if source not in SOURCES:
            hint = f"some of {', '.join(SOURCES)}"
            raise SpecError([Diagnostic("E713", None, f"a learner cannot learn from '{source}'", hint)])
    ordered = tuple(source for source in SOURCES if source in granted)
    return Examinee(name, ordered, train, place, bool(getattr(train, "together", False)), content)


def _is_ours(place: str) -> bool:
    return ":" not in place or place.endswith((".yaml", ".yml"))


def _absolute(place: str) -> str:
    if place.endswith((".yaml", ".yml")):
        return str(Path(place).resolve())
    if not is_function(place):
        return place
    path, _, name = place.rpartition(":")
    return f"{Path(path).resolve()}:{name}"


def _imported(place: str) -> tuple[Any, str]:
    if is_function(place):
        file, name = place_of(place)
        return function_of(place, "(case)"), code_hash(file, name)
    if _is_ours(place):
        ours = learner(place)
        ours.require_packages()
        return ours, hashlib.sha256(repr(ours).encode()).hexdigest()
    module, _, name = place.partition(":")
    path = _file_of(place)
    try:
        train = getattr(importlib.import_module(module), name, None)
    except Exception as error:
        raise _not_importable(module, error) from error
    return train, hashlib.sha256(place.encode()).hexdigest() if path is None else code_hash(path, name)


def _file_of(place: str) -> Path | None:
    """Return the file of a user's learner; None for one of this package, and for a module that has no file of Python."""
    if is_function(place):
        return place_of(place)[0].resolve()
    if _is_ours(place):
        return None
    module = place.partition(":")[0]
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        spec = importlib.util.find_spec(module)
    except Exception as error:  # of the packages that it is in
        raise _not_importable(module, error) from error
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin).resolve()


def _not_importable(module: str, error: Exception) -> SpecError:
    return SpecError([Diagnostic("E711", None, f"'{module}' cannot be imported: {type(error).__name__}: {error}")])


def train_at(place: str, content: str) -> Callable[[Any], Any]:
    """Return the function at a place, in another process; its file, and what that imports from its folder, is run again.

    Otherwise what one training run leaves in the modules of a learner would reach the next one in the same process.

    Args:
        content: what it was when the exam began.

    Raises:
        SpecError: E711 when it has changed since.
    """
    path = _file_of(place)
    if path is not None:
        _forget(path)
    examinee = learner_of(place)
    if examinee.content != content:
        raise SpecError([Diagnostic("E711", None, f"{place} has changed since the exam began", "run it again")])
    return examinee.trainer()


def _forget(path: Path) -> None:
    """Have a file, and what it imports from its folder, run again when it is imported next; this package stays as it is."""
    files = {file for file in code_files(path) if not file.is_relative_to(_OURS)}
    for name, module in list(sys.modules.items()):
        origin = getattr(module, "__file__", None)
        if origin is None or Path(origin).resolve() not in files:
            continue
        del sys.modules[name]
        package, _, attribute = name.rpartition(".")
        if package in sys.modules:  # where `from package import module` would find it
            vars(sys.modules[package]).pop(attribute, None)
