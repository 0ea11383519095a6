"""Frozen tasks: what a spec of tables keeps of its task."""

from pathlib import Path

import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results
from taskspec.language.registry import task_ids
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.tools.exchange.freezing import freeze, pays_after_ends
from taskspec.tools.exchange.spec_text import task_of_tables
from tests.shared.commands import Done, spec
from tests.shared.sparse import sparse

PARTS = 4
RULES = ("optimal", "random", "worst")
ABSORBING = """\
taskspec: 1
name: Ends
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: int, low: 0, high: 2}}
legal: a <= s + 1
noise: {stop: Bernoulli(1/3)}
horizon: 4
initial: {s: {0: 1/2, 1: 1/2}}
dynamics: {s': "min(s + a, 3)"}
reward: s' - a
terminal: stop or s' == 3
absorbing_reward: s / 4
measures: {cost: a == 2, moved: {value: s' - s, doc: cells}}
"""


def assert_kept(task: Task, found: Task, lost: tuple[str, ...] = ()) -> None:
    """Assert that optimal, random and worst policies have the same returns and measures on both tasks."""
    known = Results(task, 1)
    results = Results(found, 1)
    assert (task.process.legal is None) == (found.process.legal is None)
    assert known.measures.keys() - set(lost) == results.measures.keys()
    for rule in RULES:
        pairs = [(getattr(known, rule), getattr(results, rule))]
        for name, measured in results.measures.items():
            pairs.append((known.measures[name][rule], measured[rule]))
        for expected, value in pairs:
            if expected is None:
                assert value is None
            else:
                assert value.value == pytest.approx(expected.value, abs=1e-8), (task.id, rule)


@pytest.mark.parametrize("part", sparse(range(PARTS), PARTS))
def test_shipped_tasks_keep_legal_actions_measures_and_absorbing_rewards(part: int) -> None:
    """The measure `performance` of ConveyorSushi alone depends on the time, which is said."""
    for name in task_ids()[part::PARTS]:
        task = load(name)
        if task.process.legal is None and not task.process.measures and not pays_after_ends(task):
            continue
        try:
            frozen = freeze(task)
        except SpecError as error:
            assert error.codes == ["E712"], name
            continue
        lost: tuple[str, ...] = ()
        if name == "safety/ConveyorSushi-v0":
            assert frozen.remarks == ("lost: the measure performance, which has no table over these states",)
            lost = ("performance",)
        assert bool(frozen.remarks) == bool(lost), name
        assert_kept(task, task_of_tables(frozen), lost)


@pytest.mark.parametrize("change", [
    ("", ""), ("reward: s'", "reward: (t + 1) * s'"), ("terminal: stop", "terminal: t == 2"),
    ("terminal: stop or s' == 3", "terminal: t == 2"), ("absorbing_reward: s / 4", "absorbing_reward: 1/3"),
    ("horizon: 4", "horizon: 4\ndiscount: 1/2\nobservation: {seen: s // 2}"),
])  # fmt: skip
def test_ends_that_absorb_pay_what_they_paid(change: tuple[str, str]) -> None:
    """States are entered with and without an end; with the modifier `absorbing`, before or after, returns are the same."""
    text = ABSORBING.replace(*change)
    if "seen" in text:
        text = text.replace("absorbing_reward: s / 4", "absorbing_reward: s / 4 - 1")
    task = build(read_text(text, "ends.yaml"))
    assert pays_after_ends(task)
    frozen = freeze(task)
    assert not frozen.remarks
    found = task_of_tables(frozen)
    assert_kept(task, found)
    absorbed = load(task, modifiers=["absorbing"])
    assert_kept(absorbed, load(found, modifiers=["absorbing"]))
    assert_kept(absorbed, task_of_tables(freeze(absorbed)))


def test_what_tables_do_not_have_is_said(tmp_path: Path) -> None:
    text = ABSORBING.replace("absorbing_reward: s / 4", "absorbing_reward: t").replace("cost: a == 2", "cost: a * t")
    path = spec(tmp_path, text)
    done = Done("freeze", path)
    assert "lost: the absorbing reward" in done.err
    assert "lost: the measure cost" in done.err
    assert "moved:" in done.out
    for kind in ("umb", "gym-p", "npz"):
        assert "absorbing reward: not in the file" in Done("export", path, "-f", kind, "-o", tmp_path / "file").err
    absorbed = Done("export", path, "-m", "absorbing", "-o", tmp_path / "file.umb")
    assert "absorbing reward" not in absorbed.err
