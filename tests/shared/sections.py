"""The smallest task, section by section, and the spec with some of them replaced or added."""

from typing import Any

from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task

BASE = {
    "taskspec": "1",
    "name": "Walk",
    "state": "{s: {type: int, low: 0, high: 9}}",
    "action": "{a: {type: bool}}",
    "horizon": "9",
    "initial": "{s: 0}",
    "dynamics": "{s': 'min(s + a, 9)'}",
    "reward": "s' == 9",
}


def text(**sections: str) -> str:
    return "".join(f"{key}: {value}\n" for key, value in (BASE | sections).items())


def whole_spec(text: str) -> str:
    """Return a spec with what its first two lines say; at its end, where it lacks them."""
    if "taskspec" in text:
        return text
    return f"{text}\ntaskspec: 1\nname: Test\n"


def build_text(text: str, variant: str | None = None, **parameters: Any) -> Task:
    """Build a task from a spec, which may lack its first two lines."""
    return build(read_text(whole_spec(text), "spec.yaml"), variant, parameters)
