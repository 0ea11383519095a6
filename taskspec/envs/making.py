"""Makes environments of ids, paths and tasks, and registers tasks with Gymnasium.

Gymnasium is imported inside functions only: its plugin hook may load this module while `import gymnasium` is still running.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taskspec.base import ids
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.language import registry
from taskspec.language.registry import entries, load, shipped

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec

    from taskspec.envs import Environment
    from taskspec.envs.options import Autoreset
    from taskspec.envs.vector import AutoresetMode, VectorEnvironment
    from taskspec.language.modifiers import Written
    from taskspec.language.task.parts import Ending, RenderMode
    from taskspec.language.task.task import Task, TaskLike
    from taskspec.programs.backend_table import BackendName

SPEC_ID = "taskspec/Spec-v0"
ENTRY_POINT = "taskspec.envs.making:make_registered"


class UnexpectedKeywordError(SpecError, TypeError):
    """A keyword argument of a maker that is neither an option nor a parameter of the task.

    It is a TypeError with Python's wording, too, since wrappers of others try arguments and look for that.
    """

    def __init__(self, text: str, diagnostics: Iterable[Diagnostic] = ()) -> None:
        """`text` alone is what `gym.make` gives when it raises the error again with words of its own."""
        super().__init__(diagnostics or [Diagnostic("E702", None, text)])
        self.text = text
        self.args = (text, self.diagnostics)

    def __str__(self) -> str:
        return self.text


def make(
    source: TaskLike,
    /,
    variant: str | None = None,
    *,
    render_mode: RenderMode | None = None,
    ending: Ending = "terminate",
    observe_time: bool = False,
    modifiers: Iterable[Written] = (),
    **parameters: Any,
) -> Environment:
    """Make the scalar environment of a task: `load` and `taskspec.envs.Environment` in one call.

    Args:
        source: the task, its id or its path.
        variant: of the spec; None for the spec itself.
        render_mode: "rgb_array", "ansi" or "human"; None to draw nothing.
        ending: "terminate" where the task ends, or "absorb" to stay in an absorbing state until the horizon.
        observe_time: whether observations include the time.
        modifiers: of the task, such as "sticky=0.25", in this order.
        parameters: values of the task's parameters, by name.

    Returns:
        an environment of Gymnasium's interface.

    Raises:
        SpecError: there is no such task, parameter or modifier, or the spec has a mistake.
    """
    from taskspec.envs import Environment

    task = _loaded(source, variant, {**parameters, "modifiers": modifiers})
    return Environment(task, render_mode=render_mode, ending=ending, observe_time=observe_time)


def register(folder: str | os.PathLike[str] | None = None) -> list[str]:
    """Register specs with Gymnasium; they are not read in full.

    Args:
        folder: its specs, and those of its sub-folders; without one, the shipped tasks.

    Returns:
        The ids.

    Raises:
        SpecError: when the folder does not exist or a spec in it cannot be read.
    """
    _take_instances()
    if folder is None:
        for entry in shipped().values():
            _add(entry.id, {"task": entry.id})
        _add(SPEC_ID, {})
        return [*shipped(), SPEC_ID]
    root = Path(folder)
    if not root.is_dir():
        raise spec_error("E710", f"there is no folder '{root}'")
    folders = [root, *sorted(p for p in root.iterdir() if p.is_dir())]
    known: list[registry.Entry] = []
    for each in folders:
        known += entries(each.resolve())
    for entry in known:
        registry.add(entry)
        _add(entry.id, {"path": str(entry.path), "variant": entry.variant})
    return [entry.id for entry in known]


def _add(task_id: str, kwargs: dict[str, Any]) -> None:
    from gymnasium.envs.registration import EnvSpec
    from gymnasium.envs.registration import registry as known

    # The environment checks order, horizon and actions itself, so that `gym.make` can return it bare. Gymnasium's `register`
    # would look for other versions of each task among all tasks.
    known[task_id] = EnvSpec(
        task_id,
        ENTRY_POINT,
        vector_entry_point="taskspec.envs.making:make_vec_registered",
        order_enforce=False,
        disable_env_checker=True,
        kwargs=kwargs,
    )


def _take_instances() -> None:
    """Let `gym.make` and `gym.make_vec` take ids with parameters and modifiers."""
    from gymnasium.envs import registration

    find = getattr(registration, "_find_spec", None)
    if find is None or hasattr(find, "__wrapped__"):
        return

    @functools.wraps(find)
    def find_instance(env_id: str) -> Any:
        if not ids.is_instance(env_id):
            return find(env_id)
        asked = ids.parse(env_id)
        spec = copy.deepcopy(find(asked.name))
        if spec is None or spec.entry_point != ENTRY_POINT:
            return find(env_id)
        spec.kwargs.update(asked.parameters)
        if asked.modifiers:
            spec.kwargs["id_modifiers"] = asked.modifiers
        return spec

    registration._find_spec = find_instance


def make_vec(
    source: TaskLike,
    /,
    variant: str | None = None,
    *,
    num_envs: int | None = None,
    backend: BackendName = "auto",
    autoreset_mode: AutoresetMode | Autoreset = "NextStep",
    reuse: bool = False,
    num_threads: int = 1,
    ending: Ending = "terminate",
    observe_time: bool = False,
    render_mode: RenderMode | None = None,
    modifiers: Iterable[Written] = (),
    instance_seed: int | Sequence[int] | None = None,
    **parameters: Any,
) -> VectorEnvironment:
    """Make many environments of a task, stepped together: `load` and `taskspec.envs.vector.VectorEnvironment` in one call.

    With a list as `instance_seed`, lane i is a scalar environment with the constants of the seed at i; the list is taken from
    its beginning again where `num_envs` says that there are more lanes. `backend`, `reuse` and `num_threads` do not matter then.

    Args:
        source: the task, its id or its path.
        variant: of the spec; None for the spec itself.
        num_envs: number of lanes.
        backend: "numpy", "numba" or "jax", or "auto" for Numba where it is installed, else NumPy.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", as in Gymnasium.
        reuse: whether steps write into the same arrays again.
        num_threads: threads of the Numba backend.
        ending: as for `make`.
        observe_time: as for `make`.
        render_mode: as for `make`.
        modifiers: as for `make`.
        instance_seed: seed of the task's constants, or one for each lane.
        parameters: as for `make`.

    Returns:
        a vector environment of Gymnasium's interface, lanes first.

    Raises:
        SpecError: E705 when Gymnasium is older than 1.1 or the backend's package is not installed.
    """
    from taskspec.envs.vector import VectorEnvironment

    options: dict[str, Any] = {
        "autoreset_mode": autoreset_mode, "ending": ending, "observe_time": observe_time, "render_mode": render_mode,
    }  # fmt: skip
    given = {**parameters, "modifiers": modifiers}
    if isinstance(instance_seed, Sequence):
        tasks = [_loaded(source, variant, {**given, "instance_seed": seed}) for seed in instance_seed]
        return _instance_lanes(tasks, num_envs, options)
    if instance_seed is not None:
        given["instance_seed"] = instance_seed
    task = _loaded(source, variant, given)
    if num_envs is None:
        num_envs = 1
    return VectorEnvironment(task, num_envs, backend=backend, reuse=reuse, num_threads=num_threads, **options)


def _loaded(source: TaskLike, variant: str | None, given: Mapping[str, Any]) -> Task:
    try:
        return load(source, variant, **given)
    except SpecError as error:
        messages = " ".join(diagnostic.message for diagnostic in error.diagnostics)
        for name in given:
            if f"has no parameter '{name}'" in messages:
                text = f"{error}\n(got an unexpected keyword argument '{name}')"
                raise UnexpectedKeywordError(text, error.diagnostics) from None
        raise


def _instance_lanes(tasks: Sequence[Task], num_envs: int | None, options: dict[str, Any]) -> Any:
    from taskspec.envs.options import invalid, positive
    from taskspec.envs.vector import InstanceLanes

    if num_envs is None:
        count = len(tasks)
    else:
        count = positive("num_envs", num_envs)
    if not 0 < len(tasks) <= count:
        raise invalid(f"{len(tasks)} instances for {count} lanes")
    return InstanceLanes([tasks[i % len(tasks)] for i in range(count)], **options)


def made_by(task: Task) -> EnvSpec | None:
    """Return how Gymnasium makes a task's environment; None where it knows no id of the task."""
    from gymnasium.envs.registration import registry as known

    registered = known.get(task.id)
    options = dict(task.values)
    if task.modifiers:
        options["modifiers"] = list(map(str, task.modifiers))
    if registered is None or load(task.id, **options) != task:
        return None
    return dataclasses.replace(registered, kwargs=registered.kwargs | options)


