"""What Python reads, or other languages write, and this one refuses: each with what to write instead."""

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.types import Role
from tests.shared.sections import build_text, text


@pytest.mark.parametrize("written", ["true", "True"])
def test_truth_values_are_spelled_as_in_yaml_or_in_python(written: str) -> None:
    task = build_text(text(reward=f'"2 if s == 0 and {written} else (0 if {written} else 1)"'))
    same = build_text(text(reward='"2 if s == 0 and True else (0 if True else 1)"'))
    assert str(task.process.reward) == str(same.process.reward)
    choice = f'{{a: {{type: choice, values: ["{written}", other]}}}}'
    with pytest.raises(SpecError, match=f"`{written}` is a word of the language"):
        build_text(text(action=choice))


@pytest.mark.parametrize(("index", "rewards"), [
    ("(1, s % 2)", (8, 9)), ("[s % 2 for i in range(2)]", (8, 7)), ("where(s > 1, (1, 0), (0, 1))", (7, 9)),
    ("(1, 1) * (s % 2)", (8, 7)), ("(s % 2, -1)", (8, 7)),
])  # fmt: skip
def test_an_index_for_each_axis_may_be_a_vector_of_any_kind(index: str, rewards: tuple[int, int]) -> None:
    task = build_text(text(reward=f'"sum(put([[1, 2], [3, 4]], {index}, 5)[1])"'))
    for s, reward in zip((1, 2), rewards, strict=True):
        assert evaluate([task.process.reward], {(Role.STATE, "s"): (s,)}) == [(reward,)]
