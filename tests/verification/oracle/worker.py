"""One process of a run: a range of specs, one line of JSON on each."""

from __future__ import annotations

import gc
import json
import random
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.verification.oracle.compare.cases import Case
from tests.verification.oracle.compare.stages import Finding, Outcome, of, put_through
from tests.verification.oracle.generator.spec import spec

PATIENCE = 10
"""Seconds of the processor that a spec may take."""


class Hang(BaseException):
    """A spec takes longer than it may; no `Exception`, so that nothing takes it for its own."""


@contextmanager
def patience(seconds: int) -> Iterator[None]:
    def ring(*_: Any) -> None:
        raise Hang

    old = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)


def case_of(number: int) -> Case:
    """The case with a number: a random spec, one of its variants, and values for its parameters."""
    rng = random.Random(number)
    data = spec(rng)
    names = [None, None, *data.get("variants", {})]
    return Case(data, rng.choice(names), number, given(data, rng))


def given(data: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Sometimes a parameter has another value than its default."""
    if "L" not in data.get("parameters", {}) or rng.random() < 0.8:
        return {}
    return {"L": rng.randint(data["parameters"]["L"]["low"], data["parameters"]["L"]["high"])}


def examined(number: int, backends: list[str]) -> Outcome:
    try:
        with patience(PATIENCE):
            return put_through(case_of(number), of(backends), random.Random(f"stages {number}"))
    except Hang:
        return Outcome(findings=[Finding("any", "hang", f"longer than {PATIENCE} s")])


def main(first: int, last: int, backends: list[str]) -> None:
    """Examine specs first, ..., last - 1. Before each a line with its number, so that a crash has a name."""
    warnings.simplefilter("error")
    gc.freeze()
    gc.set_threshold(20_000, 20, 10)  # a spec leaves much behind, and little of it in circles
    for number in range(first, last):
        say({"begun": number})
        begun = time.process_time()
        outcome = examined(number, backends)
        found = [{"stage": f.stage, "what": f.what, "detail": f.detail} for f in outcome.findings]
        seconds = time.process_time() - begun
        record = {"spec": number, "made": outcome.made, "found": found, "seconds": round(seconds, 4)}
        say(record | {"peak": peak_memory()})


def peak_memory() -> int:
    """Bytes, at the most so far. What `getrusage` says includes what the parent held when it started this process."""
    held = next(row for row in Path("/proc/self/status").read_text().splitlines() if row.startswith("VmHWM"))
    return int(held.split()[1]) * 1024


def say(record: dict[str, Any]) -> None:
    print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3].split(","))
