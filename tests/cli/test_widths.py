"""Output at 80 and at 60 columns: what identifies and what measures is whole, on specs with long names."""

import json
import re
from pathlib import Path

import pytest

from taskspec.show.terminal.styled_text import shared_prefix
from tests.shared.commands import Done
from tests.shared.exams import exam
from tests.shared.sparse import sparse

SPEC = """\
taskspec: 1
name: {name}
title: A corridor with a very long name
capability: exploration
keywords: [long corridors]
parameters:
  corridor_length: {{type: int, default: 5, low: 1, high: 100}}
  probability_of_slipping: {{type: real, default: 0.125, low: 0, high: 1}}
state:
  position_in_the_corridor: {{type: int, low: 0, high: corridor_length}}
action:
  direction: {{type: choice, values: {{left: -1, right: 1}}}}
horizon: 2 * corridor_length
initial:
  position_in_the_corridor: 0
dynamics:
  position_in_the_corridor': >-
    clip(position_in_the_corridor + (0 if Bernoulli(probability_of_slipping) else direction), 0, corridor_length)
reward: position_in_the_corridor' == corridor_length
terminal: position_in_the_corridor' == corridor_length
expert:
  direction: right
claims:
  - optimal_return > 0.9
"""
NAMES = ("CorridorWithSlipperyFloor", "CorridorWithSlipperyFloorAndWind")
SWEEP = """\
experiment: 1
name: long
tasks:
  - task: specs_of_somebody/corridor_with_slippery_floor.yaml
    parameters: {corridor_length: [2, 3], probability_of_slipping: [0.125, 0.0625]}
policies: [random]
"""


@pytest.fixture
def specs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with two specs, an experiment, and two exams."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "specs_of_somebody"
    folder.mkdir()
    for name in NAMES:
        file = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
        (folder / f"{file}.yaml").write_text(SPEC.format(name=name))
    (tmp_path / "long.yaml").write_text(SWEEP)
    for learner in ("a_learner_with_a_long_name", "another_learner_with_a_long_name"):
        (tmp_path / "exams" / learner).mkdir(parents=True)
        scores = {"EarlyTermNeg": -16.97, "NoisyObs?L=50&M=7": [0.123, -2.345] * 7, "Sort": 0.5}
        results = exam(scores, {"EarlyTermNeg": -103.27}, seeds=14, learner=learner)
        (tmp_path / "exams" / learner / "exam.json").write_text(json.dumps(results))
    return tmp_path


COMMANDS = {
    "list": ["list", "specs_of_somebody"],
    "check": ["check", "specs_of_somebody"],
    "build": ["build", "specs_of_somebody", "-o", "out"],
    "solve": ["solve", "specs_of_somebody/corridor_with_slippery_floor.yaml", "--difficulty"],
    "run": ["run", "specs_of_somebody/corridor_with_slippery_floor.yaml"],
    "sweep": ["sweep", "long.yaml", "-o", "out"],
    "demos": ["demos", "specs_of_somebody/corridor_with_slippery_floor.yaml", "-o", "out.npz"],
    "report": ["report", "exams/a_learner_with_a_long_name", "-o", "out"],
    "report several": ["report", "exams", "-o", "out"],
    "show": ["show", "specs_of_somebody/corridor_with_slippery_floor.yaml"],
}
LOSSLESS = ("solve", "run", "sweep", "demos", "report several", "show", "list")
"""Commands that drop no columns."""


@pytest.mark.parametrize("width", sparse([60, 80], 2))
@pytest.mark.parametrize("command", COMMANDS)
def test_names_and_numbers_are_whole(specs: Path, command: str, width: int) -> None:
    wide = Done(*COMMANDS[command], columns=400)
    narrow = Done(*COMMANDS[command], columns=width)
    assert wide.status == narrow.status == 0, narrow.err
    text = re.sub(r"^wrote.*\n", "", narrow.out, flags=re.MULTILINE)
    assert max(map(len, text.splitlines())) <= width
    assert not re.search(r"\w…", re.sub(r"[/?&]…", "", text)), "a cell is cut"
    for name in set(re.findall(r"Corridor\w+-v0(?=\s)", wide.out)) | set(re.findall(r"\w+_learner_\w+", wide.out)):
        assert name in text
    numbers = set(re.findall(r"(?<![\w.=])[−-]?\d+\.\d+(?![\w.])", wide.out))
    if command in LOSSLESS:
        assert numbers <= set(re.findall(r"(?<![\w.=])[−-]?\d+\.\d+(?![\w.])", text))


def test_the_card_keeps_the_scores_at_any_width(specs: Path) -> None:
    done = Done("report", "exams/a_learner_with_a_long_name", "-o", "out", columns=60)
    assert re.search(r"^✗  EarlyTermNeg.*◂.*−16.97$", done.out, re.MULTILINE)
    assert len(re.findall(r"^✗.* −103\.27$", done.out, re.MULTILINE)) == 1
    assert "NoisyObs, L=50, M=7" in done.out and "−1.11" in done.out


@pytest.mark.parametrize(
    ("names", "shared"),
    [
        (["derail/Branching-v0?B=2&L=1", "derail/Branching-v0?B=2&L=10"], "derail/Branching-v0?B=2&"),
        (["tasks/derail/a.yaml", "tasks/derail/sub/b.yaml"], "tasks/derail/"),
        (["a.yaml", "b.yaml"], ""),
        ([], ""),
    ],
)
def test_a_shared_prefix_ends_with_a_part_of_the_name(names: list[str], shared: str) -> None:
    assert shared_prefix(names) == shared


@pytest.mark.parametrize("command", ["check", "exam", "sweep", "run", "preferences"])
def test_help_breaks_no_words_and_names_no_types(command: str) -> None:
    words = set(Done(command, "--help", columns=400).out.split())
    done = Done(command, "--help", columns=80)
    assert max(map(len, done.out.splitlines())) <= 80
    assert set(done.out.split()) <= words
    assert not re.search(r"<(bool|int|str)|x>=", done.out)


def test_bare_taskspec_ends_with_three_first_commands() -> None:
    assert re.search(r"\n *taskspec list .*\n *taskspec new .*\n *taskspec exam .*\s*$", Done().out)
