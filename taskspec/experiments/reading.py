"""Finds and reads experiments."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from taskspec.diagnostics import Diagnostic, SpecError, raise_if_errors, suggest
from taskspec.registry import tasks_root
from taskspec.source import Document, read_file
from taskspec.task.schema import Experiment, check_experiment

FOLDER = "experiments"
"""The folder of a suite that holds the experiments that come with it."""


@dataclass(frozen=True, eq=False)
class ExperimentFile:
    """An experiment as it is written: its sections, and the document that knows where each stands."""

    experiment: Experiment
    document: Document

    @property
    def folder(self) -> Path:
        """Where paths of specs start from."""
        return Path(self.document.origin.name).parent


def read(source: str | os.PathLike[str]) -> ExperimentFile:
    """An experiment, by the path of its file, or as `suite/name` one that comes with a suite.

    Raises:
        SpecError: E710 when there is none, or with every mistake in its shape.
    """
    return described(read_file(find(source)))


def described(document: Document) -> ExperimentFile:
    """The experiment that a document describes.

    Raises:
        SpecError: with every mistake in its shape.
    """
    found, problems = check_experiment(document)
    raise_if_errors(problems)
    assert found is not None
    return ExperimentFile(found, document)


def find(source: str | os.PathLike[str]) -> Path:
    """The file of an experiment.

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
    """The experiments that come with the suites, by `suite/name`."""
    found = sorted(tasks_root().glob(f"*/{FOLDER}/*.yaml"))
    return {f"{path.parent.parent.name}/{path.stem}": path for path in found}
