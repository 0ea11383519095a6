"""The error guide: every code with its explanation, from the table of codes."""

from __future__ import annotations

from itertools import groupby

from taskspec.base.diagnostics import CODES, Code
from taskspec.cli.explain import CLASSES

HEAD = """\
# Errors and warnings

Every message of taskspec has a code and a name. This page has an entry for each; `taskspec explain E302` prints one in
a terminal. Codes that begin with E stop a spec from being used, codes that begin with W only say that something looks
wrong; `taskspec check --strict` treats both alike. A spec is read in stages: mistakes in its YAML (E1) hide those in its
shape (E2), which hide the rest. Within one stage, all mistakes are reported together.

Where it helps, entries show a wrong line and a right one.
"""


def errors() -> str:
    """`docs/errors.md`."""
    classes = [_class(prefix, list(codes)) for prefix, codes in groupby(CODES.values(), lambda c: c.code[:2])]
    return "\n".join([HEAD, *classes]).rstrip() + "\n"


def _class(prefix: str, codes: list[Code]) -> str:
    return f"## {prefix}xx: {CLASSES[prefix]}\n\n" + "\n".join(_entry(code) for code in codes)


def _entry(code: Code) -> str:
    # An explicit anchor, so that a message can be linked to whatever its title says.
    head = f'<a id="{code.code.lower()}"></a>\n\n### {code.code} {code.slug}: {code.title}'
    return f"{head}\n\n{code.explanation.strip()}\n"
