"""The first environment of a process, imports included, compared with seals and with `import gymnasium` alone."""

from __future__ import annotations

import subprocess
import sys
import time

TARGET = 1.3
"""Times that of seals, at most."""
PROGRAMS = {
    "import gymnasium": "import gymnasium",
    "seals": "import gymnasium, seals; gymnasium.make('seals/RiskyPath-v0').reset(seed=0)",
    "taskspec": "import gymnasium, taskspec; gymnasium.make('derail/RiskyPath-v0').reset(seed=0)",
}


def bench(rounds: int) -> bool:
    """Print the least seconds of a process of each program, which take turns; return whether the target is met."""
    least = dict.fromkeys(PROGRAMS, float("inf"))
    for _ in range(rounds):
        for name, program in PROGRAMS.items():
            start = time.perf_counter()
            subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=True, capture_output=True)
            least[name] = min(least[name], time.perf_counter() - start)
    for name, seconds in least.items():
        print(f"{name:<16}  {seconds:.3f} s")
    ratio = least["taskspec"] / least["seals"]
    print(
        f"taskspec takes {ratio:.2f} times as long as seals, {TARGET} at most: the least of {rounds} processes of each"
    )
    return ratio <= TARGET
