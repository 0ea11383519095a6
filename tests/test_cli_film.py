"""`taskspec run --render` and `taskspec figure --overlay`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from taskspec.cli import film
from taskspec.cli.app import app

matplotlib = pytest.importorskip("matplotlib")
DERAIL = Path(__file__).parent.parent / "tasks" / "derail"


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
    monkeypatch.setattr(film, "GIF_FRAMES", 5)
    (folder / "x.yaml").write_text((DERAIL / "risky_path.yaml").read_text().replace("horizon: 5", "horizon: none"))
    assert cli("run", "x.yaml", "-o", "x.gif", "--max-steps", 3).exit_code == 0
    (folder / "x.gif").unlink()
    done = cli("run", "x.yaml", "-o", "x.gif")
    assert (done.exit_code, "--max-steps" in done.stderr) == (2, True)
    assert not (folder / "x.gif").exists()


MISUSES = [
    (["--render", "hologram"], "--render is one of"),
    (["--render", "gif", "-o", "film.mp4"], "--output"),
    (["--render", "ansi", "-o", "film.gif"], "--output"),
    (["-o", "film.txt"], "--render is one of"),
    (["--render", "ansi", "--json"], "do not go together"),
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
