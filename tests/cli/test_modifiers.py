"""Modifiers: every entry of the table, on every DERAIL task that it applies to, and what it says it keeps."""

from __future__ import annotations

import pytest

import taskspec
from taskspec.exact import Results
from taskspec.exact.scores.partial_observability import SEARCHES, best_observing
from taskspec.language.modifiers import keeps_observers
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.pages.page import page
from taskspec.show.pages.prose import CodeSpan
from tests.exact.policies.test_memory import TURNS, tiger
from tests.language.modifiers.test_modifiers import (
    GIVEN,
    OBSERVED,
    found,
    small,
)


@pytest.mark.parametrize(("task_id", "name"), GIVEN)
def test_the_page_prints_the_modifier(task_id: str, name: str) -> None:
    task = found(task_id, name)
    printed = page(task)
    section = printed.section("modifiers")
    assert section is not None and len(section.lines) == 2
    assert section.lines[0].content[0] == CodeSpan(str(task.modifiers[0]))
    assert f"modifiers=[{str(task.modifiers[0])!r}]" in printed.make
    before = page(small(task_id))
    assert before.section("modifiers") is None
    assert printed.section("dynamics") == before.section("dynamics")  # the rest is the task as written


@pytest.mark.parametrize("written", sorted(OBSERVED))
def test_what_is_said_of_those_who_see_observations_alone_is_so(written: str) -> None:
    """A task that pays for alternation: who remembers what was done earns all of it, and who does not, less."""
    task = build(read_text(TURNS))
    assert keeps_observers(task, written)
    twin = Results(taskspec.modify(task, written))
    for which in SEARCHES:
        assert best_observing(twin, which) == best_observing(Results(task), which)


def test_a_permutation_for_each_state_is_kept_from_those_who_do_not_see_the_state() -> None:
    anew = "permuted_actions=2,per_state=true"
    assert keeps_observers(small("derail/RiskyPath-v0"), anew)
    assert not keeps_observers(tiger(), anew)
    before, after = (best_observing(Results(t), "remembering") for t in (tiger(), taskspec.modify(tiger(), anew)))
    assert before != after
    assert not any(keeps_observers(tiger(), each) for each in ("sticky=0.25", "observation_noise=1", "time_observed"))
