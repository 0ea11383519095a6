"""Films of episodes: GIF and MP4 files."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any, Literal

from taskspec.base.diagnostics import spec_error
from taskspec.base.extras import need
from taskspec.base.files import Unfinished, refused, write_bytes
from taskspec.base.limits import tell
from taskspec.envs import window
from taskspec.envs.env import Environment

HOLD = 1.0
"""Seconds for which a film shows the last state of an episode."""


class Film:
    """A context manager that writes what an environment renders to a file, which exists when all went well.

    Args:
        path: the file.
        kind: a GIF is kept in memory until it is whole, with 1.5 MB a frame.
        episodes: the number of episodes, for progress.

    Raises:
        SpecError: E705 without imageio, or without ffmpeg for MP4; E716 where the file cannot be written.
    """

    def __init__(self, path: Path, kind: Literal["gif", "mp4"], episodes: int) -> None:
        self._path = path
        self._kind = kind
        self.frames = 0
        self._episodes = episodes
        self._begun = 0
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
        """Add the state of the environment; the last state of an episode stays for a second."""
        self._tell(env)
        fps = env.metadata["render_fps"]
        writer = self._writer or self._open(fps)
        picture = self._drawing.draw(env.task, env.state, env.time, note or "start")
        for _ in range(1 + round(HOLD * fps) if last else 1):
            with refused(self._path):
                writer.append_data(picture)
            self.frames += 1

    def _tell(self, env: Environment) -> None:
        """Report progress: for episodes without a horizon, which of them is shown."""
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
        """Check that ffmpeg, which does not report failures, wrote all frames.

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
