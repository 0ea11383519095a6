"""Commands of `taskspec` in a process of their own, which is a copy of one that has imported the package already."""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from taskspec.base import limits
from tests.conftest import ROOT

COMMAND = "import sys; from taskspec.cli import main; sys.argv = ['taskspec', *arguments]; main()"


class Ended(NamedTuple):
    """How a process ended, and what it said."""

    returncode: int
    stdout: str
    stderr: str


def taskspec(folder: Path, *arguments: object, resources: Mapping[str, int] | None = None, **environment: str) -> Ended:
    """Run a command of `taskspec` in a folder.

    Args:
        resources: limits, by their names in `resource`.
        environment: what differs from that of this process.
    """
    return program(COMMAND, folder, *arguments, resources=resources, **environment)


def program(
    code: str, folder: Path, *arguments: object, resources: Mapping[str, int] | None = None, **environment: str
) -> Ended:
    """Run Python, which knows `arguments`, in a folder."""
    with tempfile.TemporaryDirectory() as said, ThreadPoolExecutor(2) as readers:
        pipes = [Path(said) / "out", Path(said) / "err"]  # a limit of sizes of files does not hold for pipes
        for pipe in pipes:
            os.mkfifo(pipe)
        texts = readers.map(Path.read_text, pipes)
        known = {**os.environ, "NO_COLOR": "1", **environment}
        job = {
            "code": code, "folder": str(folder), "arguments": list(map(str, arguments)), "environment": known,
            "resources": dict(resources or {}), "pipes": list(map(str, pipes)),
        }  # fmt: skip
        process = _process()
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        status = int(process.stdout.readline())
        return Ended(status, *texts)


@cache
def _process() -> subprocess.Popen[str]:
    """The process that makes copies of itself; it ends with this one, when its input does."""
    command = [sys.executable, "-m", "tests.shared.apart"]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, text=True)


def _become(job: dict[str, Any]) -> None:
    """Run the code of a job in this copy, and end."""
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    for number, pipe in enumerate(job["pipes"], 1):
        os.dup2(os.open(pipe, os.O_WRONLY), number)
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - it lasts as long as the copy
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    os.chdir(job["folder"])
    os.environ.clear()
    os.environ.update(job["environment"])
    sys.dont_write_bytecode = "PYTHONDONTWRITEBYTECODE" in os.environ
    limits.limits.cache_clear()
    for name, amount in job["resources"].items():
        resource.setrlimit(getattr(resource, name), (amount, amount))
    exec(job["code"], {"__name__": "__main__", "arguments": job["arguments"]})


def _serve() -> None:
    for name in ("cli.app", "exact", "show.pages", "show.record", "tools.authoring.checks"):  # what many copies need
        import_module(f"taskspec.{name}")
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            _become(json.loads(line))
            sys.exit()
        print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)


if __name__ == "__main__":
    _serve()
