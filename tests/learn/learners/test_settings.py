"""Learners by name and by file: families, settings, and what is said of mistakes."""

import pickle
from pathlib import Path

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.learn.learners import BUILT_IN, FAMILIES, learner


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", BUILT_IN)
def test_every_learner_is_in_every_family(name: str, family: str) -> None:
    found = learner(name, family)
    assert found == learner(f"{family}/{name}")
    assert (found.name, found.family, found.learns_from) == (name, family, BUILT_IN[name].learns_from)
    assert found.together and pickle.loads(pickle.dumps(found)) == found
    if family != "released" and name != "dpo":  # some have no mistakes of their own
        assert (found.settings == BUILT_IN[name].settings) == (family == "paper")


def test_a_file_changes_settings_of_a_family(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("learner: ppo\nfamily: paper\nsettings: {hidden: [8], experience: {lanes: 4}}\n", encoding="utf-8")
    found = learner(path).settings
    before = learner("ppo", "paper").settings
    assert (found.hidden, found.experience.lanes) == ((8,), 4)
    assert (found.value_clip, found.experience.steps) == (before.value_clip, before.experience.steps)


@pytest.mark.parametrize(
    ("text", "code", "line", "says"),
    [
        ("learner: pppo", "E206", 1, "'pppo'"),
        ("learner: bc\nfamly: paper", "E202", 2, "famly"),
        ("learner: bc\nfamily: published", "E206", 2, "corrected"),
        ("family: paper", "E203", 1, "learner: bc"),
        ("[bc]", "E203", 1, "learner: bc"),
        ("learner: bc\nsettings:\n  bach: 3", "E202", 3, "bach"),
        ("learner: bc\nsettings:\n  batch: many", "E204", 3, "valid integer"),
        ("learner: bc\nsettings:\n  batch: true", "E204", 3, "valid integer"),
        ("learner: bc\nsettings:\n  hidden: [8, x]", "E204", 3, "valid integer"),
        ("learner: bc\nsettings:\n  loss: cubed", "E206", 3, "'likelihood'"),
        ("learner: ppo\nsettings:\n  experience: 3", "E201", 3, "mapping"),
        ("learner: ppo\nsettings: [1]", "E201", 2, "mapping"),
    ],
)
def test_mistakes_have_a_code_and_a_place(text: str, code: str, line: int, says: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text + "\n", encoding="utf-8")
    with pytest.raises(SpecError) as raised:
        learner(path)
    (found,) = raised.value.diagnostics
    assert found.code == code and found.span is not None and found.span.line == line
    assert says in str(raised.value)


@pytest.mark.parametrize(("name", "family", "code"), [("bcc", "paper", "E725"), ("bc", "papers", "E713")])
def test_unknown_names_have_a_code(name: str, family: str, code: str) -> None:
    with pytest.raises(SpecError) as raised:
        learner(name, family)
    assert raised.value.diagnostics[0].code == code


def test_the_page_lists_every_learner() -> None:
    page = (Path(__file__).parents[3] / "docs/explain/learners.md").read_text(encoding="utf-8")
    rows = [f"| `{e.name}` | {e.summary} | {' '.join(e.learns_from)} |" for e in BUILT_IN.values()]
    assert "\n".join(rows) == page.partition("|---|---|---|\n")[2].partition("\n<!-- /learners -->")[0]
