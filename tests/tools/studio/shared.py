"""A studio as people run it: a process with a folder of its own, and a page that asks it questions."""

import json
import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.sync.client import ClientConnection, connect

DERAIL = Path(__file__).parents[3] / "tasks" / "derail"
MARK = "TASKSPEC_STUDIO_TEST"
"""A variable of the environment by which the processes of one studio are found."""


class Studio:
    """A running studio."""

    def __init__(self, target: Path, *options: str) -> None:
        self.mark = uuid.uuid4().hex
        command = [sys.executable, "-m", "taskspec", "studio", str(target), "--no-browser", *options]
        environment = {**os.environ, MARK: self.mark}
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        assert self.process.stdout is not None
        with self.process.stdout as printed:
            self.address = printed.readline().strip()
        self.host = urlsplit(self.address).netloc
        self.token = parse_qs(urlsplit(self.address).query)["token"][0]

    def connect(self, path: str = "/live", **changes: str) -> ClientConnection:
        """Open a websocket as the page does, or with another token or origin."""
        token = changes.get("token", self.token)
        origin = changes.get("origin", f"http://{self.host}")
        address = f"ws://{self.host}{path}?token={token}"
        return connect(address, origin=origin, max_size=None, open_timeout=60)  # type: ignore[arg-type]

    def processes(self) -> list[int]:
        """Return the processes that this studio started, itself included."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                is_ours = f"{MARK}={self.mark}".encode() in (folder / "environ").read_bytes()
                is_dead = " Z " in (folder / "stat").read_text()
            except OSError:
                continue
            if is_ours and not is_dead:
                found.append(int(folder.name))
        return found

    def end(self, sent: signal.Signals) -> list[int]:
        """Send a signal, and return the processes that are left after a while."""
        self.process.send_signal(sent)
        self.process.wait(30)
        for _ in range(100):
            if not self.processes():
                break
            time.sleep(0.1)
        return self.processes()


@contextmanager
def running(target: Path) -> Iterator[Studio]:
    """Run a studio, and end it."""
    studio = Studio(target)
    try:
        yield studio
    finally:
        studio.process.terminate()
        studio.process.wait(30)


class Page:
    """A page that asks one question after the other."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.number = 0

    def send(self, kind: str, **message: Any) -> int:
        """Send a question, and return its number."""
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "kind": kind, **message}))
        return self.number

    def receive(self) -> dict[str, Any]:
        """Return the next answer."""
        found: dict[str, Any] = json.loads(self.socket.recv(90))
        return found

    def refusal(self, kind: str, **message: Any) -> dict[str, Any]:
        """Ask a question that is refused, and return the answer."""
        number = self.send(kind, **message)
        found = self.receive()
        assert (found["id"], found["kind"], found["ok"]) == (number, kind, False)
        return found

    def ask(self, kind: str, **message: Any) -> dict[str, Any]:
        """Ask a question, and return the answer."""
        number = self.send(kind, **message)
        found = self.receive()
        assert (found["id"], found["kind"], found["ok"]) == (number, kind, True), found.get("message")
        return found
