"""Claims that are none: what is said of them, and where."""

import pytest

from taskspec.base.diagnostics import Diagnostic
from taskspec.exact import verdicts
from tests.shared.diagnostics import codes
from tests.shared.sections import build_text

PATH = """
taskspec: 1
name: Path
parameters:
  n: {type: int, default: 3, low: 1, high: 9}
  require: [{condition: n != 7, message: not seven}]
state: {s: {type: int, low: 0, high: n}}
action: {a: {type: choice, values: [stay, go]}}
horizon: 2 * n
initial: {s: 0}
dynamics: {s': "min(s + (a == go), n)"}
reward: s' == n
claims:
  - CLAIM
"""


def wrong(claim: str) -> list[Diagnostic]:
    found = verdicts(build_text(PATH.replace("CLAIM", claim)))
    return [verdict.diagnostic for verdict in found if verdict.diagnostic is not None]


WRITTEN_OTHERWISE = [
    (
        "reachable(s == 3) == True",
        "is a condition by itself",
        "reachable(s == 3)",
        "write `reachable(s == 3)`, or `not ",
    ),
    ("1 == influences(a, s)", "is a condition by itself", "influences(a, s)", "write `influences(a, s)`, or `not "),
    (
        "1 + optimal_return() == 1",
        "a number, not a function",
        "optimal_return()",
        "write `optimal_return`, without brackets",
    ),
    ("probability(s = n) == 1", "probability has no argument 's'", "n", "`==` compares: `s == n`"),
    ("max(2, s = 1) == 1", "takes no keyword arguments", "max(2, s = 1)", "`==` compares"),
    ("max(1, optimal_return) == 1", "no other function", "optimal_return", "a claim of its own"),
    ("max(probability(s == 1), 0) == 1", "no other function", "probability(s == 1)", "a claim of its own"),
]


@pytest.mark.parametrize(("claim", "message", "place", "hint"), WRITTEN_OTHERWISE)
def test_results_where_they_cannot_stand(claim: str, message: str, place: str, hint: str) -> None:
    (found,) = wrong(claim)
    assert found.span is not None and found.hint is not None
    assert found.code == "E603"
    assert message in found.message
    assert hint in found.hint
    assert found.span.origin.line(found.span.line)[found.span.column - 1 : found.span.end_column - 1] == place


WRONG_SETTINGS = [
    ("{m: 3}", "m", "Path has no parameter 'm'", "its parameters are n"),
    ("{N: [3, 4]}", "N", "Path has no parameter 'N'", "did you mean 'n'?"),
    ("{n: 99}", "99", "parameter n must be at most 9, not 99", None),
    ("[{n: 3}, {n: [4, 0]}]", "0", "parameter n must be at least 1, not 0", None),
    ("{n: x}", "x", "parameter n must be an int, not 'x'", None),
    ("{n: 7}", "for", "not seven", None),
]


@pytest.mark.parametrize(("grid", "place", "message", "hint"), WRONG_SETTINGS)
def test_wrong_parameters_are_said_where_they_stand(grid: str, place: str, message: str, hint: str | None) -> None:
    found = wrong(f"{{claim: states > 0, for: {grid}}}")
    assert set(codes(found)) == {"E603"}
    for each in found:
        assert each.span is not None
        assert message in each.message and (hint is None or each.hint == hint)
        assert each.span.origin.line(each.span.line)[each.span.column - 1 : each.span.end_column - 1] == place
