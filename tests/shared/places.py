"""The text at a place of a file."""

from taskspec.base.diagnostics import Span


def written(span: Span) -> str:
    """The text of the file that a span covers."""
    text = span.origin.text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if span.line == span.end_line:
        return lines[span.line - 1][span.column - 1 : span.end_column - 1]
    middle = lines[span.line : span.end_line - 1]
    first = lines[span.line - 1][span.column - 1 :]
    last = lines[span.end_line - 1]
    return "\n".join([first, *middle, last[: span.end_column - 1]])
