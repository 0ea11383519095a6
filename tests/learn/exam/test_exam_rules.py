"""Rules over scores: what they mean on intervals, which diagnoses results get, and what is said where one is wrong."""

import json
import re
from operator import attrgetter
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import yaml

from taskspec.language import registry
from taskspec.learn.documents.document_models import ExamDocument, document_schema
from taskspec.learn.documents.rule_books import read_exam
from taskspec.learn.exam import findings
from tests.learn.documents.test_rule_books import HEAD, MASTERED, SUITE, TASKS
from tests.shared.commands import Done
from tests.shared.exams import diagnosed, entries, exam


def named(printed: dict[str, Any], twins: dict[str, Any] | None = None, **others: Any) -> list[str]:
    return diagnosed(exam(MASTERED | printed, MASTERED | (twins or {}), **others))


LUCK = [0.0, 1.0, 0.0, 1.0, 1.0] * 3


@pytest.mark.parametrize(
    ("name", "printed", "twins"),
    [
        ("reversed", dict.fromkeys(TASKS, -0.8), dict.fromkeys(TASKS, -0.8)),
        ("nothing_learned", dict.fromkeys(TASKS, 0.02), dict.fromkeys(TASKS, 0.02)),
        ("survival_pays", {"EarlyTermNeg": -0.6}, {"EarlyTermNeg": -0.6}),
        ("ending_pays", {"EarlyTermPos": -0.3}, {"EarlyTermPos": -0.3}),
        ("ends_unjudged", {"EarlyTermPos": LUCK, "EarlyTermNeg": LUCK}, {}),
        ("takes_risks", {"RiskyPath": 0.15}, {"RiskyPath": 0.17}),
        ("same_action", {}, {"RiskyPath": 0.2, "EarlyTermPos": 0.09, "EarlyTermNeg": -0.4, "Branching": 0.0}),
        ("meaning_of_names", {}, {"NoisyObs": 0.4}),
        ("meaning_of_names", {}, {"InitShiftLearner": -1.0}),  # where nothing was shown, the first action
        ("never_finds", {"Branching": 0.0}, {"Branching": 0.0}),
        ("finds_by_luck", {"Branching": LUCK}, {"Branching": LUCK}),
        ("copies_the_action", {"InitShiftLearner": -0.5}, {"InitShiftLearner": -0.5}),
        ("action_unseen", {"LargestSum": 0.0}, {"LargestSum": 0.0}),
        ("led_by_noise", {"NoisyObs": 0.4}, {"NoisyObs": 0.4}),
        ("long_vectors", {"LargestSum": 0.6}, {"LargestSum": 0.6}),
        ("knows_places_not_ways", {"ProcGoal": 0.5}, {"ProcGoal": 0.5}),
        ("continuous_actions", {"Parabola": -0.3}, {"Parabola": -0.3}),
        ("composed_actions", {"Sort": 0.0}, {"Sort": 0.0}),
    ],
)
def test_a_pattern_of_scores_gets_its_diagnosis_alone(
    name: str, printed: dict[str, Any], twins: dict[str, Any]
) -> None:
    assert named(printed, twins) == [name]


def test_who_used_nothing_that_it_was_granted_gets_one_diagnosis() -> None:
    printed = dict.fromkeys(TASKS, 0.2)
    results = exam(printed, printed, learns_from=["demonstrations", "preferences"])
    for score in results["scores"]:
        score["demonstrations"] = 0
    assert diagnosed(results) == ["untouched"]
    results["scores"][0]["comparisons"] = 1
    assert "untouched" not in diagnosed(results)


def test_learners_of_the_true_reward_have_no_learned_reward() -> None:
    printed = {"EarlyTermNeg": -0.6}
    assert named(printed, printed, learns_from=["reward"]) == ["ends_misvalued"]
    assert named(printed, printed, learns_from=["preferences", "demonstrations"]) == ["survival_pays"]


def test_scores_of_the_best_fixed_action_on_all_seeds_are_a_diagnosis() -> None:
    for score, expected in ((0.95, ["one_action"]), ([0.95] * 14 + [0.9], [])):
        results = exam(MASTERED | {"Parabola": score}, MASTERED)
        results["tasks"]["derail/Parabola-v0"]["constant"] = 0.95
        assert diagnosed(results) == expected


def test_who_masters_everything_gets_none() -> None:
    assert named({}) == []


