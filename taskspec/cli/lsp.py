"""`taskspec lsp`: the language server for editors."""

from __future__ import annotations


def lsp() -> None:
    """Serve an editor: mistakes while typing, completion, meanings, fixes and exact scores.

    It speaks the Language Server Protocol over standard input and output; an editor starts it. It needs the extra
    [green]editor[/].
    """
    from taskspec.tools.editor import serve

    serve()
