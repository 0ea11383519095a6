"""Finds and reads experiments."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.policies.files import is_function
from taskspec.registry import tasks_root
from taskspec.source import Document, read_file
from taskspec.task.schema.experiments import Experiment, check_document

FOLDER = "experiments"
"""The folder of a suite that holds the experiments that come with it."""


@dataclass(frozen=True, eq=False)
class ExperimentFile:
    """An experiment as it is written: its sections, and the document that knows where each stands."""

    experiment: Experiment
    document: Document

    @property
    def folder(self) -> Path:
        """Where paths of specs and learners start from."""
        return Path(self.document.origin.name).parent

    @property
    def learners(self) -> list[str]:
        """The learners, as `taskspec exam` takes them."""
        return [self._found(name) for name in self.experiment.learners]

    def _found(self, learner: str) -> str:
        is_file = learner.endswith((".yaml", ".yml")) or is_function(learner)
        return str(self.folder / learner) if is_file and not Path(learner).is_absolute() else learner


def read(source: str | os.PathLike[str]) -> ExperimentFile:
    """Return an experiment, by the path of its file, or as `suite/name` one that comes with a suite.

    Raises:
        SpecError: E710 when there is none, or with every mistake in its shape where too little of it is right.
    """
    return described(read_file(find(source)))


def described(document: Document) -> ExperimentFile:
    """Return the experiment that a document describes.

    Raises:
        SpecError: with every mistake in its shape.
    """
    found, problems = check_document(document, Experiment)
    if found is None:
        raise SpecError(problems)
    return ExperimentFile(found, document)


def read_if_experiment(source: str) -> ExperimentFile | None:
    """Return the experiment of this name or path, if it is one; None for anything else.

    Raises:
        SpecError: with every mistake in its shape.
    """
    if source in shipped():
        return read(source)
    if not source.endswith((".yaml", ".yml")) or not Path(source).is_file():
        return None
    document = read_file(Path(source))
    is_one = isinstance(document.data, dict) and "experiment" in document.data
    return described(document) if is_one else None


def find(source: str | os.PathLike[str]) -> Path:
    """Return the file of an experiment.

    Raises:
        SpecError: E710 when there is none.
    """
    path = Path(source)
    if path.exists() or path.suffix in (".yaml", ".yml"):
        return path
    known = shipped()
    named = [at for name, at in known.items() if str(source) in (name, name.split("/")[1])]
    if len(named) == 1:
        return named[0]
    hint = suggest(str(source), known) or f"a path ends in .yaml; with the suites come {', '.join(known) or 'none'}"
    raise SpecError([Diagnostic("E710", None, f"there is no experiment '{source}'", hint)])


def shipped() -> dict[str, Path]:
    """Return the experiments that come with the suites, by `suite/name`."""
    found = sorted(tasks_root().glob(f"*/{FOLDER}/*.yaml"))
    return {f"{path.parent.parent.name}/{path.stem}": path for path in found}
