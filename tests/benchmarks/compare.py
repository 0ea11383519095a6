"""Speed beside an earlier commit: `python -m tests.benchmarks compare REV`, in a checkout.

REV is unpacked into a temporary folder. For each of the two trees there is one process, which runs the same benchmarks on its own
`taskspec`. The processes take turns, so that a slow moment of the machine meets both; what counts is the ratio of two
measurements that follow each other.
"""

from __future__ import annotations

import argparse
import io
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TASKS = ("RiskyPath", "NoisyObs", "ProcGoal", "Parabola", "Sort", "LargestSum")
KINDS = ("scalar", "numpy", "numba", "load", "check")
LANES = 1024
STEPS = 256
CALIBRATION = 0.25
"""A measurement is planned from one that takes at least this share of its time."""
NOISE = 0.05
"""Two processes of the same code may differ by this share, by where things are in memory."""

Drive = Callable[[], None]
"""Does the work of a benchmark once."""


# -- in the process of a tree -------------------------------------------------------------------------------------


def drive_of(name: str) -> Drive:
    """The work of a benchmark, such as `NoisyObs scalar`."""
    task, kind = name.split()
    makers = {"scalar": _scalar, "load": _load, "check": _check}
    maker = makers.get(kind)
    if maker is not None:
        return maker(f"derail/{task}-v0")
    return _vector(f"derail/{task}-v0", kind)


def _scalar(task: str) -> Drive:
    """Steps of one environment, resets included."""
    import taskspec

    env = taskspec.make(task)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(STEPS)]
    env.reset(seed=0)

    def drive() -> None:
        for action in actions:
            *_, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return drive


def _vector(task: str, backend: str) -> Drive:
    """Steps of many environments, resets included."""
    import taskspec

    env = taskspec.make_vec(task, num_envs=LANES, backend=backend, autoreset_mode="SameStep", reuse=True)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(16)]
    env.reset(seed=0)

    def drive() -> None:
        for action in actions:
            env.step(action)

    return drive


def _load(task: str) -> Drive:
    """From the text of a spec to a task."""
    from taskspec.language import registry
    from taskspec.language.source import read_file
    from taskspec.language.task.build import build

    entry = registry.find(task)

    def drive() -> None:
        build(read_file(str(entry.path)), entry.variant, {}, entry.suite)

    return drive


def _check(task: str) -> Drive:
    """Everything that is proved of a task."""
    import taskspec
    from taskspec import exact

    found = taskspec.load(task)

    def drive() -> None:
        exact.check(found)

    return drive


def serve(tree: Path, seconds: float) -> None:
    """Measure what standard input names, line by line, and print how often a second it is done; 0 where it does not run here."""
    import taskspec

    assert Path(taskspec.__file__).resolve().is_relative_to(tree), f"{taskspec.__file__} is not in {tree}"
    planned: dict[str, tuple[Drive, int] | None] = {}
    for line in sys.stdin:
        name = line.strip()
        if name not in planned:
            planned[name] = _planned(name, seconds)
        plan = planned[name]
        rate = 0.0
        if plan is not None:
            drive, passes = plan
            rate = passes / _timed(drive, passes)
        print(repr(rate), flush=True)


def _planned(name: str, seconds: float) -> tuple[Drive, int] | None:
    """A benchmark, warm, and how often it is done in so many seconds; None, with a word, where it does not run."""
    try:
        drive = drive_of(name)
        drive()
    except Exception as error:
        print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
        return None
    passes = 1
    took = _timed(drive, passes)
    while took < CALIBRATION * seconds:
        passes *= 4
        took = _timed(drive, passes)
    return drive, max(1, round(passes * seconds / took))


def _timed(drive: Drive, passes: int) -> float:
    """Seconds of processor time."""
    start = time.process_time()
    for _ in range(passes):
        drive()
    return max(1e-9, time.process_time() - start)


# -- in the process that compares ---------------------------------------------------------------------------------


