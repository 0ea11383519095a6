"""Several mistakes at once, and each at its place."""

import pytest

import taskspec
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact import soundness
from taskspec.language import source
from taskspec.language.task.build import build
from tests.shared.diagnostics import codes, with_code
from tests.shared.sections import build_text


def problems(document: source.Document, variant: str | None = None) -> tuple[Diagnostic, ...]:
    """What building a spec, or looking at all its states, complains about."""
    try:
        return tuple(soundness(build(document, variant)))
    except SpecError as error:
        return error.diagnostics


def _written(text: str, problem: Diagnostic) -> str:
    span = problem.span
    assert span is not None
    starts = [0]
    for line in text.split("\n"):
        starts.append(starts[-1] + len(line) + 1)
    return text[starts[span.line - 1] + span.column - 1 : starts[span.end_line - 1] + span.end_column - 1]


UNCALLED = """taskspec: 1
name: C
parameters: {mode: {type: choice, values: [slow, fast], default: slow}, n: {type: int, default: 3}}
definitions:
  "f(x, y)": x + yy * maxx(x) if mode == fast else sum([i * j for i in range(n)])
  "g(x)": f(x) + pi + s' + t
  "h(x)": x == calm or x == slow
  "k(x)": all(x > 0, x < 9) or abs(x=1) or not any([x]) or min(x) > max(x, 1, 2)
state:
  s: {type: int, low: 0, high: 9}
  m: {type: choice, values: [calm, angry]}
action: {a: {type: int, low: 0, high: 1}}
horizon: 12
initial: {s: 0, m: calm}
dynamics: {s': (s + 1) % 10}
reward: 0
"""


def told(text: str) -> list[tuple[str, str]]:
    """The codes of problems, and the marked text."""
    return [(problem.code, _written(text, problem)) for problem in problems(source.read_text(text))]


def test_functions_that_nothing_calls_are_checked() -> None:
    found = told(UNCALLED)
    assert found[:4] == [("E302", "yy"), ("E303", "maxx"), ("E302", "j"), ("E304", "f(x)")]
    assert found[4:] == [("E304", "all(x > 0, x < 9)"), ("E305", "x")]


@pytest.mark.parametrize(("reward", "names"), [
    ("0 == ss == uu", ["ss", "uu"]), ("q1 < q2 <= q3", ["q1", "q2", "q3"]), ("q1 == q2 != s", ["q1", "q2"]),
    ("ss == calm", ["ss"]), ("ss == fast", ["ss"]),
])  # fmt: skip
def test_both_sides_of_a_comparison_are_checked(reward: str, names: list[str]) -> None:
    head = UNCALLED.replace(UNCALLED[UNCALLED.index("definitions") : UNCALLED.index("state:")], "")
    text = head.replace("reward: 0", f"reward: {reward}")
    assert [marked for _, marked in told(text)] == names


@pytest.mark.parametrize(
    "use", ["fold(f, 0, (1, 2))", "scan(f, 0, (1, 2))[s]", "f(s, 1)", "2 * f(1, 1) + fold(f, 0, (s, s))"]
)
@pytest.mark.parametrize("name", ["f", '"f(x, y)"'])
def test_a_broken_definition_is_all_that_is_wrong(name: str, use: str) -> None:
    text = UNCALLED.replace(
        UNCALLED[UNCALLED.index('  "f(x') : UNCALLED.index("state:")], f'  {name}: "lambda x, y: x + y"\n'
    )
    found = problems(source.read_text(text.replace("reward: 0", f"reward: {use}")))
    assert codes(found) == ["E316"]


@pytest.mark.parametrize("section", ["state", "action"])
def test_a_task_has_a_state_and_an_action(section: str) -> None:
    lines = {"state": "state: {n: {type: bool}}", "action": "action: {a: {type: bool}}", section: f"{section}: {{}}"}
    text = "taskspec: 1\nname: X\n" + "\n".join(lines.values()) + "\nhorizon: 5\ninitial: {}\ndynamics: {}\nreward: 1\n"
    found = problems(source.read_text(text))
    assert f"`{section}:` names no component" in with_code(found, "E210")[0].message


def test_what_can_be_one_value_only_starts_as_it() -> None:
    text = """\
taskspec: 1
name: X
state: {s: {type: choice, values: [only]}, n: {type: int, low: 3, high: 3, shape: 2}, x: {type: real, low: 2, high: 2}}
action: {a: {type: bool}}
horizon: 5
initial: {}
dynamics: {}
reward: a
"""
    env = taskspec.make(build_text(text))
    assert env.reset(seed=0)[0].tolist() == [0, 3, 3, 2]
