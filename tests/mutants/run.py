"""A change is made in a copy of the tree, and tests are run there until one fails."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Sequence
from importlib.util import cache_from_source
from pathlib import Path

from tests.mutants.changes import mutated
from tests.mutants.choose import Timed
from tests.mutants.rooms import ROOT

PATIENCE = 60.0
"""Seconds that a round of tests may take beyond three times what it takes without a change."""
MEMORY = 8 * 2**30
"""Bytes that a process may take: some changes never stop to append."""
NOT_RUN = (4, 5)
"""What pytest ends with where it cannot begin, or no test is chosen."""
HERE = os.pathsep.join((".", str(Path(__file__).parents[2])))
"""The copy is imported, and what it lacks of these files."""


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

    def ask(self, file: str, number: int, rounds: Iterable[Sequence[Timed]]) -> tuple[str, str]:
        """What becomes of a change, `killed`, `timeout` or `survived`, and the test that noticed it."""
        path = self.folder / file
        source = (ROOT / file).read_text()
        path.write_text(mutated(source, number))
        Path(cache_from_source(str(path))).unlink(missing_ok=True)
        try:
            for tests in filter(None, rounds):
                became, by = self.put_through(tests)
                if became != "survived":
                    return became, by
            return "survived", ""
        finally:
            path.write_text(source)

    def put_through(self, tests: Sequence[Timed]) -> tuple[str, str]:
        """Run tests on the copy as it is, up to the first that fails."""
        names = [test.name for test in tests]
        (self.folder / "chosen.txt").write_text("\n".join(names))
        files = list(dict.fromkeys(name.partition("::")[0] for name in names))
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "tests.mutants.ordered",
            "-m",
            "",
        ]
        with subprocess.Popen(
            [*command, *files], cwd=self.folder, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": HERE},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True, preexec_fn=_limited,
        ) as process:  # fmt: skip
            try:
                said, _ = process.communicate(timeout=PATIENCE + 3 * sum(test.seconds for test in tests))
            except subprocess.TimeoutExpired:
                return "timeout", ""
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
        if process.returncode in NOT_RUN:
            raise RuntimeError(said)
        return ("killed", _failed(said, names)) if process.returncode else ("survived", "")


def _limited() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def _failed(said: str, names: Sequence[str]) -> str:
    """The test that failed, or what else there is to say."""
    lines = said.strip().splitlines() or ["nothing was said"]
    last = next((line for line in lines if line.startswith(("FAILED ", "ERROR "))), lines[-1])
    return max((name for name in names if f" {name} - " in f"{last} - "), key=len, default=last[:200])
