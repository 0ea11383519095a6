"""Commas between braces and brackets: what YAML cuts in pieces is reported whole, all of it at once, and ready to be pasted."""

import re

import pytest

from taskspec.language.source import read_text
from taskspec.language.task.task import Task
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text


def load(text: str) -> Task:
    return build_text(text)


SPEC = """
taskspec: 1
name: Commas
parameters:
  L: {type: int, default: 5, low: 1, doc: length}
state:
  s: {type: int, low: 0, high: max(L, 3), doc: the position (row, column)}
  v: {type: int, low: 0, high: 9, shape: [4]}
action:
  a: {type: choice, values: {left: -1, right: 1}, doc: where to}
horizon: 2 * L
initial: {s: 0, v: 0}
dynamics: {s': clip(s + a, 0, L), v': clip(v, 0, v[0] + 9)}
observation:
  x: [v[i] for i in range(0, 4)]
  y: {value: [min(v[i], 3) for i in range(4)], low: 0, high: 3}
reward: Categorical({0: 1/2, 1: 1/2})
expert: {a: right}
claims:
  - {claim: probability(s == 1, under=expert) >= 0, where: Section 2}
"""


def pasted(text: str) -> str:
    """The text with every text in quotes that a hint shows in quotes."""
    failure = refusal(read_text, text, "spec.yaml")
    for each in failure.diagnostics:
        written = re.search(r"put this text in quotes: (\".*\")$", each.hint or "")
        assert written, each
        plain = written[1][1:-1]
        assert text.count(plain) == 1
        text = text.replace(plain, written[1])
    return text


def test_one_run_reports_all_commas_and_its_hints_are_ready_to_be_pasted() -> None:
    data = read_text(pasted(SPEC), "spec.yaml").data
    assert data["state"]["s"] == {
        "type": "int", "low": 0, "high": "max(L, 3)", "doc": "the position (row, column)",
    }  # fmt: skip
    assert data["dynamics"] == {"s'": "clip(s + a, 0, L)", "v'": "clip(v, 0, v[0] + 9)"}
    assert data["observation"]["x"] == ["v[i] for i in range(0, 4)"]
    assert data["observation"]["y"] == {"value": ["min(v[i], 3) for i in range(4)"], "low": 0, "high": 3}
    assert data["reward"] == "Categorical({0: 1/2, 1: 1/2})"
    assert load(pasted(SPEC)).observation_space.shape == (8,)


@pytest.mark.parametrize(
    ("text", "code", "quoted"),
    [
        ("d: [sum([v[i] for i in range(3)]), 2]\n", "E106", ': "sum([v[i] for i in range(3)])"'),
        ("d: {x: f(a, 0), y: f(b, 0), z: 1}\n", "E106", ': "f(b, 0)"'),
        ('d: {x: f("a", 0)}\n', "E106", ": 'f(\"a\", 0)'"),
    ],
)  # fmt: skip
def test_what_belongs_together_is_quoted_together(text: str, code: str, quoted: str) -> None:
    last = refusal(read_text, text, "spec.yaml").diagnostics[-1]
    assert last.code == code
    assert last.hint is not None
    assert last.hint.endswith(quoted)


def test_a_key_without_a_value_is_no_text_with_a_comma() -> None:
    assert refusal(read_text, "d: {low: 0, high}\n", "spec.yaml").codes == ["E107"]


def test_reading_again_is_bounded() -> None:
    assert refusal(read_text, "- " + "a" * 900_000 + "\n" + "- *z\n" * 1000, "spec.yaml").codes == ["E102"] * 2
    assert len(refusal(read_text, "- *z\n" * 1000, "spec.yaml").diagnostics) == 50


WALK = """
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 2
initial: {s: 0}
dynamics: {s': "min(s + a, 3)"}
reward: a
observation:
  here: HERE
"""


@pytest.mark.parametrize(
    "written",
    [
        "[s == i for i in range(4)]",
        '["s == i for i in range(4)"]',
        '"[s == i for i in range(4)]"',
        "\n    - s == i for i in range(4)",
    ],
)
def test_a_list_of_one_comprehension_is_the_comprehension(written: str) -> None:
    task = load(WALK.replace("HERE", written))
    assert task.observation_space.shape == (4,)


def test_a_comprehension_in_its_own_brackets_is_one_row() -> None:
    assert load(WALK.replace("HERE", '["[s == i for i in range(4)]"]')).observation_space.shape == (1, 4)


def test_a_mistake_in_a_comprehension_is_where_it_is_written() -> None:
    (found,) = refusal(load, WALK.replace("HERE", "[s == k for i in range(4)]")).diagnostics
    assert found.span is not None
    assert (found.code, found.span.line, found.span.column, found.span.end_column) == ("E302", 9, 15, 16)
