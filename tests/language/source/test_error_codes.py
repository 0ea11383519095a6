"""One broken spec per code: its first line says which code is expected, and where. One message each, at that place."""

from __future__ import annotations

from pathlib import Path

import pytest

import taskspec
from taskspec.base.codes import codes
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact import check as report
from taskspec.exact import soundness, verdicts
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.language.task.schema.check import check_shape
from taskspec.language.task.task import Task

FOLDER = Path(__file__).parents[2] / "errors"
FILES = sorted(FOLDER.glob("E[1234]*.yaml"))


def problems(document: source.Document, variant: str | None = None) -> tuple[Diagnostic, ...]:
    """What building a spec, or looking at all its states, complains about."""
    try:
        return tuple(soundness(build(document, variant)))
    except SpecError as error:
        return error.diagnostics


def test_every_code_of_specs_has_a_broken_spec() -> None:
    wanted = {f"{c.code}-{c.slug}" for c in codes().values() if c.code[:2] in ("E1", "E2", "E3", "E4")}
    assert {path.stem for path in FILES} == wanted


# -- the place is that of the sub-expression, however YAML writes the text around it ----------------------------------

WALK = """\
taskspec: 1
name: Walk
parameters: {L: {type: int, default: 9, low: 1}}
definitions:
  "reached(x)": x == L  # 1
  arrived: s == L
state:
  s: {type: int, low: 0, high: L}
  mood: {type: choice, values: [calm, "very cross"]}
action: {a: {type: choice, values: [stay, go]}}
observation:
  place: s / L  # 2
horizon: 2 * L
initial:
  s: 0
  mood: calm
dynamics:
  s': |
    min(s
      + (a == go),
      L)
  mood':
    by: [a, mood]
    rows:
      go: very cross
      stay: {calm: calm, very cross: {calm: 1/2, very cross: 1/2}}
reward:
  - if: reached(s')
    then: 1
  - else: 0 * s
terminal: >-
  arrived
    or s > 2 * L
variants:
  fast:
    dynamics:
      s': 'min(s + 2 * (a == go), L)'
    claims: [optimal_return == 1, "random_return < 1"]
"""
# (what the author wrote, what stands there instead, code, the characters pointed at, words of the message, variant)
MISTAKES: list[tuple[str, str, str, str, str, str | None]] = [
    ("horizon: 2", "horizn: 2", "E202", "horizn", "horizn", None),
    ("reached(x)\": x == L", "reached(x)\": x == M", "E302", "M", "'M' is not defined", None),
    ("min(s\n      + (a == go)", "min(s\n      + (b == go)", "E302", "b", "'b' is not defined", None),
    ("'min(s + 2 *", "'min(ss + 2 *", "E302", "ss", "'ss' is not defined", "fast"),
    ("    or s > 2 * L", "    or ss > 2 * L", "E302", "ss", "'ss' is not defined", None),
    ("place: s / L", "place: (s, L)[s] + (s, s, s) + (1, 2)", "E307", "(s, L)[s] + (s, s, s) + (1, 2)", "do not match", None),
    ("0 * s", "0 * s * (1, 2)", "E307", "0 * s * (1, 2)", "shape", None),
    ("{calm: 1/2, very cross: 1/2}", "{calm: 1/2, very cross: 0.4}", "E401", "{calm: 1/2, very cross: 0.4}", "0.9", None),
    ("      go: very cross", "      go: {calm: 0.5, very cross: calm}", "E306", "0.5", "labels", None),
    ("      + (a == go),", "      + (a == go), 1 +", "E403", "min(s\n      + (a == go), 1 +\n      L)", "10", None),
    ("'min(s + 2 * (a == go), L)'", "'s + 2 * (a == go)'", "E403", "s + 2 * (a == go)", "the next s is", "fast"),
    ("reached(s')", "reached(s', 1)", "E304", "reached(s', 1)", "2 arguments", None),
    ("stay: {calm: calm", "stay: {clam: calm", "E313", "clam", "'clam'", None),
    ("go: very cross", "go: very angry", "E301", "very angry", "expression", None),
    ("s: {type: int, low: 0, high: L}", "s: {type: int, low: 0, high: clip(L, 1, 9)}", "E106", "clip(L, 1, 9)", "splits", None),
]  # fmt: skip


GRIDS = {
    "block": ("|\n      #..\n      #x.\n", "x"),
    "short block": ("|\n      #..\n      #.\n", "#."),
    "list": ('["#..", "#x."]\n', "x"),
    "short list": ('["#..", "#."]\n', "#."),
}


@pytest.mark.parametrize("form", GRIDS)
def test_the_place_in_a_text_grid_is_the_character(form: str) -> None:
    grid, at = GRIDS[form]
    constants = f"constants:\n  map:\n    grid: {grid}    legend: {{'#': 1, .: 0}}\ndefinitions:"
    text = WALK.replace("definitions:", constants)
    (problem,) = problems(source.read_text(text))
    assert (problem.code, _written(text, problem)) == ({"x": "E203", "#.": "E307"}[at], at)


