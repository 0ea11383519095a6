"""The specs in the repository's folders, without what lies beside them: experiments, exams, findings; and their tasks."""

import re
from functools import cache
from pathlib import Path

from taskspec.base.diagnostics import SpecError
from taskspec.language import source
from taskspec.language.registry import task_ids
from taskspec.language.task.build import build
from taskspec.language.task.merge import variant_names
from taskspec.language.task.task import Task

ROOT = Path(__file__).parents[2]
SHIPPED = "tasks/*/*.yaml"
EVERY = (SHIPPED, "tests/specs/*.yaml")
PAPER = ("derail", "seals")
"""The suites that follow the paper and its code; the others are the library."""
VARIED = (
    "acrobot", "bernoulli_bandit", "blackjack", "boat_race", "car_rental", "cart_pole", "cartpole_swingup", "catch",
    "contextual_bandit", "deep_sea", "dirichlet_mdp", "discounting_chain", "drifting_bandit", "epidemic", "frozen_lake",
    "hallway", "inventory", "key_door", "life", "lights_out", "lqr", "maintenance", "memory_len", "minesweeper",
    "mountain_car", "mountain_car_continuous", "multi_choice", "n_queens", "pendulum", "permuted_actions", "preferences",
    "queue", "simon", "sokoban", "taxi", "three_in_a_column", "tic_tac_toe", "tiger", "two_goals", "umbrella",
)  # fmt: skip
"""Specs that use the language in many ways: what is tested on each of them is slow."""


@cache
def spec_file(name: str) -> Path:
    """The file of a spec of the library or of the tests, by its name without a suffix."""
    found = [*ROOT.glob(f"tasks/*/{name}.yaml"), *ROOT.glob(f"tests/specs/{name}.yaml")]
    assert len(found) == 1, found
    return found[0]


def without_figure(name: str) -> str:
    """The text of a spec without its section `figure`."""
    return re.sub(r"^figure:.*\n(?: .*\n)*", "", spec_file(name).read_text(encoding="utf-8"), flags=re.MULTILINE)


def varied_files() -> list[Path]:
    """The files of the specs that use the language in many ways."""
    return list(map(spec_file, VARIED))


def suite_ids(*suites: str) -> list[str]:
    """The ids of shipped tasks of some suites."""
    return [name for name in task_ids() if name.partition("/")[0] in suites]


def paper_ids() -> list[str]:
    """The ids of the suites that follow the paper and its code."""
    return suite_ids(*PAPER)


def specs(*patterns: str) -> list[Path]:
    """The specs that patterns of paths, from the root of the repository, lead to; sorted."""
    found = []
    for pattern in patterns:
        for path in ROOT.glob(pattern):
            if source.kind_of_text(path.read_text(encoding="utf-8", errors="replace")) == "taskspec":
                found.append(path)
    return sorted(found)


def tasks_of(path: Path) -> tuple[Task, ...]:
    """The tasks of a spec in the repository, as `tasks` has them."""
    return tasks(str(path.relative_to(ROOT)))


@cache
def tasks(*patterns: str) -> tuple[Task, ...]:
    """The tasks of these specs, each variant, at their defaults; without bases that only their variants complete."""
    found = []
    for path in specs(*patterns):
        document = source.read_file(path)
        for variant in variant_names(document.data).values():
            try:
                found.append(build(document, variant))
            except SpecError:
                continue
    return tuple(found)
