"""`taskspec demos` and `preferences`: the same data whatever writes it, read back, and mistakes."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import taskspec
from taskspec.data import demonstrations, preferences, read
from tests.exact.policies.test_memory import DRAWN, tiger
from tests.learn.data.test_data import SUFFIXES, same
from tests.shared.commands import Done
from tests.shared.folders import names
from tests.shared.specs import spec_file

pytestmark = pytest.mark.usefixtures("warm")


def test_modified_tasks_are_what_is_recorded(tmp_path: Path) -> None:
    told = Done("demos", "RiskyPath", "-m", "delay=2", "-n", 2, "-o", tmp_path / "x.npz", "--json").data
    assert told["modifiers"] == ["delay=2"] and told["instance"] == "derail/RiskyPath-v0+delay=2"
    assert read(tmp_path / "x.npz").rews.tolist() == [0, 0, 0, 1, 3] * 2


def test_an_expert_that_remembers_acts_on_what_it_saw() -> None:
    task = tiger(DRAWN)
    data = demonstrations(task, episodes=60)
    assert data.metadata["content_hash"] == task.content_hash
    env = taskspec.make(task)
    for i, found in enumerate(data.trajectories):
        env.reset(seed=i)
        lead = 0
        for t, action in enumerate(found.acts):
            assert action == np.select([lead >= 2, lead <= -2], [1, 2])
            seen, reward, *_ = env.step(action)
            lead += {0: 0, 1: -1, 2: 1}[int(seen)]
            assert seen == found.obs[t + 1] and reward == found.rews[t]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_files_hold_the_same_data_whatever_the_number_of_workers(suffix: str, tmp_path: Path) -> None:
    one = tmp_path / f"one{suffix}"
    two = tmp_path / f"two{suffix}"
    other = tmp_path / f"other{suffix}"
    arguments = ("demos", "EarlyTermNeg", "--policy", "epsilon(0.5)", "-n", 100)
    told = Done(*arguments, "-o", one, "--json", "--seed", 3).data
    assert Done(*arguments, "-o", two, "-j", 2, "--seed", 3).status == Done(*arguments, "-o", other).status == 0
    assert one.read_bytes() == two.read_bytes() != other.read_bytes()
    assert told == {"file": str(one)} | read(one).metadata


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_preferences_are_read_back_too(suffix: str, tmp_path: Path) -> None:
    done = Done("preferences", "EarlyTermPos", "-n", 40, "--teacher", "skipping(0.8)", "-o", tmp_path / f"p{suffix}")
    assert (done.status, done.err) == (0, "")
    found = read(tmp_path / f"p{suffix}")
    data = preferences("EarlyTermPos", 40, teacher="skipping(0.8)")
    assert 0 < len(data) < 40 and found.metadata == data.metadata
    assert same(found.segments.obs, data.segments.obs) and same(found.segments.episode, data.segments.episode)
    for name in ("preferences", "returns", "queries"):
        assert same(getattr(found, name), getattr(data, name)), name


@pytest.mark.parametrize(
    ("task", "length", "words"),
    [
        ("RiskyPath", 1, "segments of 1 step;"),
        ("RiskyPath", 9, "whole episodes, which have fewer than 9 steps;"),  # they have five
        ("EarlyTermNeg", 3, "segments of 2 to 3 steps;"),
    ],
)
def test_the_lengths_of_segments_are_said_as_they_are(task: str, length: int, words: str, tmp_path: Path) -> None:
    done = Done("preferences", task, "-n", 40, "--length", length, "-o", tmp_path / "p.npz")
    assert f"40 pairs of {words}" in done.out


def test_npz_opens_without_this_package_and_without_pickles(tmp_path: Path) -> None:
    Done("demos", "RiskyPath", "-n", 3, "-o", tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz", allow_pickle=False) as held:
        assert json.loads(str(held["metadata"]))["policy"] == "expert"
        assert held["obs"].tolist() == [0, 1, 2, 2, 2] * 3 and held["rews"].tolist() == [0, 1, 1, 1, 1] * 3


WRONG = [
    (["demos", "RiskyPath", "-o", "x.csv"], "E726", "--format npz"),
    (["demos", "RiskyPath", "-o", "x", "--format", "parket"], "E726", "did you mean 'parquet'"),
    (["demos", "RiskyPath", "-o", "x.npz", "--format", "parquet"], "E726", "x.parquet"),
    (["demos", "RiskyPath", "-o", "x.npz", "--policy", "exprt"], "E713", "did you mean 'expert'"),
    (["demos", "RiskyPath", "-o", "x.npz", "--policy", "epsilon(2)"], "E713", "for example: epsilon(0.1)"),
    (["demos", "Parabola", "-o", "x.npz", "--policy", "optimal"], "E712", "exact model"),
    (["demos", "RiskyPath", "-o", "x.npz", "--policy", "none.py:act"], "E710", "none.py"),
    (["demos", "RiskyPath", "-o", "x.npz", "--policy", "m.py:what"], "E713", "def what(observation)"),
    (["demos", "RiskyPath", "-o", "x.npz", "--policy", "m.py:seven"], "E706", "Discrete(2)"),
    (["demos", "RiskyPath", "-o", "x.npz", "--policy", "m.py:fails"], "E713", "ZeroDivisionError"),
    (["demos", "RiskyPath", "-o", "x.npz", "--episodes", "3", "--transitions", "3"], "E713", "cannot be combined"),
    (["preferences", "RiskyPath", "-o", "x.npz", "--teacher", "miopic(0.9)"], "E713", "did you mean 'myopic'"),
    (["preferences", "RiskyPath", "-o", "x.npz", "--teacher", "mistaken(3)"], "E713", "between 0 and 1"),
    (["preferences", "RiskyPath", "-o", "x.npz", "--teacher", "equal(1)+equal(1)"], "E713", "twice"),
    (["preferences", "Parabola", "-o", "x.npz", "--teacher", "boltzmann(0.1)"], "E712", "range of the returns"),
    (["preferences", "RiskyPath", "-o", "x", "--format", "minari"], "E713", "not store preferences"),
]


@pytest.mark.parametrize(
    ("command", "code", "words"), WRONG, ids=lambda part: " ".join(part) if isinstance(part, list) else ""
)
def test_mistakes_are_told_and_nothing_is_written(
    command: list[str], code: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.py").write_text("def seven(seen):\n    return 7\n\n\ndef fails(seen):\n    return 1 / 0\n")
    done = Done(*command)
    assert done.status in (1, 2) and code in done.err and words in " ".join(done.err.split())
    assert set(names(tmp_path)) <= {"m.py", "__pycache__"}


def test_a_spec_without_an_expert_says_what_else_there_is(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(spec_file("risky_path").read_text().replace("expert:\n  a: safe\n", "").split("claims:")[0])
    done = Done("demos", path, "-o", tmp_path / "x.npz")
    assert done.status == 1 and "gives no expert" in done.err and "`optimal`" in done.err
    assert Done("demos", path, "-o", tmp_path / "x.npz", "--policy", "epsilon(0.1)").status == 0


LABELS = """
taskspec: 1
name: Con
parameters: {c: {type: choice, values: ["../../a", b], default: b}}
state: {s: {type: int, low: 0, high: 1}}
action: {u: {type: bool}}
horizon: 2
initial: {s: 0}
dynamics: {s': "u"}
reward: s' * (1 if c == b else 2)
expert: {u: true}
"""


def test_names_and_labels_of_a_spec_are_safe_in_names_of_files(tmp_path: Path) -> None:
    """A label with slashes stays in its folder, and a task may be called like a device of Windows."""
    spec = tmp_path / "x.yaml"
    spec.write_text(LABELS)
    out = tmp_path / "out" / "d.npz"
    done = Done("demos", spec, "-p", "c=../../a,b", "-o", out, "--episodes", "2")
    assert done.status == 0, done.err
    first, second = names(out.parent)
    assert re.fullmatch(r"d-c=\.\.-\.\.-a-[0-9a-f]{8}\.npz", first) and second == "d-c=b.npz"
    pages = tmp_path / "pages"
    assert Done("docs", spec, "-o", pages, "--format", "markdown").status == 0
    assert not (pages / "con.md").exists()
    assert list(pages.glob("_con-*"))
    assert names(tmp_path) == ["out", "pages", "x.yaml"]


def test_the_command_line_says_where_data_comes_from(tmp_path: Path) -> None:
    done = Done("demos", "InitShiftLearner", "-n", 4, "-o", tmp_path / "x.npz")
    assert "InitShiftExpert" in done.out and "8 transitions of 4 episodes; the policy earns 2 (exact)" in done.out
