"""What is not checked is said, in the table and in the last line, and `--strict` fails where nobody asked for less."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.shared.commands import Done, spec

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
        (REPEATED, ["--limit", "expressions=6000"], 1, "1 tried, 1 not checked", "1 setting not checked"),
        (REAL, [], 0, "2 tried", "no errors, no warnings"),
        (WALK + CLAIMS, ["--quick"], 0, "3 not checked", "3 claims not checked"),
        (WALK + CLAIMS, ["-p", "n=4"], 0, "3 not checked", "3 claims not checked"),
    ],
)
def test_the_table_and_the_last_line_say_what_was_not_checked(
    text: str, options: list[str], status: int, column: str, last_line: str, tmp_path: Path
) -> None:
    done = Done("check", spec(tmp_path, text), "--strict", *options, columns=200)
    assert done.status == status, done.out
    *table, last = done.out.rstrip().splitlines()
    assert any(column in line for line in table), done.out
    assert last_line in last
