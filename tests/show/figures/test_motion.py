"""Figures of continuous tasks: phase portraits, episodes over time, arms; on classic control tasks and on worked examples."""

import math
from pathlib import Path

import numpy as np
import pytest

import taskspec
from taskspec import load, make_vec
from taskspec.base.diagnostics import SpecError
from taskspec.envs.window import Frames
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.show.figures import Overlay, render_frame, scene, undrawn
from taskspec.show.figures.series import series
from taskspec.show.figures.shapes import Scene
from tests.shared.scenes import Array, boxes, circles, legible, lines, places, told, words
from tests.shared.specs import without_figure

SPRING = """\
taskspec: 1
name: Spring
state:
  x: {type: real, low: -1, high: 1}
  v: {type: real, low: -1, high: 1}
action:
  a: {type: choice, values: {left: -1, none: 0, right: 1}}
horizon: 30
initial: {x: 0.5, v: 0}
dynamics:
  x': clip(x + 0.1 * v, -1, 1)
  v': clip(v - 0.1 * x + 0.05 * a, -1, 1)
reward: -x * x
expert: none
"""


def task(text: str, figure: str) -> Task:
    return build(read_text(f"{text}\nfigure: {figure}\n"))


def classic(name: str, figure: str) -> Task:
    return task(without_figure(name), figure)


def drawn(one: Task, here: dict[str, object] | None = None) -> Scene:
    assert undrawn(one) == ()
    return legible(scene(one, Overlay(here=here)))


def test_a_portrait_shows_where_a_step_leads() -> None:
    found = drawn(task(SPRING, "{kind: portrait, at: [x, v]}"))
    ends = places(lines(found, arrow=True, width=0.02, color="muted"))
    dx, down = (ends[:, 1] - ends[:, 0]).T
    is_flow = (abs(dx) < 0.5) & (abs(down) < 0.5)
    assert np.sum(is_flow) >= 70
    # a spring turns clockwise: upper right goes right and down, lower left goes left and up
    assert np.sum(is_flow & (dx > 0) & (down > 0)) >= 10
    assert np.sum(is_flow & (dx < 0) & (down < 0)) >= 10
    assert {"x", "v", "−1", "1"} <= set(words(found))
    assert "none" in found.notes[0]
    assert drawn(task(SPRING, "{kind: portrait, at: '(x, v)'}")) == found


def test_the_episode_in_a_portrait_is_the_expert_s() -> None:
    found = drawn(task(SPRING, "{kind: portrait, at: [x, v]}"))
    (line,) = places(lines(found, color="accent"))
    x = 0.5
    v = 0.0
    wanted = []
    for _ in range(31):
        wanted.append(x)
        x, v = x + 0.1 * v, v - 0.1 * x
    assert line[:, 0] - line[0, 0] == pytest.approx(2.5 * (np.array(wanted) - 0.5))


def test_a_series_follows_the_components() -> None:
    found = drawn(task(SPRING, "{kind: series}"))
    drawn_over_time = curves(found)
    assert drawn_over_time.shape == (2, 31, 2)
    for curve, box in zip(drawn_over_time, boxes(found), strict=True):  # axes have round ends, all values between them
        top = box.corner[1]
        assert top <= curve[:, 1].min() <= curve[:, 1].max() <= top + box.height
    assert set(words(found)) == {"t", "x", "v", "0", "30", "0.5", "−0.6", "−0.55"}
    assert drawn(task(SPRING, "{kind: series, values: x + v}")).alt.endswith("30 steps")


def test_a_number_that_stays_is_shown_between_its_bounds() -> None:
    found = drawn(task(SPRING.replace("v': ", "v': 0 * "), "{kind: series}"))
    assert {"−1", "1"} <= set(words(found))


def curves(found: Scene) -> Array:
    """(panel, point, 2): lines over time; one point of each where there are no lines yet."""
    joined = lines(found, color="accent")
    if joined:
        return places(joined)
    return places(circles(found))[:, None]


