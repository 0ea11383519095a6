"""Defaults that depend on other parameters follow them, wherever these are given."""

import pickle
from pathlib import Path

from taskspec import load
from taskspec.exact.rules.claim_verdicts import verdicts
from taskspec.exact.rules.examples import wrong_examples
from taskspec.exact.soundness.soundness import check_ranges
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.show.pages.write import write

GAMBLER = """
taskspec: 1
name: Gambler
parameters:
  G: {type: int, default: 100, low: 2, high: 1000}
  start: {type: int, default: G // 2, low: 1, high: G - 1}
state: {s: {type: int, low: 0, high: G}}
action: {a: {type: bool}}
horizon: 9
initial: {s: start}
dynamics: {s': s}
reward: s' == G // 2
claims:
  - {claim: optimal_return == 9, for: {G: [10, 50]}}
  - {claim: optimal_return == 0, for: [{G: 10, start: 3}]}
examples:
  - {for: [{G: 10}], initial: {s: 5}, probability: 1}
"""


def test_defaults_follow_the_parameters_that_they_depend_on(tmp_path: Path) -> None:
    """Half of 10 is 5, in claims, examples, other parameter settings and pages, and not half of 100."""
    task = build(source.read_text(GAMBLER))
    assert [v.status for v in verdicts(task)] == ["proved"] * 3
    assert not list(wrong_examples(task))
    assert [load(task, G=n).values["start"] for n in (10, 3)] == [5, 1]
    assert load(load(task, start=7), G=10).values == {"G": 10, "start": 7}
    assert pickle.loads(pickle.dumps(load(task, G=10))).values == {"G": 10, "start": 5}
    tried = {(values.get("G"), values.get("start")) for values in check_ranges(task).cases}
    assert (2, None) in tried
    assert write([task], ["html"], tmp_path, columns=[{"G": 10}])