class Side:
    """The process of a tree."""

    def __init__(self, tree: Path, seconds: float) -> None:
        command = [sys.executable, "-P", __file__, "HEAD", "--serve", str(tree), "--seconds", str(seconds)]
        environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1"}
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, cwd=tree, env=environment, stdin=pipe, stdout=pipe, text=True)

    def rate(self, name: str) -> float:
        """How often a second a benchmark is done; 0 where it does not run."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{name}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise SystemExit(f"the process that measures {name} has ended")
        return float(answer)

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


@dataclass(frozen=True)
class Row:
    """A benchmark, and in each round how many times as often a second it is done now as before."""

    name: str
    ratios: tuple[float, ...]

    def __str__(self) -> str:
        if not self.ratios:
            return f"{self.name:20}  not measured"
        middle = statistics.median(self.ratios)
        low = self.ratios[0]
        high = self.ratios[-1]
        if len(self.ratios) > 1:
            low, _, high = statistics.quantiles(self.ratios, n=4, method="inclusive")
        text = f"{self.name:20}  {middle:6.3f}×  {low:.3f}–{high:.3f}"
        if low > 1 + NOISE:
            return f"{text}  faster"
        if high < 1 - NOISE:
            return f"{text}  slower"
        return text


def raced(name: str, before: Side, now: Side, rounds: int) -> Row:
    """Measure a benchmark on both sides in turns; who begins changes from round to round."""
    ratios = []
    for i in range(rounds + 1):
        order = (before, now) if i % 2 else (now, before)
        rates = {side: side.rate(name) for side in order}
        if not all(rates.values()):
            return Row(name, ())
        if i:  # the first round warms up
            ratios.append(rates[now] / rates[before])
    return Row(name, tuple(ratios))


def unpack(revision: str, folder: Path) -> str:
    """Write the files of a commit into a folder, and return its short name."""
    named = subprocess.run(
        ["git", "rev-parse", "--short", "--verify", f"{revision}^{{commit}}"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if named.returncode:
        raise SystemExit(f"there is no commit '{revision}': {named.stderr.strip()}")
    commit = named.stdout.strip()
    held = subprocess.run(["git", "archive", "--format=tar", commit], cwd=ROOT, capture_output=True, check=True)
    with tarfile.open(fileobj=io.BytesIO(held.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return commit


def compare(revision: str, names: Sequence[str], rounds: int, seconds: float) -> None:
    """Print the ratio of each benchmark, with its quartiles."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary).resolve()
        commit = unpack(revision, folder)
        before = Side(folder, seconds)
        now = Side(ROOT, seconds)
        try:
            print(f"this tree beside {commit}: speed now / before, the median of {rounds} rounds and the quartiles")
            for name in names:
                print(raced(name, before, now, rounds), flush=True)
        finally:
            before.end()
            now.end()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        "python -m tests.benchmarks compare", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("revision", metavar="REV", help="the commit to compare with")
    parser.add_argument("--tasks", default=",".join(TASKS), help="tasks of DERAIL, with commas between them")
    parser.add_argument("--kinds", default=",".join(KINDS), help=f"of {', '.join(KINDS)}")
    parser.add_argument("--rounds", type=int, default=9, help="measurements of each benchmark on each side")
    parser.add_argument("--seconds", type=float, default=0.1, help="of processor time, about, for a measurement")
    parser.add_argument("--serve", metavar="TREE", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.serve is not None:
        serve(Path(given.serve).resolve(), given.seconds)
        return
    kinds = given.kinds.split(",")
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown:
        parser.error(f"--kinds is of {', '.join(KINDS)}, not '{unknown[0]}'")
    if given.rounds < 1:
        parser.error("--rounds is 1 or more")
    names = [f"{task} {kind}" for kind in kinds for task in given.tasks.split(",")]
    compare(given.revision, names, given.rounds, given.seconds)


if __name__ == "__main__":
    main()
