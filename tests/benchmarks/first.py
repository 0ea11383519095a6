"""The start of a process: `import taskspec`, and the first environment after it."""

from __future__ import annotations

import subprocess
import sys

PROGRAMS = {
    "import gymnasium": ("", "import gymnasium"),
    "import taskspec": ("", "import taskspec"),
    "first gym.make": ("import gymnasium, taskspec", "gymnasium.make('derail/RiskyPath-v0').reset(seed=0)"),
}
"""What is measured, by name: what runs before it, and the statement itself."""
TARGETS = {"import taskspec": 0.6, "first gym.make": 0.4}
"""Seconds of processor time, at most."""


def bench(rounds: int) -> bool:
    """Print the least processor seconds of each statement in a new process; return whether the targets are met."""
    least = dict.fromkeys(PROGRAMS, float("inf"))
    for _ in range(rounds):
        for name, (before, statement) in PROGRAMS.items():
            least[name] = min(least[name], _seconds(before, statement))
    for name, seconds in least.items():
        print(f"{name:<16}  {seconds:.3f} s")
    return all(least[name] <= most for name, most in TARGETS.items())


def _seconds(before: str, statement: str) -> float:
    lines = (before, "import time", "start = time.process_time()", statement, "print(time.process_time() - start)")
    command = [sys.executable, "-W", "ignore", "-c", "\n".join(lines)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return float(done.stdout)
