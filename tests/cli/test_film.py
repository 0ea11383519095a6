"""`taskspec run --render` and `taskspec figure --overlay`."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from taskspec.cli.app import app
from taskspec.envs import window
from taskspec.language.registry import load
from taskspec.show import figures
from taskspec.show.figures import Overlay, raster, recording, scene
from taskspec.show.figures.shapes import Box, Label
from taskspec.show.figures.states import expert_path, state_table
from taskspec.show.printers.text import plain

matplotlib = pytest.importorskip("matplotlib")
DERAIL = Path(__file__).parents[2] / "tasks" / "derail"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def cli(*args: object) -> Result:
    return CliRunner().invoke(app, [str(a) for a in args], env={"COLUMNS": "100", "NO_COLOR": "1"})


# -- films --------------------------------------------------------------------------------------------------------


def test_a_gif_has_a_frame_for_every_state(folder: Path) -> None:
    images = pytest.importorskip("imageio.v3")
    done = cli("run", "RiskyPath", "--policy", "expert", "--render", "gif", "-o", "deep/film.gif")
    assert done.exit_code == 0, done.stderr
    assert "wrote deep/film.gif" in done.stdout
    frames = images.imread(folder / "deep" / "film.gif")
    assert frames.shape[1:] == (480, 640, 3)
    assert images.immeta(folder / "deep" / "film.gif")["duration"] == 250
    assert 2 <= len(frames) <= 6 + 4  # the format joins frames that are alike; the last one stays


def test_frames_tell_what_was_done_paid_and_earned(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("imageio")
    told: list[str] = []
    drawn = window.frame

    def frame(*args: Any) -> window.Frame:
        told.append(args[3])
        return drawn(*args)

    monkeypatch.setattr(window, "frame", frame)
    assert cli("run", "EarlyTermPos", "--policy", "expert", "-o", "x.gif").exit_code == 0
    assert told == ["start", *(f"action go_on, reward 1, return {n}" for n in range(1, 11))]


MIXED = """\
taskspec: 1
name: Mixed
state: {x: {type: real}, y: {type: int, low: 0, high: 5}}
action:
  m: {type: choice, values: {N: [-1, 0], S: [1, 0]}}
  stay: {type: bool}
  by: {type: int, shape: [2], low: -1, high: 1}
