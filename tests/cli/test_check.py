"""`taskspec check`: warnings that a spec accepts, what was not checked, what is proved, and symmetries."""

import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from taskspec import exact
from taskspec.cli.app import app
from taskspec.language import source
from taskspec.language.registry import tasks_root
from taskspec.language.task.build import build
from taskspec.show.pages.facts import gather
from taskspec.show.pages.page import page
from taskspec.tools.targets import OTHERS, files_of, kind_of, others_of
from tests.exact.check import test_accept, test_proofs
from tests.exact.check.test_symmetries import task_of
from tests.exact.check.test_symmetries_proved import BOX
from tests.shared.commands import Done, spec
from tests.shared.sections import whole_spec
from tests.shared.specs import spec_file

TIGER = spec_file("tiger").read_text(encoding="utf-8")


def test_without_targets_everything_that_is_shipped_is_checked() -> None:
    kinds = [kind_of(str(path)) for path in tasks_root().rglob("*.yaml")]
    assert len(files_of([])) == kinds.count("taskspec")
    assert {kind for _, kind in others_of([])} == set(OTHERS)


PATH = whole_spec(test_accept.PATH)
LADDER = whole_spec(test_proofs.LADDER)
RARE = whole_spec(test_proofs.RARE)
WARNED = "accept: {W507: the expert is a beginner}\n"


def checked(folder: Path, text: str, *options: str) -> tuple[int, dict[str, object], str]:
    path = spec(folder, text, f"{len(list(folder.iterdir()))}.yaml")  # a file is read once
    found = Done("check", path, "--json", *options)
    return found.status, found.data, Done("check", path, *options).out


def codes(report: dict[str, object]) -> list[str]:
    return [d["code"] for d in report["diagnostics"]]  # type: ignore[index, attr-defined]


def test_an_accepted_warning_is_set_aside_in_strict_checks_too(tmp_path: Path) -> None:
    status, report, _ = checked(tmp_path, PATH, "--strict")
    assert (status, codes(report), report["accepted"]) == (1, ["W507"], [])
    status, report, text = checked(tmp_path, PATH + WARNED, "--strict")
    assert (status, codes(report)) == (0, [])
    (accepted,) = report["accepted"]  # type: ignore[misc]
    line = PATH.partition("expert:")[0].count("\n") + 1
    assert (accepted["code"], accepted["because"], accepted["line"]) == ("W507", "the expert is a beginner", line)
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
    assert (status, found["code"], found["line"], found["column"]) == (1, "W511", text.count("\n"), 10)


VARIANTS = """\
variants:
  fine: {expert: {a: go}}
  strict: {accept: {W507: null}}
"""


def test_variants_share_an_entry_and_remove_it(tmp_path: Path) -> None:
    _, report, _ = checked(tmp_path, PATH + WARNED + VARIANTS)
    assert codes(report) == ["W507"]  # of `strict`; `fine` has the entry, which the spec itself needs
    path, fine, strict = report["tasks"]  # type: ignore[misc]
    assert (path["warnings"], fine["warnings"], strict["warnings"]) == (0, 0, 1)
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
    (found,) = report["diagnostics"]  # type: ignore[misc]
    assert found["notes"] == []


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


WALK = """\
taskspec: 1
name: Walk
parameters: {n: {type: int, default: 9, low: 1, high: 99}}
state: {s: {type: int, low: 0, high: n}}
action: {a: {type: choice, values: [stay, go]}}
horizon: n
initial: {s: 0}
dynamics: {s': 'min(s + (a == go), n)'}
reward: s' == n and s < n
"""
CLAIMS = "claims: [optimal_return == 1, {claim: optimal_return == 1, for: [{n: 2}, {n: 3}]}]\n"
ACCEPTED = "accept: {W529: it has too many states, W501: nobody looks for it}\n"
UNSOUND = WALK.replace("min(s + (a == go), n)", "s + 1 + (a == go)")
REAL = WALK.replace("s: {type: int,", "s: {type: real,")
FORBIDDEN = WALK.replace("99}", "99}, p: {type: real, default: 0.5, low: 0}, require: [{condition: p > 0, message: m}]")
REPEATED = WALK.replace("reward: ", "definitions: {much: 'sum([k * s for k in range(200)])'}\nreward: much >= 0 and ")

