"""What a spec may cost: each limit is reached before the cost is spent, says how to raise it, and can be raised."""

from __future__ import annotations

from typing import Any

import pytest

from taskspec.base import limits
from taskspec.base.diagnostics import SpecError
from taskspec.base.limits import Limits, changed, table
from tests.base.test_limits import REACHED, instances


def test_every_limit_is_reached() -> None:
    assert REACHED.keys() == {row.name for row in table() if not row.fixed}


@pytest.mark.parametrize("name", REACHED)
def test_a_limit_refuses_says_how_to_raise_it_and_can_be_raised(name: str, set_limits: Any) -> None:
    little, enough, code, act = REACHED[name]
    set_limits(**{name: enough})
    assert act() is not False
    set_limits(**{name: little})
    if not code:  # samples stand in
        assert act() is False
        return
    with pytest.raises(SpecError) as caught:
        act()
    assert {d.code for d in caught.value.diagnostics} == {code}
    if code != "E410":  # a table that is too large is no look-up, and needs its `else`
        assert f"{limits.VARIABLE}={name}=" in (caught.value.diagnostics[0].hint or "")


def test_what_the_hint_says_is_enough(set_limits: Any) -> None:
    for name in (
        "variants",
        "claims",
        "candidates",
        "unrolled",
        "width",
        "one_hot",
        "transitions",
        "lanes",
        "episodes",
    ):
        little, _, _, act = REACHED[name]
        set_limits(**{name: little})
        with pytest.raises(SpecError) as caught:
            act()
        hint = caught.value.diagnostics[0].hint or ""
        said = changed(Limits(), hint[hint.index("=") + 1 : hint.index(" allows")])
        set_limits(**{name: getattr(said, name)})
        act()


def test_values_of_a_modifier_are_counted_before_they_are_written_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskspec.learn.experiments.instances.modifier", lambda *_: pytest.fail("written out"))
    with pytest.raises(SpecError, match="1,000,000 instances are too many"):
        instances("Branching, modifiers: [{delay: {range: [1, 1000001]}}]")
    with pytest.raises(SpecError, match="1,000,000 instances are too many"):
        instances("Branching, modifiers: [{distractors: {count: {range: [0, 1000]}, scale: {range: [0, 1000]}}}]")
