"""W510: an index that is moved is warned of where it matters, with the values for which it is, and nowhere else."""

import pytest

from taskspec.exact import check
from tests.shared.diagnostics import with_code
from tests.shared.sections import build_text

SPEC = """
constants:
  v: [1, 2, 3]
state:
  s: {{type: int, low: 0, high: 3}}
  x: {{type: real{bounds}}}
action:
  a: {{type: choice, values: {{back: -1, go: 1}}}}
horizon: {horizon}
initial:
  s: 1
  x: 0
dynamics:
  s': clip(s + a, 1, 3)
  x': clip(x + a / 2, 0, 5)
reward: {reward}
terminal: s' == 3
"""


def warnings(reward: str, horizon: str = "9", bounds: str = ", low: 0, high: 0") -> list[str]:
    text = SPEC.format(reward=reward, horizon=horizon, bounds=bounds)
    if bounds == ", low: 0, high: 0":  # nothing but one value, so that there is an exact model
        text = text.replace("  x': clip(x + a / 2, 0, 5)\n", "").replace(
            "real, low: 0, high: 0", "int, low: 0, high: 0"
        )
    report = check(build_text(text), claims=False)
    assert not report.errors
    return [d.message for d in with_code(report.warnings, "W510")]


MOVED = {
    "v[s - 2]": "for s = 1, this index is -1; it is moved to 0",
    "v[2 * s]": "for s = 2, this index is 4; it is moved to 2",
    "v[s + a - 1]": "for s = 1, a = back, this index is -1; it is moved to 0",
    "v[s' + 1]": "this index is 3; it is moved to 2",
    "v[t - 1]": "for t = 0, this index is -1; it is moved to 0",
    "v[t]": "for t = 3, this index is 3; it is moved to 2",
    "v[[s, s - 2]][0]": "for s = 1, this index is -1; it is moved to 0",
    "put(v, s - 2, 9)[0]": "for s = 1, this index is -1; it is moved to 0",
    "v[s - UniformInt(0, 2)]": "this index is -1; it is moved to 0",
    "v[s - 2] if s < 2 else 0": "for s = 1, this index is -1; it is moved to 0",
    "sort(put(v, s - 2, 9) if s < 3 else v)[0]": "for s = 1, this index is -1; it is moved to 0",
    "sort(where(v > 1, v, v[s - 2]))[0]": "for s = 1, this index is -1; it is moved to 0",
    "s > 0 and v[s - 2] > 1": "for s = 1, this index is -1; it is moved to 0",
}


@pytest.mark.parametrize("reward", MOVED)
def test_an_index_that_is_moved(reward: str) -> None:
    (message,) = warnings(reward)
    assert MOVED[reward] in message


@pytest.mark.parametrize(
    "reward",
    [
        "v[s]", "v[-1]", "v[s - 1]", "v[clip(s - 2, 0, 2)]", "v[s - 2] if s >= 2 else 0",
        "sort(put(v, s - 2, 9) if s >= 2 else v)[0]", "s > 1 and v[s - 2] > 1",
        "s < 2 or v[s - 2] > 1", "v[s - 3]" + " if s == 3 else v[s]",  # an episode that has come to 3 is over
    ],
)  # fmt: skip
def test_an_index_that_is_not(reward: str) -> None:
    assert warnings(reward) == []


@pytest.mark.parametrize(
    ("reward", "count"), [("v[floor(x) - 1]", 1), ("v[floor(x) // 2]", 0), ("v[floor(4 * x) + 1]", 1)]
)
def test_where_there_is_no_exact_model(reward: str, count: int) -> None:
    assert len(warnings(reward, bounds=", low: 0, high: 5")) == count


def test_the_place_is_that_of_the_index() -> None:
    text = SPEC.format(reward="1 + v[s - 2]", horizon="9", bounds="")
    (found,) = with_code(check(build_text(text), claims=False).diagnostics, "W510")
    assert found.span is not None
    assert text.splitlines()[found.span.line - 1][found.span.column - 1 :] == "s - 2]"
