"""Measures of difficulty, beside every episode of small tasks written out one by one, and beside closed forms."""

from __future__ import annotations

from taskspec.exact.scores.difficulty import difficulty
from tests.shared.commands import Done


def test_solve_prints_the_measures_and_their_reasons() -> None:
    lines = Done("solve", "RiskyPath", "--difficulty").out.splitlines()
    told = {
        line.split()[0]: line.split()[1] for line in lines if line.startswith("  ") and line.strip() != "difficulty"
    }
    assert told["best_at_random"] == "0.5"
    assert told["effective_horizon"] == "unknown"
    assert any("deterministic tasks" in line for line in lines)
    assert Done("solve", "RiskyPath", "--difficulty", "--json").data["difficulty"] == difficulty("RiskyPath").record()
    assert "difficulty" not in Done("solve", "RiskyPath", "--json").data
    assert Done("solve", "Parabola", "--difficulty", "-n", 50).out.count("infinitely many values") == 1
