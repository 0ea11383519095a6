"""The studio: specs are written in the browser, with mathematics, figure, scores and episodes beside them.

`server` admits one page, `processes` answers its questions in processes that can be ended, `answers` and `episodes` hold what
is answered, and `folder` the files. Starlette, uvicorn and websockets are imported here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from taskspec.base.extras import need


def serve(target: Path, port: int, template: str, ready: Callable[[str], None]) -> None:
    """Serve a folder, or one spec of it, on this machine until Ctrl-C.

    Args:
        target: a folder, or the file of a spec.
        port: 0 for any that is free.
        template: the text of a new spec, with places for `{name}` and `{title}`.
        ready: is called with the address of the page as soon as it can be opened.

    Raises:
        SpecError: E705 without the extra `studio`; E710, E711 for a target that is no folder or spec; E713 for a port in use.
    """
    for package in ("starlette", "uvicorn", "websockets"):
        need(package, "studio", "the studio")
    from taskspec.studio.server import Studio, run

    run(Studio.of(target, port, template), ready)
