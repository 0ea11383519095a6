"""The instances of an experiment: each task at each combination of values and modifiers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from taskspec.base import ids
from taskspec.base.diagnostics import Collector, Diagnostic, Span, SpecError, raise_if_errors, spec_error
from taskspec.base.limits import limits, tell
from taskspec.base.named import all_names
from taskspec.exact.policies.adapters import policy_of
from taskspec.exact.policies.python_files import is_function, place_of
from taskspec.language import registry
from taskspec.language.modifiers import MODIFIERS, Modifier, modifier, modify
from taskspec.language.source import Document
from taskspec.language.source import Path as Place
from taskspec.language.task.build import bound_parameters
from taskspec.language.task.parts import Parameter
from taskspec.language.task.task import Task
from taskspec.learn.documents.document_models import SPANS, TaskEntry
from taskspec.learn.experiments.experiment_file import ExperimentFile, check_axes, check_questions
from taskspec.learn.experiments.parameter_values import Assignment, Axis, Values, combinations, listed, sample, too_many
from taskspec.learn.jobs.store import DiskList


@dataclass(frozen=True, slots=True)
class Option:
    """One of the modifiers that an entry of an experiment lists, and the arguments in which it differs from the others."""

    modifier: Modifier
    varied: Mapping[str, Any] = field(default_factory=dict)


def options(written: str | Mapping[str, Any]) -> list[Option]:
    """Return the options of a modifier: two for `{sticky: [0.1, 0.25]}`."""
    if isinstance(written, str):
        return [Option(modifier(written))]
    ((name, given),) = written.items()
    arguments = MODIFIERS[name].arguments if name in MODIFIERS else ()
    kinds = {argument.name: argument.kind for argument in arguments}
    if (not isinstance(given, dict) or set(given) & set(SPANS)) and arguments and given is not None:
        given = {arguments[0].name: given}
    if not isinstance(given, dict):
        return [Option(modifier({name: given}))]
    many: dict[str, list[Any]] = {}
    titles = {}
    for key, value in given.items():
        values = listed(value, kinds.get(key, ""))
        if callable(values):
            raise spec_error("E214", "arguments of modifiers are not drawn", "list them, or give a `range`")
        many[key] = values
        if len(values) > 1:
            titles[key] = f"{name} {key}"
    if arguments and arguments[0].name in titles:
        titles[arguments[0].name] = name
    wanted = math.prod(map(len, many.values()))
    if wanted > limits().instances:
        raise too_many(wanted)
    chosen_options = []
    for chosen in itertools.product(*many.values()):
        each = dict(zip(many, chosen, strict=True))
        varied = {title: each[key] for key, title in titles.items()}
        chosen_options.append(Option(modifier({name: each}), varied))
    return chosen_options


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
    instances = DiskList[Instance]()
    refused: list[Diagnostic] = []
    used: frozenset[str] = frozenset()
    is_known = True
    for i, entry in enumerate(written.experiment.tasks):
        one = _Entry(written, i, entry, collector, instead)
        for instance in one.instances():
            instances.add(instance.id, instance)
        refused += one.refused
        used |= one.replaced
        for name in one.names:
            names[name] = names.get(name, False) or name in one.varied
        is_known = is_known and one.is_known
    for name in dict.fromkeys(itertools.chain(*instead)):
        if name not in used and not collector.has_errors:
            collector.add("E702", None, f"no task of the experiment has a parameter '{name}'")
    if is_known:
        check_axes(written, names, collector, may_be_fixed=bool(instead))
    return Expanded(instances, collector.diagnostics, tuple(refused))


def by_key(known: Iterable[Parameter]) -> dict[str, Parameter]:
    """Return parameters by their names and their aliases."""
    keys = {}
    for parameter in known:
        keys[parameter.name] = parameter
        if parameter.alias:
            keys[parameter.alias] = parameter
    return keys


@dataclass
class _Entry:
    """One task of an experiment; mistakes go to the collector."""

    written: ExperimentFile
    index: int
    entry: TaskEntry
    collector: Collector
    instead: Sequence[Mapping[str, Any]]
    replaced: frozenset[str] = frozenset()
    refused: list[Diagnostic] = field(default_factory=list)
    is_known: bool = False
    names: tuple[str, ...] = ()
    varied: tuple[str, ...] = ()

    @property
    def document(self) -> Document:
        return self.written.document

    def instances(self) -> Iterator[Instance]:
        """Yield the instances; none where something is wrong with the entry itself."""
        before = len(self.collector.diagnostics)
        source = self.entry.task
        if source.endswith((".yaml", ".yml")):
            source = str(self.written.folder / source)
        try:
            self.task = registry.load(source, self.entry.variant)
            known = bound_parameters(self.task.source.document, self.task.source.variant).parameters
        except SpecError as error:
            self._report(error, ("task",))
            return
        axes = self._replaced(list(self._axes(known)), known)
        laid = self._modifiers()
        varied = tuple(itertools.chain(*(axis.names for axis in axes if axis.size != 1)))
        arguments = tuple(dict.fromkeys(itertools.chain(*(option.varied for option in itertools.chain(*laid)))))
        self.is_known = True
        self.names = (*all_names(known), *arguments)
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
        names = list(itertools.chain(*(axis.names for axis in axes)))
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
        laid: list[list[Option]] = []
        for i, written in enumerate(self.entry.modifiers):
            try:
                laid.append(options(written))
                for option in laid[-1][:1]:
                    modify(self.task, option.modifier)
            except SpecError as error:
                self._report(error, ("modifiers", i))
        return laid

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

    # -- axes -------------------------------------------------------------------------------------------------------

    def _axes(self, known: Sequence[Parameter]) -> Iterator[Axis]:
        kinds = by_key(known)
        for section in ("parameters", "zip"):
            for name in getattr(self.entry, section):
                if name not in kinds:
                    self._unknown((section, name), name)
        for name, values in self.entry.parameters.items():
            if name not in kinds:
                continue
            try:
                chosen = listed(values, kinds[name].kind)
            except SpecError as error:
                self._report(error, ("parameters", name))
                continue
            if callable(chosen):
                yield Axis((kinds[name].name,), chosen)
            else:
                yield Axis((kinds[name].name,), [(value,) for value in chosen])
        if self.entry.zip:
            together = {kinds[name].name: values for name, values in self.entry.zip.items() if name in kinds}
            yield Axis(tuple(together), list(zip(*together.values(), strict=True)))

    def _replaced(self, axes: list[Axis], known: Sequence[Parameter]) -> list[Axis]:
        given = set(itertools.chain(*self.instead))
        names = {key: parameter.name for key, parameter in by_key(known).items() if key in given}
        self.replaced = frozenset(names)
        if not names:
            return axes
        kept = []
        for axis in axes:
            others = axis.without(frozenset(names.values()))
            if others.names:
                kept.append(others)
        values = dict.fromkeys(tuple(setting[key] for key in names) for setting in self.instead)
        return [*kept, Axis(tuple(names.values()), list(values))]

    def _unknown(self, path: Place, name: str) -> None:
        try:
            bound_parameters(self.task.source.document, self.task.source.variant, {name: 0})
        except SpecError as error:
            place = self.document.key_span(("tasks", self.index, *path))
            for diagnostic in error.diagnostics:
                if diagnostic.code == "E702":
                    self.collector.extend([replace(diagnostic, span=place)])

    # -- settings ---------------------------------------------------------------------------------------------------

    def _count(self) -> int | None:
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
        self, source: str, known: Sequence[Parameter], given: dict[str, Any], varied: tuple[str, ...],
        over: Sequence[Option],
    ) -> Instance | None:  # fmt: skip
        known = self._settled(known, given)
        values = Assignment(known, given, self._value_span, self.collector).values()
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
        all_values = dict(values)
        hash_ = ""
        if bound is not None:
            all_values = {p.name: p.value for p in bound.parameters}
            hash_ = bound.content_hash
        laid = tuple(str(option.modifier) for option in over)
        shown = {name: all_values[name] for name in varied}
        for option in over:
            shown |= option.varied
        name = str(ids.InstanceId(self.task.id, dict(sorted(all_values.items())), laid))
        return Instance(name, source, self.task.source.variant, all_values, laid, shown, hash_, problem, self.index)

    def _settled(self, known: Sequence[Parameter], given: Mapping[str, Any]) -> Sequence[Parameter]:
        plain = dict(given)
        for parameter in known:
            if parameter.kind != "choice" and isinstance(given.get(parameter.name), str):
                del plain[parameter.name]
        if len(plain) == len(given):
            return known
        try:
            return bound_parameters(self.task.source.document, self.task.source.variant, plain).parameters
        except SpecError:  # with the others they may be right
            return known

    # -- places -----------------------------------------------------------------------------------------------------

    def _span(self, *path: str | int) -> Span:
        return self.document.span(("tasks", self.index, *path))

    def _value_span(self, name: str, start: int, end: int) -> Span:
        if name not in self.entry.parameters:
            return self._span("zip", name)
        if not isinstance(self.entry.parameters[name], str):
            return self._span("parameters", name)
        return self.document.span(("tasks", self.index, "parameters", name), start, end)

    def _report(self, error: SpecError, path: Place) -> None:
        """Report the mistakes of a task, at the place where the experiment names it, unless it has one of its own."""
        place = self._span(*path)
        self.collector.extend(replace(d, span=d.span or place) for d in error.diagnostics)
