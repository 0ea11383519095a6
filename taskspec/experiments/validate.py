"""What an experiment asks of all its instances: whether there is such a thing, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from taskspec.base.diagnostics import Collector, SpecError, suggest
from taskspec.base.limits import how_to_raise, limits
from taskspec.exam.results import folder_name
from taskspec.experiments.measure import COLUMNS, SPEEDS
from taskspec.experiments.reading import ExperimentFile
from taskspec.learners import learner
from taskspec.policies.files import is_function, place_of
from taskspec.scores.difficulty import MEASURES
from taskspec.source import Path as Place


def check_questions(written: ExperimentFile, collector: Collector) -> None:
    """Report what is asked for and does not exist, or costs too much; tasks are not looked at."""
    _check_measures(written, collector)
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
            hint = f"these vary: {', '.join(varying)}" if varying else "no parameter varies"
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
    """Report columns that the plot is to show and the results do not have."""
    experiment = written.experiment
    numbers = [name for name in COLUMNS if not name.endswith("_status")]
    measured = list(MEASURES) if experiment.measures is None else experiment.measures
    speeds = list(SPEEDS) if experiment.speed else []
    known = [*numbers, *measured, *speeds]
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
    """Report more episodes for each policy, or for each estimate, than are allowed."""
    experiment = written.experiment
    rolled_out = (experiment.seeds or 1) if experiment.policies else 1
    episodes = experiment.episodes * rolled_out
    most = limits().episodes
    if episodes > most:
        times = f" ({experiment.episodes:,} with each of {rolled_out:,} seeds)" if rolled_out > 1 else ""
        message = f"{episodes:,} episodes{times} are too many; the limit is {most:,}"
        place: Place = ("episodes",) if experiment.episodes > most or rolled_out == 1 else ("seeds",)
        collector.add("E314", written.document.span(place), message, how_to_raise("episodes", episodes))


def _check_measures(written: ExperimentFile, collector: Collector) -> None:
    for i, name in enumerate(written.experiment.measures or ()):
        if name not in MEASURES:
            hint = suggest(name, MEASURES) or f"there are: {', '.join(MEASURES)}"
            collector.add("E206", written.document.span(("measures", i)), f"there is no measure '{name}'", hint)


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
            collector.extend(replace(d, span=place) if d.span is None else d for d in error.diagnostics)
