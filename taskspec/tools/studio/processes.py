"""Processes that answer the questions of a page: one for each kind, ended when a question is outdated or takes too long.

They are forked from one process that has imported everything, so that an ended one is replaced within a moment. All of them
end with the server, even if that is killed.
"""

from __future__ import annotations

import asyncio
import gc
import multiprocessing
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from pathlib import Path
from threading import Thread
from typing import Any

SECONDS = {
    "page": 10, "scores": 60, "claims": 60, "values": 30, "play": 30, "rollout": 60, "sweep": 120, "results": 30, "copy": 30,
}  # fmt: skip
"""The kinds of questions that processes answer, and how long each may take."""
PATIENCE = 0.15
"""Seconds that an outdated question may still take before its process is ended: many answers come sooner than a new process."""


class NoAnswer(Exception):
    """A question was given up; the message says why."""


def start_method() -> BaseContext:
    """Return how processes are started: forked from one that has imported everything, where the system can do this."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["taskspec.tools.studio.warm"])
    forkserver.ensure_running()
    return context


class Answerer:
    """One kind of questions: one is answered at a time, and of those that wait only the newest is."""

    def __init__(self, context: BaseContext, folder: Path) -> None:
        self._context: Any = context
        self._folder = folder
        self._thread = ThreadPoolExecutor(1)
        self._turn = asyncio.Lock()
        self._newest = 0
        self._present = 0
        self._process: Any = None
        self._connection: Connection | None = None

    async def ask(self, kind: str, question: bytes) -> bytes | None:
        """Return the answer; None where a newer question was asked meanwhile.

        Raises:
            NoAnswer: it took too long, or its process died.
        """
        self._newest += 1
        number = self._newest
        if self._turn.locked():
            asyncio.get_running_loop().call_later(PATIENCE, self._leave, number)
        async with self._turn:
            if number != self._newest:
                return None
            self._present = number
            try:
                answer = await asyncio.wrap_future(self._thread.submit(self._answer, kind, question))
            except NoAnswer:
                if number == self._newest:
                    raise
                return None
            finally:
                self._present = 0
            if number == self._newest:
                return answer
            return None

    def warm(self) -> None:
        """Start the process before there is a question."""
        self._thread.submit(self._started)

    def end(self) -> None:
        """End the process, in the middle of a question if need be."""
        self._thread.shutdown(wait=False, cancel_futures=True)
        self._kill()

    def _leave(self, newer: int) -> None:
        """End the process if it still works on a question older than a certain one, also if it only starts now."""
        if 0 < self._present < newer:
            self._kill()
            asyncio.get_running_loop().call_later(PATIENCE, self._leave, newer)

    def _kill(self) -> None:
        if self._process is not None:
            self._process.kill()

    def _started(self) -> Connection:
        if self._connection is None:
            ours: Connection
            ours, theirs = self._context.Pipe()
            process = self._context.Process(target=work, args=(theirs, self._folder), daemon=True)
            process.start()
            theirs.close()
            self._process = process
            self._connection = ours
        return self._connection

    def _answer(self, kind: str, question: bytes) -> bytes:
        seconds = SECONDS[kind]
        try:
            connection = self._started()
            connection.send_bytes(question)
            if connection.poll(seconds):
                return connection.recv_bytes()
            reason = f"`{kind}` took longer than {seconds} s, and was ended; smaller parameters may help"
        except (EOFError, OSError):
            reason = f"the process that worked out `{kind}` ended"
        self._kill()
        self._connection = None  # the next question starts another
        raise NoAnswer(reason)


def work(connection: Connection, folder: Path) -> None:
    """Answer questions, one after the other, until nobody asks any more: what a process does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which ends this process
    gc.set_threshold(100_000, 50, 50)  # as the command line does, for the same reason
    Thread(target=_end_with_server, daemon=True).start()
    from taskspec.tools.studio.answers import answered

    with suppress(EOFError, OSError):
        while True:
            connection.send_bytes(answered(connection.recv_bytes(), folder))


def _end_with_server() -> None:
    """End this process when the server is gone, in the middle of a question if need be."""
    server = multiprocessing.parent_process()
    assert server is not None
    server.join()
    os._exit(1)