@pytest.mark.parametrize(
    ("old", "new", "code", "at", "words", "variant"), MISTAKES, ids=[m[1].strip() for m in MISTAKES]
)
def test_the_place_is_the_sub_expression(
    old: str, new: str, code: str, at: str, words: str, variant: str | None
) -> None:
    assert WALK.count(old) == 1
    text = WALK.replace(old, new)
    try:
        found = problems(source.read_text(text, "walk.yaml"), variant)
    except SpecError as error:
        found = error.diagnostics
    (problem,) = found
    assert problem.code == code
    assert problem.span is not None
    assert words in problem.message
    assert _written(text, problem) == at


def _written(text: str, problem: Diagnostic) -> str:
    span = problem.span
    assert span is not None
    starts = [0]
    for line in text.split("\n"):
        starts.append(starts[-1] + len(line) + 1)
    return text[starts[span.line - 1] + span.column - 1 : starts[span.end_line - 1] + span.end_column - 1]


def test_the_spec_without_mistakes_has_none() -> None:
    document = source.read_text(WALK)
    assert problems(document) == problems(document, "fast") == ()


def test_claims_are_placed_too() -> None:
    text = WALK.replace("random_return < 1", "random_retrun < 1")
    verdict = list(verdicts(build(source.read_text(text), "fast")))[1]
    assert verdict.diagnostic is not None
    assert (verdict.status, _written(text, verdict.diagnostic)) == ("broken", "random_retrun")


# -- several mistakes at once -----------------------------------------------------------------------------------------

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


def test_functions_that_nothing_calls_are_checked() -> None:
    found = [(p.code, _written(UNCALLED, p)) for p in problems(source.read_text(UNCALLED))]
    assert found[:4] == [("E302", "yy"), ("E303", "maxx"), ("E302", "j"), ("E304", "f(x)")]
    assert found[4:] == [("E304", "all(x > 0, x < 9)"), ("E305", "x")]


@pytest.mark.parametrize(("reward", "names"), [
    ("0 == ss == uu", ["ss", "uu"]), ("q1 < q2 <= q3", ["q1", "q2", "q3"]), ("q1 == q2 != s", ["q1", "q2"]),
    ("ss == calm", ["ss"]), ("ss == fast", ["ss"]),
])  # fmt: skip
def test_both_sides_of_a_comparison_are_checked(reward: str, names: list[str]) -> None:
    head = UNCALLED.replace(UNCALLED[UNCALLED.index("definitions") : UNCALLED.index("state:")], "")
    text = head.replace("reward: 0", f"reward: {reward}")
    assert [_written(text, p) for p in problems(source.read_text(text))] == names


@pytest.mark.parametrize(
    "use", ["fold(f, 0, (1, 2))", "scan(f, 0, (1, 2))[s]", "f(s, 1)", "2 * f(1, 1) + fold(f, 0, (s, s))"]
)
@pytest.mark.parametrize("name", ["f", '"f(x, y)"'])
def test_a_broken_definition_is_all_that_is_wrong(name: str, use: str) -> None:
    text = UNCALLED.replace(
        UNCALLED[UNCALLED.index('  "f(x') : UNCALLED.index("state:")], f'  {name}: "lambda x, y: x + y"\n'
    )
    found = problems(source.read_text(text.replace("reward: 0", f"reward: {use}")))
    assert [p.code for p in found] == ["E316"]


# -- what to do about it ----------------------------------------------------------------------------------------------

