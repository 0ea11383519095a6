"""What tools ask of an environment: its horizon, its frames, and its keys."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

import taskspec
from taskspec.envs import window
from taskspec.tools.play import Warned, legend, play
from tests.conftest import needs_vectors
from tests.envs.test_legal import FORMS, SPEC, expected
from tests.shared.sections import whole_spec
from tests.shared.sparse import sparse
from tests.shared.specs import varied_files


@pytest.mark.parametrize("task_id", ["derail/Branching-v0", "derail/LargestSum-v0"])
def test_the_spec_tells_the_horizon_and_nothing_is_wrapped(task_id: str) -> None:
    env = gym.make(task_id)
    assert isinstance(env, gym.Env) and env is env.unwrapped
    assert env.spec is not None and env.spec.max_episode_steps == taskspec.load(task_id).horizon
    assert gym.make("derail/Branching-v0", L=4).spec.max_episode_steps == 4


def test_an_environment_made_again_from_its_spec_is_the_same() -> None:
    env = gym.make("derail/Branching-v0", L=4)
    again = gym.make(env.spec)
    assert env.reset(seed=1)[0] == again.reset(seed=1)[0]
    for _ in range(4):
        assert env.step(1) == again.step(1)


def test_a_spec_limits_steps_once_and_never_to_less_than_the_horizon() -> None:
    env = gym.make("derail/Branching-v0", L=4)
    assert env.spec is not None and env.spec.kwargs["L"] == 4
    for _ in range(3):
        env = gym.make(env.spec)
        assert env.unwrapped in (env, getattr(env, "env", None))  # at most one wrapper
    again = EnvSpec.from_json(env.unwrapped.spec.to_json())
    assert again.make().unwrapped.task == env.unwrapped.task
    with pytest.raises(taskspec.SpecError, match=r"E713.*have 20 steps, not 4"):
        gym.make(again, L=20)


def test_a_list_of_frames_is_what_gymnasium_collects() -> None:
    pytest.importorskip("matplotlib")
    env = gym.make("derail/RiskyPath-v0", render_mode="rgb_array_list")
    assert env is env.unwrapped
    theirs = gym.wrappers.RenderCollection(taskspec.make("RiskyPath", render_mode="rgb_array"))
    for each in (env, theirs):
        each.reset(seed=0)
        each.step(0)
        each.step(1)
    frames = env.render()
    assert np.shape(frames) == (3, 480, 640, 3)
    assert np.array_equal(frames, theirs.render())
    assert env.render() == theirs.render() == []
    env.step(1)
    env.reset()
    assert len(env.render()) == 1


def test_keys_are_arrows_for_directions_and_digits_for_the_rest() -> None:
    pygame_codes = {"right": 1073741903, "left": 1073741904, "down": 1073741905, "up": 1073741906}
    assert legend(taskspec.load("RiskyPath")) == [("0", "safe"), ("1", "risky")]
    task = taskspec.load("NoisyObs")
    for key, name in legend(task):
        code = pygame_codes.get(key) or ord(key)
        action = taskspec.make(task).get_keys_to_action()[(code,)]
        assert str(task.action[0].domain.labels[action]) == name
    assert dict(legend(task)).keys() > {"left", "right", "up", "down"}


@pytest.mark.parametrize("path", sparse(varied_files(), 2), ids=lambda path: path.stem)
def test_every_key_is_an_action_and_every_action_has_a_key(path: Path) -> None:
    env = taskspec.make(path)
    space = env.action_space
    if isinstance(space, gym.spaces.Box):
        if not space.is_bounded() or 2 ** space.shape[0] > len(window.KEYS):
            with pytest.raises(taskspec.SpecError, match="E713"):
                env.get_keys_to_action()
            return
        spread = np.array(list(env.get_keys_to_action().values()))
        assert all(map(space.contains, spread.astype(space.dtype)))
        assert np.array_equal(spread.min(0), space.low) and np.array_equal(spread.max(0), space.high)
        return
    count = int(np.prod(space.nvec)) if isinstance(space, gym.spaces.MultiDiscrete) else int(space.n)
    if count > len(window.KEYS):
        with pytest.raises(taskspec.SpecError, match="E713"):
            env.get_keys_to_action()
        return
    keys = env.get_keys_to_action()
    assert len(keys) == count == len({np.asarray(action).tobytes() for action in keys.values()})
    assert all(map(space.contains, keys.values()))
    assert len(legend(env.task)) == count


@needs_vectors("Gymnasium waits for the player from 1.0 on")
def test_a_person_plays_an_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = taskspec.make("RiskyPath", render_mode="rgb_array")
    env.reset(seed=0)
    seen: list[Any] = []
    pressed = [[], [pygame.event.Event(pygame.KEYDOWN, key=ord("0"))], [], [pygame.event.Event(pygame.QUIT)]]
    monkeypatch.setattr(pygame.event, "get", lambda: pressed.pop(0))
    play(env, lambda *step: seen.append(step[2:5]), fps=100)
    assert seen == [(0, 0.0, False), (0, 1.0, False)]


STEER = """
summary: Two thrusters.
state:
  x: {type: real, low: -1, high: 1, shape: [2]}
action:
  f: {type: real, low: -1, high: 1, shape: [NUMBER]}
horizon: 3
initial:
  x: [0, 0]
dynamics:
  x': clip(x + f[0] / 4, -1, 1)
reward: x'[0]
"""


@needs_vectors("Gymnasium waits for the player from 1.0 on")
@pytest.mark.parametrize("number", ["1", "2"])
def test_real_actions_are_played(number: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    path = tmp_path / "steer.yaml"
    path.write_text(whole_spec(STEER.replace("NUMBER", number)))
    env = taskspec.make(path, render_mode="rgb_array")
    env.reset(seed=0)
    last = max(code for (code,) in env.get_keys_to_action())
    paid: list[float] = []
    pressed = [[], [pygame.event.Event(pygame.KEYDOWN, key=last)], [pygame.event.Event(pygame.QUIT)]]
    monkeypatch.setattr(pygame.event, "get", lambda: pressed.pop(0))
    play(env, lambda *step: paid.append(step[3]), fps=100)
    assert paid == [0.25]


def test_a_window_that_nobody_can_see_is_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame")
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
    monkeypatch.setattr(pygame.display, "init", lambda: None)
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    with pytest.raises(taskspec.SpecError, match="E717"):
        play(taskspec.make("RiskyPath", render_mode="rgb_array"))


def test_the_command_says_so_where_there_is_no_display() -> None:
    pytest.importorskip("pygame")
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-m", "taskspec", "play", "RiskyPath"],
        env={**environment, "SDL_VIDEODRIVER": "x11", "NO_COLOR": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0 and "Traceback" not in done.stderr
    assert "E717" in done.stderr and "1  risky" in done.stdout


@pytest.mark.parametrize("form", FORMS)
def test_a_player_is_told_of_illegal_actions(form: str, tmp_path: Path) -> None:
    action, move = FORMS[form]
    path = tmp_path / "lift.yaml"
    path.write_text(whole_spec(SPEC.replace("ACTION", action).replace("MOVE", move)))
    task = taskspec.load(path)
    told: list[str] = []
    env = Warned(taskspec.make(task), told.append)
    env.reset(seed=0, options={"state": {"level": 2, "door": True}})
    names = window.names(task)
    assert expected(form, env.unwrapped.state)[-1] == 0
    env.step(window.actions(task)[-1])
    assert told == [f"{names[-1]} is illegal here"]
    env.unwrapped.state = {"door": False}
    env.step(window.actions(task)[-1])
    assert len(told) == 1
