"""What a chart shows, as matplotlib lays it out."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from taskspec.show.figures import chart


def texts(figure: Any) -> Iterator[tuple[str, Any]]:
    """The words that a figure shows, each with its box in pixels."""
    from matplotlib.axis import Axis
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    with chart.style():
        FigureCanvasAgg(figure).draw()
        hidden = set()
        for axis in figure.findobj(Axis):
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not low - 1e-9 <= tick.get_loc() <= high + 1e-9 or not axis.axes.axison:
                    hidden |= {tick.label1, tick.label2}
        for text in figure.findobj(Text):
            if text.get_text().strip() and text.get_visible() and text not in hidden:
                yield text.get_text(), text.get_window_extent()


def luminance(color: str) -> float:
    """The relative luminance of WCAG 2.2."""
    shares = np.frombuffer(bytes.fromhex(color[1:]), dtype=np.uint8) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(a: str, b: str) -> float:
    darker, brighter = sorted((luminance(a), luminance(b)))
    return (brighter + 0.05) / (darker + 0.05)


def assert_legible(figure: Any) -> None:
    """No words overlap others."""
    words = list(texts(figure))
    assert words
    for i, (name, box) in enumerate(words):
        for other, place in words[:i]:
            assert not box.overlaps(place), f"'{name}' overlaps '{other}'"
