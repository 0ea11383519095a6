"""`python -m tests.verification.proofs`: random models and claims about them, beside brute force in fractions and beside Storm.

    python -m tests.verification.proofs --models 1000 --claims 10000 --jobs 2
    python -m tests.verification.proofs --models 1 --seed 37 --claims 10

Every model, and every claim about it, follows from its number alone.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

from tests.verification.oracle.run import Tally, endings, faults, run
from tests.verification.processes import machine
from tests.verification.proofs import storm

CHUNK = 50


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.proofs", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--models", type=int, default=1000, help="how many models")
    parser.add_argument("--claims", type=int, default=10_000, help="how many claims, all together")
    parser.add_argument("--seed", type=int, default=0, help="the number of the first model")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    return parser.parse_args()


def verdicts(tally: Tally) -> str:
    """A line for each kind of claim: how many were true and false, and what became of them."""
    kinds: dict[str, list[str]] = {}
    total: Counter[str] = Counter()
    for name, count in sorted(tally.compared.items()):
        if name.startswith("claims, "):
            kind, _, became = name.removeprefix("claims, ").partition(": ")
            kinds.setdefault(kind, []).append(f"{became} {count:,}")
            total[became] += count
    lines = {"all": [f"{became} {count:,}" for became, count in sorted(total.items())], **kinds}
    return "".join(f"{kind}: {'; '.join(became)}\n" for kind, became in lines.items())


def summary(tally: Tally, seconds: float, jobs: int) -> str:
    made = tally.compared
    beside = f"{made['storm']:,} by Storm" if storm.is_installed() else "none by Storm, which is not installed"
    libraries = ("numpy", "scipy", *(("stormpy",) if storm.is_installed() else ()))
    return (
        f"{tally.specs:,} models, {made['rows']:,} rows, {made['returns']:,} returns ({made['returns withheld']:,} withheld, "
        f"{beside}), {made['claims']:,} claims, {endings(tally)}; {machine(seconds, jobs, *libraries)}"
    )


def main() -> int:
    asked = arguments()
    begun = time.perf_counter()
    per_model = -(-asked.claims // asked.models)
    tally = run("tests.verification.proofs.worker", asked.models, asked.seed, asked.jobs, str(per_model), CHUNK)
    print(faults(tally), end="")
    families = {name.removeprefix("family "): n for name, n in tally.made.items() if name.startswith("family ")}
    print(", ".join(f"{name} {n:,}" for name, n in sorted(families.items())))
    print(verdicts(tally), end="")
    print(summary(tally, time.perf_counter() - begun, asked.jobs))
    return 1 if tally.found else 0


if __name__ == "__main__":
    sys.exit(main())
