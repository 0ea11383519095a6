"""Experts that remember, on the command line and on pages: what they act on, and what is said of them."""

from pathlib import Path

import pytest

import taskspec
from taskspec.exact import Expert, check
from taskspec.exact.rollout.rollout import by_expert, simulate
from taskspec.show.pages.page import page
from tests.exact.policies.test_memory import DRAWN, SEEN, episode, listening, tiger
from tests.shared.commands import Done


@pytest.mark.parametrize("observation", [SEEN, DRAWN])
def test_it_acts_on_what_it_was_shown(observation: str, tmp_path: Path) -> None:
    task = tiger(observation)
    expert = Expert(task)
    whole = task.remembering()
    own = [episode(taskspec.make(task), expert, seed) for seed in range(60)]
    assert own == simulate(whole, by_expert(whole), episodes=60).tolist()
    assert len(set(own)) > 2
    env = taskspec.make(task)
    following = [episode(env, expert, seed) for seed in (0, *[None] * 59)]
    spec = tmp_path / "tiger.yaml"
    spec.write_text(task.source.document.origin.text)
    assert Done("run", spec, "--policy", "expert", "--episodes", 60, "--json").data["returns"] == following


def test_pages_say_what_it_remembers() -> None:
    found = " ".join(str(page(tiger())).split())
    assert "lead" in found and "remembers" in found and "the balance" in found


def test_its_page_its_checks_and_its_examples_are_about_what_it_reads() -> None:
    right = """examples:
  - {state: {lead: 2, heard: right}, expert: {a: left}}
  - {state: {lead: 2, heard: left}, expert: {a: listen}}
"""
    task = listening(SEEN, True, right)
    assert set(check(task).codes) <= {"W507", "W518"}
    found = str(page(task))
    assert found.count("remembers") == 1 and "sound" in found[found.index("remembers") :]
