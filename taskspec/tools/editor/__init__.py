"""The language server: `taskspec.tools.authoring` for editors that speak the Language Server Protocol; pygls is imported here."""

import gc

from taskspec.base.extras import need


def serve() -> None:
    """Answer an editor over standard input and output, until it says to stop.

    Raises:
        SpecError: E705 without the extra `editor`.
    """
    need("pygls", "editor", "the language server")
    from taskspec.tools.editor.server import server

    gc.freeze()  # what is loaded by now stays: looking for garbage in it would make every so many keystrokes slow
    server.start_io()
