"""`python -m tests.verification.oracle`: random specs by the thousand, on several processes."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.verification.oracle.run import Tally, endings, faults, run
from tests.verification.processes import machine


def summary(tally: Tally, seconds: float, jobs: int) -> str:
    steps = sum(n for stage, n in tally.compared.items() if stage.split()[0] in ("scalar", "numpy", "numba", "jax"))
    made = machine(seconds, jobs, "numpy", "gymnasium")
    return f"{tally.specs:,} specs, {steps:,} steps, {endings(tally)}; {made}"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.verification.oracle", description=__doc__)
    parser.add_argument("--specs", type=int, default=1000, help="how many specs")
    parser.add_argument("--seed", type=int, default=0, help="the number of the first of them")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--backends", default="numpy", help="numpy, numba, jax: any of them, by commas")
    parser.add_argument("--save", type=Path, help="minimise one spec of each kind of fault into this folder")
    return parser.parse_args()


def save(tally: Tally, folder: Path) -> None:
    from tests.verification.oracle.compare.stages import Finding
    from tests.verification.oracle.found import save, smaller
    from tests.verification.oracle.worker import case_of

    kinds = {f"{f['stage']}: {f['what']}": f for f in tally.found if f["what"] not in ("hang", "died")}
    for f in kinds.values():
        finding = Finding(f["stage"], f["what"], f["detail"])
        print(f"kept {save(smaller(case_of(f['spec']), finding), finding, folder)}")


def main() -> int:
    asked = arguments()
    begun = time.perf_counter()
    tally = run("tests.verification.oracle.worker", asked.specs, asked.seed, asked.jobs, asked.backends)
    print(faults(tally), end="")
    print(", ".join(f"{stage} {n:,}" for stage, n in tally.made.items()))
    print(summary(tally, time.perf_counter() - begun, asked.jobs))
    if asked.save is not None:
        save(tally, asked.save)
    return 1 if tally.found else 0


if __name__ == "__main__":
    sys.exit(main())
