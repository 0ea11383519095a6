"""The instances of an experiment: each task at each combination of values and modifiers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from taskspec.base import ids
from taskspec.base.diagnostics import Collector, Diagnostic, Span, SpecError, raise_if_errors, spec_error
from taskspec.base.limits import limits, tell
from taskspec.exact.policies.adapters import policy_of
from taskspec.exact.policies.python_files import is_function, place_of
from taskspec.language import registry
from taskspec.language.modifiers import MODIFIERS, Modifier, modifier, modify
from taskspec.language.source import Path as Place
from taskspec.language.task.build import bound_parameters
from taskspec.language.task.parts import Parameter
from taskspec.language.task.task import Task
from taskspec.learn.documents.document_models import SPANS, TaskEntry
from taskspec.learn.experiments.experiment_file import ExperimentFile, check_axes, check_questions
from taskspec.learn.experiments.parameter_values import (
    Assignment,
    Axis,
    Values,
    combinations,
    listed,
    sample,
    too_many,
)
from taskspec.learn.jobs.store import DiskList

# The modifiers of an experiment: an argument may have several values, each of which makes instances of its own.


@dataclass(frozen=True, slots=True)
class Option:
    """One of the modifiers that an entry of an experiment lists, and the arguments in which it differs from the others."""

    modifier: Modifier
    varied: Mapping[str, Any] = field(default_factory=dict)


def options(written: str | Mapping[str, Any]) -> list[Option]:
    """Return the options of a modifier: `{sticky: [0.1, 0.25]}` is two, `{distractors: {count: [1, 4], kind: normal}}` as
    well.
    """
    if isinstance(written, str):
        return [Option(modifier(written))]
    ((name, given),) = written.items()
    if name in MODIFIERS:
        arguments = MODIFIERS[name].arguments
    else:
        arguments = ()
    kinds = {a.name: a.kind for a in arguments}
    if (not isinstance(given, dict) or set(given) & set(SPANS)) and arguments and given is not None:
        given = {arguments[0].name: given}
    if not isinstance(given, dict):
        return [Option(modifier({name: given}))]
    many = {key: _values(value, kinds.get(key, "")) for key, value in given.items()}
    wanted = math.prod(map(len, many.values()))
    if wanted > limits().instances:
        raise too_many(wanted)
    found = [dict(zip(many, chosen, strict=True)) for chosen in itertools.product(*many.values())]
    if arguments:
        first = arguments[0].name
    else:
        first = ""
    titles = {key: name if key == first else f"{name} {key}" for key, values in many.items() if len(values) > 1}
    return [Option(modifier({name: each}), {titles[key]: each[key] for key in titles}) for each in found]


def _values(written: Any, kind: str) -> list[Any]:
    found = listed(written, kind)
    if callable(found):
        raise spec_error("E214", "arguments of modifiers are not drawn", "list them, or give a `range`")
    return found


# From an experiment to the instances that it is about: each task at each combination of its values.


@dataclass(frozen=True)
class Instance:
    """A task at values of all its parameters, with modifiers.

    `source` and `variant` are what `registry.load` takes. `varied` has the values of what varies in its entry: parameters, and
    arguments of modifiers. `problem` says why there is no such task: a value that a parameter cannot have, or values that
    may not go together.
    """

    id: str
    source: str
    variant: str | None
    parameters: Mapping[str, Any]
    modifiers: tuple[str, ...] = ()
    varied: Mapping[str, Any] = field(default_factory=dict)
    content_hash: str = ""
    problem: str | None = None
    entry: int = 0

    @property
    def task(self) -> str:
        """The id of the task, without values and modifiers."""
        return ids.parse(self.id).name

    def load(self) -> Task:
        """Load the task.

        Returns:
            It, with the parameters of the instance.

        Raises:
            SpecError: with every mistake in it.
        """
        return modify(registry.load(self.source, self.variant, **self.parameters), *self.modifiers)


@dataclass(frozen=True)
class Expanded:
    """The instances of an experiment, on disk, and what is wrong with what it gives.

    `refused` are the problems of single instances: values that a parameter cannot have, or that may not go together.
    """

    instances: Sequence[Instance]
    diagnostics: tuple[Diagnostic, ...] = ()
    refused: tuple[Diagnostic, ...] = ()

    def raise_if_wrong(self) -> None:
        """Raise SpecError with all that is wrong with the experiment itself; single instances may still be refused."""
        raise_if_errors(self.diagnostics)

    def tasks(self) -> tuple[Task, ...]:
        """Load the task of every instance.

        Returns:
            The tasks, in the order of the instances.

        Raises:
            SpecError: with all that is wrong with the experiment, or with instances of it.
        """
        self.raise_if_wrong()
        raise_if_errors(self.refused)
        return tuple(instance.load() for instance in self.instances)


def expand(written: ExperimentFile, instead: Sequence[Mapping[str, Any]] = ()) -> Expanded:
    """Return every instance once, in the order of the file; the last parameter of an entry changes fastest.

    Args:
        written: the experiment.
        instead: settings of parameters, each a combination of values that takes the place of those in the file, for the tasks
            that have the parameters.

    Returns:
        The instances, and what is wrong with them.
    """
    collector = Collector()
    collector.extend(written.problems)
    check_questions(written, collector)
    names = dict[str, bool]()
    found = DiskList[Instance]()
    refused: list[Diagnostic] = []
    used: frozenset[str] = frozenset()
    is_known = True
    for i, entry in enumerate(written.experiment.tasks):
        one = _Entry(written, i, entry, collector, instead)
        for instance in one.instances():
            found.add(instance.id, instance)
        refused += one.refused
        used |= one.replaced
        for name in one.names:
            names[name] = names.get(name, False) or name in one.varied
        is_known = is_known and one.is_known
    for name in dict.fromkeys(name for setting in instead for name in setting):
        if name not in used and not collector.has_errors:
            collector.add("E702", None, f"no task of the experiment has a parameter '{name}'")
    if is_known:
        check_axes(written, names, collector, may_be_fixed=bool(instead))
    return Expanded(found, collector.diagnostics, tuple(refused))


class _Entry:
    """One task of an experiment; mistakes go to the collector."""

    def __init__(
        self,
        written: ExperimentFile,
        index: int,
        entry: TaskEntry,
        collector: Collector,
        instead: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        self.written = written
        self.index = index
        self.entry = entry
        self.collector = collector
        self.instead = instead
        self.replaced: frozenset[str] = frozenset()
        self.document = written.document
        self.refused: list[Diagnostic] = []
        self.is_known = False
        self.names: tuple[str, ...] = ()
        self.varied: tuple[str, ...] = ()

    def instances(self) -> Iterator[Instance]:
        """Yield the instances; none where something is wrong with the entry itself."""
        before = len(self.collector.diagnostics)
        source = self._source()
        try:
            self.task = registry.load(source, self.entry.variant)
            known = bound_parameters(self.task.source.document, self.task.source.variant).parameters
        except SpecError as error:
            self._report(error, ("task",))
            return
        axes = self._replaced(list(self._axes(known)), known)
        laid = self._modifiers()
        varied = tuple(name for axis in axes for name in axis.names if axis.size != 1)
        arguments = tuple(dict.fromkeys(name for choice in laid for option in choice for name in option.varied))
        self.is_known = True
        self.names = (*(p.name for p in known), *arguments)
        self.varied = (*varied, *arguments)
        self._check_policies()
        is_wrong = len(self.collector.diagnostics) > before
        many = self._count()
        if many is None:
            many = math.prod(axis.size for axis in axes if not callable(axis.values))
        many *= math.prod(map(len, laid))
        if many > limits().instances:
            self._report(too_many(many), ())
            return
        names = [name for axis in axes for name in axis.names]
        planned = 0
        for chosen in self._settings(axes):
            given = dict(zip(names, itertools.chain.from_iterable(chosen), strict=True))
            for over in itertools.product(*laid):
                tell(f"planning instance {planned:,} of {many:,}", planned / many)
                planned += 1
                instance = self._instance(source, known, given, varied, over)
                if is_wrong:  # the first shows what is wrong with expressions, too
                    return
                if instance is not None:
                    yield instance

    def _modifiers(self) -> list[list[Option]]:
        found: list[list[Option]] = []
        for i, written in enumerate(self.entry.modifiers):
            try:
                found.append(options(written))
                for option in found[-1][:1]:
                    modify(self.task, option.modifier)
            except SpecError as error:
                self._report(error, ("modifiers", i))
        return found

    def _check_policies(self) -> None:
        for i, policy in enumerate(self.written.experiment.policies):
            try:
                if is_function(policy):  # a check runs no code
                    place_of(policy)
                else:
                    policy_of(self.task, policy)
            except SpecError as error:
                place = self.document.span(("policies", i))
                self.collector.extend(replace(d, span=place) for d in error.diagnostics)

    def _source(self) -> str:
        """Return the task as `registry.load` takes it: paths start from the file's folder."""
        name = self.entry.task
        is_relative = name.endswith((".yaml", ".yml")) and not Path(name).is_absolute()
        if is_relative:
            return str(self.written.folder / name)
        return name

    # -- axes -------------------------------------------------------------------------------------------------------

    def _axes(self, known: Sequence[Parameter]) -> Iterator[Axis]:
        kinds = {key: p for p in known for key in (p.name, p.alias) if key}
        for section in ("parameters", "zip"):
            for name in getattr(self.entry, section):
                if name not in kinds:
                    self._unknown((section, name), name)
        for name, values in self.entry.parameters.items():
            if name not in kinds:
                continue
            try:
                found = listed(values, kinds[name].kind)
            except SpecError as error:
                self._report(error, ("parameters", name))
                continue
            yield Axis((kinds[name].name,), found if callable(found) else [(v,) for v in found])
        if self.entry.zip:
            together = [name for name in self.entry.zip if name in kinds]
            lists = [self.entry.zip[name] for name in together]
            yield Axis(tuple(kinds[name].name for name in together), list(zip(*lists, strict=True)))

    def _replaced(self, axes: list[Axis], known: Sequence[Parameter]) -> list[Axis]:
        keys = {key: p.name for p in known for key in (p.name, p.alias) if key and any(key in s for s in self.instead)}
        self.replaced = frozenset(keys)
        if not keys:
            return axes
        kept = [found for axis in axes if (found := axis.without(frozenset(keys.values()))).names]
        return [*kept, Axis(tuple(keys.values()), list(dict.fromkeys(tuple(s[k] for k in keys) for s in self.instead)))]

    def _unknown(self, path: Place, name: str) -> None:
        try:
            bound_parameters(self.task.source.document, self.task.source.variant, {name: 0})
        except SpecError as error:
            place = self.document.key_span(("tasks", self.index, *path))
            self.collector.extend(replace(d, span=place) for d in error.diagnostics if d.code == "E702")

    # -- settings ---------------------------------------------------------------------------------------------------

    def _count(self) -> int | None:
        """Return the number of sampled combinations; None for all."""
        wanted = self.entry.sample
        if wanted is None or isinstance(wanted, int):
            return wanted
        return wanted.count

    def _settings(self, axes: Sequence[Axis]) -> Iterable[tuple[Values, ...]]:
        count = self._count()
        if count is None:
            return combinations(axes)
        return sample(axes, count, getattr(self.entry.sample, "seed", 0))

    def _instance(
        self,
        source: str,
        known: Sequence[Parameter],
        given: dict[str, Any],
        varied: tuple[str, ...],
        over: Sequence[Option],
    ) -> Instance | None:
        known = self._settled(known, given)
        values = Assignment(
            known, given, lambda name, start, end: self._value_span(name, start, end), self.collector
        ).values()
        if values is None:
            return None
        problem = None
        bound = None
        try:
            bound = bound_parameters(self.task.source.document, self.task.source.variant, values)
        except SpecError as error:
            problem = "; ".join(d.message for d in error.diagnostics)
            place = self._span("parameters")
            note = f"at {ids.assigned(values.items())}"
            self.refused += [replace(d, span=place, notes=(*d.notes, note)) for d in error.diagnostics]
        if bound is None:
            all_values = dict(values)
        else:
            all_values = {p.name: p.value for p in bound.parameters}
        laid = tuple(str(option.modifier) for option in over)
        shown = {n: all_values[n] for n in varied} | {k: v for option in over for k, v in option.varied.items()}
        name = str(ids.InstanceId(self.task.id, dict(sorted(all_values.items())), laid))
        if bound is None:
            hash_ = ""
        else:
            hash_ = bound.content_hash
        return Instance(name, source, self.task.source.variant, all_values, laid, shown, hash_, problem, self.index)

    def _settled(self, known: Sequence[Parameter], given: Mapping[str, Any]) -> Sequence[Parameter]:
        texts = {p.name for p in known if p.kind != "choice" and isinstance(given.get(p.name), str)}
        if not texts:
            return known
        try:
            plain = {name: value for name, value in given.items() if name not in texts}
            return bound_parameters(self.task.source.document, self.task.source.variant, plain).parameters
        except SpecError:  # with the others they may be right
            return known

    # -- places -----------------------------------------------------------------------------------------------------

    def _span(self, *path: str | int) -> Span:
        return self.document.span(("tasks", self.index, *path))

    def _value_span(self, name: str, start: int, end: int) -> Span:
        path: Place = ("tasks", self.index, "parameters" if name in self.entry.parameters else "zip", name)
        one = isinstance(self.entry.parameters.get(name), str)
        if one:
            return self.document.span(path, start, end)
        return self.document.span(path)

    def _report(self, error: SpecError, path: Place) -> None:
        """Report the mistakes of a task, at the place where the experiment names it, unless it has one of its own."""
        place = self._span(*path)
        self.collector.extend(replace(d, span=place) if d.span is None else d for d in error.diagnostics)
