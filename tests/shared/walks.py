"""A small task, as a spec of which sections are replaced."""

import re

from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task

BASE = """\
taskspec: 1
name: Walk
constants: {}
state:
  s: {type: int, low: 0, high: 9}
action:
  a: {type: int, low: 0, high: 1}
horizon: 10
initial: {s: 0}
dynamics:
  s': (s + a) % 10
reward: s'
"""


def written(text: str = BASE, name: str = "<test>", suite: str = "", **sections: str) -> Task:
    """A task, with some sections of the base spec replaced."""
    for section, value in sections.items():
        pattern = rf"^{section}:.*\n(  .*\n)*"
        text = re.sub(pattern, "", text, flags=re.MULTILINE) + f"{section}:{value}\n"
    return build(read_text(text, name), None, {}, suite)
