"""The command line: what is refused and in which words, completion, and what is imported."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from taskspec.cli import completions
from tests.shared.commands import Done
from tests.shared.for_each import for_each

DERAIL = Path(__file__).parents[2] / "tasks" / "derail"
REFUSED = [
    (["show", "Branchng"], 1, "did you mean 'derail/Branching'?"),
    (["show", "nope.yaml"], 1, "E710"),
    (["check", "nowhere/"], 1, "E710"),
    (["show", str(DERAIL)], 1, "is a folder"),
    (["show", "Branching", "-p", "L"], 1, "name=value"),
    (["show", "Branching", "-p", "L=0"], 1, "E703"),
    (["show", "Branching", "-p", "L=abc"], 1, "E703"),
    (["show", "Branching", "-p", "Q=1"], 1, "E702"),
    (["show", "Branching", "-p", "L=1", "-p", "L=2"], 1, "twice"),
    (["show", str(DERAIL / "early_term.yaml")], 1, "only its variants are tasks"),
    (["show", "Branching", "--variant", "sealz"], 1, "error[E211 unknown-variant]: Branching has no variant 'sealz'"),
    (["show", "Branching", "--variant", "sealz"], 1, "= hint: did you mean 'seals'?"),
    (["new", "1st"], 1, "E205"),
    (["explain", "E999"], 1, "no code 'E999'"),
    (["run", "Branching", "--policy", "bogus"], 1, "no policy 'bogus'"),
    (["run", "Branching", "--policy", "random(x)"], 1, "no policy 'random(x)'"),
    (["run", "Branching", "--policy", "nope.json"], 1, "E710"),
    (["check", "--format", "xml"], 2, "text, json, github"),
    (["run", "Branching", "--json", "--render", "ansi"], 2, "cannot be combined"),
    (["run", "Branching", "--seed", "-1"], 2, "--seed"),
    (["frobnicate"], 2, "frobnicate"),
    (["show"], 2, "TASK"),
]


@for_each(("args", "status", "words"), REFUSED)
def test_every_misuse_gets_one_clear_message(args: list[str], status: int, words: str) -> None:
    done = Done(*args)
    assert done.status == status
    assert words in done.err
    assert done.out == ""


def test_a_fault_of_our_own_is_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> None:
        raise RuntimeError("oh")

    monkeypatch.setattr("taskspec.tools.targets.tasks_of", broken)
    done = Done("show", "Branching")
    assert done.status == 70
    assert "internal error: RuntimeError: oh" in done.err


def test_an_interrupt_has_its_own_status(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("taskspec.tools.targets.tasks_of", interrupted)
    assert Done("show", "Branching").status == 130


def test_a_reader_that_goes_away_is_no_error() -> None:
    command = f"{sys.executable} -m taskspec explain | head -1"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_completion_offers_ids_and_paths() -> None:
    assert list(dict(completions.complete_targets("derail/Br"))) == ["derail/Branching-v0", "derail/BranchingSeals-v0"]
    assert list(dict(completions.complete_targets(f"{DERAIL}/so"))) == [f"{DERAIL}/sort.yaml"]


def test_completion_works_in_a_shell() -> None:
    env = {"_TASKSPEC_COMPLETE": "complete_bash", "COMP_WORDS": "taskspec show derail/Branching-", "COMP_CWORD": "2"}
    command = [sys.executable, "-m", "taskspec"]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["derail/Branching-v0"]


def test_messages_at_one_place_come_in_the_order_of_the_spec(tmp_path: Path) -> None:
    """Not in that of hashes, which is another one in every process."""
    names = ["zeta", "alpha", "nu", "beta", "xi"]
    abstraction = {"state": {name: {"type": "bool"} for name in names}, "map": {}}
    path = tmp_path / "risky.yaml"
    text = (DERAIL / "risky_path.yaml").read_text(encoding="utf-8")
    path.write_text(f"{text}\nabstraction: {json.dumps(abstraction)}\n", encoding="utf-8")
    for name, said in zip(names, Done("check", path, "--json").data["diagnostics"], strict=True):
        assert said["message"] == f"the map does not say what '{name}' is"
