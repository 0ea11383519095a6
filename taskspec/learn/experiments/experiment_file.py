"""Finds, reads and checks the files of experiments."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from taskspec.base.diagnostics import Collector, Diagnostic, SpecError, spec_error, suggest
from taskspec.base.limits import how_to_raise, limits
from taskspec.exact.policies.python_files import is_function, place_of
from taskspec.exact.scores.difficulty import MEASURES
from taskspec.language.registry import tasks_root
from taskspec.language.source import Document, read_file
from taskspec.language.source import Path as Place
from taskspec.learn.documents.document_models import Experiment, check_document
from taskspec.learn.exam.results import folder_name
from taskspec.learn.learners import learner

RETURNS = ("optimal", "expert", "random", "worst")
COLUMNS = (
    "states", "actions", "horizon", "discount", "optimal", "optimal_half", "optimal_status", "expert", "expert_half",
    "expert_status", "random", "random_half", "random_status", "worst", "worst_half", "worst_status",
)  # fmt: skip
"""Columns of every result, in addition to the measures and policies that were asked for."""
SPEEDS = ("steps_per_second", "steps_per_second_vectorized")
FOLDER = "experiments"
"""The folder of a suite that holds the experiments that come with it."""


@dataclass(frozen=True, eq=False)
class ExperimentFile:
    """An experiment as it is written: its sections, and the document that knows where each stands."""

    experiment: Experiment
    document: Document
    problems: tuple[Diagnostic, ...] = ()
    """Mistakes in its shape, whose entries `experiment` lacks; `expand` reports them with all others."""

    @property
    def folder(self) -> Path:
        """The folder that paths of specs and learners start from."""
        return Path(self.document.origin.name).parent

    @property
    def learners(self) -> list[str]:
        """The learners, as `taskspec exam` takes them."""
        places = []
        for name in self.experiment.learners:
            if name.endswith((".yaml", ".yml")) or is_function(name):
                name = str(self.folder / name)
            places.append(name)
        return places


def read(source: str | os.PathLike[str]) -> ExperimentFile:
    """Return an experiment.

    Args:
        source: the path of its file, or `suite/name` of one that comes with a suite.

    Returns:
        The file with its entries checked for their shape; instances are not yet known.

    Raises:
        SpecError: E710 when there is none, or with every mistake in its shape where too little of it is right.
    """
    return described(read_file(find(source)))


def described(document: Document) -> ExperimentFile:
    """Return the experiment that a document describes."""
    experiment, problems = check_document(document, Experiment)
    if experiment is None:
        raise SpecError(problems)
    return ExperimentFile(experiment, document, problems)


def read_if_experiment(source: str) -> ExperimentFile | None:
    """Return the experiment of this name or path, if it is one; None for anything else."""
    if source in shipped():
        return read(source)
    if not source.endswith((".yaml", ".yml")) or not Path(source).is_file():
        return None
    document = read_file(Path(source))
    if not isinstance(document.data, dict) or "experiment" not in document.data:
        return None
    return described(document)


def find(source: str | os.PathLike[str]) -> Path:
    """Return the file of an experiment."""
    path = Path(source)
    if path.exists() or path.suffix in (".yaml", ".yml"):
        return path
    known = shipped()
    named = {}
    for name, at in known.items():
        if str(source) in (name, at.stem):
            named[name] = at
    if len(named) == 1:
        return next(iter(named.values()))
    hint = suggest(str(source), known) or f"a path ends in .yaml; with the suites come {', '.join(known) or 'none'}"
    raise spec_error("E710", f"there is no experiment '{source}'", hint)


def shipped() -> dict[str, Path]:
    """Return the experiments that come with the suites, by `suite/name`."""
    paths = sorted(tasks_root().glob(f"*/{FOLDER}/*.yaml"))
    return {f"{path.parent.parent.name}/{path.stem}": path for path in paths}


def check_questions(written: ExperimentFile, collector: Collector) -> None:
    """Report what is asked for and does not exist, or costs too much; tasks are not looked at."""
    for i, name in enumerate(written.experiment.measures or ()):
        if name not in MEASURES:
            hint = suggest(name, MEASURES) or f"there are: {', '.join(MEASURES)}"
            collector.add("E206", written.document.span(("measures", i)), f"there is no measure '{name}'", hint)
    _check_learners(written, collector)
    _check_episodes(written, collector)
    _check_shown(written, collector)


def check_axes(
    written: ExperimentFile, names: Mapping[str, bool], collector: Collector, may_be_fixed: bool = False
) -> None:
    """Report axes of the plot that no instance has.

    Args:
        names: the parameters of all tasks, and the arguments of modifiers that have several values: whether each varies.
        may_be_fixed: whether an axis may have one value in all instances, as other values were given than those of the file.
    """
    plot = written.experiment.plot
    may_be_fixed = may_be_fixed or collector.has_errors
    for key, name in (("x", plot.x), ("y", plot.y)):
        if name is not None and name not in names:
            _unknown(written, ("plot", key), f"no instance has a parameter '{name}'", name, list(names), collector)
        elif name is not None and not names[name] and not may_be_fixed:
            message = f"'{name}' has one value in all instances of each task, so it is no axis"
            varying = [other for other, varies in names.items() if varies]
            hint = "no parameter varies"
            if varying:
                hint = f"these vary: {', '.join(varying)}"
            collector.add("E206", written.document.span(("plot", key)), message, hint)
    if plot.x is not None and plot.x == plot.y:
        collector.add("E206", written.document.span(("plot", "y")), f"'{plot.y}' is on both axes")
    for i, name in enumerate(plot.log):
        if name != "value" and name not in names:
            message = f"no instance has a parameter '{name}'"
            _unknown(written, ("plot", "log", i), message, name, ["value", *names], collector)


def _unknown(
    written: ExperimentFile, place: Place, message: str, name: str, known: Sequence[str], collector: Collector
) -> None:
    hint = suggest(name, known) or f"there are: {', '.join(known)}"
    collector.add("E206", written.document.span(place), message, hint)


def _check_shown(written: ExperimentFile, collector: Collector) -> None:
    experiment = written.experiment
    known = [name for name in COLUMNS if not name.endswith("_status")]
    if experiment.measures is None:
        known += MEASURES
    else:
        known += experiment.measures
    if experiment.speed:
        known += SPEEDS
    for i, name in enumerate(experiment.plot.show):
        if name in known:
            continue
        place: Place = ("plot", "show", i)
        message = f"the results have no column '{name}'"
        if name in MEASURES:
            collector.add("E206", written.document.span(place), message, f"add '{name}' to `measures`")
        elif name in SPEEDS:
            collector.add("E206", written.document.span(place), message, "set `speed: true`")
        else:
            _unknown(written, place, message, name, known, collector)


def _check_episodes(written: ExperimentFile, collector: Collector) -> None:
    experiment = written.experiment
    rolled_out = 1
    if experiment.policies:
        rolled_out = experiment.seeds or 1
    episodes = experiment.episodes * rolled_out
    most = limits().episodes
    if episodes <= most:
        return
    times = ""
    if rolled_out > 1:
        times = f" ({experiment.episodes:,} with each of {rolled_out:,} seeds)"
    section = "seeds"
    if experiment.episodes > most or rolled_out == 1:
        section = "episodes"
    message = f"{episodes:,} episodes{times} are too many; the limit is {most:,}"
    collector.add("E314", written.document.span((section,)), message, how_to_raise("episodes", episodes))


def _check_learners(written: ExperimentFile, collector: Collector) -> None:
    folders = [folder_name(name) for name in written.learners]
    given = written.experiment.learners
    for i, name in enumerate(written.learners):
        first = folders.index(folders[i])
        if first < i:
            message = f"the results of '{given[i]}' would take the place of those of '{given[first]}'"
            hint = (
                f"both are kept in a folder '{folders[i]}': name each learner once, and functions in files differently"
            )
            collector.add("E713", written.document.span(("learners", i)), message, hint)
        try:
            if is_function(name):  # a check runs no code
                place_of(name)
            elif ":" not in name or name.endswith((".yaml", ".yml")):
                learner(name)
        except SpecError as error:
            place = written.document.span(("learners", i))
            collector.extend(replace(d, span=d.span or place) for d in error.diagnostics)
