"""`taskspec lsp`, as an editor uses it: a process that answers requests over its standard input and output."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("pygls")

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

from taskspec.tools.editor.checks import check
from taskspec.tools.editor.server import server
from tests.shared.diagnostics import codes

SPEC = Path(__file__).parents[3] / "tasks" / "derail" / "risky_path.yaml"


class Session:
    """A client of a server of its own, in a loop of its own: scripts run in it one after another, each on a document."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.client = LanguageClient("test", "1")
        self.problems: dict[str, asyncio.Queue[list[lsp.Diagnostic]]] = defaultdict(asyncio.Queue)
        self.refreshed = asyncio.Event()

        @self.client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def published(params: lsp.PublishDiagnosticsParams) -> None:
            self.problems[params.uri].put_nowait(list(params.diagnostics))

        @self.client.feature(lsp.WORKSPACE_CODE_LENS_REFRESH)
        def refresh(params: Any) -> None:
            self.refreshed.set()

    def run(self, script: Awaitable[None], seconds: float = 120) -> None:
        self.loop.run_until_complete(asyncio.wait_for(script, seconds))

    async def open(self) -> None:
        await self.client.start_io(sys.executable, "-m", "taskspec", "lsp")
        await self.client.initialize_async(lsp.InitializeParams(capabilities=lsp.ClientCapabilities()))
        self.client.initialized(lsp.InitializedParams())

    async def close(self) -> None:
        await self.client.shutdown_async(None)
        self.client.exit(None)
        await self.client.stop()


@pytest.fixture(scope="module")
def session() -> Iterator[Session]:
    started = Session()
    started.run(started.open())
    yield started
    started.run(started.close(), 30)
    started.loop.close()


class Editor:
    """An open document, and what the server sent of it."""

    def __init__(self, session: Session, path: Path) -> None:
        self.client = session.client
        self.refreshed = session.refreshed
        self.uri = path.as_uri()
        self.text = path.read_text(encoding="utf-8")
        self.problems = session.problems[self.uri]
        self.version = 1

    async def open(self) -> list[lsp.Diagnostic]:
        document = lsp.TextDocumentItem(self.uri, "yaml", self.version, self.text)
        self.client.text_document_did_open(lsp.DidOpenTextDocumentParams(document))
        return await self.problems.get()

    async def change(self, old: str, new: str) -> list[lsp.Diagnostic]:
        assert self.text.count(old) >= 1
        self.text = self.text.replace(old, new, 1)
        self.version += 1
        document = lsp.VersionedTextDocumentIdentifier(self.version, self.uri)
        whole = lsp.TextDocumentContentChangeWholeDocument(self.text)
        self.client.text_document_did_change(lsp.DidChangeTextDocumentParams(document, [whole]))
        while not self.problems.empty():
            self.problems.get_nowait()
        return await self.problems.get()

    def place(self, before: str) -> dict[str, Any]:
        """Return the request of the place after a piece of the text, in UTF-16 units."""
        lines = self.text[: self.text.index(before) + len(before)].split("\n")
        column = len(lines[-1].encode("utf-16-le")) // 2
        return {"text_document": lsp.TextDocumentIdentifier(self.uri), "position": lsp.Position(len(lines) - 1, column)}

    def close(self) -> None:
        document = lsp.TextDocumentIdentifier(self.uri)
        self.client.text_document_did_close(lsp.DidCloseTextDocumentParams(document))


Edited = Callable[[Callable[[Editor], Awaitable[None]]], None]


@pytest.fixture
def edited(session: Session, tmp_path: Path) -> Edited:
    """Run a script on a copy of a spec that is open in an editor."""
    path = tmp_path / "spec.yaml"
    shutil.copy(SPEC, path)
    for bibliography in SPEC.parent.glob("*.bib"):
        shutil.copy(bibliography, tmp_path)

    def run(script: Callable[[Editor], Awaitable[None]]) -> None:
        editor = Editor(session, path)
        try:
            session.run(script(editor))
        finally:
            editor.close()

    return run


def test_mistakes_are_marked_while_typing_and_fixed(edited: Edited) -> None:
    async def script(editor: Editor) -> None:
        assert await editor.open() == []
        problems = await editor.change("start: {safe: detour", "start: {safe: detuor")
        (problem,) = (each for each in problems if each.source == "taskspec")
        line = editor.text.split("\n")[problem.range.start.line]
        assert line[problem.range.start.character : problem.range.end.character] == "detuor"
        context = lsp.CodeActionContext([problem])
        document = lsp.TextDocumentIdentifier(editor.uri)
        (action,) = await editor.client.text_document_code_action_async(
            lsp.CodeActionParams(document, problem.range, context)
        )
        assert isinstance(action, lsp.CodeAction)
        (edit,) = action.edit.changes[editor.uri]
        assert (edit.range, edit.new_text) == (problem.range, "detour")
        assert await editor.change("detuor", "detour") == []

    edited(script)


