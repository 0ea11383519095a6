"""`taskspec run --render` and `taskspec figure --overlay`."""

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec.envs import window
from taskspec.language.registry import load
from taskspec.show import figures
from taskspec.show.figures import Overlay, raster, recording, scene
from taskspec.show.figures.shapes import Label, Scene
from taskspec.show.figures.states import expert_path, state_table
from taskspec.show.printers.text import plain
from tests.shared.commands import Done
from tests.shared.scenes import boxes, labels, words

matplotlib = pytest.importorskip("matplotlib")
DERAIL = Path(__file__).parents[2] / "tasks" / "derail"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_gif_has_a_frame_for_every_state(folder: Path) -> None:
    images = pytest.importorskip("imageio.v3")
    done = Done("run", "RiskyPath", "--policy", "expert", "--render", "gif", "-o", "deep/film.gif")
    assert done.status == 0, done.err
    assert "wrote deep/film.gif" in done.out
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
    assert Done("run", "EarlyTermPos", "--policy", "expert", "-o", "x.gif").status == 0
    assert told[0] == "start"
    for t in range(1, 11):
        assert told[t] == f"action go_on, reward 1, return {t}"
    assert len(told) == 11


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


@pytest.fixture
def titles(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Lines of the titles of all frames that are drawn."""
    titles: list[list[str]] = []
    drawn = figures.render_frame

    def render_frame(*args: Any, **more: Any) -> window.Frame:
        titles.append(args[2].replace("\u00a0", " ").split("\n"))
        return drawn(*args, **more)

    monkeypatch.setattr(figures, "render_frame", render_frame)
    return titles


def test_frames_tell_actions_by_their_labels_and_numbers_with_signs_on_one_line(
    folder: Path, titles: list[list[str]]
) -> None:
    pytest.importorskip("imageio")
    (folder / "x.yaml").write_text(MIXED, encoding="utf-8")
    (folder / "plan.json").write_text('[["S", 0, -1, 1], ["N", 1, 0, 0]]', encoding="utf-8")
    done = Done("run", "x.yaml", "--policy", "plan.json", "-o", "x.gif")
    assert done.status == 0, done.err
    assert titles[1][1:] == ["action S, stay = false, by = [−1, 1],", "reward −0.25, return −0.25"]
    assert titles[2][1:] == ["action N, stay = true, by = [0, 0],", "reward −0.25, return −0.5"]


@pytest.mark.parametrize("digits", range(1, 12))
def test_a_number_stays_with_its_name(digits: int, titles: list[list[str]]) -> None:
    window.frame(load("derail/RiskyPath-v0"), {"s": 0}, 1, f"action {'1' * digits}.5, reward -1.25e-05, return -12.125")
    (lines,) = titles
    title = "\n".join(lines)
    assert "reward −1.25e−05" in title and "return −12.125" in title


def test_a_note_is_seen_and_cut_to_the_frame() -> None:
    one = load("derail/RiskyPath-v0")
    bare = window.frame(one, {"s": 0}, 1, None)
    short = window.frame(one, {"s": 0}, 1, "a")
    long = window.frame(one, {"s": 0}, 1, "word " * 15)
    longer = window.frame(one, {"s": 0}, 1, "word " * 500)
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
    for found in shown:
        assert (found.width, found.height) == (shown[0].width, shown[0].height)
        assert {"…", "⋮"}.isdisjoint(words(found))
        assert key(found) == key(shown[0])
    for one_moment, next_moment in pairwise(shown[:3]):
        assert one_moment.items != next_moment.items or "Sort" in name


def key(found: Scene) -> set[Label]:
    """Words that say what is seen, which stay where they are."""
    return {label for label in labels(found) if plain(label.text) in ("good", "bad", "x", "y")}


def test_a_graph_without_room_at_a_legible_size_is_shown_in_pages() -> None:
    one = load("derail/Branching-v0", L=10)
    whole = scene(one, Overlay(here={"s": 20}))
    assert whole is not None and whole.focus is not None
    assert raster.LEAST_SCALE * whole.width > 640 * raster.INCH / raster.DPI  # there is no room for all
    frames = [window.frame(one, {"s": 2 * k}, k)[100:] for k in range(11)]
    are_other = np.not_equal(frames[1:], frames[:-1])
    columns = are_other.any(axis=(1, 3)).sum(axis=1)
    assert np.sum(columns > 300) == 1  # but for one turn, two vertices change
    assert np.sum(columns < 150) == 9


def test_a_page_is_turned_where_the_agent_leaves_the_window() -> None:
    one = load("derail/ProcGoal-v0", D=60)
    for x, goals in ((-3, 2), (-40, 0)):  # one of them in the key
        found = scene(one, Overlay(here={"p": np.array([x, 0]), "g": np.array([0, 0])}))
        assert found is not None
        assert len(boxes(found, fill="good")) == goals


def test_an_mp4_lasts_as_long_as_the_episode(folder: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    done = Done("run", "RiskyPath", "--policy", "expert", "-o", "film.mp4", "-n", 2)
    assert done.status == 0, done.err
    assert (folder / "film.mp4").read_bytes()[4:8] == b"ftyp"
    assert ffmpeg.count_frames_and_secs(str(folder / "film.mp4")) == (2 * (6 + 4), 5.0)


def test_a_film_is_named_after_its_task(folder: Path) -> None:
    pytest.importorskip("imageio")
    done = Done("run", "RiskyPath", "--render", "gif", "--json")
    assert (done.status, done.out[0]) == (0, "{")
    assert (folder / "RiskyPath.gif").read_bytes()[:6] == b"GIF89a"


def test_a_film_of_any_length_is_cut(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("imageio")
    monkeypatch.setattr(recording, "GIF_FRAMES", 5)
    (folder / "x.yaml").write_text((DERAIL / "risky_path.yaml").read_text().replace("horizon: 5", "horizon: none"))
    assert Done("run", "x.yaml", "-o", "x.gif", "--max-steps", 3).status == 0
    (folder / "x.gif").unlink()
    done = Done("run", "x.yaml", "-o", "x.gif")
    assert (done.status, "--max-steps" in done.err) == (1, True)
    assert not (folder / "x.gif").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--render hologram", "--render is one of"), ("--render gif -o film.mp4", "--output"),
        ("--render ansi -o film.gif", "--output"), ("-o film.txt", "--render is one of"),
        ("--render ansi --json", "cannot be combined"),
    ],
)  # fmt: skip
def test_misuse(options: str, message: str) -> None:
    done = Done("run", "RiskyPath", *options.split())
    assert (done.status, message in done.err) == (2, True)


@pytest.mark.parametrize(("kind", "package"), [("gif", "imageio.v2"), ("mp4", "imageio_ffmpeg"), ("gif", "matplotlib")])
def test_missing_packages(kind: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    done = Done("run", "RiskyPath", "--render", kind)
    assert (done.status, "E705" in done.err) == (1, True)
    assert "pip install" in done.err and "[figures]" in done.err


def test_missing_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")

    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(ffmpeg, "get_ffmpeg_exe", missing)
    done = Done("run", "RiskyPath", "--render", "mp4")
    assert (done.status, "ffmpeg" in done.err) == (1, True)


def test_a_window_on_a_machine_without_a_display() -> None:
    done = Done("run", "RiskyPath", "--policy", "expert", "--render", "human")
    assert (done.status, "return" in done.out) == (0, True)
    assert "no display" in done.err


def test_overlays(folder: Path) -> None:
    done = Done("figure", "RiskyPath", "-o", "r.svg", "--overlay", "values,expert", "--overlay", "occupancy")
    assert done.status == 0, done.err
    assert Done("figure", "RiskyPath", "-o", "plain.svg").status == 0
    assert (folder / "r.svg").read_text() != (folder / "plain.svg").read_text()
    assert Done("figure", "RiskyPath", "-o", "r.svg", "--overlay", "colour").status == 2
    assert "E712" in Done("figure", "Parabola", "-o", "p.svg", "--overlay", "values").err
