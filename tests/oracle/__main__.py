"""`python -m tests.oracle`: random specs by the thousand, on several processes."""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

CHUNK = 250


@dataclass
class Tally:
    """What a run came to."""

    specs: int = 0
    made: Counter[str] = field(default_factory=Counter)
    """Specs by stage."""
    compared: Counter[str] = field(default_factory=Counter)
    """Steps, rows, numbers by stage."""
    found: list[dict[str, Any]] = field(default_factory=list)
    peak: int = 0
    slowest: float = 0.0

    def add(self, record: dict[str, Any]) -> None:
        if "peak" in record:
            self.peak = max(self.peak, record["peak"])
        if "spec" not in record:
            return
        self.specs += 1
        self.slowest = max(self.slowest, record["seconds"])
        self.made.update(record["made"].keys())
        self.compared.update(record["made"])
        self.found += [{"spec": record["spec"], **f} for f in record["found"]]


def records(first: int, last: int, backends: str) -> Iterator[dict[str, Any]]:
    """What a process says of its specs; where one kills it, another goes on with the next."""
    while first < last:
        command = [sys.executable, "-m", "tests.oracle.worker", str(first), str(last), backends]
        begun = last
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for line in process.stdout:
                record = json.loads(line)
                begun = record.get("begun", begun)
                yield record
        if process.returncode == 0:
            return
        detail = f"the process ended with {process.returncode}"
        yield {"spec": begun, "made": {}, "seconds": 0, "found": [{"stage": "any", "what": "died", "detail": detail}]}
        first = begun + 1


def run(specs: int, seed: int, jobs: int, backends: str) -> Tally:
    tally = Tally()
    starts = range(seed, seed + specs, CHUNK)
    with ThreadPoolExecutor(jobs) as pool:
        chunks = pool.map(lambda a: list(records(a, min(a + CHUNK, seed + specs), backends)), starts)
        for chunk in chunks:
            for record in chunk:
                tally.add(record)
    return tally


def faults(tally: Tally) -> str:
    """A line for each kind of fault: how often it was found, and where first."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for finding in tally.found:
        kinds.setdefault(f"{finding['stage']}: {finding['what']}", []).append(finding)
    return "".join(
        f"{len(many)} × {kind}: spec {many[0]['spec']}: {worded(many[0])[:200]}\n" for kind, many in kinds.items()
    )


def worded(finding: dict[str, Any]) -> str:
    """A finding in a line: the last of a traceback, the first of anything else."""
    lines = finding["detail"].strip().splitlines()
    return lines[-1] if finding["what"].startswith(("crash", "raised")) else lines[0]


def summary(tally: Tally, seconds: float, jobs: int) -> str:
    kinds = Counter(f["what"].split()[0] for f in tally.found)
    crashes, hangs = kinds["crash"] + kinds["died"], kinds["hang"]
    machine = f"{platform.system()} {platform.machine()}, {jobs} processes, Python {platform.python_version()}"
    libraries = ", ".join(f"{name} {version(name)}" for name in ("taskspec", "numpy", "gymnasium"))
    steps = sum(n for stage, n in tally.compared.items() if stage.split()[0] in ("scalar", "numpy", "numba", "jax"))
    return (
        f"{tally.specs:,} specs, {steps:,} steps, {len(tally.found) - crashes - hangs} differences, {crashes} crashes, "
        f"{hangs} hangs, slowest {tally.slowest:.1f} s, peak memory {tally.peak / 2**20:.0f} MB; "
        f"{datetime.now(UTC).date()}, {seconds:.0f} s on {machine}, {libraries}"
    )


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.oracle", description=__doc__)
    parser.add_argument("--specs", type=int, default=1000, help="how many specs")
    parser.add_argument("--seed", type=int, default=0, help="the number of the first of them")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--backends", default="numpy", help="numpy, numba, jax: any of them, by commas")
    parser.add_argument("--save", type=Path, help="minimise one spec of each kind of fault into this folder")
    return parser.parse_args()


def save(tally: Tally, folder: Path) -> None:
    from tests.oracle.compare.stages import Finding
    from tests.oracle.found import save, smaller
    from tests.oracle.worker import case_of

    kinds = {f"{f['stage']}: {f['what']}": f for f in tally.found if f["what"] not in ("hang", "died")}
    for f in kinds.values():
        finding = Finding(f["stage"], f["what"], f["detail"])
        print(f"kept {save(smaller(case_of(f['spec']), finding), finding, folder)}")


def main() -> int:
    asked = arguments()
    begun = time.perf_counter()
    tally = run(asked.specs, asked.seed, asked.jobs, asked.backends)
    print(faults(tally), end="")
    print(", ".join(f"{stage} {n:,}" for stage, n in tally.made.items()))
    print(summary(tally, time.perf_counter() - begun, asked.jobs))
    if asked.save is not None:
        save(tally, asked.save)
    return 1 if tally.found else 0


if __name__ == "__main__":
    sys.exit(main())
