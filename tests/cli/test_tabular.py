"""Arrays of exact models, beside planning written anew, simulated episodes, and the packages that take them."""

from __future__ import annotations

from pathlib import Path

from tests.shared.commands import Done


def test_the_command_line_says_where_data_comes_from(tmp_path: Path) -> None:
    done = Done("demos", "InitShiftLearner", "-n", 4, "-o", tmp_path / "x.npz")
    assert "InitShiftExpert" in done.out and "8 transitions of 4 episodes; the policy earns 2 (exact)" in done.out
