"""What registration reads from the lines of a spec is what a full reading finds, on every spec and however it is laid out."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.language.source import read_text
from taskspec.language.source.scan import REQUIRED, Scanned, scan, task_name

ROOT = Path(__file__).parents[3]
SPECS = sorted(
    p for folder in ("tasks", "tests") for p in (ROOT / folder).rglob("*.yaml") if p.parent.name != "mutants"
)
BASE = """\
taskspec: 1
name: Walk
version: 2
state: {s: {type: int, low: 0, high: 9}}
action:
  a: {type: bool}
horizon: 5
initial: {s: 0}
dynamics: {}
reward: s
variants:
  long:
    horizon: 9
    title: a longer one
  WalkFar:
    base: long
"""
# What is written instead of a part of the base; the meaning of all but the last few is the same.
LAYOUTS = [
    ("name: Walk", 'name: "Walk"  # the name'), ("name: Walk", "name: 'Walk'"), ("name: Walk", "name:\n  Walk"),
    ("name: Walk", "'name': Walk"), ("name: Walk", "name : Walk"), ("name: Walk", "name: >-\n  Walk"),
    ("version: 2", "version: 0x2"), ("version: 2", "version: +2"), ("version: 2", "# version: 9\nversion:   2   "),
    ("\n", "\r\n"), ("horizon: 5", "horizon: 5\n\n# name: Other\n   # more"), ("reward: s", "reward: 's\n  + 1'"),
    ("reward: s", "reward: 'name\nname: s'"), ("reward: s", "reward: [s,\nname: X]"), ("reward: s", "? reward\n: s"),
    ("reward: s", "reward: |\n  name: X"), ("  long:", "  'long':"), ("  long:", "  long :"), ("  long:", "  long:  # x"),
    ("    title: a longer one", "    title: |\n      a longer\n      one"), ("    title: a", "    title: 'a'  # "),
    ("\nvariants:", "\nvariants:  # two"), ("\nvariants:", "\nvariants:\n\n  # two"), ("reward: s\n", ""),
    ("state: {", "status: {"),
    ("variants:\n  long:\n    horizon: 9\n    title: a longer one\n  WalkFar:\n    base: long\n", "variants: {b: {}, 'a': {}}"),
    ("variants:\n  long:\n    horizon: 9\n    title: a longer one\n  WalkFar:\n    base: long\n", "variants:\n"),
    ("  WalkFar:", "  other: {}\n  WalkNear: 'x'\n  WalkFar:"), ("taskspec: 1", "--- # x\ntaskspec: 1"),
]  # fmt: skip


def read(text: str) -> Scanned | None:
    """The tasks of a text by the YAML reader; None where that refuses it."""
    try:
        data = read_text(text).data
    except SpecError:
        return None
    name, variants = str(data.get("name", "")), data.get("variants") or {}
    version = data.get("version", 0)
    tasks = [(name, None)] if all(section in data for section in REQUIRED) else []
    tasks += [(task_name(name, key), key) for key in variants]
    return Scanned(version if isinstance(version, int) else 0, tuple(tasks))


def agree(text: str) -> None:
    expected = read(text)
    if expected is not None:
        assert scan(text) == expected


@pytest.mark.parametrize("path", SPECS, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_specs_are_scanned_as_they_are_read(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    agree(text)
    data = read(text)
    if data is not None:
        agree(json.dumps(read_text(text).data))


@pytest.mark.parametrize(("old", "new"), LAYOUTS, ids=[repr(new) for _, new in LAYOUTS])
def test_layouts_are_scanned_as_they_are_read(old: str, new: str) -> None:
    assert old in BASE
    text = BASE.replace(old, new)
    assert read(text) is not None
    agree(text)


def test_every_line_may_be_missing() -> None:
    lines = BASE.splitlines()
    for i in range(len(lines)):
        agree("\n".join([*lines[:i], *lines[i + 1 :]]))
        agree("\n".join([*lines[:i], re.sub(r":.*", ":", lines[i]), *lines[i + 1 :]]))
