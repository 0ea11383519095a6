"""The whole check of a text, in a process that can be ended: problems, verdicts on claims and exact scores.

`check` runs this file in a process of its own, which prints one JSON object for each part of the results.
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

SECONDS = 60
"""How long a check may take; what it found by then is kept."""
_LARGEST = 1 << 24


class LastCheck:
    """The results of a check: its text, the problems that were found, and remarks by the path of what they stand above."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.problems: list[dict[str, Any]] = []
        self.lenses: list[tuple[list[str], str]] = []

    def problems_in(self, text: str) -> Iterator[dict[str, Any]]:
        """Yield the problems at their places in a later text, without those in lines that have changed since."""
        old = self.text.split("\n")
        new = text.split("\n")
        above = _alike(old, new)
        below = min(_alike(old[::-1], new[::-1]), len(old) - above)
        for each in self.problems:
            if each["end_line"] <= above:
                yield each
            elif each["line"] > len(old) - below:
                moved = len(new) - len(old)
                yield {**each, "line": each["line"] + moved, "end_line": each["end_line"] + moved}


def _alike(old: list[str], new: list[str]) -> int:
    for at, (one, other) in enumerate(zip(old, new, strict=False)):
        if one != other:
            return at
    return min(len(old), len(new))


async def check(text: str, name: str, take: Callable[[dict[str, Any]], None]) -> None:
    """Give the results of a check to a function as they come; the process ends with the task that waits for it.

    Args:
        text: the text of a spec without mistakes.
        name: its file, which need not hold this text.
        take: is given `problems` as `taskspec check --json` writes them, and `lenses`, pairs of a path and a remark.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "taskspec.tools.editor.checks", name, limit=_LARGEST,
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    assert process.stdin is not None and process.stdout is not None
    try:
        process.stdin.write(text.encode())
        process.stdin.close()
        with suppress(TimeoutError):
            async with asyncio.timeout(SECONDS):
                async for line in process.stdout:
                    take(json.loads(line))
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


def results(text: str, name: str) -> Iterator[dict[str, Any]]:
    """Yield the problems of all tasks of a spec, then their scores."""
    from taskspec import exact
    from taskspec.base.diagnostics import SpecError, records
    from taskspec.language.registry import suite_of
    from taskspec.tools.authoring.checks import check_file, examine
    from taskspec.tools.targets import File

    file = File(Path(name), suite_of(name), text=text)
    report = check_file(file, examine)
    statuses = []
    for task in report.tasks:
        statuses += [claim["status"] for claim in task.claims]
    claims = []
    if statuses:
        claims = [(["claims"], f"{statuses.count('proved')} of {len(statuses)} claims proved")]
    yield {"problems": records(report.diagnostics), "lenses": claims}
    scores = []
    for each in report.tasks:
        if each.task is None:
            continue
        with suppress(SpecError):
            place = ["variants", each.variant] if each.variant is not None else ["name"]
            scores.append((place, _words(exact.scores(each.task))))
    yield {"lenses": scores}


def _words(scores: Any) -> str:
    from taskspec.base.display import setting

    words = []
    for name in ("optimal", "expert", "random", "worst"):
        value = getattr(scores, name)
        if value is not None and value.value is not None:
            words.append(f"{name} {setting(value.value)}" + " (estimated)" * (not value.exact))
    return ", ".join(words)


if __name__ == "__main__":
    for _part in results(sys.stdin.buffer.read().decode(), sys.argv[1]):
        sys.stdout.write(json.dumps(_part) + "\n")
        sys.stdout.flush()
