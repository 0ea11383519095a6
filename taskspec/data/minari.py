"""Demonstrations as a dataset of Minari, in a folder of its own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec.data.transitions import Trajectory
from taskspec.exact.model.failure import misused
from taskspec.extras import need
from taskspec.making import made_by

if TYPE_CHECKING:
    from taskspec.data.demonstrations import Demonstrations

EXTRA = "minari"
_NAME = re.compile(r"[-_\w]*\w-v\d+")


def write_minari(folder: Path, place: Path, data: Demonstrations) -> None:
    """Write the dataset `place` into a folder that is going to be there.

    Raises:
        SpecError: E705 where Minari, or h5py, is not installed; E713 where the last part of the place is no name of a dataset.
    """
    if not _NAME.fullmatch(place.name):
        misused(f"Minari cannot call a dataset '{place.name}'", "end the folder's name in a version: expert-v0")
    if data.task is None:
        misused(
            "a dataset of Minari is written of what `demonstrations` gives, not of what was read", "write both at once"
        )
    storage = need("minari.dataset.minari_storage", EXTRA, "this format").MinariStorage
    need("h5py", EXTRA, "this format")
    buffer, told = need("minari.data_collector").EpisodeBuffer, data.metadata
    made = storage.new(
        folder / "data", observation_space=data.task.observation_space, action_space=data.task.action_space,
        env_spec=made_by(data.task), data_format="hdf5",
    )  # fmt: skip
    made.update_metadata({
        "dataset_id": place.name, "algorithm_name": told["policy"], "minari_version": need("minari").__version__,
        "description": f"{told['id']}, policy {told['policy']}, seed {told['seed']}", "taskspec": dict(told),
    })  # fmt: skip
    made.update_episodes(_episode(buffer, t, i, told["seed"] + i) for i, t in enumerate(data.trajectories))


def _episode(buffer: Any, t: Trajectory, number: int, seed: int) -> Any:
    ends = [[False] * (len(t) - 1) + [over] for over in (t.terminated, t.truncated)]
    return buffer(
        id=number, seed=seed, observations=t.obs, actions=t.acts, rewards=t.rews, terminations=ends[0], truncations=ends[1],
        infos={},
    )  # fmt: skip
