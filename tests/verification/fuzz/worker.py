"""One process of a run: a range of inputs, within limits of time and memory. A line of JSON before and after each."""

from __future__ import annotations

import gc
import json
import random
import resource
import sys
import time
import warnings
from pathlib import Path
from typing import Any

from tests.verification.fuzz.layers import Fault, Outcome, put_through
from tests.verification.fuzz.mutate import mutant
from tests.verification.oracle.worker import Hang, patience, peak_memory

PATIENCE = 10
"""Seconds of the processor that an input may take."""
MEMORY = 2**30
"""Bytes that an input may take."""


def limited() -> None:
    """From now on this process has room for so much more; and nothing that warns goes unnoticed."""
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY, held + MEMORY))
    warnings.simplefilter("error")


def examined(content: bytes, chance: random.Random | None = None) -> Outcome:
    """What an input comes to; too much time or memory is a fault."""
    try:
        with patience(PATIENCE):
            return put_through(content, chance)
    except Hang:
        return Outcome(faults=[Fault("any", "hang", "", f"longer than {PATIENCE} s")])
    except MemoryError:
        return Outcome(faults=[Fault("any", "MemoryError", "", f"more than {MEMORY:,} bytes")])


def chance_of(number: int) -> random.Random:
    """Decides which layers an input goes through."""
    return random.Random(f"layers of {number}")


def main(first: int, last: int) -> None:
    limited()
    for number in range(first, last):
        say({"begun": number})
        begun = time.process_time()
        outcome = examined(mutant(number), chance_of(number))
        say({
            "input": number, "seconds": round(time.process_time() - begun, 3), "layers": sorted(set(outcome.layers)),
            "digest": outcome.digest, "faults": [{"signature": f.signature, "detail": f.detail} for f in outcome.faults],
        })  # fmt: skip
        if number % 500 == 0:
            gc.collect()
    say({"peak": peak_memory()})


def say(record: dict[str, Any]) -> None:
    print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
