"""Worked examples of variants, on pages and in the terminal."""

import json
import re
from pathlib import Path

from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.show import pages
from taskspec.tools.authoring.checks import check_file, examine
from taskspec.tools.targets import File
from tests.exact.rules.test_examples import AT, SPEC, V
from tests.shared.commands import Done
from tests.shared.diagnostics import codes


def test_a_variant_inherits_examples_and_replaces_them(tmp_path: Path) -> None:
    example = {"state": {"s": 3}, "expert": {"a": "on"}}
    variants = {
        "same": {"horizon": 6},
        "other": {"expert": {"a": "back", "b": True}},
        "own": {"expert": {"a": "back", "b": True}, "examples": [{"state": {"s": 3}, "expert": {"a": "back"}}]},
        "none": {"expert": {"a": "back", "b": True}, "examples": None},
    }
    path = tmp_path / "walk.yaml"
    path.write_text(json.dumps(SPEC | {"examples": [example], "variants": variants}), encoding="utf-8")
    report = check_file(File(path, ""), examine)
    counts = {each.variant: (each.coverage.examples, len(each.coverage.wrong_examples)) for each in report.tasks}
    assert counts == {None: (1, 0), "same": (1, 0), "other": (1, 1), "own": (1, 0), "none": (0, 0)}
    assert [code for code in codes(report.diagnostics) if code.startswith("E")] == ["E611"]


def test_pages_print_examples_as_a_table(tmp_path: Path) -> None:
    shown = [
        {"state": {"s": 1}, "action": {"a": "on"}, "next": {"s": {"1": "1/4", "2": "3/4"}}, "doc": "slips & 1|4"},
        {"state": {"s": 1, "v": V}, "action": {"a": "on"}, "reward": 2, "next": {"s": 2}, "probability": "3/4"},
        {"t": 4, "state": {"s": 1}, "action": {"a": "on"}, "truncated": True, "terminal": False},
        {"for": [{"n": 2}], "state": {"s": 2}, "expert": {"a": "on", "b": "Bernoulli(1/2)"}},
        {"initial": {"mood": "calm"}},
    ]
    task = build(source.read_text(json.dumps(SPEC | {"examples": shown}), "walk.yaml"))
    pages.write(
        [task], ["markdown", "latex", "html"], tmp_path, facts={task.id: pages.Facts(wrong_examples=frozenset({3}))}
    )
    markdown = (tmp_path / "walk.md").read_text(encoding="utf-8")
    rows = re.split(r"\s*\n\s*", markdown.partition("- **Examples**\n\n")[2].strip())[:7]
    assert rows[:2] == ["| for | state | action | what follows |  |  |", "|---|---|---|---|---|---|"]
    assert rows[2].startswith(r"|  | $s = 1$ | $a = \text{on}$ | $s' = \begin{cases} 1 &")
    assert rows[2].endswith(r"\end{cases}$ | slips &amp; 1\|4 |  |")
    assert rows[3].endswith(r"$s' = 2$, reward $2$, with probability $\frac{3}{4}$ |  |  |")
    assert rows[4] == r"|  | $s = 1$, $t = 4$ | $a = \text{on}$ | the episode is truncated |  |  |"
    assert rows[5].startswith(r"| $n = 2$ | $s = 2$ |  | expert $a = \text{on}$, $b \sim \mathrm{Bernoulli}")
    assert rows[5].endswith("|  | (✗ does not hold) |")
    assert rows[6] == r"|  |  |  | first $\mathrm{mood} = \text{calm}$ |  |  |"
    html = (tmp_path / "walk.html").read_text(encoding="utf-8")
    latex = (tmp_path / "walk.tex").read_text(encoding="utf-8")
    table = html.partition("<table>")[2].partition("</table>")[0]
    cells = (table.count("<tr>"), table.count("<th "), table.count("<td>"))
    assert cells == (6, 4, 32)  # a cell above a column without a title is no heading
    assert "slips &amp; 1|4" in table
    body = latex.partition(r"\taskspectable{llllll}{")[2].partition("\n")[0]
    assert r"slips \& 1\textbar{}4" in body or r"slips \& 1|4" in body
    assert r"\taskspecwide" not in body


def test_the_terminal_shows_examples(tmp_path: Path) -> None:
    path = tmp_path / "walk.yaml"
    path.write_text(json.dumps(SPEC | {"examples": [AT | {"next": {"s": 2}, "probability": "3/4"}]}), encoding="utf-8")
    shown = Done("show", path).out
    for words in ("on, b = 1", "s′ = 2", "with probability", "3/4"):
        assert words in shown
