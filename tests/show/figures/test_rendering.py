"""Environments as text, as pixels and in a window."""

from __future__ import annotations

import copy
import pickle
import sys
import warnings
from itertools import product
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.passive_env_checker import env_render_passive_checker

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.envs import Environment, NotRunningError
from taskspec.envs.window import Window
from taskspec.show.figures import render_frame
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.specs import paper_ids

matplotlib = pytest.importorskip("matplotlib")
pyplot = pytest.importorskip("matplotlib.pyplot")
IDS = paper_ids()
MODES = Environment.metadata["render_modes"]


@pytest.fixture(autouse=True)
def no_windows() -> Any:
    """As on a machine without a display."""
    matplotlib.use("Agg")
    yield
    assert pyplot.get_fignums() == []


def walk(env: Any, seed: int, steps: int = 3) -> list[Any]:
    """Observations and rewards along random actions."""
    env.action_space.seed(seed)
    seen: list[Any] = [env.reset(seed=seed)[0]]
    for _ in range(steps):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        seen += [observation, reward]
        if terminated or truncated:
            break
    return seen


@pytest.mark.parametrize("name", sparse(IDS, 10))
def test_gymnasium_is_content_with_every_way_to_render(name: str) -> None:
    env = gym.make(name, render_mode="rgb_array").unwrapped
    for mode in MODES:
        other = env.spec.make(render_mode=mode)
        other.reset(seed=0)
        env_render_passive_checker(other)
        other.close()
    if env.task.horizon == 1:
        return  # Gymnasium's checker takes the end of a one-step episode for a mistake
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*infinity")  # noise has no bounds
        check_env(env)


@for_each(
    ("name", "options"),
    [(name, {}) for name in IDS] + list(product(IDS[::6], ({"ending": "absorb"}, {"observe_time": True}))),
)
def test_pixels_of_the_present_state(name: str, options: dict[str, Any]) -> None:
    env = taskspec.make(name, render_mode="rgb_array", **options)
    env.reset(seed=1)
    frame = env.render()
    assert (frame.shape, frame.dtype) == ((480, 640, 3), np.uint8)
    assert frame.std() > 0


@pytest.mark.parametrize("mode", MODES)
def test_rendering_changes_no_trajectory(mode: str) -> None:
    plain = taskspec.make("NoisyObs")
    rendered = taskspec.make("NoisyObs", render_mode=mode)
    for a, b in zip(walk(plain, 3), walk(rendered, 3), strict=True):
        assert np.array_equal(a, b)
    rendered.close()


def test_without_a_mode_the_generated_functions_are_called_bare() -> None:
    env = taskspec.make("RiskyPath")
    env.reset(seed=0)
    assert env.step is env._lane.step
    assert env.render() is None


@pytest.mark.parametrize("mode", MODES)
def test_there_is_nothing_to_see_before_the_first_reset(mode: str) -> None:
    env = taskspec.make("RiskyPath", render_mode=mode)
    with pytest.raises(NotRunningError, match="E707"):
        env.render()


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The pictures that were shown."""
    pictures: list[Any] = []
    real = Window.show

    def show(window: Window, pixels: Any) -> None:
        pictures.append(pixels)
        real(window, pixels)

    monkeypatch.setattr(Window, "show", show)
    return pictures


def test_the_window_follows_every_reset_and_step(shown: list[Any]) -> None:
    env = taskspec.make("RiskyPath", render_mode="human")
    env.reset(seed=0)
    env.step(0)
    env.reset()
    env.reset(options={"state": {"s": 1}})
    assert len(shown) == 4
    assert env.render() is None
    assert len(shown) == 5
    assert len(pyplot.get_fignums()) == 1
    env.close()
    env.close()


def test_a_window_closed_by_hand_stays_closed(shown: list[Any]) -> None:
    env = taskspec.make("RiskyPath", render_mode="human")
    env.reset(seed=0)
    pyplot.close("all")
    env.step(0)
    assert pyplot.get_fignums() == []
    env.close()


def test_errors_are_those_of_the_environment() -> None:
    env = taskspec.make("RiskyPath", render_mode="human")
    with pytest.raises(NotRunningError, match="E707"):
        env.step(0)
    env.close()


@pytest.mark.parametrize("mode", MODES)
def test_copies_and_pickles_go_on_by_themselves(mode: str) -> None:
    env = taskspec.make("Sort", render_mode=mode)
    env.reset(seed=1)
    copies = [env, pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
    action = env.action_space.sample()
    after = [each.step(action)[0] for each in copies]
    assert all(np.array_equal(after[0], each) for each in after)
    assert all(each.render_mode == mode for each in copies)
    if mode == "human":
        assert len(pyplot.get_fignums()) == 3
    for each in copies:
        each.close()


class Canvas:
    """A canvas of a backend with windows, as far as `Window` uses it."""

    required_interactive_framework = "tk"

    def __init__(self) -> None:
        self.waits: list[float] = []

    def draw(self) -> None: ...

    def start_event_loop(self, seconds: float) -> None:
        self.waits.append(seconds)


def test_a_real_window_gets_its_time() -> None:
    window = Window("x", 4)
    canvas = Canvas()
    pixels = np.zeros((4, 6, 3), np.uint8)
    window.show(pixels)
    real = window._figure.canvas
    window._figure.canvas = canvas
    window.show(pixels)
    assert canvas.waits == [0.25]
    window._figure.canvas = real
    window.close()


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_a_missing_package_is_missed_at_once(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(SpecError, match="E705") as caught:
        taskspec.make("RiskyPath", render_mode=mode)
    assert 'pip install -e ".[figures]"' in str(caught.value)
    taskspec.make("RiskyPath", render_mode="ansi")


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(ValueError, match="render_mode"):
        taskspec.make("RiskyPath", render_mode="hologram")


def test_pixels_are_those_of_the_frame() -> None:
    env = taskspec.make("RiskyPath", render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    env.step(0)
    title = "RiskyPath, step 1 of 5"
    assert np.array_equal(env.render(), render_frame(env.task, env.state, title))
    assert not np.array_equal(env.render(), first)