LARGE = "5 sanity checks not checked"


@pytest.mark.parametrize(
    ("text", "options", "status", "column", "last_line"),
    [
        (WALK + CLAIMS, [], 0, "3 proved", "no errors, no warnings"),
        (WALK, ["--limit", "transitions=15"], 1, "5 not checked", f"1 warning, {LARGE}"),
        (WALK, ["--limit", "seconds=0"], 1, "5 not checked", f"1 warning, {LARGE}"),
        (WALK + ACCEPTED, ["--limit", "transitions=15"], 0, "5 not checked", f"1 warning accepted, {LARGE}"),
        (WALK + CLAIMS, ["--limit", "transitions=15"], 1, "1 not decided", f"1 error, 1 warning, {LARGE}"),
        (UNSOUND + CLAIMS, [], 1, "3 not checked", "3 claims not checked"),
        (REPEATED, ["--limit", "expressions=1500"], 1, "2 tried, 1 not checked", "1 setting not checked"),
        (REAL, [], 0, "3 tried", "no errors, no warnings"),
        (FORBIDDEN, [], 0, "3 tried, 1 not checked", "no warnings, 1 setting not checked"),
        (WALK + CLAIMS, ["--quick"], 0, "3 not checked", "3 claims not checked"),
        (WALK + CLAIMS, ["-p", "n=4"], 0, "3 not checked", "3 claims not checked"),
    ],
)
def test_the_table_and_the_last_line_say_what_was_not_checked(
    text: str, options: list[str], status: int, column: str, last_line: str, tmp_path: Path
) -> None:
    done = Done("check", spec(tmp_path, text), "--strict", *options, columns=200)
    assert done.status == status, done.out
    table, _, last = done.out.rstrip().rpartition("\n")
    assert column in table, done.out
    assert last_line in last


STATUSES = {
    "exact and proved": (LADDER, "random_return == 2**-L", "proved", "exact", "proved"),
    "tested on episodes": (RARE, "random_return < 1e6", "tested", "estimated", "tested in 1000 episodes"),
    "undecided": (LADDER, "random_return < 0.1 * 10 * 2**-L", "undecided", "exact", "not decided"),
    "false": (LADDER, "random_return == 1", "false", "exact", "does not hold"),
    "contradicted": (RARE, "random_return > 1e6", "contradicted", "estimated", "does not hold"),
}


@pytest.mark.parametrize("name", STATUSES)
def test_statuses_are_the_same_wherever_they_are_told(name: str, tmp_path: Path) -> None:
    text, claim, of_claim, of_number, on_page = STATUSES[name]
    path = spec(tmp_path, f"{text}claims:\n  - {claim}\n")
    (told,) = Done("check", path, "--json").data["tasks"][0]["claims"]
    assert (told["status"], told["claim"]) == (of_claim, claim)
    assert Done("solve", path, "--json").data["random"]["status"] == of_number
    pattern = "exact" if of_number == "exact" else "(95 % CI,|in all of) 1,000 episodes"
    assert re.search(pattern, Done("solve", path).out)
    (verdict_,) = gather(build(source.read_file(path))).verdicts
    assert verdict_.text == on_page


def test_commands_tell_of_symmetries(tmp_path: Any) -> None:
    path = tmp_path / "box.yaml"
    path.write_text(
        whole_spec(BOX) + "symmetries: {s: {doc: turned, action: {i: 2 - i}}, wrong: {observation: {w: 0}}}\n"
    )
    right, wrong = Done("check", path, "--json").data["tasks"][0]["symmetries"]
    assert (right["symmetry"], right["status"]) == ("s", "proved")
    assert (wrong["symmetry"], wrong["status"]) == ("wrong", "false")
    assert "i ↦ 2 − i" in Done("show", path).out
    section = page(task_of("derail/ProcGoal-v0")).section("symmetries")
    assert section is not None and len(section.lines) == 2
