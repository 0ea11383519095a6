"""Mistakes in learners: what each does, the code that does it, and what to do.

What a learner learned shows them: its values (`operators`), its reward (`starc`), or what it does
after demonstrations (`taskspec.learn.exam.pairings`); each has a table by the same names. Mistakes of groups of episodes show in
the expectation of an estimator (`taskspec.oracle`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class KnownMistake:
    """A mistake in a learner.

    Attributes:
        what: words that follow "a learner".
        code: what such code usually looks like.
        fix: what to do.
        reported: public threads, as owner/repository#number.
        oracle: functions of `taskspec.oracle` that the code fails against.
        explanation: what goes wrong, and a change that repairs it; Markdown.
    """

    what: str
    code: str
    fix: str
    reported: tuple[str, ...]
    oracle: tuple[str, ...]
    explanation: str

    @property
    def calls(self) -> str:
        """The functions of `taskspec.oracle`, in words."""
        return " and ".join(f"`oracle.{name}`" for name in self.oracle)


def anchor(name: str) -> str:
    """Return the name of a mistake without spaces: what `taskspec explain` takes, and its page is called."""
    return name.replace(" ", "_").replace("-", "_").lower()


FIELD = re.compile(r"^- ([a-z ]+): (.*)\n", re.MULTILINE)


def _read() -> dict[str, KnownMistake]:
    """Read `mistakes.md` beside this file; its first lines say how an entry is written."""
    page = Path(__file__).with_name("mistakes.md").read_text(encoding="utf-8")
    found = {}
    for entry in page.split("\n### ")[1:]:
        heading, _, text = entry.partition("\n")
        name, _, what = heading.partition(": ")
        fields = dict(FIELD.findall(text))
        found[name] = KnownMistake(
            what,
            fields.get("usual code", ""),
            fields.get("repair", ""),
            _listed(fields, "reported"),
            _listed(fields, "oracle"),
            FIELD.sub("", text).strip(),
        )
    return found


def _listed(fields: dict[str, str], name: str) -> tuple[str, ...]:
    return tuple(fields[name].split(", ")) if name in fields else ()


MISTAKES = _read()
"""Mistakes by name, and three that are none: `right`, `on policy` and `until the limit`."""
