"""Audits find every planted fault and fact, and nothing in the right versions and in Gymnasium's environments."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from taskspec.tools.audit import subject as subjects
from taskspec.tools.audit import tabulate
from taskspec.tools.audit.evidence import Evidence
from taskspec.tools.audit.report import Audit, examined
from taskspec.tools.audit.subject import Deadline, Subject, frozen
from taskspec.tools.audit.tabulate import TableSearch, Untabulated
from tests.shared.commands import Done
from tests.shared.sparse import sparse
from tests.tools.audit.environments import PLANTED, RIGHT

PLACE = Path(__file__).with_name("environments.py")
pytestmark = pytest.mark.filterwarnings("ignore")


def audit(name: str, seconds: float = 5.0, **kwargs: object) -> Audit:
    return examined(Subject(name, kwargs), seconds)


def names(found: Audit, kind: str | None = None) -> set[str]:
    return {entry.check.name for entry in found.entries if kind in (None, entry.check.kind)}


def entry_of(subject: Subject, check: str) -> Any:
    """What is told of one check."""
    return next(entry for entry in examined(subject, 5.0).entries if entry.check.name == check)


@pytest.mark.parametrize("planted", sparse(PLANTED, 7), ids=lambda each: each.__name__)
def test_what_is_planted_is_found(planted: type) -> None:
    found = audit(f"{PLACE}:{planted.__name__}")
    assert PLANTED[planted] in names(found)
    assert names(found, "fault") <= {PLANTED[planted]}, "nothing else is accused"


@pytest.mark.parametrize("right", sparse(RIGHT, 2), ids=lambda each: each.__name__)
def test_right_versions_are_clean(right: type) -> None:
    assert names(audit(f"{PLACE}:{right.__name__}")) == set()


TOYS = ("FrozenLake-v1", "Taxi-v4", "Blackjack-v1", "CliffWalking-v1")
CONTROL = ("CartPole-v1", "Acrobot-v1", "Pendulum-v1", "MountainCarContinuous-v0", "MountainCar-v0")


@pytest.mark.parametrize("name", sparse([*TOYS, *CONTROL], 4))
def test_nothing_is_wrong_with_the_environments_of_gymnasium(name: str) -> None:
    if name not in gymnasium.registry:
        pytest.skip("not in this version of Gymnasium")
    found = audit(name, 5.0)
    assert names(found, "fault") == set()
    assert names(found) <= {"unreached", "returns"}


def test_a_table_by_copies_has_the_values_of_the_own_one() -> None:
    lake = Evidence(Subject("FrozenLake-v1", {"is_slippery": False}), 60.0)
    expected = lake.solved
    assert lake.table is not None and lake.table.declared == 16
    subject = Subject(f"{PLACE}:lake_without_table", {})
    copied = Evidence(subject, 60.0)
    assert copied.table is not None and copied.table.declared is None
    assert copied.solved is not None and expected is not None
    assert copied.solved.best == expected.best == 1.0
    assert copied.solved.random == pytest.approx(expected.random, abs=1e-12)
    assert copied.solved.constant == pytest.approx(expected.constant, abs=1e-12)


def test_a_search_says_what_ended_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tabulate, "MOST_STATES", 3)
    subject = Subject(f"{PLACE}:lake_without_table", {})
    for seconds, words in ((-1.0, "the time for its table ran out after 1 state"), (60.0, "it has more than 3 states")):
        search = TableSearch(subject, None, frozenset(), frozenset(), Deadline(seconds), math.inf)
        with pytest.raises(Untabulated, match=words):
            search.run()


def test_estimated_chance_is_near_the_right_one() -> None:
    """The grid in which a move slips with probability 1/4, solved here by value iteration in plain Python."""
    V = np.zeros((4, 4))
    moves = ((1, 0), (0, 1), (-1, 0), (0, -1))
    for _ in range(300):
        Q = np.zeros((4, 4, 4))
        for x, y, a in np.ndindex(4, 4, 4):
            for b, p in ((a, 0.75), ((a + 1) % 4, 0.25)):
                to = min(max(x + moves[b][0], 0), 3), min(max(y + moves[b][1], 0), 3)
                Q[x, y, a] += p * (0.99 if to == (3, 3) else V[to] - 0.01)
        V = Q.max(axis=2)
        V[3, 3] = 0
    x = Evidence(Subject(f"{PLACE}:Slippery", {}), 60.0)
    assert x.solved is not None and x.table is not None
    assert len(x.table.drawn) == 15 * 4
    assert x.solved.best == pytest.approx(V[0, 0], abs=0.02)
    assert np.mean(x.checked) == pytest.approx(V[0, 0], abs=0.01)


def test_a_hidden_state_is_shown_by_two_episodes_that_look_alike() -> None:
    subject = Subject(f"{PLACE}:HiddenState", {})
    entry = entry_of(subject, "hidden state")
    assert entry.finding.trace is not None
    one, other = entry.finding.trace
    assert subject.play((one,))[-1].outcome != subject.play((other,))[-1].outcome
    assert one.actions[-1:] == other.actions[-1:], "the last actions are the same"


TRACED = [planted for planted, check in PLANTED.items() if check in ("reset", "instances", "hidden reward")]


@pytest.mark.parametrize("planted", sparse(TRACED, 2))
def test_traces_are_texts_that_can_be_read_again(planted: type) -> None:
    subject = Subject(f"{PLACE}:{planted.__name__}", {})
    entry = entry_of(subject, PLANTED[planted])
    assert entry.finding.trace is not None
    again = subject.play(subject.read(entry.trace))
    for step, other in zip(again, subject.play(entry.finding.trace), strict=True):
        assert step.outcome == other.outcome


def test_the_command_reports_and_replays(tmp_path: Path) -> None:
    done = Done("audit", f"{PLACE}:OutOfSpace", "--seconds", "5", "--json")
    assert done.status == 1
    (finding,) = (f for f in done.data["findings"] if f["kind"] == "fault")
    played = Done("audit", f"{PLACE}:OutOfSpace", "--replay", finding["trace"])
    assert played.status == 0
    assert "a second run gives the same" in played.out
    table, _, script = played.out.partition("import runpy")
    (tmp_path / "replay.py").write_text(f"import runpy{script}", encoding="utf-8")
    ran = subprocess.run([sys.executable, "replay.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    last = ran.stdout.splitlines()[-1]
    value = table.strip().splitlines()[-2].split("[")[1].split(",")[0]
    assert value[:6] in last
    right = Done("audit", f"{PLACE}:RightTable", "--seconds", "5")
    assert right.status == 0 and "no faults" in right.out


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("NoSuchThing-v0",), 1, "cannot be made"),
        ((f"{PLACE}:nothing",), 1, "has no function 'nothing'"),
        ((f"{PLACE}:Grid", "--kwargs", "[1]"), 2, "is a JSON object"),
        ((f"{PLACE}:Grid", "--kwargs", "{"), 2, "is a JSON object"),
        ((f"{PLACE}:Grid", "--kwargs", '{"size": 3}'), 1, "unexpected keyword argument 'size'"),
        ((f"{PLACE}:Grid", "--replay", "3:[0,"), 1, "is not a trace"),
        ((f"{PLACE}:Grid", "--replay", "left"), 1, "is not a trace"),
    ],
)
def test_wrong_use_is_explained(arguments: tuple[str, ...], status: int, words: str) -> None:
    done = Done("audit", *arguments)
    assert done.status == status
    assert words in done.err


def test_a_step_that_hangs_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subjects, "PATIENCE", 0.2)
    found = audit(f"{PLACE}:Hangs", 1.0)
    (fault,) = found.faults
    assert "takes longer than 0.2 s" in fault.finding.words


def test_equal_observations_are_equal_in_any_form() -> None:
    assert frozen(1) == frozen(np.int64(1)) == frozen(1.0)
    assert frozen(np.array([0.0])) == frozen(np.array([-0.0], np.float32))
    assert frozen({"a": 1, "b": (2, "x")}) == frozen({"b": (2, "x"), "a": 1})
    assert frozen([1, 2]) != frozen([2, 1])
