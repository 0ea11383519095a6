"""What others offer: Gymnasium, seals, EnvPool and gymnax, each driven as its users would."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from taskspec.learn.experiments.speed import ACTIONS, Drive, scalar, stepped
from tests.benchmarks.race import Contestant


def gymnasium_cart_pole(lanes: int) -> Contestant:
    """Gymnasium's own vector environment of CartPole."""

    def make() -> Any:
        import gymnasium

        return gymnasium.make_vec("CartPole-v1", num_envs=lanes, vectorization_mode="vector_entry_point")

    return Contestant("CartPole", "CartPoleVectorEnv", lanes, _vector(make), rival="numba")


def envpool_cart_pole(lanes: int) -> Contestant:
    def make() -> Any:
        envpool = import_module("envpool")
        return envpool.make("CartPole-v1", env_type="gymnasium", num_envs=lanes, num_threads=1)

    return Contestant("CartPole", "EnvPool", lanes, _vector(make, lanes), rival="numba")


def seals_scalar(env_id: str, task: str) -> Contestant:
    """An environment of seals, as registered."""

    def make() -> Drive:
        import gymnasium

        with _foreign():
            import_module("seals")  # registers its environments
            return _quietly(scalar(gymnasium.make(env_id)))

    return Contestant(task, "seals", 1, make)


def seals_sync(env_id: str, task: str, lanes: int) -> Contestant:
    """An environment of seals in Gymnasium's SyncVectorEnv."""

    def make() -> Any:
        import gymnasium

        import_module("seals")
        return gymnasium.make_vec(env_id, num_envs=lanes, vectorization_mode="sync")

    return Contestant(task, "SyncVectorEnv", lanes, _vector(make))


def gymnax(
    env_id: str,
    task: str,
    lanes: int,
    options: Mapping[str, Any] | None = None,
    params: Mapping[str, Any] | None = None,
) -> Contestant:
    """An environment of gymnax inside `scan`; `options` are those of `gymnax.make`, `params` replace its parameters."""

    def make() -> Drive:
        from tests.benchmarks.scan import gymnax_scan

        with _foreign():
            return gymnax_scan(env_id, lanes, options or {}, params or {})

    return Contestant(task, "gymnax", lanes, make, rival="jax-scan")


def registered_vector(env_id: str, lanes: int, **options: Any) -> Callable[[], Drive]:
    """One of our own environments as `gymnasium.make_vec` gives it, with Gymnasium's defaults."""

    def make() -> Any:
        import gymnasium

        return gymnasium.make_vec(env_id, num_envs=lanes, **options)

    return _vector(make)


def registered_scalar(env_id: str) -> Drive:
    """One of our own environments as `gymnasium.make` gives it."""
    import gymnasium

    return scalar(gymnasium.make(env_id))


def empty_scalar() -> Drive:
    """An environment without an episode's end, whose step does nothing: no environment of Gymnasium is faster."""
    import gymnasium

    class Empty(gymnasium.Env[int, int]):
        observation_space = action_space = gymnasium.spaces.Discrete(2)

        def reset(
            self, *, seed: int | None = None, options: dict[str, Any] | None = None
        ) -> tuple[int, dict[str, Any]]:
            return 0, NOTHING

        def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
            return 0, 0.0, False, False, NOTHING

    return scalar(Empty())


NOTHING: dict[str, Any] = {}


def _vector(make: Callable[[], Any], lanes: int | None = None) -> Callable[[], Drive]:
    """`lanes` is for spaces that are those of one environment."""

    def prepare() -> Drive:
        with _foreign():
            env = make()
            env.reset()
            space = env.action_space
            space.seed(0)
            batch = space.sample if lanes is None else lambda: np.array([space.sample() for _ in range(lanes)])
            actions = [batch() for _ in range(ACTIONS)]
        return _quietly(stepped(env, actions, lanes))

    return prepare


def _quietly(drive: Drive) -> Drive:
    """Without the warnings that others give at every step."""

    def quiet() -> int:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return drive()

    return quiet


@contextlib.contextmanager
def _foreign() -> Iterator[None]:
    """Around code that is not ours: what it says on import or creation is not for our users."""
    with open(os.devnull, "w") as nowhere, warnings.catch_warnings():  # noqa: PTH123  # a device, not a path
        warnings.simplefilter("ignore")
        with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            yield
