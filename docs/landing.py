"""The first screen of the site: a spec beside what comes of it. All of it stands in the README, whose blocks the tests run."""

from __future__ import annotations

import re
from pathlib import Path

START = """\
---
hide-toc: true
---

# One YAML file, one task

Researchers who study learning from humans need tiny tasks that isolate one capability. Write such a task once: its environments,
its exact scores and proofs, and its printed specification come from one file, so that paper and code cannot disagree.

{commands}

::::{{container}} first-screen
:::{{container}}
{spec}

{environment}
:::
:::{{container}}
{figure}

{printed}

{scores}
:::
::::
"""


def landing(readme: Path) -> str:
    """The first screen, in MyST, from the README's own blocks."""
    text = readme.read_text(encoding="utf-8")
    example = text[text.index("## A task and what it compiles to") :]
    figure, printed = (
        _first(r"(?<=]\()[^)]*svg", example),
        _first(r"(?<=<!-- printed -->\n).*?(?=<!-- /printed -->)", example),
    )
    set_up, test = (block.strip("$ \n") for block in re.findall(r"```console\n(\$ [^`]*)```", text)[:2])
    return START.format(
        commands=f"```console\n$ {set_up}\n$ taskspec new my_task.yaml\n$ taskspec check my_task.yaml\n$ {test}\n```",
        spec=_first(r"```yaml\n.*?```", example),
        figure=f"![]({figure.removeprefix('docs/')})",
        printed=re.sub(r"^> ?", "", printed, flags=re.MULTILINE),
        scores=_first(r"```console\n\$ taskspec check.*?```", example),
        environment=_first(r"```python\n.*?```\s+```text\n.*?```", example),
    )


def _first(pattern: str, text: str) -> str:
    found = re.search(pattern, text, re.DOTALL)
    assert found is not None, f"the README has no {pattern}"
    return found[0]