horizon: 3
initial: {x: 0, y: 0}
dynamics: {x': "x + m[0]", y': 0 if stay else y}
reward: -0.25
"""


def test_frames_tell_actions_by_their_labels_and_numbers_with_signs_on_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("imageio")
    titles: list[str] = []
    drawn = figures.render_frame

    def render_frame(*args: Any, **more: Any) -> window.Frame:
        titles.append(args[2])
        return drawn(*args, **more)

    monkeypatch.setattr(figures, "render_frame", render_frame)
    (folder / "x.yaml").write_text(MIXED, encoding="utf-8")
    (folder / "plan.json").write_text('[["S", 0, -1, 1], ["N", 1, 0, 0]]', encoding="utf-8")
    done = cli("run", "x.yaml", "--policy", "plan.json", "-o", "x.gif")
    assert done.exit_code == 0, done.stderr
    first, second = (title.replace("\u00a0", " ").split("\n")[1:] for title in titles[1:3])
    assert first == ["action S, stay = false, by = [−1, 1],", "reward −0.25, return −0.25"]
    assert second == ["action N, stay = true, by = [0, 0],", "reward −0.25, return −0.5"]


@pytest.mark.parametrize("digits", range(1, 12))
def test_a_number_stays_with_its_name(digits: int, monkeypatch: pytest.MonkeyPatch) -> None:
    titles: list[str] = []
    monkeypatch.setattr(figures, "render_frame", lambda *args, **more: titles.append(args[2]))
    window.frame(load("derail/RiskyPath-v0"), {"s": 0}, 1, f"action {'1' * digits}.5, reward -1.25e-05, return -12.125")
    (title,) = titles
    lines = title.replace("\u00a0", " ").split("\n")
    assert any("reward −1.25e−05" in line for line in lines) and any("return −12.125" in line for line in lines)


def test_a_note_is_seen_and_cut_to_the_frame() -> None:
    one = load("derail/RiskyPath-v0")
    bare, short, long, longer = (
        window.frame(one, {"s": 0}, 1, note) for note in (None, "a", "word " * 15, "word " * 500)
    )
    picture = 150  # pixels down to which words reach
    assert not np.array_equal(short[:picture], long[:picture])
    assert np.array_equal(short[picture:], long[picture:]) and np.array_equal(long[picture:], longer[picture:])
    assert (longer[:picture, -5:] == 255).all() and not np.array_equal(bare, short)


FILMED = [
    ("derail/Branching-v0", {"L": 10}), ("derail/ProcGoal-v0", {"D": 4}), ("seals/CliffWorldLarge-v0", {}),
    ("derail/Sort-v0", {"L": 12}), ("derail/Parabola-v0", {}), ("derail/NoisyObs-v0", {}), ("seals/RandomTransition-v0", {}),
    ("derail/Branching-v0", {"L": 40, "B": 12}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "values"), FILMED)
def test_films_leave_nothing_out_and_their_window_stays(name: str, values: dict[str, int]) -> None:
    """What does not move is at one place in all frames, and there are no dots for what is left out."""
    one = load(name, **values)
    states = expert_path(one, 12) if name != "seals/RandomTransition-v0" else [{"s": s} for s in range(5)]
    shown = [scene(one, Overlay(here=state)) or state_table(one, state) for state in states]
    assert len({(x.width, x.height) for x in shown}) == 1
    assert not any(plain(x.text) in ("…", "⋮") for found in shown for x in found.items if isinstance(x, Label))
    assert all(a.items != b.items for a, b in itertools.pairwise(shown[:3])) or "Sort" in name
    keys = [
        {x for x in found.items if isinstance(x, Label) and plain(x.text) in ("good", "bad", "x", "y")}
        for found in shown
    ]
    assert all(key == keys[0] for key in keys)


def test_a_graph_without_room_at_a_legible_size_is_shown_in_pages() -> None:
    one = load("derail/Branching-v0", L=10)
    whole = scene(one, Overlay(here={"s": 20}))
    assert whole is not None and whole.focus is not None
    assert raster.LEAST_SCALE * whole.width > 640 * raster.INCH / raster.DPI  # there is no room for all
    frames = [window.frame(one, {"s": 2 * k}, k)[100:] for k in range(11)]
    changed = [int((a != b).any(axis=(0, 2)).sum()) for a, b in itertools.pairwise(frames)]
    assert sum(columns > 300 for columns in changed) == 1  # but for one turn, two vertices change
    assert sum(columns < 150 for columns in changed) == 9


def test_a_page_is_turned_where_the_agent_leaves_the_window() -> None:
    one = load("derail/ProcGoal-v0", D=60)
    near, far = ([g - k, 0] for g, k in ((0, 3), (0, 40)))
    at = [scene(one, Overlay(here={"p": np.array(p), "g": np.array([0, 0])})) for p in (near, far)]
    goals = [sum(isinstance(x, Box) and x.fill == "good" for x in found.items) for found in at if found is not None]
    assert goals == [2, 0]  # one of them in the key


def test_an_mp4_lasts_as_long_as_the_episode(folder: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    done = cli("run", "RiskyPath", "--policy", "expert", "-o", "film.mp4", "-n", 2)
    assert done.exit_code == 0, done.stderr
    assert (folder / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert ffmpeg.count_frames_and_secs(str(folder / "film.mp4")) == (2 * (6 + 4), 5.0)


def test_a_film_is_named_after_its_task(folder: Path) -> None:
    pytest.importorskip("imageio")
    done = cli("run", "RiskyPath", "--render", "gif", "--json")
    assert (done.exit_code, done.stdout[0]) == (0, "{")
    assert (folder / "RiskyPath.gif").read_bytes()[:6] == b"GIF89a"


def test_a_film_of_any_length_is_cut(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("imageio")
    monkeypatch.setattr(recording, "GIF_FRAMES", 5)
    (folder / "x.yaml").write_text((DERAIL / "risky_path.yaml").read_text().replace("horizon: 5", "horizon: none"))
    assert cli("run", "x.yaml", "-o", "x.gif", "--max-steps", 3).exit_code == 0
    (folder / "x.gif").unlink()
    done = cli("run", "x.yaml", "-o", "x.gif")
    assert (done.exit_code, "--max-steps" in done.stderr) == (1, True)
    assert not (folder / "x.gif").exists()


MISUSES = [
    (["--render", "hologram"], "--render is one of"),
    (["--render", "gif", "-o", "film.mp4"], "--output"),
    (["--render", "ansi", "-o", "film.gif"], "--output"),
    (["-o", "film.txt"], "--render is one of"),
    (["--render", "ansi", "--json"], "cannot be combined"),
]


@pytest.mark.parametrize(("options", "words"), MISUSES)
def test_misuse(options: list[str], words: str) -> None:
    done = cli("run", "RiskyPath", *options)
    assert (done.exit_code, words in done.stderr) == (2, True)


@pytest.mark.parametrize(("kind", "package"), [("gif", "imageio.v2"), ("mp4", "imageio_ffmpeg"), ("gif", "matplotlib")])
def test_missing_packages(kind: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    done = cli("run", "RiskyPath", "--render", kind)
    assert (done.exit_code, "E705" in done.stderr) == (1, True)
    assert "pip install" in done.stderr and "[figures]" in done.stderr


def test_missing_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")

    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(ffmpeg, "get_ffmpeg_exe", missing)
    done = cli("run", "RiskyPath", "--render", "mp4")
    assert (done.exit_code, "ffmpeg" in done.stderr) == (1, True)


def test_a_window_on_a_machine_without_a_display() -> None:
    done = cli("run", "RiskyPath", "--policy", "expert", "--render", "human")
    assert (done.exit_code, "return" in done.stdout) == (0, True)
    assert "no display" in done.stderr


# -- figures ------------------------------------------------------------------------------------------------------


def test_overlays(folder: Path) -> None:
    done = cli("figure", "RiskyPath", "-o", "r.svg", "--overlay", "values,expert", "--overlay", "occupancy")
    assert done.exit_code == 0, done.stderr
    assert cli("figure", "RiskyPath", "-o", "plain.svg").exit_code == 0
    over, plain = ((folder / name).read_text() for name in ("r.svg", "plain.svg"))
    assert over != plain
    assert cli("figure", "RiskyPath", "-o", "r.svg", "--overlay", "colour").exit_code == 2
    assert "E712" in cli("figure", "Parabola", "-o", "p.svg", "--overlay", "values").stderr
