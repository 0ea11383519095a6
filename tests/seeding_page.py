"""The code that `docs/seeding.md` prints, as a reference that shares none with taskspec."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parent.parent / "docs" / "seeding.md"


def _code_of_the_page() -> dict[str, Any]:
    names: dict[str, Any] = {}
    with contextlib.redirect_stdout(io.StringIO()):
        for block in re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL):
            exec(block, names)
    return names


CODE = _code_of_the_page()
STEP, RESET, CONSTANT, words = CODE["STEP"], CODE["RESET"], CODE["CONSTANT"], CODE["words"]
