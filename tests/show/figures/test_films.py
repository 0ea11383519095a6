"""Films in pages: at each moment exactly the figure of one state is seen, and a state points at its line."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from taskspec import load
from taskspec.show.figures import Overlay, scene
from taskspec.show.figures.film import LAST, film
from taskspec.show.figures.states import expert_path
from taskspec.show.figures.vector_formats import svg_item
from taskspec.show.pages.write import write

SVG = "{http://www.w3.org/2000/svg}"


def seen(picture: str) -> list[str]:
    """What a browser shows at the middle of each moment, element after element, without the frame's own elements."""
    root = ElementTree.fromstring(picture)
    style = root.findtext(f"{SVG}style") or ""
    rules = dict(re.findall(r"@keyframes (\S+?)\{((?:[^{}]*\{[^{}]*\})*)\}", style))
    moments = round(float(re.findall(r"animation-duration:([\d.]+)s", style)[0]) / 0.7)
    found = []
    for moment in range(moments):
        shown = []
        for element in root:
            if element.tag == f"{SVG}g":
                name = element.attrib["style"].removeprefix("animation-name:")
                times = [(float(at), to) for at, to in re.findall(r"([\d.]+)%\{visibility:(\w+)\}", rules[name])]
                state = [to for at, to in times if at <= 100 * (moment + 0.5) / moments][-1]
                if state == "visible":
                    shown += list(element)
            elif element.tag not in (f"{SVG}style", f"{SVG}title"):
                shown.append(element)
        found.append("".join(_text(each) for each in shown))
    return found


def _text(element: ElementTree.Element) -> str:
    return (
        ElementTree.tostring(element, encoding="unicode").replace("ns0:", "").replace(f' xmlns:ns0="{SVG[1:-1]}"', "")
    )


@pytest.mark.parametrize(
    "name",
    ["derail/EarlyTermPos-v0", "derail/NoisyObs-v0", "derail/Branching-v0", "derail/Sort-v0", "derail/Parabola-v0"],
)
def test_a_film_shows_the_figure_of_one_state_at_a_time(name: str) -> None:
    task = load(name)
    picture = film(task)
    assert picture is not None
    found = seen(picture)
    every = 1 if task.is_finite else -(-len(expert_path(task)) // (len(found) - LAST + 1))
    states = expert_path(task)[::every]
    for t, shown in enumerate(found[: 1 - LAST]):
        frame = scene(task, Overlay(here=states[t], seen=dict(enumerate(states[: t + 1]))))
        assert frame is not None
        root = ElementTree.fromstring(f"<x xmlns='{SVG[1:-1]}'>{''.join(map(svg_item, frame.items))}</x>")
        expected = "".join(map(_text, root))
        assert shown.startswith(expected), t
        assert re.fullmatch(r"<text[^>]*>(start|step \d+: .*; reward \S+, return \S+)</text>", shown[len(expected) :])
    assert found[-1] == found[-LAST]
    assert "<script" not in picture and "prefers-reduced-motion" in picture


def test_a_film_tells_what_was_done_and_paid() -> None:
    found = seen(film(load("derail/RiskyPath-v0")) or "")
    told = [shown.rpartition(">start<")[1] or re.findall(r"step [^<]*", shown)[-1] for shown in found]
    assert told[:3] == [">start<", "step 1: safe; reward 0, return 0", "step 2: safe; reward 1, return 1"]


def test_where_nobody_knows_how_to_act_there_is_no_film() -> None:
    assert film(load("classic_control/Pendulum-v0")) is None
    assert film(load("planning/Life-v0")) is None


def test_a_page_has_the_film_among_its_views_and_marks_the_line_of_a_state(tmp_path: Path) -> None:
    write(["derail/RiskyPath-v0", "derail/NoisyObs-v0"], ["html"], tmp_path)
    page = (tmp_path / "risky-path.html").read_text(encoding="utf-8")
    assert 'class="figure film"' in page and ">film</label>" in page
    for state in range(4):
        assert re.search(rf'<circle [^>]*data-state="{state}"', page)
        assert f'article:has([data-state="{state}"]:hover) [data-of="{state}"]' in page
    lines = re.findall(r'<span data-of="(\d)">.*?(?:aria-label|alttext)="s([₀-₉]) —', page)
    assert lines == [("0", "₀"), ("1", "₁"), ("2", "₂"), ("3", "₃")]
    assert ":has(" not in (tmp_path / "noisy-obs.html").read_text(encoding="utf-8")
