"""A commented spec to start from."""

from __future__ import annotations

import re
from pathlib import Path

from taskspec.base.diagnostics import spec_error
from taskspec.base.files import write_text

SCAFFOLD = """\
# Completion and marks in an editor: run `taskspec schema -o taskspec.schema.json`, then make the next line
# the first one:     # yaml-language-server: $schema=taskspec.schema.json
taskspec: 1
name: {name}
title: {title}
summary: Walk along a corridor to the goal at its end.        # one sentence
description: |                                                # Markdown, with $math$
  The agent starts at the left end of a corridor of $L$ steps and is paid once it stands at the right end.
  What a learner must get right to do well here, and what cannot matter, belongs in this paragraph.
capability: exploration              # the one thing this task isolates
# sources:                           # where the task comes from
#   - {{key: author2020title, where: section 3}}

parameters:                          # parameters: `taskspec run FILE -p L=8`, and gym.make(..., L=8)
  L: {{type: int, default: 5, low: 1, high: 100, doc: length of the corridor}}

state:                               # types: int, real, bool, choice; bounds are inclusive
  s: {{type: int, low: 0, high: L, doc: position}}
action:
  a: {{type: choice, values: {{left: -1, right: 1}}, doc: direction of the step}}
# observation:                       # what the agent sees; the state itself unless given
#   position: s / L

horizon: 2 * L                       # the episode is cut off after so many steps; `none` for never
initial:                             # distributions are drawn where they stand: `s: UniformInt(0, L)`
  s: 0
dynamics:                            # a prime marks the next value; what is not named stays as it is
  s': clip(s + a, 0, L)
reward: s' == L                      # a condition counts as 0 or 1
terminal: s' == L                    # ends the episode

expert:                              # or `optimal`, or `soft(1)`
  a: right
claims:                              # statements that `taskspec check` holds you to
  - optimal_return == 1
  - expert_return == optimal_return
"""


def write_scaffold(name: str, output: Path | None = None) -> Path:
    """Write the scaffold of a task.

    Args:
        name: of the task, such as RiskyPath, or a file, such as risky_path.yaml, after which the task is named.
        output: the file, or a folder for it; by default a file named after the task.

    Raises:
        SpecError: E205 for a name that no task can have, E716 where the file exists already.
    """
    path = Path(name)
    is_file = path.suffix in (".yaml", ".yml")
    if is_file:
        name = "".join(word[:1].upper() + word[1:] for word in re.split(r"[_\W]+", path.stem))
    if not re.fullmatch("[A-Za-z][A-Za-z0-9]*", name):
        raise spec_error("E205", f"'{name}' cannot name a task: letters and digits only, a letter first")
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name).lower()
    if not is_file:
        path = Path(f"{words.replace(' ', '_')}.yaml")
    if output is not None and output.is_dir():
        path = output / path
    elif output is not None:
        path = output
    write_text(path, SCAFFOLD.format(name=name, title=words.capitalize()), new=True)
    return path