def test_a_question_that_fails_has_no_answer() -> None:
    class Broken:
        def analysis(self, uri: str) -> Any:
            raise RuntimeError(uri)

    place = SimpleNamespace(text_document=SimpleNamespace(uri="file:///x.yaml"))
    features = server.protocol.fm.features.values()
    assert len(features) > 10
    for feature in features:
        assert feature.func(Broken(), place) is None


def test_names_are_completed_explained_found_and_renamed(edited: Edited) -> None:
    async def script(editor: Editor) -> None:
        await editor.open()
        await editor.change("summary: A shortcut", "summary: 𝔸 shortcut")  # two units in UTF-16
        await editor.change("  by: [s']\n  rows: {goal: 1", "  by: [s']\n  rows: {go")
        offered = await editor.client.text_document_completion_async(lsp.CompletionParams(**editor.place("rows: {go")))
        assert [each.label for each in offered.items] == ["goal"]
        await editor.change("rows: {go", "rows: {goal: 1")
        there = editor.place("prefers(optimal, a")
        shown = await editor.client.text_document_hover_async(lsp.HoverParams(**there))
        assert shown.contents.value.startswith("`a`: action component, choice of safe, risky")
        declared = await editor.client.text_document_definition_async(lsp.DefinitionParams(**there))
        assert editor.text.split("\n")[declared.range.start.line].startswith("  a: {type: choice")
        change = await editor.client.text_document_rename_async(lsp.RenameParams(**there, new_name="way"))
        lines = editor.text.split("\n")
        for edit in sorted(change.changes[editor.uri], key=lambda e: e.range.start.character, reverse=True):
            line = lines[edit.range.start.line]
            lines[edit.range.start.line] = line[: edit.range.start.character] + "way" + line[edit.range.end.character :]
        assert await editor.change(editor.text, "\n".join(lines)) == []
        assert "prefers(soft(1), way == safe" in editor.text
        assert "by: [s, way]" in editor.text

    edited(script)


def test_a_name_is_renamed_in_the_specs_that_extend_its_own(tmp_path: Path, edited: Edited) -> None:
    child = tmp_path / "child.yaml"
    child.write_text(
        "taskspec: 1\nname: Child\nextends: spec.yaml\nreward: (s' == goal) - (a == risky)\n", encoding="utf-8"
    )

    async def script(editor: Editor) -> None:
        await editor.open()
        change = await editor.client.text_document_rename_async(
            lsp.RenameParams(**editor.place("prefers(optimal, a"), new_name="way")
        )
        assert set(change.changes) == {editor.uri, child.as_uri()}
        (edit,) = change.changes[child.as_uri()]
        assert (edit.range.start.line, edit.range.start.character, edit.new_text) == (3, 24, "way")

    edited(script)


def test_scores_and_verdicts_follow_what_is_typed_and_stay_until_there_are_others(edited: Edited) -> None:
    async def script(editor: Editor) -> None:
        await editor.open()
        document = lsp.TextDocumentIdentifier(editor.uri)

        async def lenses() -> dict[str, str]:
            found = await editor.client.text_document_code_lens_async(lsp.CodeLensParams(document))
            lines = editor.text.split("\n")
            return {lines[lens.range.start.line].strip().partition(":")[0]: lens.command.title for lens in found}

        while not await lenses():
            await editor.refreshed.wait()
            editor.refreshed.clear()
        assert await lenses() == {
            "name": "optimal 4, expert 4, random -122.219, worst -247.5",
            "claims": "16 of 16 claims proved",
            "seals": "optimal 3, expert 3, random -97.9375, worst -198",
        }
        editor.refreshed.clear()
        await editor.change("optimal_return == 4", "optimal_return == 5")
        await editor.refreshed.wait()
        assert (await lenses())["claims"] == "15 of 16 claims proved"
        while not editor.problems.empty():
            problems = editor.problems.get_nowait()
        assert codes(problems) == ["E601"]
        (problem,) = await editor.change(
            "horizon: 5", "# a line more\nhorizon: 5"
        )  # the claim stays marked, one line below
        line = editor.text.split("\n")[problem.range.start.line]
        assert line[problem.range.start.character : problem.range.end.character] == "optimal_return == 5"
        mistakes = await editor.change("initial:", "intial:")
        assert "E601" in codes(mistakes) and len(mistakes) > 1

    edited(script)


