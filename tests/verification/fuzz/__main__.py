"""`python -m tests.verification.fuzz`: mutated specs by the million, on several processes.

    python -m tests.verification.fuzz --inputs 1000000 --jobs 2
    python -m tests.verification.fuzz --only 12345 --show

Every input follows from its number alone. One in `--twice` is given to a second process, with another seed of Python's hashes,
and must be answered in the same words.
"""

from __future__ import annotations

import argparse
import heapq
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from tests.verification.processes import machine, records

CHUNK = 2_000
KEPT = 10
"""How many inputs of a kind of fault, and of the slowest ones, are told."""


@dataclass
class Tally:
    """What a run came to."""

    inputs: int = 0
    layers: Counter[str] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)
    examples: dict[str, tuple[int, str]] = field(default_factory=dict)
    """For each kind of fault an input, and the details."""
    twice: int = 0
    peak: int = 0
    slowest: list[tuple[float, int]] = field(default_factory=list)
    """Seconds and input of the slowest ones."""
    seconds: float = 0.0

    def add(self, record: dict[str, Any]) -> None:
        if "peak" in record:
            self.peak = max(self.peak, record["peak"])
        if "input" not in record:
            return
        self.inputs += 1
        self.layers.update(record["layers"])
        self.seconds += record["seconds"]
        self.slowest = heapq.nlargest(KEPT, [*self.slowest, (record["seconds"], record["input"])])
        for fault in record["faults"]:
            self.fault(fault["signature"], record["input"], fault["detail"])

    def fault(self, signature: str, number: int, detail: str) -> None:
        self.kinds[signature] += 1
        self.examples.setdefault(signature, (number, detail))
        if self.kinds[signature] <= KEPT:
            print(told(signature, number, detail), file=sys.stderr, flush=True)  # a long run is read while it runs


def told(signature: str, number: int, detail: str) -> str:
    return f"{signature}: input {number}: {detail.strip().splitlines()[-1][:200]}"


def of_inputs(first: int, last: int, hash_seed: int = 0) -> Iterator[dict[str, Any]]:
    """What a process says of its inputs; one that dies, or is ended, is a fault."""
    for record in records("tests.verification.fuzz.worker", first, last, PYTHONHASHSEED=str(hash_seed)):
        yield record
        if "died" in record:
            code = record["died"]
            kind = "hang" if code == -9 else f"died of {-code}" if code < 0 else f"ended with {code}"
            faults = [{"signature": f"any: {kind} at ", "detail": f"the process ended with {code}"}]
            yield {"input": record["begun"], "layers": [], "seconds": 0, "digest": "", "faults": faults}


def run(inputs: int, seed: int, jobs: int, twice: int, until: float = float("inf")) -> Tally:
    """Run inputs from number `seed` on, and stop early when the clock passes `until`."""
    tally = Tally()
    starts = range(seed, seed + inputs, CHUNK)

    def chunk(start: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        if time.monotonic() > until:
            return [], []
        last = min(start + CHUNK, seed + inputs)
        again = start + (last - start) // twice if twice else start
        return list(of_inputs(start, last)), list(of_inputs(start, again, hash_seed=1))

    with ThreadPoolExecutor(jobs) as pool:
        for once, again in pool.map(chunk, starts):
            for record in once:
                tally.add(record)
            compare(tally, once, again)
            if len(starts) > 5:
                print(f"{tally.inputs:,} inputs, {sum(tally.kinds.values())} faults", file=sys.stderr, flush=True)
    return tally


def compare(tally: Tally, once: list[dict[str, Any]], again: list[dict[str, Any]]) -> None:
    digests = {record["input"]: record["digest"] for record in once if "input" in record}
    for record in again:
        if "input" in record:
            tally.twice += 1
            if record["digest"] != digests[record["input"]]:
                tally.fault("any: another answer at ", record["input"], "a second process answers differently")


def summary(tally: Tally, seconds: float, jobs: int) -> str:
    kinds = Counter(signature.split()[1] for signature in tally.kinds.elements())
    crashes = kinds["died"] + kinds["ended"]
    hangs = kinds["hang"]
    differences = kinds["another"] + kinds["message"]
    raised = sum(kinds.values()) - crashes - hangs - differences
    slowest = tally.slowest[0][0] if tally.slowest else 0
    return (
        f"{tally.inputs:,} inputs ({tally.twice:,} of them twice), {differences} differences, {raised} exceptions, "
        f"{crashes} crashes, {hangs} hangs, slowest {slowest:.1f} s, peak memory {tally.peak / 2**20:.0f} MB; "
        f"{machine(seconds, jobs, 'numpy', 'PyYAML')}"
    )


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.fuzz", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--inputs", type=int, default=10_000, help="how many inputs")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after about so long")
    parser.add_argument("--seed", type=int, default=0, help="the number of the first of them")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--twice", type=int, default=20, help="one in how many is run twice; 0: none")
    parser.add_argument(
        "--save", action="store_true", help="minimise one input of each kind of fault, and keep it under found/"
    )
    parser.add_argument("--only", type=int, help="one input, through all layers")
    parser.add_argument("--show", action="store_true", help="print that input")
    return parser.parse_args()


def only(number: int, show: bool) -> int:
    from tests.verification.fuzz.mutate import mutant
    from tests.verification.fuzz.worker import examined

    content = mutant(number)
    if show:
        sys.stdout.buffer.write(content)
    outcome = examined(content)
    print(
        "\n".join((" > ".join(outcome.layers), *outcome.said, *(f"{f.signature}\n{f.detail}" for f in outcome.faults)))
    )
    return 1 if outcome.faults else 0


def save(tally: Tally) -> None:
    from tests.verification.fuzz.found import keep

    for signature, (number, _) in tally.examples.items():
        print(f"kept {keep(number, signature)}", flush=True)


def main() -> int:
    asked = arguments()
    if asked.only is not None:
        return only(asked.only, asked.show)
    begun = time.monotonic()
    tally = run(asked.inputs, asked.seed, asked.jobs, asked.twice, begun + asked.seconds)
    for signature, count in tally.kinds.most_common():
        number, detail = tally.examples[signature]
        print(f"{count} × {told(signature, number, detail)}")
    print(
        ", ".join(f"{layer} {n:,}" for layer, n in tally.layers.most_common()),
        "; slowest are ",
        ", ".join(f"{number} ({seconds:.1f} s)" for seconds, number in tally.slowest),
        sep="",
    )
    print(summary(tally, time.monotonic() - begun, asked.jobs))
    if asked.save:
        save(tally)
    return 1 if tally.kinds else 0


if __name__ == "__main__":
    sys.exit(main())
