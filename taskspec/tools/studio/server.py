"""The server of the studio: one page, its files, the language server, and answers, for one person on this machine.

Everybody else is turned away: it listens on the loopback interface alone, and asks each request for its own name as the host,
for the page's own address as the origin, and for a random token.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import secrets
import signal
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from taskspec.base.diagnostics import SpecError, records, spec_error
from taskspec.tools.studio.folder import SPECS, FileRefused, Folder, new
from taskspec.tools.studio.processes import SECONDS, Answerer, NoAnswer, start_method

HOST = "127.0.0.1"
LARGEST = 4_000_000
"""Bytes of a message of a page."""
STATIC = Path(__file__).parent / "static"
STYLES = Path(__file__).parents[2] / "show" / "pages" / "templates"
"""The styles of printed pages and figures, beside other templates."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self'; frame-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
HEADERS = {
    "Content-Security-Policy": POLICY, "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}  # fmt: skip


@dataclass(frozen=True)
class Studio:
    """A folder that is served, the spec of it that is opened first, and the token that the page's address has."""

    folder: Folder
    opened: str | None
    template: str
    socket: socket.socket
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @classmethod
    def of(cls, target: Path, port: int, template: str) -> Studio:
        """Return the studio of a folder, or of one spec in its folder; `port` 0 means any that is free.

        Raises:
            SpecError: E710 where there is nothing of the name, E711 for a file that is no spec, E713 where the port is taken.
        """
        if not target.exists():
            raise spec_error(
                "E710", f"there is no file or folder '{target}'", "`taskspec new` writes a spec to start from"
            )
        place = target.resolve()
        if place.is_dir():
            folder = Folder(place)
            opened = None
        elif place.suffix in SPECS:
            folder = Folder(place.parent)
            opened = place.name
        else:
            raise spec_error("E711", f"'{target}' is not a spec: it does not end in .yaml")
        listening = socket.socket()
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((HOST, port))
        except (OSError, OverflowError) as error:
            listening.close()
            raise spec_error(
                "E713", f"port {port} cannot be used: {error}", "`--port 0` takes one that is free"
            ) from None
        return cls(folder, opened, template, listening)

    @property
    def origin(self) -> str:
        return f"http://{HOST}:{self.socket.getsockname()[1]}"

    @property
    def address(self) -> str:
        """The address of the page, with its token."""
        return f"{self.origin}/?token={self.token}"


class Guard:
    """Turns requests away that do not come from the studio's own page, and adds headers that bind the page."""

    def __init__(self, app: ASGIApp, studio: Studio) -> None:
        self.app = app
        self.studio = studio

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what is admitted."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        if self._admits(scope):
            await self.app(scope, receive, send_with_headers)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            refusal = PlainTextResponse("403: open the address that `taskspec studio` printed", 403)
            await refusal(scope, receive, send_with_headers)

    def _admits(self, scope: Scope) -> bool:
        headers = Headers(scope=scope)
        is_socket = scope["type"] == "websocket"
        if f"http://{headers.get('host')}" != self.studio.origin:
            return False
        if headers.get("origin", None if is_socket else self.studio.origin) != self.studio.origin:
            return False
        if scope["path"].startswith("/static/") and not is_socket:
            return True
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        return hmac.compare_digest(given.encode(), self.studio.token.encode())


def application(studio: Studio) -> ASGIApp:
    context = start_method()

    def index(request: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def live(page: WebSocket) -> None:
        await page.accept()
        answerers = {kind: Answerer(context, studio.folder.root) for kind in SECONDS}
        answerers["claims"] = answerers["scores"]  # they rest on the same results, and are asked for after them
        await Conversation(studio, page, answerers).run()

    routes = [
        Route("/", index),
        Mount("/static/pages", StaticFiles(directory=STYLES)),
        Mount("/static", StaticFiles(directory=STATIC)),
        WebSocketRoute("/live", live),
        WebSocketRoute("/lsp", speak),
    ]
    return Guard(Starlette(routes=routes), studio)


# -- questions and answers --------------------------------------------------------------------------------------------


class Conversation:
    """The questions of one page, each answered once; those about files here, the others in processes."""

    def __init__(self, studio: Studio, page: WebSocket, answerers: dict[str, Answerer]) -> None:
        self._page = page
        self._answerers = answerers
        self._tasks: set[asyncio.Task[None]] = set()
        folder = studio.folder
        self._files: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "files": lambda asked: folder.listing(studio.opened),
            "open": lambda asked: folder.open(asked["path"]),
            "save": lambda asked: folder.save(asked["path"], asked["text"], asked["digest"]),
            "new": lambda asked: new(asked["from"], asked.get("path"), studio.template),
        }

    async def run(self) -> None:
        """Answer until the page is closed."""
        for kind in ("page", "scores"):
            self._answerers[kind].warm()
        try:
            while True:
                text = await self._page.receive_text()
                task = asyncio.create_task(self._answer(text))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
        except (WebSocketDisconnect, KeyError):  # a frame of bytes is no question
            pass
        finally:
            for answerer in self._answerers.values():
                answerer.end()
            for task in self._tasks:
                task.cancel()

    async def _answer(self, text: str) -> None:
        asked: Any = None
        with suppress(ValueError, RecursionError):
            asked = json.loads(text)
        if not isinstance(asked, dict):
            asked = {}
        kind = str(asked.get("kind"))
        if kind in SECONDS:
            answer = await self._worked_out(asked, text)
        elif kind in self._files:
            answer = await asyncio.to_thread(self._about_files, asked)
        else:
            answer = _refusal(asked, f"there is no kind of question '{kind}'")
        with suppress(RuntimeError, WebSocketDisconnect):  # the page is gone
            await self._page.send_text(answer)

    async def _worked_out(self, asked: dict[str, Any], text: str) -> str:
        try:
            answer = await self._answerers[asked["kind"]].ask(asked["kind"], text.encode(errors="replace"))
        except NoAnswer as error:
            return _refusal(asked, str(error))
        if answer is None:
            return _refusal(asked, "a newer question was asked", outdated=True)
        return answer.decode()

    def _about_files(self, asked: dict[str, Any]) -> str:
        try:
            answer = self._files[asked["kind"]](asked)
        except FileRefused as error:
            return _refusal(asked, str(error), refused=error.why)
        except SpecError as error:
            return _refusal(asked, error.diagnostics[0].message, problems=records(error.diagnostics))
        except OSError as error:
            return _refusal(asked, f"the file cannot be used: {error.strerror}")
        except (KeyError, TypeError, AttributeError) as error:
            return _refusal(asked, f"the question lacks a part, or it has another type: {error}")
        return json.dumps({"id": asked.get("id"), "kind": asked["kind"], "ok": True, **answer}, ensure_ascii=False)


def _refusal(asked: dict[str, Any], message: str, **more: Any) -> str:
    return json.dumps({"id": asked.get("id"), "kind": asked.get("kind"), "ok": False, "message": message, **more})


# -- the language server ----------------------------------------------------------------------------------------------


async def speak(page: WebSocket) -> None:
    """Let a page speak with a language server of its own, one message of the protocol in each frame."""
    await page.accept()
    editor = await asyncio.to_thread(_language_server)
    server = editor.new_server()
    outgoing: asyncio.Queue[bytes] = asyncio.Queue()

    class FrameWriter:
        def write(self, content: bytes) -> None:
            outgoing.put_nowait(content)

        def close(self) -> None:
            pass

    async def forward() -> None:
        while True:
            await page.send_text((await outgoing.get()).decode())

    server.protocol.set_writer(FrameWriter(), include_headers=False)
    sender = asyncio.create_task(forward())
    try:
        while True:
            message = await page.receive_text()
            server.protocol.handle_message(json.loads(message, object_hook=server.protocol.structure_message))
    except (WebSocketDisconnect, KeyError, ValueError):
        pass
    finally:
        sender.cancel()
        for check in server.checks.values():
            check.cancel()


def _language_server() -> Any:
    from taskspec.tools.editor import server

    return server


# -- running ----------------------------------------------------------------------------------------------------------


def run(studio: Studio, ready: Callable[[str], None]) -> None:
    """Serve until Ctrl-C, or until the terminal is closed.

    Args:
        ready: is called with the address as soon as the page can be opened.
    """
    config = uvicorn.Config(
        application(studio), log_level="critical", access_log=False, server_header=False, lifespan="off",
        ws="websockets-sansio", ws_max_size=LARGEST, timeout_graceful_shutdown=1,
    )  # fmt: skip
    server = uvicorn.Server(config)

    def hang_up(*_: Any) -> None:
        server.should_exit = True

    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, hang_up)
    studio.socket.listen()
    ready(studio.address)
    threading.Thread(target=_language_server, daemon=True).start()  # so that the editor need not wait for imports
    with suppress(KeyboardInterrupt):
        server.run(sockets=[studio.socket])
