"""Exams in tests, for the fixture `exam` of pytest: arguments, and what a failure says.

The plugin itself is `taskspec_pytest.py` beside this package.
"""

from __future__ import annotations

import inspect
import os
import shlex
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from taskspec.base.diagnostics import TaskspecError, suggest
from taskspec.base.display import count_of, listed, plural
from taskspec.base.files import safe_name
from taskspec.language.task.task import Task, TaskLike
from taskspec.learn.exam.asked_tasks import exam_id, suites_of, tasks_of
from taskspec.learn.exam.card import flag_text, nearest
from taskspec.learn.exam.examining import examine
from taskspec.learn.exam.report import write
from taskspec.learn.exam.results import Exam
from taskspec.learn.jobs.running import Running

__all__ = ["ExamOutcome", "examined"]

DEFAULTS: Mapping[str, Any] = {"seeds": 5, "steps": 10_000}
"""The budget where neither the test, nor its marker, nor the command line says one."""
TERMS = ("suite", "tasks", "seeds", "steps", "transitions", "twins", "learns_from", "against", "laws")
"""The arguments of an exam in a test and in the marker, as those of `taskspec.learn.exam.examine`."""
COUNTS = ("seeds", "steps", "transitions", "twins")
MOST_PROBLEMS = 8
"""Problems that a failure prints."""
MOST_LINES = 50
"""Lines of a spec that a failure prints."""


def examined(
    request: pytest.FixtureRequest, learner: str | Callable[[Any], Any], terms: Mapping[str, Any]
) -> ExamOutcome:
    """Run the exam of a test; bad arguments fail the test with their message alone.

    Args:
        request: of the fixture; its marker and the command line say what the test does not.
        learner: as `taskspec.learn.exam.examine` takes it.
        terms: what the test says, some of `TERMS`.

    Returns:
        The exam's results, with `passes()`, which fails the test where the learner does.
    """
    __tracebackhide__ = True
    marked: dict[str, Any] = {}
    for marker in reversed(list(request.node.iter_markers("exam"))):
        marked |= marker.kwargs
    given = {**DEFAULTS, **marked, **terms, **_options(request.config)}
    return _examined(request.node.nodeid, learner, given, request.config.getoption("--exam-out"))


def _options(config: pytest.Config) -> dict[str, Any]:
    given = {name: config.getoption(f"--exam-{name}") for name in ("suite", "tasks", "seeds", "steps")}
    return {name: value for name, value in given.items() if value is not None}


def _examined(test: str, learner: str | Callable[[Any], Any], given: Mapping[str, Any], out: str | None) -> ExamOutcome:
    __tracebackhide__ = True
    terms = _terms(given)
    folder = None
    if out is not None:
        folder = Path(out) / safe_name(test.replace("/", "-").replace("::", "-"))
    workers = None
    if "PYTEST_XDIST_WORKER" in os.environ:  # the tests are run in parallel already
        workers = 1
    message = None
    try:
        exam = examine(learner, **terms, out=folder, running=Running(workers))
        if folder is not None:
            write(exam, folder)
    except TaskspecError as error:
        message = str(error)
    if message is not None:
        pytest.fail(message, pytrace=False)
    return ExamOutcome(exam, test, learner, terms)


def _terms(given: Mapping[str, Any]) -> dict[str, Any]:
    __tracebackhide__ = True
    terms: dict[str, Any] = {}
    for name, value in given.items():
        if name not in TERMS:
            hint = suggest(name, TERMS) or f"it has {', '.join(TERMS)}"
            pytest.fail(f"an exam has no argument '{name}': {hint}", pytrace=False)
        if isinstance(value, str) and name in COUNTS:
            number = count_of(value)
            if number is None:
                pytest.fail(f"the exam's '{name}' is a number such as 50k, not '{value}'", pytrace=False)
            terms[name] = number
        elif isinstance(value, str) and name in ("tasks", "learns_from"):
            terms[name] = [part.strip() for part in value.split(",")]
        elif value is not None:
            terms[name] = value
    return terms