def make_registered(**options: Any) -> Environment:
    """Return what `gym.make` calls: keywords are those of `_made`."""
    return _made(make, **options)


def make_vec_registered(**options: Any) -> VectorEnvironment:
    """Return what `gym.make_vec` calls: keywords are those of `_made`."""
    return _made(make_vec, **options)


def _made(
    maker: Callable[..., Any],
    *,
    task: str | None = None,
    path: str | None = None,
    variant: str | None = None,
    max_episode_steps: int | None = None,
    id_modifiers: Iterable[Written] = (),
    modifiers: Iterable[Written] = (),
    **options: Any,
) -> Any:
    """Return what a maker gives for keywords of Gymnasium: an id, or a spec's file, and parameters and options.

    `id_modifiers` are those that stand in the id; others come after them. `max_episode_steps`, as the spec of an environment
    has it, must be the horizon (E713): Gymnasium would cut episodes short, without a word.
    """
    if task is not None and path is not None:
        raise spec_error("E713", "give `task` or `path`, not both")
    source: TaskLike | None = task
    if path is not None:
        source = Path(path)
    if source is None:
        raise spec_error("E713", f"{SPEC_ID} needs a spec", 'gym.make("taskspec/Spec-v0", path="my.yaml")')
    made = maker(source, variant, modifiers=(*id_modifiers, *registry.listed(modifiers)), **options)
    horizon = made.task.horizon
    if max_episode_steps not in (None, horizon):
        message = f"episodes of {made.task.id} have {horizon} steps, not {max_episode_steps}"
        raise spec_error("E713", message, "a parameter of the task may decide it")
    return made
