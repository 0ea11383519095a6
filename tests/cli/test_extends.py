"""Commands on specs that extend a spec of another file."""

from __future__ import annotations

import json
from pathlib import Path

from tests.language.task.test_extends import run as run
from tests.shared.apart import taskspec


def test_the_command_line_checks_lists_and_prints_them(run: Path) -> None:
    for command in (["check", "--strict", "--json"], ["list"], ["show"], ["docs", "-o", "pages"]):
        done = taskspec(run.parent, *command, run)
        assert done.returncode == 0, done.stdout + done.stderr
        if "--json" in command:
            assert [t["id"] for t in json.loads(done.stdout)["tasks"]] == [
                "runs/Run-v0",
                "runs/RunShort-v0",
                "runs/RunLate-v0",
            ]