class ExamOutcome:
    """The result of an exam in a test.

    Attributes:
        exam: what `exam.json` holds.
    """

    def __init__(self, exam: Exam, test: str, learner: str | Callable[[Any], Any], terms: Mapping[str, Any]) -> None:
        """`test`: its id in pytest."""
        self.exam = exam
        self._test = test
        self._learner = learner
        self._terms = terms

    def passes(self, allow: Sequence[str] = ()) -> None:
        """Fail the test where something is flagged, or the learner fails a capability.

        Args:
            allow: kinds of flags that are accepted, such as "twin".
        """
        __tracebackhide__ = True
        problems = []
        for flag in self.exam["flags"]:
            if flag["kind"] not in allow:
                problems.append((flag["task"], f"{flag['kind']} {flag['task']}: {flag_text(flag)}"))
        for capability, verdict in self.exam["verdicts"].items():
            if verdict["verdict"] == "fails":
                text = f"fails {capability}: {verdict.get('passed', 0)} of {verdict['seeds']} seeds pass"
                problems.append((verdict["tasks"][0], text))
        if not self.exam["verdicts"]:
            names = listed(list(self.exam["tasks"]))
            problems.append((next(iter(self.exam["tasks"])), f"the learner can learn none of the tasks: {names}"))
        if problems:
            tasks = list(dict.fromkeys(task for task, _ in problems))
            pytest.fail(self._failure([text for _, text in problems], tasks), pytrace=False)

    def _failure(self, problems: Sequence[str], tasks: Sequence[str]) -> str:
        """Return the message of a failed test: the problems with their causes, the first task, and a command."""
        exam = self.exam
        lines = [f"{exam['learner']}: {exam['steps']:,} steps, {plural(len(exam['seeds']), 'seed')}", ""]
        for text in problems[:MOST_PROBLEMS]:
            lines += _wrapped(text)
        if len(problems) > MOST_PROBLEMS:
            lines.append(f"and {len(problems) - MOST_PROBLEMS} more")
        for diagnosis in exam["diagnoses"]:
            lines += ["", *_wrapped(nearest(diagnosis))]
            lines += [*_wrapped(f"cause: {diagnosis['cause']}"), *_wrapped(f"try: {diagnosis['try']}")]
        lines += ["", f"{tasks[0]}:", *_spec(self._asked()[tasks[0]])]
        lines += ["", f"To reproduce: {self._command(tasks)}"]
        return "\n".join(lines)

    def _asked(self) -> dict[str, Task]:
        tasks = self._terms.get("tasks")
        suites = suites_of(self._terms.get("suite"), tasks)
        return {exam_id(task): task for task in tasks_of(suites, tasks)}

    def _command(self, tasks: Sequence[str]) -> str:
        place = _place(self._learner)
        given = self._terms.get("tasks")
        if given is None:
            names: list[TaskLike] = list(tasks)
        else:
            names = [name for task, name in zip(self._asked(), given, strict=True) if task in tasks]
        if place is None or not all(isinstance(name, str) for name in names):
            return shlex.join(["pytest", self._test])
        words = ["taskspec", "exam", place, "--tasks", ",".join(map(str, names))]
        for name in TERMS:
            value = self._terms.get(name)
            if name == "tasks" or value is None or value is False:
                continue
            words.append(f"--{name.replace('_', '-')}")
            if isinstance(value, list | tuple):
                words.append(",".join(map(str, value)))
            elif value is not True:
                words.append(str(value))
        return shlex.join(words)


def _spec(task: Task) -> list[str]:
    lines = task.source.document.origin.text.splitlines()
    shown = [f"  {line}".rstrip() for line in lines[:MOST_LINES]]
    if len(lines) > MOST_LINES:
        shown.append(f"  ... {len(lines) - MOST_LINES} more lines: taskspec show {task.id}")
    return shown


def _wrapped(text: str) -> list[str]:
    wrapped = []
    for line in text.splitlines():
        wrapped += textwrap.wrap(line, 79, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)
    return wrapped


def _place(learner: str | Callable[[Any], Any]) -> str | None:
    """Return where the command line finds a learner: `file.py:train`; None for a function inside of another one."""
    if isinstance(learner, str):
        return learner
    name = getattr(learner, "__qualname__", "")
    try:
        file = inspect.getsourcefile(learner)
    except TypeError:
        file = None
    if file is None or not name.isidentifier():
        return None
    return f"{os.path.relpath(file)}:{name}"
