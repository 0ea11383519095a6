"""Whatever takes a task takes its id or the path of its spec as well."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import taskspec
from taskspec import data, exact
from taskspec.envs import Environment
from taskspec.envs.vector import VectorEnvironment
from taskspec.show import figures, pages

ID = "derail/RiskyPath-v0"


TASK = taskspec.load(ID)


PATH = Path(TASK.source.document.origin.name)


def functional(source: Any) -> Any:
    pytest.importorskip("jax")
    from taskspec.programs.jax import Functional

    return Functional(source).task


def func_env(source: Any) -> Any:
    jax = pytest.importorskip("jax")
    from taskspec.envs.functional import TaskFuncEnv

    return int(TaskFuncEnv(source).initial(jax.random.key(3)).seen)


def sb3(source: Any) -> Any:
    pytest.importorskip("stable_baselines3")
    from taskspec.envs.sb3 import Sb3VecEnv

    return Sb3VecEnv(source, 2, backend="numpy").task


def written(source: Any, folder: Path) -> Any:
    return pages.write([source], ["markdown"], folder)[0].read_text(encoding="utf-8")


def drawn(source: Any, folder: Path) -> Any:
    return pages.figure(source, folder / "figure.svg").read_text(encoding="utf-8")


USES: dict[str, Callable[[Any, Path], Any]] = {
    "load": lambda x, _: taskspec.load(x),
    "make": lambda x, _: taskspec.make(x).task,
    "make_vec": lambda x, _: taskspec.make_vec(x, backend="numpy").task,
    "Environment": lambda x, _: Environment(x).task,
    "VectorEnvironment": lambda x, _: VectorEnvironment(x, 2, backend="numpy").task,
    "Sb3VecEnv": lambda x, _: sb3(x),
    "Functional": lambda x, _: functional(x),
    "TaskFuncEnv": lambda x, _: func_env(x),
    "check": lambda x, _: [(v.claim.text, v.status, v.detail) for v in exact.check(x).verdicts],
    "scores": lambda x, _: exact.scores(x).record(),
    "score": lambda x, _: exact.score(x, returns=[4.0]).normalised,
    "extract": lambda x, _: exact.extract(x).start.tolist(),
    "verdicts": lambda x, _: [v.status for v in exact.verdicts(x)],
    "warnings": lambda x, _: exact.warnings(x),
    "examine": lambda x, _: exact.examine(x),
    "soundness": lambda x, _: exact.soundness(x),
    "check_ranges": lambda x, _: exact.check_ranges(x),
    "wrong_examples": lambda x, _: list(exact.wrong_examples(x)),
    "Results": lambda x, _: exact.Results(x).optimal,
    "Expert": lambda x, _: exact.Expert(x).predict(0, deterministic=True)[0],
    "page": lambda x, _: pages.page(x).sections,
    "gather": lambda x, _: pages.gather(x).scores,
    "overlay": lambda x, _: pages.overlay(x, ["values"]),
    "scene": lambda x, _: figures.scene(x),
    "undrawn": lambda x, _: figures.undrawn(x),
    "render_frame": lambda x, _: pages.render_frame(x, {"s": 0}).sum(),
    "demonstrations": lambda x, _: data.demonstrations(x, episodes=2).metadata,
    "preferences": lambda x, _: data.preferences(x, 2).metadata,
    "tabular": lambda x, _: data.tabular(x).R.tolist(),
    "write": written,
    "figure": drawn,
}


@pytest.mark.parametrize("name", USES)
def test_an_id_a_path_and_a_task_are_the_same_to_all(name: str, tmp_path: Path) -> None:
    use = USES[name]
    wanted = use(TASK, tmp_path)
    for source in (ID, "RiskyPath", PATH, str(PATH)):
        assert use(source, tmp_path) == wanted


@pytest.mark.parametrize("name", USES)
def test_what_is_no_task_is_refused_with_a_code(name: str, tmp_path: Path) -> None:
    for source in ("derail/RiskyPth-v0", 3):
        with pytest.raises(taskspec.SpecError) as found:
            USES[name](source, tmp_path)
        assert found.value.codes == ["E701"]