@pytest.mark.parametrize("figure", ["{kind: series}", "{kind: series, values: '[x, v]'}"])
def test_a_film_of_a_series_grows_on_axes_that_stay(figure: str) -> None:
    one = task(SPRING, figure)
    t = np.arange(31)
    values = np.stack([np.cos(t), np.sin(t)])
    frames = []
    seen: dict[int, dict[str, float]] = {}
    for now, (x, v) in enumerate(values.T):
        seen[now] = {"x": x, "v": v}
        frames.append(legible(scene(one, Overlay(here=seen[now], seen=seen))))
    first = frames[0]
    whole = curves(frames[-1])
    assert np.diff(whole[..., 0]) == pytest.approx(5 / 30)
    assert whole[..., 1] - whole[:, :1, 1] == pytest.approx(0.5 * (values[:, :1] - values))
    for now, found in enumerate(frames):
        assert (found.width, found.height) == (first.width, first.height)
        assert np.array_equal(curves(found), whole[:, : now + 1])
        still = {*boxes(found), *first.items} & set(found.items)
        assert len(still) == len(first.items) - (4 if now else 0)  # two points, and what their numbers are


def test_time_turns_a_page_in_a_film_without_a_horizon() -> None:
    one = task(SPRING.replace("horizon: 30", "horizon: none"), "{kind: series}")
    state = {"x": 0.5, "v": 0.25}
    for now, ends in ((200, {"0", "200"}), (201, {"200", "400"})):
        seen = dict.fromkeys(range(now - 100, now + 1), state)
        found = scene(one, Overlay(here=state, seen=seen))
        assert found is not None and ends <= set(words(found))


def test_frames_of_numbers_without_a_figure_and_without_bounds() -> None:
    text = SPRING.replace(", low: -1, high: 1}", "}").replace(", -1, 1)", ", -inf, inf)")
    one = build(read_text(text))
    size = (320, 240)
    start = {"x": 130.0, "v": -0.03}
    after = {"x": 140.0, "v": -0.03}
    frames = Frames()
    first = frames.draw(one, start, 0)
    second = frames.draw(one, after, 1)
    assert np.array_equal(first, render_frame(one, start, "Spring, step 0 of 30", seen={0: start}))
    found = series(one, Overlay(here=after, seen={0: start, 1: after}))
    assert found is not None
    assert {"−200", "200", "−0.05", "0.05", "x = 140", "v = −0.03"} <= set(words(found))
    again = frames.draw(one, start, 0)
    assert np.array_equal(again, first) and not np.array_equal(second, first)  # another episode begins
    lost = {"x": math.nan, "v": 0.0}
    assert np.array_equal(render_frame(one, lost, size=size, seen={0: lost}), render_frame(one, lost, size=size))


def test_a_lane_draws_the_series_of_its_own_episode(tmp_path: Path) -> None:
    path = tmp_path / "spring.yaml"
    path.write_text(f"{SPRING}figure: {{kind: series}}\n", encoding="utf-8")
    lanes = make_vec(path, num_envs=2, render_mode="rgb_array", autoreset_mode="Disabled")
    single = taskspec.make(load(path), render_mode="rgb_array")
    lanes.reset(seed=0)
    single.reset(seed=1)
    for number in range(4):
        (first, second) = lanes.render() or ()
        alone = single.render()
        assert np.array_equal(second, alone)
        assert np.array_equal(first, second) == (number == 0)
        lanes.step(np.array([0, 2]))
        single.step(2)
    mask = np.array([False, True])
    lanes.reset(options={"reset_mask": mask})
    lanes.step(np.array([0, 2]))
    fresh = make_vec(path, num_envs=2, render_mode="rgb_array")
    fresh.reset(seed=0)
    fresh.step(np.array([0, 2]))
    assert np.array_equal((lanes.render() or ())[1], (fresh.render() or ())[1])  # nothing is kept of the last episode


