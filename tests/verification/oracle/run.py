"""Random specs on several processes, and what all of them came to."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from tests.verification.processes import records

CHUNK = 1000
TOLD_FROM = 5
"""Chunks from which on a run says how far it is."""
MOST = 10
"""Specs of a kind of fault that are named."""


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
    heaviest: int | None = None
    """The spec after which memory was at its peak."""
    slowest: float = 0.0
    longest: int | None = None
    """The spec that took longest."""

    def add(self, record: dict[str, Any]) -> None:
        if record.get("peak", 0) > self.peak:
            self.peak = record["peak"]
            self.heaviest = record.get("spec")
        if "spec" not in record:
            return
        self.specs += 1
        if record["seconds"] > self.slowest:
            self.slowest = record["seconds"]
            self.longest = record["spec"]
        self.made.update(record["made"].keys())
        self.compared.update(record["made"])
        self.found += [{"spec": record["spec"], **f} for f in record["found"]]


def of_specs(worker: str, first: int, last: int, more: str) -> Iterator[dict[str, Any]]:
    """What a process says of its specs; one that dies is a finding."""
    for record in records(worker, first, last, more):
        yield record
        if "died" in record:
            detail = f"the process ended with {record['died']}"
            found = [{"stage": "any", "what": "died", "detail": detail}]
            yield {"spec": record["begun"], "made": {}, "seconds": 0, "found": found}


def run(worker: str, specs: int, seed: int, jobs: int, more: str, chunk: int = CHUNK) -> Tally:
    tally = Tally()
    starts = range(seed, seed + specs, chunk)
    with ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(lambda a: list(of_specs(worker, a, min(a + chunk, seed + specs), more)), starts):
            for record in found:
                tally.add(record)
            if len(starts) > TOLD_FROM:  # a long run is read while it runs
                print(f"{tally.specs:,} specs, {len(tally.found)} findings", file=sys.stderr, flush=True)
    return tally


def faults(tally: Tally) -> str:
    """A line for each kind of fault: how often it was found, and in which specs first."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for finding in tally.found:
        kinds.setdefault(f"{finding['stage']}: {finding['what']}", []).append(finding)
    return "".join(
        f"{len(many)} × {kind}: spec {', '.join(str(f['spec']) for f in many[:MOST])}: {worded(many[0])[:200]}\n"
        for kind, many in kinds.items()
    )


def worded(finding: dict[str, Any]) -> str:
    """A finding in a line: the last of a traceback, the first of anything else."""
    lines = finding["detail"].strip().splitlines()
    return lines[-1] if finding["what"].startswith(("crash", "raised")) else lines[0]


def endings(tally: Tally) -> str:
    """How many differences, crashes and hangs there were, and what the run took."""
    kinds = Counter(f["what"].split()[0] for f in tally.found)
    crashes = kinds["crash"] + kinds["died"]
    hangs = kinds["hang"]
    return (
        f"{len(tally.found) - crashes - hangs} differences, {crashes} crashes, {hangs} hangs, "
        f"slowest {tally.slowest:.1f} s{_at(tally.longest)}, peak memory {tally.peak / 2**20:.0f} MB{_at(tally.heaviest)}"
    )


def _at(spec: int | None) -> str:
    return "" if spec is None else f" (spec {spec})"
