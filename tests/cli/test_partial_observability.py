"""Commands on tasks that are partly observable."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from tests.exact.scores.test_partial_observability import spec_file


def test_solve_and_pages_say_what_the_optimum_knows(tmp_path: Path) -> None:
    def run(*arguments: str) -> str:
        command = [sys.executable, "-m", "taskspec", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout

    path = str(spec_file("memory_len"))
    text = run("solve", path)
    assert [line.split()[:3] for line in text.splitlines()[1:4]] == [
        ["optimal", "1", "exact"], ["remembering", "1", "exact"], ["memoryless", "0", "exact"],
    ]  # fmt: skip
    assert "knowing the state" in text
    told = json.loads(run("solve", path, "--json"))["yardsticks"]
    assert told == {"remembering": [1.0, 1.0], "memoryless": [0.0, 0.0], "why_not": None}
    assert json.loads(run("solve", "derail/RiskyPath", "--json"))["yardsticks"] is None
    run("docs", path, "--format", "markdown", "-o", "pages")
    page = "".join(p.read_text() for p in (tmp_path / "pages").rglob("*.md"))
    assert "optimal return, knowing the state" in page and "best return without memory" in page
