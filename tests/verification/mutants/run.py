"""A change is made in a copy of the tree, and tests are run there until one fails."""

from __future__ import annotations

import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Sequence
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from tests.verification.mutants.changes import mutated
from tests.verification.mutants.choose import Timed
from tests.verification.mutants.ordered import Only
from tests.verification.mutants.rooms import ROOT

PATIENCE = 30
"""Seconds of the processor that tests may take beyond three times what they take without a change."""
ASLEEP = 900
"""Seconds by the clock, for what waits for ever."""
MEMORY = 8 * 2**30
"""Bytes that a process may take: some changes never stop to append."""
PACKAGES = [
    "pytest",
    "numpy",
    "scipy.sparse",
    "scipy.stats",
    "hypothesis",
    "typer.testing",
    "pydantic",
    "yaml",
    "jinja2",
]
"""Imported once for all processes."""
SAID = "said.txt"
"""Where tests print to."""


class Copy:
    """A copy of the repository, in which one file at a time is another."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
        for name in filter(None, listed):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
        subprocess.run([sys.executable, "-m", "compileall", "-q", "."], cwd=folder, check=True)

    def ask(self, file: str, number: int, tests: Iterable[Timed]) -> tuple[str, str]:
        """What becomes of a change, `killed`, `timeout` or `survived`, and the test that noticed it."""
        path = self.folder / file
        source = (ROOT / file).read_text()
        path.write_text(mutated(source, number))
        Path(cache_from_source(str(path))).unlink(missing_ok=True)
        try:
            return self.put_through(tests)
        finally:
            path.write_text(source)

    def put_through(self, tests: Iterable[Timed]) -> tuple[str, str]:
        """Run tests on the copy as it is, one file after the other, up to the first that fails."""
        by_file: dict[str, list[str]] = {}
        seconds = 0.0
        for test in tests:
            by_file.setdefault(test.name.partition("::")[0], []).append(test.name)
            seconds += test.seconds
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(PACKAGES)
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(
            target=_run, args=(str(self.folder), list(by_file.values()), int(PATIENCE + 3 * seconds), theirs)
        )
        process.start()
        theirs.close()
        try:
            said = _heard(ours)
            process.join(10)
        finally:
            if process.is_alive():
                os.killpg(process.pid or 0, signal.SIGKILL)
                process.join()
        if said is None and (process.exitcode or 0) > 0:
            raise RuntimeError((self.folder / SAID).read_text())
        if said is None:
            return ("timeout" if process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL) else "killed"), ""
        return said


def _heard(pipe: Any) -> tuple[str, str] | None:
    """What a process says at its end; None where it ends without a word."""
    try:
        return pipe.recv() if pipe.poll(ASLEEP) else None
    except EOFError:
        return None


def _run(folder: str, files: Sequence[Sequence[str]], seconds: int, out: Any) -> None:
    """In a process of its own: run the tests of each file, and say what fails."""
    import pytest

    os.setsid()
    os.chdir(folder)
    sys.path.insert(0, folder)
    sys.dont_write_bytecode = True
    for name in [name for name in sys.modules if name.partition(".")[0] == "taskspec"]:
        del sys.modules[name]  # Python may import it at its start, for Gymnasium
    os.environ |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": folder}
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    said = os.open(SAID, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(said, 1)
    os.dup2(said, 2)
    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    for names in files:
        file = names[0].partition("::")[0]
        only = Only(names)
        status = pytest.main([file, *options], plugins=[only])
        if status == pytest.ExitCode.NO_TESTS_COLLECTED:
            raise RuntimeError(f"{file} has no test of those that were chosen")
        if status:
            out.send(("killed", only.failed or f"{file} ended with {int(status)}"))
            return
    out.send(("survived", ""))
