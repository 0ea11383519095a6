"""A plugin of pytest: the fixture `exam` examines a learner, and a failure says what is wrong with it.

pytest imports this file in every test run where taskspec is installed. It stands beside the package, whose import costs more, and
imports it when a test asks for `exam`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from taskspec.learn.pytest_plugin import ExamOutcome


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of exams."""
    group = parser.getgroup("taskspec", "exams of learners")
    group.addoption("--exam-suite", metavar="NAME", help="suite of tasks for all exams")
    group.addoption("--exam-tasks", metavar="TASK,...", help="tasks for all exams")
    group.addoption("--exam-seeds", metavar="N", help="seeds of all exams")
    group.addoption("--exam-steps", metavar="N", help="steps of each training run in all exams, such as 50k")
    group.addoption("--exam-out", metavar="FOLDER", help="save exam.json and report.html of each test here")


def pytest_configure(config: pytest.Config) -> None:
    """Describe the marker."""
    config.addinivalue_line("markers", "exam(suite, tasks, seeds, steps, ...): tasks and budget of the fixture `exam`")


@pytest.fixture
def exam(request: pytest.FixtureRequest) -> Callable[..., ExamOutcome]:
    """Return a function that examines a learner: `exam(train, tasks="RiskyPath").passes()`."""

    def examine_learner(learner: str | Callable[[Any], Any], **terms: Any) -> ExamOutcome:
        from taskspec.learn.pytest_plugin import examined

        __tracebackhide__ = True
        return examined(request, learner, terms)

    return examine_learner
