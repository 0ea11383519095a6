"""Ctrl-C, while a command runs many jobs: what is done is kept."""

import os
import signal
from pathlib import Path

import pytest
import typer

from taskspec.cli.console import reported
from taskspec.learn.jobs.running import Interrupted
from taskspec.learn.jobs.store import Store
from tests.learn.jobs.test_jobs import begun, finished, kept, program, wait_for


def test_ctrl_c_keeps_what_is_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "store"
    log = tmp_path / "log"
    Store(path).close()
    process = program(path, log, 200, 0.05)
    wait_for(lambda: len(kept(path)) >= 10 or process.poll() is not None)
    os.killpg(process.pid, signal.SIGINT)
    status, out = finished(process)
    rows = kept(path)
    assert status == 130 and 10 <= len(rows) < 200
    assert out.startswith(f"interrupted: {len(rows)} of 200 jobs are over and kept in ")
    assert len(begun(log)) - len(rows) <= 2
    with pytest.raises(typer.Exit) as end, reported():
        raise Interrupted(out)
    assert end.value.exit_code == 130 and capsys.readouterr().err.startswith("interrupted: ")
