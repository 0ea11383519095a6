"""Warnings that a spec accepts: set aside with their reasons, in `--strict` too; a reason for nothing is a warning."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from taskspec import exact
from taskspec.cli.app import app
from taskspec.language import source
from taskspec.language.task.build import build
from tests.exact.check.test_accept import PATH
from tests.shared.specs import spec_file

TIGER = spec_file("tiger").read_text(encoding="utf-8")


WARNED = "accept: {W507: the expert is a beginner}\n"


def checked(folder: Path, text: str, *options: str) -> tuple[int, dict[str, object], str]:
    path = folder / f"{len(list(folder.iterdir()))}.yaml"  # a file is read once
    path.write_text(text, encoding="utf-8")
    found = CliRunner().invoke(app, ["check", str(path), "--json", *options])
    shown = CliRunner().invoke(app, ["check", str(path), *options])
    return found.exit_code, json.loads(found.stdout), shown.stdout


def codes(report: dict[str, object]) -> list[str]:
    return [d["code"] for d in report["diagnostics"]]  # type: ignore[index, attr-defined]


def test_an_accepted_warning_is_set_aside_in_strict_checks_too(tmp_path: Path) -> None:
    status, report, _ = checked(tmp_path, PATH, "--strict")
    assert (status, codes(report), report["accepted"]) == (1, ["W507"], [])
    status, report, text = checked(tmp_path, PATH + WARNED, "--strict")
    assert (status, codes(report)) == (0, [])
    (accepted,) = report["accepted"]  # type: ignore[misc]
    assert (accepted["code"], accepted["because"], accepted["line"]) == ("W507", "the expert is a beginner", 10)
    assert "no errors, no warnings, 1 warning accepted" in text


def test_a_pomdp_can_be_one_on_purpose(tmp_path: Path) -> None:
    without = TIGER.partition("accept:")[0]
    assert "W518" in codes(checked(tmp_path, without)[1])
    said = "accept: {W518: the task is to find out by listening}\n"
    assert "W518" not in codes(checked(tmp_path, without + said)[1])


def test_a_reason_for_nothing_is_a_warning_at_its_place(tmp_path: Path) -> None:
    text = PATH.replace("{a: stay}", "{a: go}") + WARNED
    status, report, _ = checked(tmp_path, text, "--strict")
    (found,) = report["diagnostics"]  # type: ignore[misc]
    assert (status, found["code"], found["line"], found["column"]) == (1, "W511", 11, 10)


VARIANTS = """\
variants:
  fine: {expert: {a: go}}
  strict: {accept: {W507: null}}
"""


def test_variants_share_an_entry_and_remove_it(tmp_path: Path) -> None:
    _, report, _ = checked(tmp_path, PATH + WARNED + VARIANTS)
    assert codes(report) == ["W507"]  # of `strict`; `fine` has the entry, which the spec itself needs
    by_name = {task["name"]: task["warnings"] for task in report["tasks"]}  # type: ignore[attr-defined]
    assert by_name == {"Path": 0, "PathFine": 0, "PathStrict": 1}
    _, report, _ = checked(tmp_path, PATH + WARNED + VARIANTS, "--variant", "fine")
    assert codes(report) == ["W511"]


@pytest.mark.parametrize("options", [["-p", "n=1"], ["--quick"]])
def test_what_is_not_looked_for_is_not_missed(tmp_path: Path, options: list[str]) -> None:
    text = (
        PATH.replace("{a: stay}", "'go if n == 1 else stay'")
        .replace("expert: ", "expert: {a: ")
        .replace("stay'\n", "stay'}\n")
        + WARNED
    )
    assert codes(checked(tmp_path, text)[1]) == []
    assert codes(checked(tmp_path, text, *options)[1]) == []


def test_a_variant_lists_the_section(tmp_path: Path) -> None:
    text = PATH + "variants:\n  slow: {accept: {W507: it is slow}}\n"
    _, report, _ = checked(tmp_path, text)
    assert [d["notes"] for d in report["diagnostics"]] == [[]]  # type: ignore[attr-defined]


def test_a_figure_that_cannot_be_drawn_is_said_so_and_may_be_accepted(tmp_path: Path) -> None:
    drawn = PATH.replace("a: stay", "a: go") + "figure: {kind: grid, at: [s, 0]}\n"
    undrawn = drawn.replace("[s, 0]", "[9999 * s, 0]")
    accepted = undrawn + "accept: {W523: columns are metres in the source}\n"
    for text, found in ((drawn, []), (undrawn, ["W523"]), (accepted, [])):
        assert codes(checked(tmp_path, text)[1]) == found
        path = tmp_path / f"docs{len(text)}.yaml"  # a file is read once
        path.write_text(text, encoding="utf-8")
        made = CliRunner().invoke(app, ["docs", str(path), "--no-results", "-f", "svg", "-o", str(tmp_path / "out")])
        assert made.exit_code == 0
        assert ("W523" in made.stderr) == bool(found)
    report = exact.check(build(source.read_text(accepted, "path.yaml")))
    assert not report.diagnostics  # Python's `check` does not draw