@pytest.mark.parametrize(
    ("name", "others"),
    [
        ("spread_untrained", {"task": "Parabola", "score": 1.0, "stochastic": -0.4}),
        ("never_decides", {"task": "RiskyPath", "score": 1.0, "stochastic": 0.4}),
        ("only_by_chance", {"task": "ProcGoal", "score": 0.3, "stochastic": 0.85}),
        ("policy_at_fault", {"task": "RiskyPath", "score": 0.2, "stochastic": 0.2, "reward_regret": 0.0}),
        ("reward_at_fault", {"task": "RiskyPath", "score": 1.0, "stochastic": 1.0, "reward_regret": 0.8}),
    ],
)
def test_what_other_numbers_tell(name: str, others: dict[str, Any]) -> None:
    results = exam(MASTERED, MASTERED)
    task = others.pop("task")
    score = others.pop("score")
    kept = [each for each in results["scores"] if each["task"] != f"derail/{task}-v0"]
    results["scores"] = kept + entries({task: score}, 15, **others)
    assert name in diagnosed(results)


def test_a_path_that_is_lost_on_every_seed_though_its_start_is_right() -> None:
    assert "loses_the_path" in named({"Branching": 0.3, "InitShiftLearner": 0.0})


def test_a_diagnosis_says_where_it_is_from_and_what_speaks_for_it() -> None:
    (found,) = findings.diagnose(exam(MASTERED | {"EarlyTermNeg": -0.6}, MASTERED | {"EarlyTermNeg": -0.6}), "derail")
    assert found["tasks"] == ["derail/EarlyTermPos-v0", "derail/EarlyTermNeg-v0"]
    assert found["evidence"] == ["score(EarlyTermPos) = 1.00", "score(EarlyTermNeg) = −0.60"]
    assert found["source"].startswith("Kostrikov et al. (2019). Discriminator-Actor-Critic") and found["try"]


def test_a_diagnosis_at_its_border_is_undecided() -> None:
    """EarlyTermNeg is to be below 0 for `survival_pays`: its interval is, contains 0, or is above."""
    around = np.linspace(-0.3, 0.3, 15)
    for mean, is_named, is_open in (
        (-0.5, True, False),
        (-0.02, False, True),
        (0.02, False, False),
        (0.5, False, False),
    ):
        scores = MASTERED | {"EarlyTermNeg": (around + mean).tolist()}
        results = exam(scores, scores)
        assert ("survival_pays" in diagnosed(results)) == is_named, mean
        undecided = "\n".join(findings.undecided(results, "derail"))
        told = re.findall("Prolongs episodes.*", undecided)
        assert bool(told) == is_open, mean
        assert not is_open or "score(EarlyTermNeg) = −0.02 [" in told[0]


def test_a_suite_without_an_exam_has_no_diagnoses(tmp_path: Path) -> None:
    assert findings.diagnose(exam(MASTERED), tmp_path) == []


def test_the_command_checks_exams_and_counts_them() -> None:
    done = Done("check", SUITE / "exam.yaml")
    assert done.status == 0 and "1 exam: no errors" in done.out
    told = Done("check", SUITE / "exam.yaml", "--json").data
    assert told["tasks"] == [] and told["exams"][0]["rules"] == len(read_exam(SUITE / "exam.yaml").rules)


def test_the_command_shows_the_line_of_a_mistake(tmp_path: Path) -> None:
    path = tmp_path / "exam.yaml"
    path.write_text(f"{HEAD}    when: scor(Sort) > 0\n", encoding="utf-8")
    done = Done("check", path)
    assert done.status == 1 and "exam.yaml:8:11: error[E303 unknown-function]" in done.out


def test_an_exam_is_no_spec(tmp_path: Path) -> None:
    assert (SUITE / "exam.yaml", "exam") in registry.files_in(SUITE)
    assert SUITE / "exam.yaml" not in map(attrgetter("path"), registry.entries(SUITE))
    done = Done("solve", SUITE / "exam.yaml")
    assert done.status == 1 and "this is an exam, not a spec" in done.err + done.out


def test_the_schema_takes_what_is_taken_and_nothing_else() -> None:
    data = yaml.safe_load((SUITE / "exam.yaml").read_text(encoding="utf-8"))
    schema = json.loads(Done("schema", "--exam").out)
    assert schema == document_schema(ExamDocument)
    jsonschema.Draft202012Validator(schema).validate(data)
    data["diagnoses"]["reversed"].pop("cause")
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema).validate(data)