def test_a_check_ends_with_what_waits_for_it(tmp_path: Path) -> None:
    name = str(tmp_path / "unlike_any_other.yaml")

    def processes() -> list[Path]:
        return [place for place in Path("/proc").glob("[0-9]*/cmdline") if name.encode() in _content(place)]

    async def script() -> None:
        running = asyncio.create_task(check(SPEC.read_text(encoding="utf-8"), name, lambda part: None))
        while not processes():
            await asyncio.sleep(0.01)
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running
        while processes():
            await asyncio.sleep(0.01)

    if not Path("/proc/self/cmdline").exists():
        pytest.skip("this system does not show its processes as files")
    asyncio.run(asyncio.wait_for(script(), timeout=30))


def _content(place: Path) -> bytes:
    try:
        return place.read_bytes()
    except OSError:  # it has ended
        return b""


def test_layout_folding_and_signatures(edited: Edited) -> None:
    async def script(editor: Editor) -> None:
        await editor.open()
        document = lsp.TextDocumentIdentifier(editor.uri)
        await editor.change("initial:\n  s: start", "initial:\n  s: start  if  true else detour")
        options = lsp.FormattingOptions(tab_size=2, insert_spaces=True)
        (edit,) = await editor.client.text_document_formatting_async(lsp.DocumentFormattingParams(document, options))
        assert "s: start if true else detour\n" in edit.new_text
        assert await editor.change(editor.text, edit.new_text) == []
        assert not await editor.client.text_document_formatting_async(lsp.DocumentFormattingParams(document, options))
        lines = editor.text.split("\n")
        folds = await editor.client.text_document_folding_range_async(lsp.FoldingRangeParams(document))
        folded = {lines[each.start_line].strip(): lines[each.end_line].strip() for each in folds}
        assert folded["dynamics:"] == "trap: trap"
        assert folded["variants:"] == "- prefers(maxent, a == risky, at=s == start)"
        assert folded["description: |"] == "the expectation over outcomes is not."
        await editor.change("goal: 1, trap: -100", "goal: 'clip(1, [0, 0], ', trap: -100")
        call = await editor.client.text_document_signature_help_async(
            lsp.SignatureHelpParams(**editor.place("'clip(1, [0, 0], "))
        )
        assert call.signatures[0].label == "clip(x, low, high)"
        assert call.signatures[0].parameters[call.active_parameter].label == "high"

    edited(script)


def test_colours_and_outline(edited: Edited) -> None:
    async def script(editor: Editor) -> None:
        await editor.open()
        document = lsp.TextDocumentIdentifier(editor.uri)
        outline = await editor.client.text_document_document_symbol_async(lsp.DocumentSymbolParams(document))
        assert [each.name for each in outline if each.name in ("state", "action")] == ["state", "action"]
        found = await editor.client.text_document_semantic_tokens_full_async(lsp.SemanticTokensParams(document))
        line = column = 0
        words = set()
        lines = editor.text.split("\n")
        for at in range(0, len(found.data), 5):
            down, right, length, _, _ = found.data[at : at + 5]
            column = right if down else column + right
            line += down
            words.add(lines[line][column : column + length])
        assert {"s'", "goal", "start", "prefers", "122.21875"} <= words

    edited(script)


def test_other_files_are_left_alone(edited: Edited) -> None:
    async def script(editor: Editor) -> None:
        await editor.open()
        assert await editor.change(editor.text, "services:\n  web: {image: x\n") == []
        offered = await editor.client.text_document_completion_async(lsp.CompletionParams(**editor.place("  we")))
        assert list(offered.items) == []

    edited(script)


def test_the_server_ends_as_the_protocol_says() -> None:
    sent = b""
    for asked in (
        {"method": "initialize", "id": 1, "params": {"capabilities": {}}},
        {"method": "shutdown", "id": 2},
        {"method": "exit"},
    ):
        body = json.dumps({"jsonrpc": "2.0", **asked}).encode()
        sent += b"Content-Length: %d\r\n\r\n%s" % (len(body), body)
    done = subprocess.run(
        [sys.executable, "-m", "taskspec", "lsp"], input=sent, capture_output=True, timeout=120, check=False
    )
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False)
