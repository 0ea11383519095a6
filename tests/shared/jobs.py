"""Jobs for the tests of runs, and two programs.

`python -m tests.shared.jobs STORE LOG COUNT SECONDS [CLUSTER]` is a run; without arguments, it is a Dask cluster of two workers.
"""

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.learn.jobs.running import Interrupted, Running, run
from taskspec.learn.jobs.store import Job, Store
from taskspec.learn.jobs.work import within_limit


def square(x: int, log: str | None = None, seconds: float = 0.0) -> dict[str, int]:
    """A number and its square. A line of the log says when it was begun."""
    if log is not None:
        with Path(log).open("a") as file:
            file.write(f"{x}\n")
    time.sleep(seconds)
    return {"x": x, "square": x * x}


def threads() -> int:
    """Those that JAX computes with on this machine's processors."""
    import jax

    jax.numpy.zeros(3).block_until_ready()
    names = map(Path.read_text, Path("/proc/self/task").glob("*/comm"))
    return "".join(names).count("XLAEigen")


def compiled_again() -> list[int]:
    """Compile a function of JAX twice, as modules that are run again do, and return how often the compiled one was kept."""
    import jax

    are_hits: list[bool] = []
    jax.monitoring.register_event_listener(lambda event, **_: are_hits.append(event.endswith("/cache_hits")))
    found = []
    for _ in range(2):
        jax.jit(lambda x: jax.numpy.tanh(x) @ x)(jax.numpy.ones((3, 3))).block_until_ready()
        found.append(sum(are_hits))
        jax.clear_caches()
    return found


def variable(name: str) -> str:
    return os.environ[name]


def wrong(text: str) -> None:
    raise ValueError(text)


def refused() -> None:
    raise SpecError([Diagnostic("E713", None, "no such thing", "take another")])


def odd() -> object:
    return object()


def leave() -> None:
    sys.exit(3)


def die(log: str) -> None:
    """Kill the process that this runs in, each time."""
    square(0, log)
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(log: str) -> dict[str, int]:
    if not Path(log).exists():
        die(log)
    return square(7)


def turn() -> None:
    """A loop in Python, which a signal interrupts."""
    while True:
        pass


def without_signals() -> None:
    """Make the process that this runs in one without signals for time limits."""
    del signal.setitimer, signal.SIGALRM


def deaf() -> None:
    """A loop that catches whatever interrupts it."""
    while True:
        try:
            turn()
        except BaseException:
            continue


def hold() -> int:
    """One call in C that holds the interpreter for hours and heeds no signal."""
    return sum(range(10**13))


def meet(folder: str, name: str, other: str) -> int:
    """Return the number of this process, as soon as the other job has begun, too."""
    (Path(folder) / name).touch()
    while not (Path(folder) / other).exists():
        time.sleep(0.01)
    return os.getpid()


def partly_limited(before: float, within: float) -> None:
    time.sleep(before)
    with within_limit():
        time.sleep(within)


def talk(text: str, log: str) -> dict[str, int]:
    """Print to both streams, and die the first time."""
    print(text)
    os.write(2, b"and aloud\n")
    sys.stdout.flush()
    return die_once(log)


def squares(count: int, *arguments: Any) -> list[Job]:
    return [Job(f"k{x}", f"the square of {x}", "tests.shared.jobs:square", (x, *arguments)) for x in range(count)]


def cluster() -> None:
    """A Dask cluster of two workers that lasts until standard input ends: its address and the workers' processes are printed."""
    import distributed  # takes long, and only this needs it

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as found:
        print(found.scheduler_address, *(worker.pid for worker in found.workers.values()), flush=True)
        sys.stdin.read()


def main(path: str, log: str, count: str, seconds: str, address: str | None = None) -> None:
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # which who starts us in the background may have turned off
    try:
        with Store(path) as store:
            running = Running(None if address else 2, address)
            run(squares(int(count), log, float(seconds)), store, running)
    except (SpecError, Interrupted) as error:
        print(error)
        sys.exit(1 if isinstance(error, SpecError) else 130)


if __name__ == "__main__":
    main(*sys.argv[1:]) if len(sys.argv) > 1 else cluster()
