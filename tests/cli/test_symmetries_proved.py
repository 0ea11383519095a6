"""Which maps of symmetries are proved, tested and refused, and the section of a spec."""

from __future__ import annotations

import json
from typing import Any

from taskspec.show.pages.page import page
from tests.cli.test_commands import Done
from tests.exact.check.test_symmetries import task_of
from tests.exact.check.test_symmetries_proved import BOX


def test_commands_tell_of_symmetries(tmp_path: Any) -> None:
    path = tmp_path / "box.yaml"
    path.write_text(BOX + "symmetries: {s: {doc: turned, action: {i: 2 - i}}, wrong: {observation: {w: 0}}}\n")
    record = json.loads(Done("check", str(path), "--format", "json").out)["tasks"][0]
    assert [(s["symmetry"], s["status"]) for s in record["symmetries"]] == [("s", "proved"), ("wrong", "false")]
    assert "i ↦ 2 − i" in Done("show", str(path)).out
    section = page(task_of("derail/ProcGoal-v0")).section("symmetries")
    assert section is not None and len(section.lines) == 2
