"""`fold` and `scan` beside Python's `reduce` and `accumulate`; the end of an episode, named in its reward."""

import itertools
from functools import reduce
from typing import Any

import pytest

import taskspec
from taskspec.exact import scores
from tests.shared.conformance import Agreement, ReferenceEnv
from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text

BRACKETS = """
summary: Write brackets that close; what is left open costs.
definitions:
  "depth(d, sign)": max(d - 1, 0) if sign == 2 else min(d + (sign == 1), 3)
  "halved(x, sign)": x / 2 + sign
state:
  word: {type: int, low: 0, high: 2, shape: 4}
  i: {type: int, low: 0, high: 4}
action:
  a: {type: int, low: 0, high: 2}
observation:
  depths: scan(depth, i // 2, word)
  total: "fold(halved, 1, word)"
horizon: 9
initial: {word: 0, i: 0}
dynamics:
  word': put(word, min(i, 3), a)
  i': min(i + 1, 4)
reward: (1 - fold(depth, 0, word')) if terminal else 0
terminal: i >= 3 and Bernoulli(1/2)
"""


def depth(d: int, sign: int) -> int:
    return max(d - 1, 0) if sign == 2 else min(d + (sign == 1), 3)


def test_folds_are_those_of_python() -> None:
    """And the reward is paid in the step that ends the episode, whatever ends it."""
    env: Any = taskspec.make(build_text(BRACKETS))
    ends = 0
    for seed, word in enumerate(itertools.product(range(3), repeat=4)):
        seen, _ = env.reset(seed=seed)
        written = [0] * 4
        for i in range(9):
            assert list(seen[:4]) == list(itertools.accumulate(written, depth, initial=min(i, 4) // 2))[1:]
            assert seen[4] == pytest.approx(reduce(lambda x, sign: x / 2 + sign, written, 1.0), rel=1e-6)
            written[min(i, 3)] = word[min(i, 3)]
            seen, reward, terminated, *_ = env.step(written[min(i, 3)])
            assert reward == (1 - reduce(depth, written, 0) if terminated else 0)
            if terminated:
                ends += 1
                break
    assert ends > 60


@pytest.mark.parametrize("backend", ["numpy", "numba", "jax"])
def test_backends_agree(backend: Any) -> None:
    pytest.importorskip(backend)
    Agreement(build_text(BRACKETS), backend, 5, "SameStep", one=ReferenceEnv).run(30)


def test_the_end_in_a_reward_is_the_condition_written_out() -> None:
    ended = BRACKETS.replace("i >= 3 and Bernoulli(1/2)", "i >= 3")
    written = ended.replace("if terminal else", "if i >= 3 else")
    found, expected = (scores(build_text(text)) for text in (ended, written))
    assert (found.optimal, found.random, found.worst) == (expected.optimal, expected.random, expected.worst)
    assert float(found.optimal.value) == 1


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        ("fold(depth, 0, word')", "fold(depth, 0, a)", "E306", "fold goes through a vector, not int"),
        ("fold(depth, 0, word')", "fold(max, 0, word')", "E306", "fold needs a definition with two arguments"),
        ("fold(depth, 0, word')", "fold(depht, 0, word')", "E306", "fold needs a definition with two arguments"),
        ("fold(depth, 0, word')", "fold(depth, 0)", "E304", "fold(f, start, x) was given 2 arguments"),
        ("scan(depth, i // 2, word)", "scan(depth, i, word)[4]", "E315", "index 4 is outside a vector of 4"),
        ("terminal: i >= 3 and Bernoulli(1/2)", "", "E302", "there is no section `terminal`"),
        ("i >= 3 and", "terminal and", "E302", "'terminal' can only be used in `reward`"),
        ("  i: {type", "  terminal: {type", "E309", "'terminal' means the end of the episode"),
    ],
)
def test_what_is_no_fold_and_no_end_is_said(old: str, new: str, code: str, words: str) -> None:
    found = refusal(build_text, BRACKETS.replace(old, new))
    assert code in found.codes
    assert any(words in d.message for d in found.diagnostics if d.code == code)
