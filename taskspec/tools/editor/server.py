"""A language server for specs: mistakes while typing, completion, meanings, places of names, layout, fixes, and exact scores.

`taskspec.tools.authoring` answers at once. Soundness, claims and scores come from a process (`checks`) that ends when the text
changes; its last results stay, at their lines, until there are new ones.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

from lsprotocol import types as lsp
from pygls.lsp.server import LanguageServer
from pygls.workspace import TextDocument

from taskspec.base import __version__
from taskspec.base.diagnostics import Diagnostic, SpecError, records
from taskspec.tools.authoring import meanings
from taskspec.tools.authoring.analysis import Analysis, analyse
from taskspec.tools.authoring.completion import complete
from taskspec.tools.authoring.formatting import formatted
from taskspec.tools.editor.checks import LastCheck, check
from taskspec.tools.editor.protocol import client_range, diagnostic, outline_entry, text_edit

_KINDS = {
    "key": lsp.CompletionItemKind.Property,
    "value": lsp.CompletionItemKind.EnumMember,
    "label": lsp.CompletionItemKind.EnumMember,
    "function": lsp.CompletionItemKind.Function,
    "distribution": lsp.CompletionItemKind.Class,
    "keyword": lsp.CompletionItemKind.Keyword,
    "variant": lsp.CompletionItemKind.Reference,
}
PAUSE = 0.4
"""Seconds without a change after which a text is checked."""
_IS_SPEC = re.compile(r"^taskspec *:", re.MULTILINE)
Handler = TypeVar("Handler", bound=Callable[..., Any])
_log = logging.getLogger(__name__)


class Server(LanguageServer):
    """The server with what is known of each open document."""

    def __init__(self) -> None:
        super().__init__("taskspec", __version__, text_document_sync_kind=lsp.TextDocumentSyncKind.Incremental)
        self.analyses: dict[str, Analysis] = {}
        self.known: dict[str, Analysis] = {}
        """The last analysis of each document in which there were tasks."""
        self.checked: dict[str, LastCheck] = {}
        self.checks: dict[str, asyncio.Task[None]] = {}

    def feature(self, feature_name: str, options: Any | None = None) -> Callable[[Handler], Handler]:
        """Register what answers a request: nothing where it fails, since an editor would show the failure at each key."""
        register = super().feature(feature_name, options)

        def decorated(handler: Handler) -> Handler:
            @wraps(handler)
            def answer(*arguments: Any) -> Any:
                try:
                    return handler(*arguments)
                except Exception:
                    _log.exception("no answer to %s", feature_name)
                    return None

            return register(cast(Handler, answer))

        return decorated

    def analysis(self, uri: str) -> tuple[Analysis, TextDocument]:
        """Return the analysis of a document as it is now, and the document."""
        document = self.workspace.get_text_document(uri)
        latest = self.analyses.get(uri)
        if latest is None or latest.text != document.source:
            if _IS_SPEC.search(document.source):
                latest = analyse(document.source, document.path, self.known.get(uri))
            else:
                latest = Analysis(document.source, document.path, None, (), ())
            self.analyses[uri] = latest
            if latest.attempts:
                self.known[uri] = latest
        return latest, document

    def publish(self, uri: str) -> None:
        """Send the mistakes of a document, with those that the last check found."""
        analysis, document = self.analysis(uri)
        problems = records(_problems_here(analysis))
        if uri in self.checked:
            known = {(each.code, each.message) for each in analysis.diagnostics}
            for each in self.checked[uri].problems_in(analysis.text):
                if (each["code"], each["message"]) not in known:
                    problems.append(each)
        shown = [diagnostic(each, document) for each in problems]
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, shown, document.version))


server = Server()


def new_server() -> Server:
    """Return a server with the features of `server`, for one more client."""
    fresh = Server()
    known = server.protocol.fm
    for name, feature in known.features.items():
        fresh.feature(name, known.feature_options.get(name))(feature.func)
    return fresh


# -- documents ----------------------------------------------------------------------------------------------------


@server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
def opened(ls: Server, params: lsp.DidOpenTextDocumentParams) -> None:
    """Analyse and check a document."""
    ls.publish(params.text_document.uri)
    _start_check(ls, params.text_document.uri, 0)


@server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
def changed(ls: Server, params: lsp.DidChangeTextDocumentParams) -> None:
    """Analyse a document as it is now, and check it after a pause."""
    ls.publish(params.text_document.uri)
    _start_check(ls, params.text_document.uri, PAUSE)


@server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
def closed(ls: Server, params: lsp.DidCloseTextDocumentParams) -> None:
    uri = params.text_document.uri
    for known in (ls.analyses, ls.known, ls.checked):
        known.pop(uri, None)
    running = ls.checks.pop(uri, None)
    if running is not None:
        running.cancel()


# -- what is asked for --------------------------------------------------------------------------------------------


@server.feature(lsp.TEXT_DOCUMENT_COMPLETION)
def completion(ls: Server, params: lsp.CompletionParams) -> lsp.CompletionList:
    """Return what can be written at a place."""
    uri = params.text_document.uri
    analysis, document = ls.analysis(uri)
    if not _IS_SPEC.search(analysis.text):
        return lsp.CompletionList(is_incomplete=False, items=[])
    if not analysis.attempts and uri in ls.known:
        known = ls.known[uri]
        analysis = Analysis(analysis.text, analysis.name, known.document, known.attempts, analysis.diagnostics)
    offset = document.offset_at_position(params.position)
    offered, word = complete(analysis, offset)
    start = document.client_position_at_offset(offset - len(word))
    items = []
    for each in offered:
        edit = lsp.TextEdit(lsp.Range(start, params.position), each.label)
        items.append(
            lsp.CompletionItem(
                each.label, kind=_KINDS.get(each.kind, lsp.CompletionItemKind.Variable), detail=each.detail or None,
                documentation=each.documentation or None, text_edit=edit, filter_text=each.label,
            )
        )  # fmt: skip
    return lsp.CompletionList(is_incomplete=False, items=items)


@server.feature(lsp.TEXT_DOCUMENT_HOVER)
def hovered(ls: Server, params: lsp.HoverParams) -> lsp.Hover | None:
    """Return what the word at a place means."""
    analysis, document = ls.analysis(params.text_document.uri)
    text = meanings.hover(analysis, document.offset_at_position(params.position))
    if text is None:
        return None
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text))


@server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
def defined(ls: Server, params: lsp.DefinitionParams) -> lsp.Location | None:
    """Return where the name at a place is declared."""
    analysis, document = ls.analysis(params.text_document.uri)
    span = meanings.definition(analysis, document.offset_at_position(params.position))
    if span is None:
        return None
    return lsp.Location(document.uri, client_range(span, document))


@server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
def referred(ls: Server, params: lsp.ReferenceParams) -> list[lsp.Location]:
    """Return every place of the name at a place."""
    analysis, document = ls.analysis(params.text_document.uri)
    spans = meanings.references(analysis, meanings.name_at(analysis, document.offset_at_position(params.position)))
    return [lsp.Location(document.uri, client_range(span, document)) for span in spans]


@server.feature(lsp.TEXT_DOCUMENT_RENAME)
def renamed(ls: Server, params: lsp.RenameParams) -> lsp.WorkspaceEdit | None:
    """Return the changes that give the name at a place another name, in specs of the folder that extend this one, too.

    A name that another file declares is renamed there.
    """
    analysis, document = ls.analysis(params.text_document.uri)
    name = meanings.name_at(analysis, document.offset_at_position(params.position))
    if name is None or not analysis.declarations[name].path:
        return None
    changes = {document.uri: [text_edit(each, document) for each in meanings.rename(analysis, name, params.new_name)]}
    for other, place in _extending(ls, Path(document.path)):
        if name in other.declarations and not other.declarations[name].path:
            changes[place.uri] = [text_edit(each, place) for each in meanings.rename(other, name, params.new_name)]
    return lsp.WorkspaceEdit(changes=changes)


def _extending(ls: Server, path: Path) -> Iterator[tuple[Analysis, TextDocument]]:
    for place in sorted(path.parent.glob("*.yaml")):
        document = ls.workspace.get_text_document(place.as_uri())
        if place != path and "extends" in document.source:
            analysis = analyse(document.source, str(place))
            if analysis.document is not None and str(path) in analysis.document.files:
                yield analysis, document


@server.feature(lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions([lsp.CodeActionKind.QuickFix]))
def actions(ls: Server, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    """Return the fixes of the mistakes in a range."""
    analysis, document = ls.analysis(params.text_document.uri)
    offered = []
    for each in _problems_here(analysis):
        fix = each.fix
        if fix is None:
            continue
        problem = diagnostic(records([each])[0], document)
        if problem.range.end.line < params.range.start.line or problem.range.start.line > params.range.end.line:
            continue
        edit = lsp.WorkspaceEdit(changes={document.uri: [text_edit(fix, document)]})
        title = f"write {fix.replacement}"
        offered.append(lsp.CodeAction(title, lsp.CodeActionKind.QuickFix, [problem], is_preferred=True, edit=edit))
    return offered


@server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
def symbols(ls: Server, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """Return the sections of a document with their entries."""
    analysis, document = ls.analysis(params.text_document.uri)
    if analysis.document is None or not isinstance(analysis.document.data, dict):
        return []
    outline = []
    for section, entries in analysis.document.data.items():
        symbol = outline_entry(analysis, (section,), lsp.SymbolKind.Module, document)
        if isinstance(entries, dict):
            symbol.children = []
            for key in entries:
                child = outline_entry(analysis, (section, key), lsp.SymbolKind.Variable, document)
                symbol.children.append(child)
        outline.append(symbol)
    return outline


@server.feature(
    lsp.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL,
    lsp.SemanticTokensLegend(token_types=list(meanings.TOKEN_KINDS), token_modifiers=[]),
)
def coloured(ls: Server, params: lsp.SemanticTokensParams) -> lsp.SemanticTokens:
    """Return the names and functions in the expressions of a document, each relative to the one before."""
    analysis, document = ls.analysis(params.text_document.uri)
    data: list[int] = []
    line = column = 0
    for kind, span in meanings.tokens(analysis):
        place = client_range(span, document)
        start = place.start.character
        if place.start.line == line:
            start -= column
        length = place.end.character - place.start.character
        data += [place.start.line - line, start, length, meanings.TOKEN_KINDS.index(kind), 0]
        line = place.start.line
        column = place.start.character
    return lsp.SemanticTokens(data)


@server.feature(lsp.TEXT_DOCUMENT_CODE_LENS)
def lenses(ls: Server, params: lsp.CodeLensParams) -> list[lsp.CodeLens]:
    """Return exact scores above the names of tasks, and verdicts above the claims."""
    uri = params.text_document.uri
    analysis, document = ls.analysis(uri)
    shown: list[lsp.CodeLens] = []
    if uri not in ls.checked or analysis.document is None:
        return shown
    for path, text in ls.checked[uri].lenses:
        if path[-1] in analysis.entries(*path[:-1]):
            place = client_range(analysis.document.key_span(tuple(path)), document)
            shown.append(lsp.CodeLens(place, lsp.Command(text, "")))
    return shown


@server.feature(lsp.TEXT_DOCUMENT_SIGNATURE_HELP, lsp.SignatureHelpOptions(trigger_characters=["(", ","]))
def signature(ls: Server, params: lsp.SignatureHelpParams) -> lsp.SignatureHelp | None:
    """Return how the function is called whose arguments are being written."""
    analysis, document = ls.analysis(params.text_document.uri)
    call = meanings.signature_at(analysis, document.offset_at_position(params.position))
    if call is None:
        return None
    written, doc, argument = call
    inside = written.partition("(")[2].rstrip(")")
    arguments = [lsp.ParameterInformation(each) for each in inside.split(", ")]
    return lsp.SignatureHelp([lsp.SignatureInformation(written, doc or None, arguments)], 0, argument)


@server.feature(lsp.TEXT_DOCUMENT_FORMATTING)
def laid_out(ls: Server, params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
    """Return the change that gives a document its usual layout."""
    analysis, document = ls.analysis(params.text_document.uri)
    new = analysis.text
    with suppress(SpecError):
        if _IS_SPEC.search(analysis.text):
            new = formatted(analysis.text, analysis.name)
    if new == analysis.text:
        return []
    whole = lsp.Range(lsp.Position(0, 0), document.client_position_at_offset(len(analysis.text)))
    return [lsp.TextEdit(whole, new)]


@server.feature(lsp.TEXT_DOCUMENT_FOLDING_RANGE)
def folds(ls: Server, params: lsp.FoldingRangeParams) -> list[lsp.FoldingRange]:
    """Return the lines of each entry that has several, without its first."""
    analysis, _ = ls.analysis(params.text_document.uri)
    if analysis.document is None:
        return []
    ranges = []
    for path in _entries(analysis.document.data, ()):
        first = analysis.document.key_span(path).line
        value = analysis.document.span(path)
        last = value.end_line - (value.end_column == 1)
        if last > first:
            ranges.append(lsp.FoldingRange(first - 1, last - 1))
    return ranges


def _entries(data: Any, path: tuple[str | int, ...]) -> Iterator[tuple[str | int, ...]]:
    entries: Iterable[tuple[str | int, Any]] = ()
    if isinstance(data, dict):
        entries = data.items()
    elif isinstance(data, list):
        entries = enumerate(data)
    for key, value in entries:
        yield (*path, key)
        yield from _entries(value, (*path, key))


def _problems_here(analysis: Analysis) -> Iterator[Diagnostic]:
    """Yield the problems that are not in other files."""
    for each in analysis.diagnostics:
        if each.span is None or each.span.origin.name == analysis.name:
            yield each


# -- checks -------------------------------------------------------------------------------------------------------


def _start_check(ls: Server, uri: str, pause: float) -> None:
    running = ls.checks.get(uri)
    if running is not None:
        running.cancel()
    ls.checks[uri] = asyncio.get_running_loop().create_task(_check(ls, uri, pause))


async def _check(ls: Server, uri: str, pause: float) -> None:
    await asyncio.sleep(pause)
    analysis, document = ls.analysis(uri)
    if not analysis.attempts or any(each.severity == "error" for each in analysis.diagnostics):
        return
    checked = LastCheck(analysis.text)

    def take(part: dict[str, Any]) -> None:
        checked.lenses += part["lenses"]
        if "problems" in part:
            for each in part["problems"]:
                if each["line"] and each["file"] == document.path:
                    checked.problems.append(each)
            ls.checked[uri] = checked
            ls.publish(uri)

    await check(analysis.text, document.path, take)
    ls.workspace_code_lens_refresh(None)
