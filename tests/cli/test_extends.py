"""Commands on specs that extend a spec of another file."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.language.task.test_extends import run as run


def test_the_command_line_checks_lists_and_prints_them(run: Path) -> None:
    for command in (["check", "--strict", "--json"], ["list"], ["show"], ["docs", "-o", "pages"]):
        done = subprocess.run(
            [sys.executable, "-m", "taskspec", *command, run], cwd=run.parent, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        if "--json" in command:
            assert [t["id"] for t in json.loads(done.stdout)["tasks"]] == [
                "runs/Run-v0",
                "runs/RunShort-v0",
                "runs/RunLate-v0",
            ]
