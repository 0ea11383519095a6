"""`taskspec solve`: measures of difficulty, and what the optimum knows where a task is partly observable."""

import json
import re
from pathlib import Path

from taskspec.exact.scores.difficulty import difficulty
from tests.shared.apart import taskspec
from tests.shared.commands import Done
from tests.shared.specs import spec_file


def test_solve_prints_the_measures_and_their_reasons() -> None:
    out = Done("solve", "RiskyPath", "--difficulty").out
    told = dict(re.findall(r"^  +(\S+) +(\S+)", out, re.MULTILINE))
    assert told["best_at_random"] == "0.5"
    assert told["effective_horizon"] == "unknown"
    assert "deterministic tasks" in out
    assert Done("solve", "RiskyPath", "--difficulty", "--json").data["difficulty"] == difficulty("RiskyPath").record()
    assert "difficulty" not in Done("solve", "RiskyPath", "--json").data
    assert Done("solve", "Parabola", "--difficulty", "-n", 50).out.count("infinitely many values") == 1


def test_solve_and_pages_say_what_the_optimum_knows(tmp_path: Path) -> None:
    def run(*arguments: str) -> str:
        done = taskspec(tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout

    path = str(spec_file("memory_len"))
    text = run("solve", path)
    assert re.search(r"\n *optimal +1 +exact.*\n *remembering +1 +exact.*\n *memoryless +0 +exact", text)
    assert "knowing the state" in text
    told = json.loads(run("solve", path, "--json"))["yardsticks"]
    assert told == {"remembering": [1.0, 1.0], "memoryless": [0.0, 0.0], "why_not": None}
    assert json.loads(run("solve", "derail/RiskyPath", "--json"))["yardsticks"] is None
    run("docs", path, "--format", "markdown", "-o", "pages")
    page = "".join(map(Path.read_text, (tmp_path / "pages").rglob("*.md")))
    assert "optimal return, knowing the state" in page and "best return without memory" in page