GRID = """\
taskspec: 1
name: Grid
parameters: {N: {type: int, default: 4, low: 2}}
definitions:
  "far(q)": norm1(q)
state:
  p: {type: int, shape: [2], low: 0, high: N - 1}
  mood: {type: choice, values: [calm, cross]}
action:
  move: {type: choice, values: {up: [-1, 0], right: [0, 1]}}
horizon: 4 * N
initial:
  p: (0, 0)
  mood: calm
dynamics:
  p': clip(p + move, 0, N - 1)
  mood':
    by: [mood, move]
    rows:
      calm: {up: cross, else: calm}
      cross: calm
reward: -far(p')
terminal: all(p' == (0, 3))
figure: {kind: grid, at: p, highlight: {good: "all(p == N)"}}
"""
HINTS: list[tuple[str, str, str, str, str | None]] = [
    ("horizon: 4 * N", "horizon: 1e3", "E204", "1e3", None),
    ("horizon: 4 * N", "horizon: 4N", "E301", "4N", "a product is written `4 * N`"),
    ("horizon: 4 * N", "horizon: N × 4", "E301", "×", "write `*`"),
    ("-far(p')", "−far(p')", "E301", "−", "write `-`"),
    ("all(p' == (0, 3))", "on", "E302", "on", None),
    ("all(p' == (0, 3))", "No", "E302", "No", None),
    ("all(p' == (0, 3))", "mood == happy", "E313", "happy", None),
    ("      cross: calm", "      happy: calm", "E313", "happy", None),
    ("by: [mood, move]", "by: [mood]", "E208", "{up: cross, else: calm}", "add to `by` what these rows look at"),
    (
        "      calm: {up: cross, else: calm}",
        "      calm: {up: cross}",
        "E410",
        "calm",
        "add the row, or `else:`",
    ),
    (
        "mood: calm\n",
        "mood: 1 / 2\n",
        "E306",
        "1 / 2",
        "`floor(x)` and `round(x)` give ints",
    ),
    (
        "clip(p + move, 0, N - 1)",
        "put(p, 0, 0.5)",
        "E306",
        "put(p, 0, 0.5)",
        "declare 'p' `type: real` if it is to hold reals",
    ),
    ("clip(p + move, 0, N - 1)", "p / 2", "E306", "p / 2", "`x // y` divides ints, rounded down"),
    ("high: N - 1}", "high: 10**30}", "E318", "10**30", "a real has no such limit"),
    ("norm1(q)", "np.abs(q)", "E316", "np.abs", "write `abs(x)`"),
    ("norm1(q)", "norm1(q) + Normal()", "E311", "Normal()", None),
    (
        "clip(p + move, 0, N - 1)",
        "clip(0, N - 1, p + move)",
        "E403",
        "clip(0, N - 1, p + move)",
        "`clip(x, low, high)` has the value first, then the bounds that it keeps to",
    ),
    ("mood: calm\n", "mood: 'Uniform({calm, cross}) if Bernoulli(1/0) else calm'\n", "E402", "Bernoulli(1/0)", None),
    ("-far(p')", "Normal(0, 1/0)", "E408", "Normal(0, 1/0)", None),
    ("-far(p')", "Uniform(-inf, 0)", "E408", "Uniform(-inf, 0)", None),
    ("-far(p')", "UniformInt(0, 2**31)", "E408", "UniformInt(0, 2**31)", None),
    ("p: (0, 0)", "p: (0, 99)", "E404", "(0, 99)", None),
    ("-far(p')", "-far(p') / 0", "E406", "-far(p') / 0", None),
    ("kind: grid", "kind: gird", "E206", "gird", "did you mean 'grid'?"),
    ("at: p", "att: p", "E202", "att", "did you mean 'at'?"),
    ("at: p, ", "", "E203", "figure", None),
    ("at: p", "at: [p, 0]", "E307", "[p, 0]", None),
    ("at: p", "at: mood", "E307", "mood", None),
    ("good:", "god:", "E202", "god", "did you mean 'good'?"),
    ("p == N)", "p == n)", "E302", "n", "did you mean 'N'?"),
    ("at: p", "at: p, map: walls", "E302", "walls", None),
    (
        "figure: {kind: grid",
        "constants: {m: [[0, 10]]}\nfigure: {map: m, kind: grid",
        "E204",
        "m",
        "m: {grid: [...], legend: {...}}",
    ),
]


@pytest.mark.parametrize(("old", "new", "code", "place", "hint"), HINTS, ids=[f"{n}" for _, n, *_ in HINTS])
def test_messages_say_what_to_do(old: str, new: str, code: str, place: str, hint: str | None) -> None:
    text = GRID.replace(old, new, 1)
    document = source.read_text(text)
    (problem,) = check_shape(document) or check(build_or_say(document))
    assert (problem.code, _written(text, problem)) == (code, place)
    assert hint is None or problem.hint == hint


def build_or_say(document: source.Document) -> Task | tuple[Diagnostic, ...]:
    try:
        return build(document)
    except SpecError as error:
        return error.diagnostics


def check(found: Task | tuple[Diagnostic, ...]) -> tuple[Diagnostic, ...]:
    """What a whole check says about a task, all that is warned of included."""
    return report(found).diagnostics if isinstance(found, Task) else found


def test_mistakes_in_an_abstraction_are_said_to_be_there() -> None:
    text = GRID + "abstraction:\n  state: {d: {type: int, low: 0, high: 6}}\n  map: {d: far(p)}\n"
    found = report(build(source.read_text(text))).diagnostics
    assert found and all("this is about the abstraction" in d.notes[-1] for d in found if d.severity == "error")


def test_a_misspelt_result_in_a_claim_gets_a_suggestion() -> None:
    text = GRID + "claims: [optimal_retrun < 0]\n"
    (problem,) = report(build(source.read_text(text))).diagnostics
    assert (problem.code, problem.hint) == ("E603", "did you mean 'optimal_return'?")


@pytest.mark.parametrize("section", ["state", "action"])
def test_a_task_has_a_state_and_an_action(section: str) -> None:
    lines = {"state": "state: {n: {type: bool}}", "action": "action: {a: {type: bool}}", section: f"{section}: {{}}"}
    text = "taskspec: 1\nname: X\n" + "\n".join(lines.values()) + "\nhorizon: 5\ninitial: {}\ndynamics: {}\nreward: 1\n"
    found = problems(source.read_text(text))
    assert ("E210", f"`{section}:` names no component") in [(p.code, p.message) for p in found]


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
    env = taskspec.make(build(source.read_text(text)))
    assert env.reset(seed=0)[0].tolist() == [0, 3, 3, 2]
