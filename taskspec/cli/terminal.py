"""What is printed with Rich: nothing that a spec or a file name contains gets further than this unless it can be seen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import rich.console
import rich.text
from rich.segment import Segment

from taskspec.visible import visible


class VisibleText(rich.text.Text):
    """Styled text, visible before its width is measured."""

    def __init__(self, text: str = "", *args: Any, **options: Any) -> None:
        super().__init__(visible(text), *args, **options)

    def append(self, text: Any, style: Any = None) -> VisibleText:
        super().append(visible(text) if isinstance(text, str) else text, style)
        return self


class Console(rich.console.Console):
    """Makes plain strings visible before they are measured, and whatever else arrives when it is rendered."""

    def render_str(self, text: str, **options: Any) -> rich.text.Text:
        return super().render_str(visible(text), **options)

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


class PipedConsole(Console):
    """Prints lines without the blanks that fill them up to the width: files and other programs have no use for them."""

    def print(self, *objects: Any, **options: Any) -> None:
        with self.capture() as captured:
            super().print(*objects, **options)
        text = captured.get()
        self.file.write("\n".join(line.rstrip(" ") for line in text.split("\n")))
