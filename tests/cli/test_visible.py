"""Whatever a spec or a file is called and says, people see it: no output holds a character that a screen would obey or hide."""

import json
import os
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from taskspec.base.display import ON_PAGES, visible
from taskspec.cli.app import app
from taskspec.language import registry
from taskspec.show.pages.write import write
from tests.base.test_visible import NASTY, hidden

WRITTEN = NASTY.encode("unicode_escape").decode()
"""As a spec may write it between double quotes."""


SPEC = r"""
taskspec: 1
name: Nasty
title: "ti@tle"
summary: "su@m"
description: "de@s `co@de` [l@](http://x.example/@)"
capability: "ca@p"
sources: [{key: "k@", where: "w@"}]
errata: [{source: "s@", here: "h@", because: "b@"}]
parameters:
  n: {type: int, default: 3, low: 1, high: 9, doc: "doc@"}
  m: {type: choice, values: ["p@", q], default: "p@", doc: "d"}
constants: {map: {grid: ["ab", "\u202ea"], legend: {a: 0, b: 1, "\u202e": 2}}}
state:
  s: {type: choice, values: ["l@", go], doc: "doc@"}
action:
  a: {type: choice, values: ["x@", push], symbols: ["x@", p]}
horizon: 2
initial: {s: go}
dynamics:
  s':
    by: a
    rows: {push: go, else: "l@"}
reward: (s' == go) + n + map[0, 0]
expert: push
claims:
  - {claim: optimal_return == 8, where: "wh@"}
figure: {kind: graph, highlight: {good: "s == go"}}
""".replace("@", WRITTEN)


BROKEN = SPEC.replace("(s' == go)", "(s' == '@gone')").replace("reward:", '"bo@gus": 1\nreward:').replace("@", WRITTEN)


GOOD = os.fsdecode(b"good\x1b[2J\xe2\x80\xae\xff,%:\n.yaml")


BAD = os.fsdecode(b"bad\x1b[2J\xe2\x80\xae\xff,%:\n.yaml")


FOLDER = os.fsdecode(b"folder\xff\x1b[2J\n")


COMMANDS = [
    ["check", GOOD], ["check", BAD], ["check", "--json", GOOD], ["check", "--json", BAD], ["check", "--format", "github", BAD],
    ["check", FOLDER], ["check", f"none{NASTY}.yaml"], ["list", "."], ["list", "--json", "."], ["list", FOLDER],
    ["show", GOOD], ["show", "--json", GOOD], ["show", "--source", GOOD], ["show", BAD], ["show", f"x{NASTY}"],
    ["run", GOOD, "--episodes", "2"], ["run", "--json", GOOD], ["run", GOOD, "--policy", "expert", "--render", "ansi"],
    ["run", GOOD, "--policy", f"{NASTY}:f"], ["run", GOOD, "-p", f"n{NASTY}=3"], ["run", GOOD, "-p", f"m={NASTY}"],
    ["solve", GOOD], ["solve", "--json", GOOD], ["score", GOOD, "--returns", "3"], ["explain", NASTY], ["new", f"n{NASTY}"],
    ["docs", GOOD, "-o", "out"], ["docs", GOOD, "--format", "markdown", "-o", "out2"], ["figure", GOOD, "-o", "f.svg"],
    ["figure", GOOD, "-o", os.fsdecode(b"f\xff\x1b.svg")], ["build", "."], ["schema", "-o", os.fsdecode(b"s\xff\x1b.json")],
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("nasty")
    try:
        (path / GOOD).write_text(SPEC, encoding="utf-8")
    except (OSError, ValueError):
        pytest.skip("a file system whose names are UTF-8")
    (path / BAD).write_text(BROKEN, encoding="utf-8")
    (path / FOLDER).mkdir()
    (path / FOLDER / "x.yaml").write_text(SPEC, encoding="utf-8")
    return path


@pytest.mark.parametrize("color", [None, "1"])
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: visible(" ".join(command), ""))
def test_what_commands_print_can_be_seen(
    folder: Path, command: list[str], color: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    done = CliRunner().invoke(app, command, env={"COLUMNS": "100", "FORCE_COLOR": color})
    assert done.exit_code in (0, 1, 2), done.output
    for text in (done.stdout, done.stderr):
        assert not hidden(re.sub(r"\x1b\[[0-9;]*m|\x1b\]8;[^\x1b]*\x1b\\", "", text) if color else text)
    if "--json" in command:
        json.loads(done.stdout)


@pytest.mark.parametrize("kind", ["html", "markdown", "latex", "svg"])
def test_pages_can_be_seen(folder: Path, kind: str, tmp_path: Path) -> None:
    written = write([registry.load(folder / GOOD)], [kind], tmp_path)
    for path in written:
        assert not hidden(path.read_text(encoding="utf-8"), ON_PAGES), path
