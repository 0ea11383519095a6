"""Charts: files that do not change, colours that follow the paper, and words that do not overlap."""

import itertools
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.colors import to_hex

from taskspec.base.diagnostics import SpecError
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart
from tests.shared.charts import assert_legible, contrast, texts

HOSTILE = "a $x_2$ <b> & \0 ✗ 漢"


def drawn(title: str = HOSTILE) -> Chart:
    with chart.style():
        figure = chart.figure(3, 2)
        axes = figure.add_subplot()
        axes.plot([1, 2, 3], [1e-3, 10, 1e4], "o-", color=chart.BLUE, label="here")
        axes.set_yscale("log")
        axes.set_title(title)
        axes.legend()
        chart.numbers(axes.yaxis, is_log=True)
        chart.labelled(axes, [1, 2, 3], ["one", "two", "three"], 2.5)
    return Chart(figure, title)


@pytest.mark.parametrize("kind", chart.FORMATS)
def test_the_same_chart_gives_the_same_bytes(kind: str, tmp_path: Path) -> None:
    first = chart.save(drawn(), tmp_path / f"a.{kind}").read_bytes()
    second = chart.save(drawn(), tmp_path / f"b.{kind}").read_bytes()
    assert first == second and not re.search(rb"\b20\d\d-\d\d-\d\d|CreationDate", first)


def test_svg_has_its_words_as_text_and_its_description() -> None:
    root = ElementTree.fromstring(chart.svg(drawn()))
    words = {node.text for node in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"one", "two", "three", "here", "0.001"} <= words
    (title,) = (str(node.text) for node in root.iter("{http://www.w3.org/2000/svg}title"))
    assert title in words and "$x_2$ <b> &" in title and "\0" not in title


def test_colours_on_pages_follow_the_paper() -> None:
    """Apart from the colours of lines, which are the same on any paper, all are variables."""
    lines = {chart.VERMILION, chart.GREEN, chart.PURPLE, chart.ORANGE}
    text = chart.svg(drawn())
    bare = re.sub(r"var\(--[\w-]+, #\w+\)", "", text)
    assert set(re.findall(r"#[0-9a-f]{6}\b", bare)) <= lines
    assert "<rect" not in text.partition("<defs")[0]


def test_a_style_sheet_of_a_chart_changes_no_other_drawing() -> None:
    assert "<style" not in chart.svg(drawn())


CONES = {
    "protanopia": ((0.11238, 0.88762, 0.0), (0.11238, 0.88762, 0.0), (0.00401, -0.00401, 1.0)),
    "deuteranopia": ((0.29275, 0.70725, 0.0), (0.29275, 0.70725, 0.0), (-0.02234, 0.02234, 1.0)),
}
"""Viénot, Brettel and Mollon (1999), in linear light."""


@pytest.mark.parametrize("kind", CONES)
def test_colours_of_lines_differ_for_the_colour_blind(kind: str) -> None:
    def seen(color: str) -> np.ndarray:
        shares = np.frombuffer(bytes.fromhex(color[1:]), dtype=np.uint8) / 255
        return np.asarray(CONES[kind] @ shares**2.2).clip(0) ** (1 / 2.2)

    for a, b in itertools.combinations((chart.BLUE, chart.VERMILION, chart.GREEN, chart.ORANGE, chart.INK), 2):
        assert np.abs(seen(a) - seen(b)).max() > 0.12, (a, b)


def test_numbers_in_a_heat_map_can_be_read() -> None:
    with chart.style():
        figure = chart.figure(3, 2)
        axes = figure.add_subplot()
        chart.heat_map(axes, np.array([[1.0, 5.0, np.nan], [10.0, 100.0, 1000.0]]), has_numbers=True)
        numbers = {text.get_text(): text.get_color() for text in axes.texts}
        (mesh,) = axes.collections
        mesh.update_scalarmappable()
        colors = np.delete(mesh.get_facecolors(), 2, axis=0)
    assert list(numbers) == ["1", "5", "10", "100", "1000"]
    for ink, color in zip(numbers.values(), colors, strict=True):
        assert contrast(ink, to_hex(color)) > 4


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize(
    "names", [["1"] * 3, [str(n) for n in range(40)], ["a long name of a setting"] * 5, ["x" * 80, "y"]]
)
def test_labels_do_not_overlap(names: list[str], turns: bool) -> None:
    with chart.style():
        figure = chart.figure(3, 2)
        axes = figure.add_axes((0.1, 0.2, 0.8, 0.7))
        axes.set_xlim(0, len(names))
        axes.yaxis.set_visible(False)
        chart.labelled(axes, [i + 0.5 for i in range(len(names))], names, 2.4, turns)
    if not turns:
        assert_legible(figure)
    shown = [name for name, _ in texts(figure)]
    assert shown[0] == names[0] and set(shown) <= set(names)


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SpecError) as error:
        chart.save(drawn(), tmp_path / "x.tex")
    assert error.value.diagnostics[0].code == "E726"
