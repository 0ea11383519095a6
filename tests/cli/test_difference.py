"""`taskspec diff`: files, ids, values of parameters and revisions."""

import subprocess
from pathlib import Path

import pytest

from tests.shared.commands import Done, spec
from tests.tools.test_difference import CORRIDOR


def test_the_command_reads_files_ids_values_and_revisions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    spec(tmp_path, CORRIDOR, "c.yaml")
    for command in (
        ["init", "-q"],
        ["add", "c.yaml"],
        ["-c", "user.name=a", "-c", "user.email=a", "commit", "-qm", "a"],
    ):
        subprocess.run(["git", *command], check=True)
    spec(tmp_path, CORRIDOR.replace("3/4", "1/2"), "c.yaml")
    done = Done("diff", "git:HEAD:c.yaml", "c.yaml")
    assert done.status == 1
    assert "same optimal policy" in done.out and "the version in the id must rise" in done.out
    assert "with probability 3/4" in done.out and "with probability 1/2" in done.out
    found = Done("diff", "derail/Branching?L=5", "derail/Branching", "--json")
    assert found.status == 1 and found.data["difference"]["t"] == 4
    assert Done("diff", "derail/Branching", "derail/Branching?L=10").status == 0
    wrong = {"git:c.yaml": "git:REV:PATH", "git:nothing:c.yaml": "git cannot show", "git:--help:c.yaml": "git:REV:PATH"}
    for target, words in wrong.items():
        done = Done("diff", target, "c.yaml")
        assert done.status == 1 and words in done.err
