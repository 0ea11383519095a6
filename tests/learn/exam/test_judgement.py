"""Judgement of all runs: when a mistake is named, with which others, and when none is."""

import pytest

from taskspec.learn.exam.judgement import Run, judged
from taskspec.learn.exam.operators import GOOD

Distances = dict[str, float]
FITS: Distances = {"right": 0.8, "limit is an end": 0.05}
HALF: Distances = {"right": 0.4, "limit is an end": 0.15}
TELLS_NOTHING: Distances = {"right": 0.02}


def names(*tasks: Distances, seeds: int = 5, values: int = 4) -> tuple[str, ...]:
    """Return what is named after some runs on each task, all of them alike."""
    runs = []
    for number, distances in enumerate(tasks):
        runs += [Run(f"task {number}", distances, dict.fromkeys(distances, values))] * seeds
    return judged(runs, GOOD).names


@pytest.mark.parametrize(
    ("expected", "tasks"),
    [
        (("limit is an end",), [FITS, *[TELLS_NOTHING] * 9]),  # tasks that cannot show it do not dilute it
        (("limit is an end",), [FITS, FITS, {"right": 0.9, "limit is an end": 0.7}, TELLS_NOTHING]),  # one is unfinished
        (("limit is an end",), [FITS, {"right": 0.02, "limit is an end": 0.01}]),  # one that both explain
        ((), [FITS, {"right": 0.02, "limit is an end": 0.6}]),  # one contradicts it
        ((), [FITS, FITS, {"right": 0.3, "limit is an end": 0.9}]),  # one where neither explains, and it is far worse
        ((), [FITS, {"right": 0.9, "limit is an end": 0.7}]),  # as many are unfinished
        ((), [FITS, {"right": 0.6}]),  # where it makes no difference, values are wrong
        ((), [{"right": 1.0, "one outcome": 0.0}, {"right": 0.6}]),
        (("one outcome",), [{"right": 1.0, "one outcome": 0.0}, TELLS_NOTHING]),
        ((), [{"right": 0.3, "limit is an end": 0.18}]),  # it is merely nearer
        (("limit is an end", "mask late"), [{**FITS, "mask late": 0.08}]),  # a tie
        (("limit is an end",), [{**FITS, "mask late": 0.08}, {**FITS, "mask late": 0.9}]),
        (("limit is an end",), [*[HALF] * 2, *[TELLS_NOTHING] * 4, {"right": 0.7, "undiscounted": 0.3}]),  # no tie: too far
        (("limit is an end",), [{**FITS, "grows": 0.0}]),  # vague, and not said beside another
        (("grows",), [{"right": 1.0, "grows": 0.0}]),
        (("another discount",), [{"right": 1.0, "immediate reward": 0.15, "another discount": 0.0}] * 2),  # nearer by far
        (("immediate reward",), [{"right": 1.0, "immediate reward": 0.02, "another discount": 0.0}] * 2),
        ((), [{**FITS, "mask late": 0.05, "mask early": 0.05, "all states": 0.05}]),  # too many ties
        (("on policy",), [{"right": 0.3, "on policy": 0.05, "limit is an end": 0.02}]),  # what is right explains it
        ((), [{"right": 0.4, "until the limit": 0.3}]),
    ],
)  # fmt: skip
def test_a_name_needs_everything_to_speak_for_it(expected: tuple[str, ...], tasks: list[Distances]) -> None:
    assert names(*tasks) == expected


def test_few_runs_and_few_values_name_nothing() -> None:
    assert names(FITS, seeds=4) == ()
    assert names(FITS, FITS, seeds=3) == ("limit is an end",)
    assert names(FITS, values=2) == ()
    free = {"right": 0.8, "one pair": 0.0}  # the fit chooses a value of each task
    assert names(free, free, values=2) == ()
    assert names(free, values=9) == ()
    assert names(free, free, values=3) == ("one pair",)


def test_the_nearest_are_listed_where_none_is_named() -> None:
    run = Run("task", {"right": 0.5, "mask late": 0.3, "limit is an end": 0.4, "all states": 0.9}, {})
    found = judged([run] * 5, GOOD)
    assert found.names == () and found.nearest == (("mask late", 0.3), ("limit is an end", 0.4))
