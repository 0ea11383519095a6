"""`python -m tests.verification.mutants`: small changes of the source, one at a time, and whether some test notices.

    python -m tests.verification.mutants --room lang --sample 100 --seed 0
    python -m tests.verification.mutants --room lang --again          # those that nothing noticed
    python -m tests.verification.mutants --table                      # what is in docs/explain/correctness.md

Results are kept as lines of JSON, so that a run goes on where one was stopped. A sample is the same wherever the text of what it
changes is. Which tests run which lines is found out once, by coverage.py.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from tests.verification.mutants.changes import Mutant, mutants
from tests.verification.mutants.rooms import NOT_CHANGED, ROOMS, ROOT
from tests.verification.mutants.table import HEAD, equivalent, reasons, row


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.mutants", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--room", choices=ROOMS, action="append", help="default: all of them")
    parser.add_argument("--sample", type=int, default=100, help="how many changes of each room")
    parser.add_argument("--seed", type=int, default=0, help="which of them")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--again", action="store_true", help="ask the tests once more about changes that survived")
    parser.add_argument(
        "--table", action="store_true", help="run nothing; print what is in docs/explain/correctness.md"
    )
    parser.add_argument(
        "--folder", type=Path, default=ROOT / "build" / "mutants", help="where maps and results are kept"
    )
    return parser.parse_args()


def sample(room: str, size: int, seed: int) -> list[Mutant]:
    """Changes of a room, the same ones as long as their text stays."""
    return sorted(changes_of(room), key=lambda m: hashlib.sha256(f"{seed} {m.key}".encode()).digest())[:size]


@cache
def changes_of(room: str) -> list[Mutant]:
    files = [p.relative_to(ROOT).as_posix() for p in sorted((ROOT / ROOMS[room].folder).rglob("*.py"))]
    return [m for file in files if file not in NOT_CHANGED for m in mutants(file, (ROOT / file).read_text())]


def results(path: Path) -> dict[str, dict[str, Any]]:
    """By the key of a change what became of it, the last word on each."""
    lines = path.read_text().splitlines() if path.exists() else []
    return {record["key"]: record for record in map(json.loads, lines)}


def run(room: str, wanted: list[Mutant], jobs: int, folder: Path, again: bool) -> None:
    from tests.verification.mutants.choose import chosen, mapped
    from tests.verification.mutants.run import Copy

    seen = mapped(ROOMS[room], folder / "map")
    with tempfile.TemporaryDirectory() as scratch, (folder / f"{room}.jsonl").open("a") as out:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for k in range(jobs):
            copies.put(Copy(Path(scratch, str(k))))

        def ask(mutant: Mutant) -> dict[str, Any]:
            copy = copies.get()
            begun = time.monotonic()
            try:
                became, by = copy.ask(mutant.file, mutant.number, chosen(mutant, ROOMS[room], seen, again))
            finally:
                copies.put(copy)
            return {
                **asdict(mutant),
                "key": mutant.key,
                "became": became,
                "by": by,
                "seconds": round(time.monotonic() - begun, 1),
            }

        noticed = set()
        with ThreadPoolExecutor(jobs) as pool:
            for record in pool.map(ask, wanted):
                print(json.dumps(record), file=out, flush=True)
                print(f"{record['became']:9} {record['seconds']:5} s  {record['key']}", flush=True)
                noticed.add(record["by"])
        tests = [test for s in seen for test in s.tests if test.name in noticed]
        became, by = copies.get().put_through(tests) if tests else ("survived", "")
        if became != "survived":
            raise RuntimeError(f"{became} without a change: {by}")


def main() -> int:
    asked = arguments()
    asked.folder.mkdir(parents=True, exist_ok=True)
    lines = list(HEAD)
    for room in asked.room or ROOMS:
        path = asked.folder / f"{room}.jsonl"
        wanted = sample(room, asked.sample, asked.seed)
        known = results(path)
        if not asked.table:
            settled = equivalent() if asked.again else known
            done = {key for key, record in known.items() if record["became"] != "survived" or key in settled}
            run(room, [m for m in wanted if m.key not in done], asked.jobs, asked.folder, asked.again)
        lines.append(row(room, changes_of(room), wanted, results(path)))
    print("\n".join(lines if not asked.table else [*lines, "", *reasons()]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
