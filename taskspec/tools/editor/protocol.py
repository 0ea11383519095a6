"""Places, changes, problems and sections of a text as the Language Server Protocol writes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lsprotocol import types as lsp
from pygls.workspace import TextDocument
from pygls.workspace.position_codec import ServerTextPosition, ServerTextRange

from taskspec.base.diagnostics import Fix, Span
from taskspec.tools.authoring.analysis import Analysis

_SEVERITIES = {"error": lsp.DiagnosticSeverity.Error, "warning": lsp.DiagnosticSeverity.Warning}


def client_range(span: Span, document: TextDocument) -> lsp.Range:
    return _lines_range(span.line, span.column, span.end_line, span.end_column, document)


def _lines_range(line: int, column: int, end_line: int, end_column: int, document: TextDocument) -> lsp.Range:
    start = ServerTextPosition(line - 1, column - 1)
    end = ServerTextPosition(end_line - 1, end_column - 1)
    return document.range_to_client_units(ServerTextRange(start, end))


def text_edit(fix: Fix, document: TextDocument) -> lsp.TextEdit:
    return lsp.TextEdit(client_range(fix.span, document), fix.replacement)


def diagnostic(problem: Mapping[str, Any], document: TextDocument) -> lsp.Diagnostic:
    place = lsp.Range(lsp.Position(0, 0), lsp.Position(0, 0))
    if problem["line"] is not None:
        place = _lines_range(problem["line"], problem["column"], problem["end_line"], problem["end_column"], document)
    text = "\n".join(filter(None, [problem["message"], problem["hint"], *problem["notes"]]))
    severity = _SEVERITIES[problem["severity"]]
    return lsp.Diagnostic(place, text, severity=severity, code=problem["code"], source="taskspec")


def outline_entry(
    analysis: Analysis, path: tuple[str, ...], kind: lsp.SymbolKind, document: TextDocument
) -> lsp.DocumentSymbol:
    assert analysis.document is not None
    key = client_range(analysis.document.key_span(path), document)
    value = client_range(analysis.document.span(path), document)
    whole = lsp.Range(key.start, max(key.end, value.end, key=lambda place: (place.line, place.character)))
    return lsp.DocumentSymbol(path[-1] or "?", kind, whole, key)
