"""The numbers of `docs/explain/fidelity.md`, beside the installed package `seals` and our tasks."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import taskspec
from taskspec.exact import scores
from tests.shared.seals import original
from tests.shared.specs import paper_ids

PAGE = (Path(__file__).parents[2] / "docs" / "explain" / "fidelity.md").read_text(encoding="utf-8")
SECTIONS = dict(part.split("\n", 1) for part in re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:])
OF_SEALS = {"InitShift": "InitShiftTrain"}
OURS = {"InitShift": "InitShiftExpert"}


def rows(point: str) -> Iterator[tuple[str, str, str]]:
    """Section, and the last two cells, of every row about a point: of the code, and of ours."""
    for title, text in SECTIONS.items():
        for line in text.splitlines():
            cells = re.split(r" *\| *", line)
            if len(cells) == 6 and cells[1] == point:
                yield title, cells[3], cells[4]


def last_number(cell: str) -> float:
    return float(re.findall(r"-?[\d.]+", cell)[-1])


def test_there_is_a_section_for_every_task() -> None:
    for task in paper_ids():
        name = task.partition("/")[2].removesuffix("-v0")
        assert name.endswith("Seals") or name.startswith(tuple(SECTIONS)), task


@pytest.mark.parametrize(("title", "code", "ours"), list(rows("horizon")))
def test_horizons(title: str, code: str, ours: str) -> None:
    registered = gym.spec(f"seals/{OF_SEALS.get(title, title)}-v0").max_episode_steps
    assert registered == last_number(code)
    assert taskspec.load(f"derail/{OURS.get(title, title)}").horizon == last_number(ours)


@pytest.mark.parametrize(("title", "code", "ours"), [*rows("best return"), *rows("random return")])
def test_returns(title: str, code: str, ours: str) -> None:
    which = "optimal" if (title, code, ours) in set(rows("best return")) else "random"
    for variant, cell in (("Seals", code), ("", ours)):
        found = scores(f"derail/{OURS.get(title, title)}{variant}")
        assert getattr(found, which).value == pytest.approx(last_number(cell), rel=1e-9)


def test_the_risky_action_of_the_code() -> None:
    assert np.flatnonzero(original("RiskyPath").unwrapped.transition_matrix[0, 1]).tolist() == [2, 3]


def test_the_learners_start_of_the_code() -> None:
    theirs = original("InitShiftTest").unwrapped
    assert theirs.initial_state() == 1
    assert theirs.initial_state_dist.tolist() == [1, 0, 0, 0, 0, 0, 0]
    assert taskspec.make(taskspec.load("derail/InitShiftLearner")).reset(seed=0)[0] == 1


def test_what_the_code_tells_of_horizons_and_takes_as_options() -> None:
    theirs = original("RiskyPath").unwrapped
    assert theirs.horizon is None
    with pytest.raises(NotImplementedError):
        theirs.reset(options={})
    ours = gym.make("derail/RiskyPathSeals-v0")
    assert ours.spec is not None and ours.spec.max_episode_steps == ours.unwrapped.task.horizon == 5  # type: ignore[attr-defined]
    ours.reset(options={})


def test_the_goal_of_branching_in_the_code() -> None:
    theirs = original("Branching").unwrapped
    assert (theirs.transition_matrix[-1, :, -1] == 1).all()


@pytest.mark.slow
def test_what_the_wind_costs() -> None:
    table = re.findall(r"^\| (CliffWorld\w*) *\|(.*?)\|(.*?)\|", SECTIONS["CliffWorld"], re.MULTILINE)
    assert len(table) == 3
    for name, best, windless in table:
        theirs = original(name).unwrapped
        sizes = {"width": theirs.width, "height": theirs.height, "horizon": theirs.horizon}
        calm = original(name, **sizes, fail_p=0.0).unwrapped
        assert planned(theirs, theirs) == pytest.approx(float(best), abs=5e-4)
        assert planned(calm, theirs) == pytest.approx(float(windless), abs=5e-4)


def planned(believed: Any, real: Any) -> float:
    """The return, in a world, of the plan that is best in another one; of equal actions, the first."""
    states = np.arange(real.state_dim)
    hoped = np.zeros(len(states))
    value = np.zeros(len(states))
    for _ in range(real.horizon):
        q = believed.reward_matrix[:, None] + believed.transition_matrix @ hoped
        hoped = q.max(axis=1)
        chosen = q.argmax(axis=1)
        value = real.reward_matrix + real.transition_matrix[states, chosen] @ value
    return float(real.initial_state_dist @ value)
