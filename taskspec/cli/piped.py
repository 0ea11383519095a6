"""The console for what is no terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console


class PipedConsole(Console):
    """Prints lines without the blanks that fill them up to the width: files and other programs have no use for them."""

    def print(self, *objects: Any, **options: Any) -> None:
        with self.capture() as captured:
            super().print(*objects, **options)
        text = captured.get()
        self.file.write("\n".join(line.rstrip(" ") for line in text.split("\n")))
