"""How `taskspec run --render` shows episodes: as text, in a window, or in a film."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec.base.diagnostics import spec_error
from taskspec.base.files import Unfinished, refused, write_bytes
from taskspec.base.progress import tell
from taskspec.cli.console import say
from taskspec.cli.failures import misuse

if TYPE_CHECKING:
    from taskspec.cli.rollouts import Watch
    from taskspec.envs import Environment
    from taskspec.task.parameters import RenderMode

RENDER_MODES: dict[str, RenderMode] = {"ansi": "ansi", "human": "human", "gif": "rgb_array", "mp4": "rgb_array"}
"""What an environment renders for each value of `--render`."""
FILMS = ("gif", "mp4")
GIF_FRAMES = 500  # a GIF is kept in memory until it is whole: 1.5 MB a frame
HOLD = 1.0
"""Seconds for which a film shows the last state of an episode."""


def kind_of(render: str | None, output: Path | None) -> str | None:
    """What to show, by `--render` or else by the ending of the file.

    Raises:
        UsageError: when there is no such way, or it does not go with the file.
    """
    ending = None if output is None else output.suffix[1:].lower()
    kind = render or ending
    if kind is not None and kind not in RENDER_MODES:
        raise misuse(f"--render is one of {', '.join(RENDER_MODES)}, not '{kind}'")
    if output is not None and (kind not in FILMS or ending != kind):
        raise misuse(f"--output is a video: its name ends in .gif or .mp4, as --render says, not '{output.name}'")
    return kind


@contextmanager
def watching(kind: str | None, path: Path, episodes: int) -> Iterator[Watch | None]:
    """What looks at every state; None where nobody does."""
    from taskspec.cli.progress import progress

    match kind:
        case "ansi":
            yield _print
        case "gif" | "mp4":
            with progress(str(path)), Film(path, kind, episodes) as film:
                yield film
        case _:
            yield None


def _print(env: Environment, note: str, last: bool) -> None:
    say((f"{env.render()}\n  {note}" if note else str(env.render())) + "\n")


class Film:
    """Writes what an environment renders to a GIF or MP4 file, which is there when all went well.

    Raises:
        SpecError: E705 without imageio, or without ffmpeg for MP4; E716 where the file cannot be written.
    """

    def __init__(self, path: Path, kind: str, episodes: int) -> None:
        from taskspec.base.extras import need
        from taskspec.envs import window

        self._path, self._kind, self.frames = path, kind, 0
        self._episodes, self._begun = episodes, 0
        self._writer: Any = None
        self._drawing = window.Frames()
        self._target: BytesIO | Unfinished = BytesIO()  # a GIF is kept in memory; ffmpeg writes to a file
        self._imageio = need("imageio.v2", "figures")
        if kind == "mp4":
            self._ffmpeg = need("imageio_ffmpeg", "figures")
            _find_ffmpeg(self._ffmpeg)

    def __enter__(self) -> Film:
        return self

    def __call__(self, env: Environment, note: str, last: bool) -> None:
        self._tell(env)
        fps = env.metadata["render_fps"]
        writer = self._writer or self._open(fps)
        picture = self._drawing.draw(env.task, env.state, env.time, note or "start")
        for _ in range(1 + round(HOLD * fps) if last else 1):
            with refused(self._path):
                writer.append_data(picture)
            self.frames += 1
        if self._kind == "gif" and self.frames > GIF_FRAMES:
            raise misuse(f"a GIF holds {GIF_FRAMES} steps at most", "make an MP4, or cut the episode with --max-steps")

    def _tell(self, env: Environment) -> None:
        """How far the film is: of episodes without a horizon, which of them it shows."""
        horizon = env.task.horizon
        self._begun += env.time == 0
        part = 0.0 if horizon is None else env.time / horizon
        what = f"{self._path}, episode {self._begun:,} of {self._episodes:,}, step {env.time:,}"
        tell(what, (self._begun - 1 + part) / self._episodes)

    def _open(self, fps: float) -> Any:
        if self._kind == "gif":
            self._writer = self._imageio.get_writer(self._target, format="GIF", mode="I", duration=1000 / fps, loop=0)
            return self._writer
        with refused(self._path):
            self._target = file = Unfinished(self._path)
            self._writer = self._imageio.get_writer(file.path, mode="I", fps=fps)
        return self._writer

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        try:
            with refused(self._path):
                if self._writer is not None:
                    self._writer.close()
                if self._writer is not None and error is None:
                    self._finish()
        finally:
            if isinstance(self._target, Unfinished):
                self._target.discard()

    def _finish(self) -> None:
        if isinstance(self._target, BytesIO):
            write_bytes(self._path, self._target.getvalue())
        else:
            self._check(self._target.path)
            self._target.finish()

    def _check(self, path: Path) -> None:
        """ffmpeg keeps it to itself when it could not write.

        Raises:
            OSError: frames are missing.
        """
        try:
            frames, _ = self._ffmpeg.count_frames_and_secs(str(path))
        except RuntimeError:
            frames = 0
        if frames != self.frames:
            raise OSError(f"ffmpeg wrote {frames} of {self.frames} frames")


def _find_ffmpeg(module: Any) -> None:
    try:
        module.get_ffmpeg_exe()
    except RuntimeError as error:
        raise spec_error("E705", "an MP4 needs ffmpeg, which was not found", "install ffmpeg, or make a GIF") from error


def warn_unseen() -> None:
    """Say on standard error that there is no display, rather than show nothing without a word."""
    from taskspec.base.extras import need

    if need("matplotlib", "figures").get_backend().lower() == "agg":
        say("no display was found, so no window is shown; --render gif makes a film", err=True)
