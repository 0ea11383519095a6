"""Commands on tasks that are partly observable."""

from __future__ import annotations

import json
from pathlib import Path

from tests.shared.apart import taskspec
from tests.shared.specs import spec_file


def test_solve_and_pages_say_what_the_optimum_knows(tmp_path: Path) -> None:
    def run(*arguments: str) -> str:
        done = taskspec(tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout

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
