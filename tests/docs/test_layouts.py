"""What `docs/tools/layouts.py` measures of layouts, on pictures whose measures are plain."""

import shlex
import sys
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from docs.tools import layouts

SQUARES = [(0.0, 0.0, 1.0, 1.0), (4.0, 0.0, 5.0, 1.0), (0.0, 4.0, 1.0, 5.0), (4.0, 4.0, 5.0, 5.0)]


def line(*points: tuple[float, float]) -> np.ndarray:
    return np.array(points)


def test_faults_are_counted() -> None:
    arrows = [
        (0, 3, line((1, 1), (4, 4))), (1, 2, line((4, 1), (1, 4))),  # which cross
        (2, 3, line((1, 4.5), (2, 4.5), (2, 0.5), (4.5, 0.5), (4.5, 4))),  # over a vertex, and over both of them
    ]  # fmt: skip
    labels = [(0, (2.2, 2.2, 2.8, 2.8)), (2, (3.8, 0.2, 4.2, 0.4))]
    found = layouts.Layout(SQUARES, arrows, labels).measured()
    assert found == {
        "crossings": 3, "arrows over vertices": 1, "vertices over vertices": 0, "labels over labels or vertices": 1,
        "arrows through labels of others": 1, "length of an arrow (cm)": pytest.approx((2 * 18**0.5 + 11) / 3),
        "area (cm²)": 25.0,
    }  # fmt: skip


def test_graphs_are_the_same_every_time_and_ours_have_no_arrow_over_a_vertex() -> None:
    first = list(islice(layouts.plans(), 12))
    assert first == list(islice(layouts.plans(), 12))
    drawn = list(filter(None, first))
    assert len(drawn) > 8
    for plan in drawn:
        measured = layouts.ours(plan).measured()
        assert measured["arrows over vertices"] == measured["vertices over vertices"] == 0


def test_what_graphviz_writes_is_read(tmp_path: Path) -> None:
    """A picture in its format `plain`, in inches: three vertices in a row, and the arrows between them."""
    plan = next(plan for plan in layouts.plans() if plan is not None and len(plan.spots) == 3)
    text = ["graph 1 9 1"]
    for i in range(3):
        text.append(f'node {i} {3 * i} 0 1 1 "" solid box black lightgrey')
    spots = list(plan.spots)
    ends = []
    for arc, told in zip(plan.arcs, plan.told, strict=True):
        i = spots.index(arc.source)
        j = spots.index(arc.target)
        ends.append((i, j))
        label = "" if told is None else f' "" {3 * (i + j) / 2} 5'
        text.append(f"edge {i} {j} 4 {3 * i} 0 {3 * i} 9 {3 * j} 9 {3 * j} 0{label} solid black")
    (tmp_path / "plain").write_text("\n".join([*text, "stop"]), encoding="utf-8")
    command = shlex.join([sys.executable, "-c", f"print(open({str(tmp_path / 'plain')!r}).read())"])
    found = layouts.graphviz(plan, command)
    squares = [(-0.5, -0.5, 0.5, 0.5), (2.5, -0.5, 3.5, 0.5), (5.5, -0.5, 6.5, 0.5)]
    assert np.array(found.vertices) / 2.54 == pytest.approx(np.array(squares))
    assert [(a, b) for a, b, _ in found.arrows] == ends
    assert len(found.labels) == len(plan.told) - plan.told.count(None)