@pytest.mark.parametrize("angles", [(0.0, 0.0), (math.pi / 2, math.pi / 2), (math.pi, 0.0)])
def test_an_arm_hangs_down_at_zero(angles: tuple[float, float]) -> None:
    one = classic("acrobot", "{kind: arm, values: '[s[0], s[0] + s[1]]'}")
    found = drawn(one, {"s": [angles[0], angles[1], 0.0, 0.0]})
    (base, elbow) = places(circles(found, fill="paper"))
    tip = places(circles(found, fill="ink"))[0]
    turned = np.cumsum(angles)
    links = [elbow - base, tip - elbow]
    assert np.array(links) == pytest.approx(1.2 * np.stack([np.sin(turned), np.cos(turned)], axis=1))


@pytest.mark.parametrize(
    ("name", "figure"),
    [
        ("mountain_car", "{kind: portrait, at: [x, v]}"), ("mountain_car", "{kind: series}"),
        ("mountain_car_continuous", "{kind: portrait, at: [x, v]}"), ("cart_pole", "{kind: series}"),
        ("acrobot", "{kind: arm, values: '[s[0], s[0] + s[1]]'}"),
    ],
)  # fmt: skip
def test_classic_control_is_drawn(name: str, figure: str) -> None:
    assert "is drawn:" not in told(drawn(classic(name, figure)))


def test_what_cannot_be_drawn_says_so() -> None:
    one = classic("acrobot", "{kind: portrait, at: ['s[0]', '2 * s[1]']}")
    (warning,) = undrawn(one)
    assert warning.code == "W523" and warning.hint is not None and "arm" in warning.hint
    found = scene(one)
    assert found is not None
    assert "No portrait is drawn" in told(found)


def test_what_a_kind_needs_is_asked_for() -> None:
    for kind in ("portrait", "arm"):
        with pytest.raises(SpecError, match="E203"):
            task(SPRING, f"{{kind: {kind}}}")


def chain(count: int) -> Task:
    return task(
        f"taskspec: 1\nname: Chain\nstate:\n  s: {{type: real, shape: [{count}]}}\naction:\n  a: {{type: int, low: 0, high: 1}}\n"
        f"horizon: 3\ndynamics: {{s': s}}\ninitial: {{s: '[0 for i in range({count})]'}}\nreward: 0",
        "{kind: arm, values: s}",
    )


def test_a_long_arm_has_the_size_of_a_figure() -> None:
    for links in (1, 30):
        found = drawn(chain(links))
        assert max(found.width, found.height) < 13
        assert len(circles(found, fill="paper")) + len(circles(found, fill="ink")) == links + 1


@pytest.mark.parametrize(("count", "size"), [(31, "31 numbers"), (3000, "3,000 numbers")])
def test_too_long_an_arm_says_so(count: int, size: str) -> None:
    one = chain(count)
    found = scene(one)
    assert found is not None
    assert size in told(found)
    assert "up to 30 finite angles" in told(found)
    (warning,) = undrawn(one)
    assert warning.code == "W523"


def test_angles_that_are_no_numbers_are_not_drawn() -> None:
    one = chain(2)
    for angle in (math.inf, math.nan):
        frame = render_frame(one, {"s": [angle, 0.0]})
        assert frame.shape == (480, 640, 3)
        assert scene(one, Overlay(here={"s": [angle, 0.0]})) is None


def test_a_flow_leaves_out_what_leads_nowhere() -> None:
    text = SPRING.replace("x': clip(x + 0.1 * v, -1, 1)", "x': clip(x + 0.1 * v, -1, 1) / (x > -0.8)")
    found = drawn(task(text, "{kind: portrait, at: [x, v]}"))
    whole = drawn(task(SPRING, "{kind: portrait, at: [x, v]}"))
    assert 20 < len(lines(found, arrow=True)) < len(whole.items)


@pytest.mark.parametrize("figure", ["{kind: portrait, at: [x, v]}", "{kind: series}"])
def test_numbers_beyond_all_bounds_are_not_drawn(figure: str) -> None:
    text = SPRING.replace("low: -1, high: 1}", "low: -1.7e308, high: 1.7e308}").replace(
        ", -1, 1)", ", -1.7e308, 1.7e308)"
    )
    text = text.replace("0.1 * v", "-2 * x * (2 if x > 0 else 1)").replace("x: 0.5", "x: 1.6e308")
    found = scene(task(text, figure))
    assert found is not None
    assert "is drawn:" in told(found)
