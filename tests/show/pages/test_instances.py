"""Constants drawn per instance: lanes of several instances, and the values in Python, on pages and in figures."""

import json
from pathlib import Path

import pytest

from taskspec import SpecError, load
from taskspec.show.figures import figure
from tests.language.task.test_instances import SHUFFLED
from tests.language.task.test_instances import path as path
from tests.shared.apart import taskspec


def test_constants_are_printed_and_drawn(path: Path) -> None:
    task = load(path, instance_seed=3)
    command = ("show", path, "-p", "instance_seed=3")
    printed = taskspec(path.parent, *command).stdout
    assert "meaning ∼ Perm(N), drawn once per instance" in printed and "half = ⌊N / 2⌋" in printed
    assert f"here meaning = {task.constants['meaning'].tolist()}" in printed
    told = json.loads(taskspec(path.parent, *command, "--json").stdout)["constants"]
    assert told["walls"] == task.constants["walls"].tolist() and told["half"] == 2
    assert task.annotations.figure is not None
    assert task.annotations.figure.map == tuple(
        "".join("#" if w else " " for w in row) for row in task.constants["walls"]
    )
    drawn = [figure(load(path, instance_seed=seed), path.parent / f"{seed}.svg").read_text() for seed in (3, 4)]
    assert drawn[0] != drawn[1]
    path.write_text(SHUFFLED.replace("map: walls", "map: odds"))
    with pytest.raises(SpecError, match=r"E204.*nor a matrix of conditions or digits"):
        load(path)
