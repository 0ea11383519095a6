"""Films of episodes: what an environment renders, written to a GIF or an MP4."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from taskspec.base.diagnostics import spec_error
from taskspec.base.extras import need
from taskspec.base.files import Unfinished, refused
from taskspec.base.limits import tell
from taskspec.envs.window import Frames
from taskspec.show.terminal.rollouts import Watch

GIF_FRAMES = 500
"""A GIF is kept in memory until it is whole, with 1.5 MB a frame."""
HOLD = 1.0
"""Seconds for which a film shows the last state of an episode."""


class Film:
    """A context manager that writes what an environment renders to a file, which exists when all went well.

    Args:
        path: the file.
        kind: of the file.
        episodes: the number of episodes, for progress.

    Raises:
        SpecError: E705 without imageio, or without ffmpeg for MP4; E716 where the file cannot be
            written; E713 for a GIF that is too long.
    """

    def __init__(self, path: Path, kind: Literal["gif", "mp4"], episodes: int) -> None:
        self._path = path
        self._kind = kind
        self.frames = 0
        self._episodes = episodes
        self._begun = 0
        self._writer: Any = None
        self._drawing = Frames()
        self._file: Unfinished | None = None
        self._imageio = need("imageio.v2", "figures")
        if kind == "mp4":
            self._ffmpeg = need("imageio_ffmpeg", "figures")
            try:
                self._ffmpeg.get_ffmpeg_exe()
            except RuntimeError as error:
                hint = "install ffmpeg, or make a GIF"
                raise spec_error("E705", "an MP4 needs ffmpeg, which was not found", hint) from error

    def __enter__(self) -> Film:
        return self

    def __call__(self, env: Any, note: str, last: bool) -> None:
        """Add the state of the environment; the last state of an episode stays for a second."""
        horizon = env.task.horizon  # progress without one: which episode is shown
        self._begun += env.time == 0
        part = env.time / horizon if horizon is not None else 0.0
        what = f"{self._path}, episode {self._begun:,} of {self._episodes:,}, step {env.time:,}"
        tell(what, (self._begun - 1 + part) / self._episodes)
        fps = env.metadata["render_fps"]
        writer = self._writer or self._open(fps)
        picture = self._drawing.draw(env.task, env.state, env.time, note or "start")
        copies = 1
        if last:
            copies += round(HOLD * fps)
        for _ in range(copies):
            with refused(self._path):
                writer.append_data(picture)
            self.frames += 1
        if self._kind == "gif" and self.frames > GIF_FRAMES:
            hint = "make an MP4, or cut the episode with --max-steps"
            raise spec_error("E713", f"a GIF holds {GIF_FRAMES} steps at most", hint)

    def _open(self, fps: float) -> Any:
        options: dict[str, Any] = {"fps": fps}
        if self._kind == "gif":
            options = {"format": "GIF", "duration": 1000 / fps, "loop": 0}
        with refused(self._path):
            self._file = Unfinished(self._path)
            self._writer = self._imageio.get_writer(self._file.path, mode="I", **options)
        return self._writer

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if self._file is None:
            return
        try:
            with refused(self._path):
                if self._writer is not None:
                    self._writer.close()
                if error is None:
                    self._check(self._file.path)
                    self._file.finish()
        finally:
            self._file.discard()

    def _check(self, path: Path) -> None:
        """Count the frames of an MP4: ffmpeg does not report failures."""
        if self._kind == "gif":
            return
        frames = 0
        with suppress(RuntimeError):
            frames, _ = self._ffmpeg.count_frames_and_secs(str(path))
        if frames != self.frames:
            raise OSError(f"ffmpeg wrote {frames} of {self.frames} frames")


@contextmanager
def watching(kind: str | None, path: Path, episodes: int, show: Callable[[str], None]) -> Iterator[Watch | None]:
    """Yield a function that shows every state of an environment; None where nothing is to be shown.

    Args:
        kind: `ansi` for text, `gif` or `mp4` for a film.
        path: of the film.
        episodes: the number of episodes, for progress.
        show: gets the text of each state.
    """

    def show_text(env: Any, note: str, last: bool) -> None:
        lines = [env.render()]
        if note:
            lines.append(f"  {note}")
        show("\n".join(lines) + "\n")

    match kind:
        case "ansi":
            yield show_text
        case "gif" | "mp4":
            with Film(path, kind, episodes) as film:
                yield film
        case _:
            yield None
