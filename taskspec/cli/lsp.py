"""`taskspec lsp`: the language server, for editors."""

from __future__ import annotations

from taskspec.base.extras import need


def lsp() -> None:
    """Serve an editor: mistakes while typing, completion, meanings, fixes and exact scores.

    It speaks the Language Server Protocol over standard input and output; an editor starts it. It needs the extra
    [green]editor[/].
    """
    need("pygls", "editor", "the language server")
    from taskspec.editor.server import server

    server.start_io()
